r"""The motion that the amplitude equation rules, and the fields of the full problem along it.

In circular components :math:`A_\pm = A_1 \pm i A_2` the vector equation

.. math:: \dot{A} = g A + \alpha\,(A\cdot A)A^* + \beta\,(A\cdot A^*)A, \qquad g = \gamma\mu

is :math:`\dot{A}_\pm = A_\pm[g + X|A_\pm|^2 + Y|A_\mp|^2]` with :math:`X = \beta/2`, :math:`Y = \alpha + \beta/2`. Moduli do not feel phases.
With :math:`L = \log(|A_+|^2 + |A_-|^2)`, :math:`D = \log(|A_+|^2/|A_-|^2)` and :math:`\tau = \tanh(D/2)`

.. math:: \dot{L} = 2g_r + e^L[X_r(1+\tau^2) + Y_r(1-\tau^2)], \quad \dot{D} = -2\alpha_r e^L\tau, \quad
          \dot{\varphi} = g_i + e^L(X_i+Y_i)/2, \quad \dot{\psi} = -\alpha_i e^L\tau/2,

where :math:`\arg A_\pm = \varphi \pm \psi`: planar motion (D = 0) and its direction :math:`\psi` stay as they are by construction, circular
motion is a scalar equation, and an algebraic decay over twelve decades takes steps that grow with time. The scalar equations, real and
complex, are Bernoulli's and are solved in closed form. Source: labels amplitude, relations and planar amplitude of the paper.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, log
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from flint import acb, arb
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from numerics.algebra import Algebra, Constants
from numerics.coefficients import Module, Resolution, Result, builder, evaluate, uniform
from numerics.ellipse import cartesian_components, circular_components, cross_product
from numerics.precision import EvaluationError, working_precision
from numerics.sampled import Samples, barycentric

ORDERS = ("1/2", "1")
MOST_CALLS = 1_000_000
LARGEST = 60.0  # log of the growth of |A|^2 beyond which the solution is said to leave every bound


@dataclass(frozen=True, slots=True, kw_only=True)
class ScalarMotion:
    r"""Closed-form solution of :math:`\dot{A} = A(g + k\,|A|^n)`; for n = 1 of :math:`\dot{A} = A(g + k A)` with A real.

    `start` is A(0); `direction` the constant vector (or 1) that multiplies A.
    """

    growth: complex
    saturation: complex
    power: int
    start: complex
    direction: tuple[complex, ...]

    def logarithms(self, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        r"""Return :math:`\log(y/y_0)` and :math:`\int y\,dt` with :math:`y = |A|^n = y_0 e^{n g_r t}/(1 - k_r y_0 E)`, :math:`E = (e^{n g_r t} - 1)/g_r`."""
        g, k, n = self.growth.real, self.saturation.real, self.power
        y = self.start.real if n == 1 else abs(self.start) ** n
        rate = n * g * times
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            if g > 0:  # e^{rate} cancels, so that nothing overflows and a state of rest stays one
                growth = -np.log(np.exp(-rate) + k * y * np.expm1(-rate) / g)
            else:
                growth = rate - np.log1p(-k * y * (np.expm1(rate) / g if g else n * times))
            integral = (growth - rate) / (n * k) if k else y * (np.expm1(rate) / (n * g) if g else times)
        bad = ~(np.isfinite(growth) & np.isfinite(integral))
        if bad.any():
            raise EvaluationError(f"motion: the amplitude grows without bound before t = {times[bad].min():.6g}: nothing in the amplitude equation saturates it; "
                                  "expected a smaller initial amplitude, another sign of mu, or a shorter time")
        return growth, integral

    def amplitude(self, times: ArrayLike) -> NDArray[np.complex128]:
        """Return A at the times, shape (..., 2) for a vector."""
        t = np.asarray(times, dtype=float)
        value = np.zeros(t.shape, dtype=complex)
        if self.start:
            growth, integral = self.logarithms(t)
            with np.errstate(under="ignore", over="ignore"):
                value = self.start * np.exp(growth / self.power) * np.exp(1j * (self.growth.imag * t + self.saturation.imag * integral))
        value = value[..., None] * np.array(self.direction) if len(self.direction) > 1 else value
        if not np.isfinite(value).all():
            raise EvaluationError("motion: the amplitude grows beyond the range of a double; expected a shorter time or another sign of mu")
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class VectorMotion:
    """Solution of the vector equation for a motion that is neither planar nor circular: dense output of DOP853, then a state of rest."""

    growth: complex
    alpha: complex
    beta: complex
    dense: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    rest: float  # the time from which the moduli do not change any more (or the end)
    final: tuple[float, float, float, float]
    steps: int

    def variables(self, times: ArrayLike) -> NDArray[np.float64]:
        """Return L, D, phi and psi at the times, shape (4, ...)."""
        t = np.asarray(times, dtype=float)
        inside = np.minimum(t, self.rest)
        result = np.asarray(self.dense(inside.ravel())).reshape(4, *t.shape).copy()
        later = t - inside
        slope = rates(np.array(self.final), self.growth, self.alpha, self.beta)
        if self.growth.real:  # what is left of the way to rest: dL/dt = -2 g_r (L - L_rest)
            result[0] -= slope[0] / (2 * self.growth.real) * np.expm1(-2 * self.growth.real * later)
        slope[0] = 0.0
        if slope[1] * self.final[1] < 0:  # towards a line: D decays exponentially
            result[1] *= np.exp(slope[1] / self.final[1] * later)
            slope[1] = 0.0
        return result + slope.reshape(4, *[1] * t.ndim) * later

    def amplitude(self, times: ArrayLike) -> NDArray[np.complex128]:
        """Return (A_1, A_2) at the times, shape (..., 2)."""
        size, ratio, phase, turn = self.variables(times)
        with np.errstate(under="ignore"):
            plus = np.exp((size - np.logaddexp(0, -ratio)) / 2 + 1j * (phase + turn))
            minus = np.exp((size - np.logaddexp(0, ratio)) / 2 + 1j * (phase - turn))
        return cartesian_components(plus, minus)


class Motion(Protocol):
    """A solution of the amplitude equation."""

    def amplitude(self, times: ArrayLike) -> NDArray[np.complex128]:
        """Return the amplitude at the times."""


def rates(y: NDArray[np.float64], growth: complex, alpha: complex, beta: complex) -> NDArray[np.float64]:
    """Return d/dt of (L, D, phi, psi)."""
    size, tau = np.exp(min(y[0], 700.0)), np.tanh(y[1] / 2)
    x, cross = beta / 2, alpha + beta / 2
    return np.array([
        2 * growth.real + size * (x.real * (1 + tau * tau) + cross.real * (1 - tau * tau)), -2 * alpha.real * size * tau,
        growth.imag + size * (x.imag + cross.imag) / 2, -alpha.imag * size * tau / 2,
    ])


def at_rest(y: NDArray[np.float64], slope: NDArray[np.float64], scale: float) -> bool:
    """Tell whether |A| and the shape of the orbit have come to rest: at a circle, at a line that attracts, or anywhere if nothing moves D."""
    if not abs(slope[0]) <= 1e-12 * scale:
        return False
    return bool(abs(y[1]) > 80 or (abs(y[1]) < 1e-17 and slope[1] * y[1] <= 0) or abs(slope[1]) <= 1e-15 * scale * abs(y[1]))


def integrate_vector(growth: complex, alpha: complex, beta: complex, initial: Sequence[complex], until: float) -> VectorMotion:
    """Return the motion from a general initial amplitude (A_1, A_2), by DOP853 at a relative tolerance of 1e-13.

    Raises
    ------
    EvaluationError
        The solution grows without bound before `until`.
    """
    plus, minus = (complex(one) for one in circular_components(np.array(initial)))
    p, q = abs(plus) ** 2, abs(minus) ** 2
    # p - q = -4 Im(A_1^* A_2) without cancellation, so that a nearly planar motion keeps its digits
    ratio = 2 * np.arctanh(-4 * float(cross_product(np.array(initial))) / (p + q)) if min(p, q) > 1e-3 * max(p, q) else log(p) - log(q)
    angles = np.angle(plus), np.angle(minus)
    start = np.array([log(p + q), ratio, (angles[0] + angles[1]) / 2, (angles[0] - angles[1]) / 2])
    scale = 2 * abs(growth.real)
    strengths = [abs(one) for one in (beta.real / 2, (alpha + beta).real) if one]
    bound = max(start[0], log(scale / min(strengths)) if scale and strengths else start[0]) + LARGEST
    calls = 0

    def slope(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal calls
        calls += 1
        if calls > MOST_CALLS:
            raise EvaluationError(f"motion: found two very different rates: {MOST_CALLS} evaluations reach t = {t:.6g} only; expected a shorter time")
        return rates(y, growth, alpha, beta)

    def stop(t: float, y: NDArray[np.float64]) -> float:
        return 0.0 if scale and at_rest(y, rates(y, growth, alpha, beta), scale) else 1.0

    def leave(t: float, y: NDArray[np.float64]) -> float:
        return float(y[0] - bound)

    stop.terminal = leave.terminal = True  # type: ignore[attr-defined]
    leave.direction = 1  # type: ignore[attr-defined]
    solution = solve_ivp(slope, (0.0, until), start, method="DOP853", rtol=1e-13, atol=[1e-13, 1e-300, 1e-13, 1e-13],
                         dense_output=True, events=(stop, leave))
    if solution.status == -1 or len(solution.t_events[1]):
        raise EvaluationError(f"motion: the amplitude grows without bound at t = {solution.t[-1]:.6g}: nothing in the amplitude equation saturates it; "
                              "expected a smaller initial amplitude, another sign of mu, or a shorter time")
    final = solution.y[:, -1]
    return VectorMotion(growth=growth, alpha=alpha, beta=beta, dense=solution.sol, rest=float(solution.t[-1]), final=tuple(map(float, final)), steps=len(solution.t))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What is to be moved: an initial amplitude and a distance of the control from the threshold; original amplitude and time."""

    initial: tuple[complex, ...]
    mu: float
    until: float

    def __post_init__(self) -> None:
        if not all(isfinite(one.real) and isfinite(one.imag) for one in self.initial):
            raise EvaluationError("initial: found a number that is not finite; expected finite components")
        if not isfinite(self.mu):
            raise EvaluationError(f"mu: found {self.mu}; expected a finite distance of the control from the threshold")
        if not (isfinite(self.until) and self.until > 0):
            raise EvaluationError(f"until: found {self.until}; expected a finite time above 0")


