"""Problems on which digits are lost or there is nothing to compute: `fredholm bench` runs them, and the tests say what has to come out.

Each is small, and its numbers are known by hand or near a point where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from sympy import Expr, Integer, Rational, Symbol, exp, pi, symbols, tanh

from derive.problem import Problem, load_problem
from derive.statement import field

s, t = symbols("s t", real=True)
c = Symbol("c", real=True)
u = field("u", s, t)
x, y = field("x", t), field("y", t)


def ordinary(equations: tuple[Expr, ...], base: dict[Any, Any], reach: Any = 1) -> Problem:
    """Return ordinary differential equations about a state of rest."""
    return Problem(name="hard", time=t, control=c, control_range=(-reach, reach), fields=tuple(base), equations=equations, base_state=base, normalisation=(x, None))


def on_interval(equation: Expr, length: Any, rows: tuple[Expr, ...], control_range: tuple[Any, Any], place: Any, right: tuple[Expr, ...] = ()) -> Problem:
    """Return a scalar equation with the same rows at both ends, unless others are given for the right one."""
    return Problem(name="hard", space=s, interval=(0, length), time=t, control=c, control_range=control_range, fields=(u,), equations=(equation,),
                   boundary={0: rows, length: right or rows}, base_state={u: 0}, normalisation=(u, place))


def meeting_exponents(distance: Any) -> Problem:
    """u_t = (c + 1) u - (1 + d_ss)^2 u - u^3 on (0, L): at the threshold sigma^2 = -1 +- |1 - k^2|, k = pi/L; distance 0: equal."""
    length = pi * (1 + Rational(distance) / 2)
    return on_interval(u.diff(t) - (c + 1) * u + u + 2 * u.diff(s, 2) + u.diff(s, 4) + u**3, length, (u, u.diff(s, 2)), (-2, 0), length / 2)


def boundary_layers(width: Any) -> Problem:
    """u_t = -(e^2 u'')'' + u'' + c u - u^3 - u^2 u', clamped: exponents +-1/e, layers of the width e at both ends."""
    return on_interval(u.diff(t) + Rational(width) ** 2 * u.diff(s, 4) - u.diff(s, 2) - c * u + u**3 + u**2 * u.diff(s), 1, (u, u.diff(s)), (0, 20), Rational(1, 2))


def slow_oscillation(k: Any, unit: Any = 1) -> Problem:
    """x'' + k x = (c - x^2) x' - x^3, omega^2 = k; time in units of `unit`, control in units of 1/unit."""
    return ordinary((unit**2 * x.diff(t, 2) + Rational(k) * x - unit * (unit * c - x**2) * x.diff(t) + x**3,), {x: 0}, Integer(1) / unit)


def nearly_double(d: Any) -> Problem:
    """lambda^2 + d lambda - c = 0 has a double root at c = -d^2/4; A' = (mu A - A^3)/d."""
    return ordinary((x.diff(t) - y, y.diff(t) - c * x + Rational(d) * y + x**3), {x: 0, y: 0})


def resonant(d: Any) -> Problem:
    """x'' + x = c x' + x y - x^3, y'' + 2 d y' + (4 + d^2) y = x^2 has the eigenvalue -d + 2 i beside i."""
    return ordinary((x.diff(t, 2) - c * x.diff(t) + x - x * y + x**3, y.diff(t, 2) + 2 * Rational(d) * y.diff(t) + (4 + Rational(d) ** 2) * y - x**2), {x: 0, y: 0})


def neutral_mean(d: Any) -> Problem:
    """x'' + x = c x' - x y, y' = (c - d) y + x^2: the mean of y decays at the rate d."""
    return ordinary((x.diff(t, 2) - c * x.diff(t) + x + x * y, y.diff(t) + (Rational(d) - c) * y - x**2), {x: 0, y: 0})


def two_modes(d: Any) -> Problem:
    """Two oscillators that lose stability at c = 0 and c = d."""
    return ordinary((x.diff(t, 2) - c * x.diff(t) + x + x**2 * x.diff(t), y.diff(t, 2) - (c - Rational(d)) * y.diff(t) + 3 * y + y * x), {x: 0, y: 0})


def strong_advection(q: int, place: Any) -> Problem:
    """u_t = u'' - 2 q u' + c u - u^3: exponents q +- i pi, c = q^2 + pi^2, the mode exp(q s) sin(pi s), the adjoint exp(-q s) sin(pi s)."""
    return on_interval(u.diff(t) - u.diff(s, 2) + 2 * q * u.diff(s) - c * u + u**3, 1, (u,), (0, 2 * q**2 + 40), place)