def shape_of(initial: Sequence[complex], real: bool) -> str:
    """Return "still", "planar", "circular" or "general": which equation the motion needs; up to the rounding of what is given."""
    if not any(initial):
        return "still"
    if len(initial) == 1 or real:
        return "planar"
    plus, minus = (abs(complex(one)) for one in circular_components(np.array(initial)))
    if plus == 0 or minus == 0:
        return "circular"
    return "general" if cross_product(np.array(initial)) else "planar"


def check_scene(module: Module, scene: Scene) -> None:
    """Refuse a scene that does not fit the kind of amplitude, in one line that says what does."""
    count, real = (2 if module.MULTIPLICITY == 2 else 1), module.KIND == "steady"
    if len(scene.initial) != count:
        wanted = "two, along e1 and e2 across the axis, such as 0.03,0.005i" if count == 2 else "one, such as 0.03"
        raise EvaluationError(f"initial: found {len(scene.initial)} components; expected {wanted}")
    if real and any(one.imag for one in scene.initial):
        raise EvaluationError(f"initial: found a complex amplitude; the bifurcation of {module.NAME} is steady and its amplitude real: leave the i out")


def motion_of(emitted: str | Path | Mapping[str, Any], scene: Scene, digits: int = 15) -> tuple[Motion, Result]:
    """Return the motion from an initial amplitude, and the coefficients that it needed: no others are evaluated.

    Parameters
    ----------
    emitted
        As for `evaluate`.
    scene
        Original amplitude and time: A is half the peak of the normalised field (the peak itself when steady).

    Raises
    ------
    EvaluationError
        The scene does not fit the problem, or the amplitude grows without bound.
    """
    module = Module(emitted)
    check_scene(module, scene)
    shape = shape_of(scene.initial, module.KIND == "steady")
    result = evaluate(emitted, digits=digits, only=needed(module, shape, scene.mu))
    return motion_from(result, scene, shape), result


def needed(module: Module, shape: str, mu: float) -> tuple[str, ...]:
    """Return the monomials whose coefficients a motion needs; empty: all."""
    monomials = [monomial for _, monomial, _ in module.COEFFICIENTS if not monomial.startswith("epsilon")]
    if shape == "circular":
        monomials.remove("dot(A,A)*conj(A)")
    if mu == 0:
        monomials.remove("mu*A")
    return tuple(monomials)


def motion_from(result: Result, scene: Scene, shape: str) -> Motion:
    """Return the motion for known coefficients."""
    values = {one.monomial: complex(one.value) for one in result.coefficients}
    growth = values["mu*A"] * scene.mu if scene.mu else 0j
    if shape == "general":
        return integrate_vector(growth, values["dot(A,A)*conj(A)"], values["dot(A,conj(A))*A"], scene.initial, scene.until)
    size = float(np.hypot.reduce(np.abs(np.array(scene.initial))))
    direction = tuple(one / size for one in scene.initial) if size else scene.initial
    power = 1 if "A**2" in values else 2
    if shape == "circular":
        saturation = values["dot(A,conj(A))*A"]
    else:  # planar: A = e A with (alpha + beta)|A|^2, or the only coefficient there is
        saturation = sum((value for monomial, value in values.items() if monomial != "mu*A" and not monomial.startswith("epsilon")), 0j)
    start: complex = size
    if len(scene.initial) == 1:
        start, direction = scene.initial[0], (1,)
    motion = ScalarMotion(growth=growth, saturation=saturation, power=power, start=start, direction=direction)
    motion.amplitude(np.array([scene.until]))  # says so if it does not last
    return motion