def interior_layer(steep: int) -> Problem:
    """A coefficient that jumps at s = 1/2 within 1/steep."""
    return on_interval(u.diff(t) - u.diff(s, 2) - c * u * (1 + tanh(steep * (s - Rational(1, 2))) / 2) + u**3, 1, (u,), (0, 60), Rational(1, 2))


def wall_layer(steep: int) -> Problem:
    """A coefficient with a layer of width 1/steep at the wall."""
    return on_interval(u.diff(t) - u.diff(s, 2) - c * u * tanh(steep * s) + u**3 * (1 + exp(-steep * s)), 1, (u,), (0, 30), 1, (u.diff(s),))


def narrow_bump(width: Any) -> Problem:
    """u_t = c (1 + exp(-((s - 1/3)/d)^2)) u + u'' - u^3: c = pi^2 (1 - 2 sin(pi/3)^2 sqrt(pi) d) + O(d^2); no node need lie within the bump."""
    return on_interval(u.diff(t) - c * (1 + exp(-(((s - Rational(1, 3)) / Rational(width)) ** 2))) * u - u.diff(s, 2) + u**3, 1, (u,), (0, 30), Rational(1, 2))


def rapid_mode() -> Problem:
    """u_t = (c + 1) u - (1 + d_ss/144)^2 u - u^3 on (0, pi): sin(12 s), threshold -1, A^3 coefficient -3/4."""
    return on_interval(u.diff(t) - c * u + 2 * u.diff(s, 2) / 144 + u.diff(s, 4) / 20736 + u**3, pi, (u, u.diff(s, 2)), (-2, 0), pi / 24)


def scaled(size: Any) -> Problem:
    """u_t = D u'' + c u - u^3/D on (0, 1): threshold D pi^2, A^3 coefficient -3/(4 D)."""
    d = Rational(size)
    return on_interval(u.diff(t) - d * u.diff(s, 2) - c * u + u**3 / d, 1, (u,), (0, 20 * d), Rational(1, 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class HardCase:
    """A hard problem: what is hard about it, the digits to ask for, and (control, frequency) of a later instability where that is meant."""

    name: str
    problem: Callable[[], Problem]
    digits: int = 16
    near: tuple[str, str] | None = None


def hard_cases() -> Iterator[HardCase]:
    """Yield every hard case."""
    for distance in ("1e-1", "1e-5", "1e-15", "1e-30", "0"):
        yield HardCase(name=f"exponents {distance} apart", problem=partial(meeting_exponents, distance))
    for which, near in (("second", ("174.6", "1508")), ("third", ("402", "4430"))):
        yield HardCase(name=f"the filament's {which} instability", problem=partial(load_problem, "follower_force"), near=near)
    for width in ("1/40", "1/1000"):
        yield HardCase(name=f"boundary layers of width {width}", problem=partial(boundary_layers, width))
    for q, place in ((40, Rational(1, 2)), (200, Rational(9, 10))):
        yield HardCase(name=f"exponents {q} +- i pi", problem=partial(strong_advection, q, place))
    for d in ("1e-3", "1e-6", "1e-9", "-1e-3", "0"):
        yield HardCase(name=f"steady, a double eigenvalue d^2/4 away, d = {d}", problem=partial(nearly_double, d))
    for k in ("1e-8", "1e-12", "1e-30", "0", "-1e-12"):
        yield HardCase(name=f"Hopf, omega^2 = {k}", problem=partial(slow_oscillation, k))
    for d in ("1e-4", "0"):
        yield HardCase(name=f"second harmonic {d} from resonance", problem=partial(resonant, d))
    yield HardCase(name="mean mode 1e-5 from neutral", problem=partial(neutral_mean, "1e-5"))
    for d in ("1e-4", "0"):
        yield HardCase(name=f"a second mode {d} from critical", problem=partial(two_modes, d))
    yield HardCase(name="a coefficient that jumps within 1/1000", problem=partial(interior_layer, 1000), digits=10)
    yield HardCase(name="a coefficient with a layer of 1/1000", problem=partial(wall_layer, 1000), digits=10)
    yield HardCase(name="a coefficient with a bump of width 1/200", problem=partial(narrow_bump, "1/200"), digits=10)
    yield HardCase(name="a rapid mode, sin 12 s", problem=rapid_mode)
    for size in ("1e-12", "1e12"):
        yield HardCase(name=f"parameters of size {size}", problem=partial(scaled, size))
    for digits in (5, 16, 17, 1000, 3000):
        yield HardCase(name=f"the filament, {digits} digits", problem=partial(load_problem, "follower_force"), digits=digits)