# Fields


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A term of the expansion: exponents over the amplitudes, harmonic, and {unknown: values at the places}."""

    exponents: tuple[int, ...]
    harmonic: int
    values: Mapping[int, NDArray[np.complex128]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """The functions of s that the fields are made of, at given places, for one distance mu from the threshold.

    `base` holds the base state at the control itself, threshold + mu; `terms` the mode and, to order 1, the responses.
    """

    problem: str
    unknowns: tuple[tuple[str, str], ...]
    normalised: str
    amplitudes: tuple[str, ...]
    frame: NDArray[np.float64]  # rows e1, e2, axis
    vector: bool
    places: NDArray[np.float64]  # shape (1,) without space
    spatial: bool
    base: NDArray[np.complex128]
    terms: tuple[Term, ...]
    order: str

    @property
    def fields(self) -> tuple[str, ...]:
        """The fields of the statement."""
        return tuple(dict.fromkeys(name for name, _ in self.unknowns))

    def monomials(self, amplitude: NDArray[np.complex128]) -> dict[str, NDArray[np.complex128]]:
        """Return the amplitudes by name: A and its conjugate, or the circular components of both."""
        if not self.vector:
            return {"A": amplitude, "Ac": np.conj(amplitude)}
        first, second = amplitude[..., 0], amplitude[..., 1]
        plus, minus = first + 1j * second, first - 1j * second
        return {"Ap": plus, "Am": minus, "Cp": np.conj(minus), "Cm": np.conj(plus)}

    def at(self, amplitude: ArrayLike, phase: ArrayLike) -> dict[str, NDArray[np.float64]]:
        r"""Return the fields in Cartesian components, {name: shape (..., places) or (..., places, 3)}.

        Parameters
        ----------
        amplitude
            A at some times, shape (...,) or (..., 2).
        phase
            :math:`\omega t` there, shape (...,).
        """
        amplitude = np.asarray(amplitude, dtype=complex)
        known = self.monomials(amplitude)
        turn = np.exp(1j * np.asarray(phase, dtype=float))
        still = [np.broadcast_to(row, (*turn.shape, len(self.places))).astype(complex) for row in self.base]
        moving = [np.zeros((*turn.shape, len(self.places)), dtype=complex) for _ in self.base]
        for term in self.terms:
            factor = turn**term.harmonic
            for name, power in zip(self.amplitudes, term.exponents, strict=True):
                if power:
                    factor = factor * known[name] ** power
            for unknown, values in term.values.items():
                target = moving if term.harmonic else still
                target[unknown] = target[unknown] + factor[..., None] * values
        partner = [k + {"p": 1, "m": -1}.get(component, 0) for k, (_, component) in enumerate(self.unknowns)]
        total = [still[k] + moving[k] + np.conj(moving[partner[k]]) for k in range(len(self.base))]
        return self.cartesian(total)

    def cartesian(self, total: Sequence[NDArray[np.complex128]]) -> dict[str, NDArray[np.float64]]:
        """Return fields from unknowns: v = (v_p (e1 - i e2) + v_m (e1 + i e2))/2 + v_n n."""
        fields: dict[str, NDArray[np.float64]] = {}
        for name in self.fields:
            parts = {component: total[k] for k, (field, component) in enumerate(self.unknowns) if field == name}
            if "p" in parts:
                e1, e2, normal = self.frame
                value = ((parts["p"] + parts["m"])[..., None] * e1 - 1j * (parts["p"] - parts["m"])[..., None] * e2) / 2 + parts["n"][..., None] * normal
                fields[name] = value.real
            elif "x" in parts:
                fields[name] = np.stack([parts[axis].real for axis in "xyz"], axis=-1)
            else:
                fields[name] = parts[""].real
        return fields


def shapes_of(emitted: str | Path | Mapping[str, Any], result: Result, mu: float, order: str = "1", places: ArrayLike = 101) -> Shapes:
    """Return the functions of s of the fields, right to about 1e-12 of their size at two resolutions.

    Parameters
    ----------
    order
        "1/2": base state and mode; "1": the responses of second order too. With an A**2 in the amplitude equation A is of the
        size of mu, and both are the same.
    places
        Values of s, or how many of them, equally spaced with the ends.
    """
    if order not in ORDERS:
        raise EvaluationError(f"order: found {order!r}; expected one of {', '.join(ORDERS)}")
    module = Module(emitted)
    probe = Constants(control=acb(0), frequency=acb(0), values={})
    with working_precision(96):
        ends = [float(arb(acb(end).real.mid())) for end in module.interval(probe)] if module.SPATIAL else [0.0, 0.0]
        frame = np.array([[float(acb(entry).real.mid()) for entry in row] for row in module.frame(probe)]) if module.MULTIPLICITY == 2 else np.eye(3)
    where = np.linspace(*ends, places) if isinstance(places, int) else np.atleast_1d(np.asarray(places, dtype=float))
    where = where if module.SPATIAL else np.zeros(1)
    if not np.all((where >= ends[0]) & (where <= ends[1])):
        raise EvaluationError(f"places: found a place outside the interval; expected values from {ends[0]:g} to {ends[1]:g}")
    responses = order == "1" and not any(one.monomial == "A**2" for one in result.coefficients)
    table = converged_table(module, result, mu, responses, where)
    terms = tuple(Term(exponents=exponents, harmonic=harmonic, values=values) for exponents, harmonic, values in table[1])
    return Shapes(problem=module.NAME, unknowns=module.UNKNOWNS, normalised=module.NORMALISED, amplitudes=module.AMPLITUDES, frame=frame, vector=module.MULTIPLICITY == 2,
                  places=where, spatial=module.SPATIAL, base=table[0], terms=terms, order=order)


Table = tuple[NDArray[np.complex128], list[tuple[tuple[int, ...], int, dict[int, NDArray[np.complex128]]]]]


def converged_table(module: Module, result: Result, mu: float, responses: bool, places: NDArray[np.float64]) -> Table:
    """Return base state and terms at the places, from two resolutions that agree."""
    resolution = Resolution(nodes=18, breaks=uniform(3))
    before = table_at(module, result, mu, responses, places, resolution)
    if not module.SPATIAL:
        return before
    for _ in range(5):
        resolution = Resolution(nodes=resolution.nodes + 4, breaks=uniform(len(resolution.breaks) * 3 // 2))
        after = table_at(module, result, mu, responses, places, resolution)
        pairs = [*zip(before[0], after[0], strict=True)]
        for (_, _, old), (_, _, new) in zip(before[1], after[1], strict=True):
            pairs += [(old[k], new[k]) for k in new]
        if all(np.abs(a - b).max() <= 1e-11 * max(1e-3, np.abs(b).max()) for a, b in pairs):
            return after
        before = after
    raise EvaluationError(f"{module.NAME}: the functions of s are not resolved by {len(resolution.breaks) - 1} panels of {resolution.nodes} nodes; the problem has layers that are too thin")


def table_at(module: Module, result: Result, mu: float, responses: bool, places: NDArray[np.float64], resolution: Resolution) -> Table:
    """Return base state and terms at the places, at one resolution."""
    with working_precision(128):
        build = builder(module, "chebyshev", resolution, 64)
        frequency = acb(arb(result.threshold.frequency)) if result.threshold.frequency else acb(0)
        control = arb(result.threshold.control)
        a = build(acb(control), frequency)
        try:
            there = build(acb(control + arb(mu)), frequency)
            base = np.array([values_at(there, value, places) for value in module.base(there)])
        except ZeroDivisionError:
            base = np.full((1, 1), np.nan + 0j)
        if not np.isfinite(base).all():
            raise EvaluationError(f"mu: found no finite base state at {module.CONTROL} = threshold + {mu:g}; expected a smaller distance")
        terms = [(exponents, harmonic, {k: values_at(a, value, places) for k, value in values.items()})
                 for exponents, harmonic, values in (*module.fields_mode(a), *(module.fields_responses(a) if responses else ()))]
    return base, terms


def values_at(a: Algebra, value: Any, places: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return a function at the places, by barycentric interpolation on its panel."""
    if not isinstance(value, Samples):
        return np.full(len(places), complex(value))
    algebra = value.algebra
    left, width = float(algebra.left_end.mid()), 2 * float(algebra.halves[0].mid())  # panels of equal length
    nodes = np.array([float(point) for point in algebra.rules.points])
    weights = np.array([float(weight.mid()) for weight in barycentric(algebra.rule, algebra.rules.points, algebra.weights)])
    table = np.array([complex(one) for one in value.values]).reshape(algebra.panels, algebra.nodes)
    panel = np.clip(((places - left) / width).astype(int), 0, algebra.panels - 1)
    x = 2 * ((places - left) / width - panel) - 1
    distance = x[:, None] - nodes
    hit = distance == 0
    share = weights / np.where(hit, 1, distance)
    share = np.where(hit.any(axis=1)[:, None], hit, share)
    return (share * table[panel]).sum(axis=1) / share.sum(axis=1)


def fast_phase(frequency: str | None, times: ArrayLike) -> NDArray[np.float64]:
    r"""Return :math:`\omega t` modulo 2 pi, reduced with all the digits of the frequency."""
    t = np.asarray(times, dtype=float)
    if frequency is None:
        return np.zeros_like(t)
    with working_precision(256):
        omega, turn = arb(frequency), 2 * arb.pi()
        reduced = [float((omega * arb(float(one)) - turn * (omega * arb(float(one)) / turn).mid().floor()).mid()) for one in t.ravel()]
    return np.array(reduced).reshape(t.shape)
