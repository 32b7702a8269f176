r"""Growth rates at any control, and the control where the two rightmost merge into a pair.

The emitted critical operator is analytic in its frequency: with :math:`\omega = -i\lambda` its determinant D is that of the growth rate
:math:`\lambda` at any control. Doubles come from collocation in integrated form (nothing is differentiated), digits from D.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
from flint import acb, arb
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from numerics.algebra import Constants, midpoint
from numerics.coefficients import UNIFORM, Module, Resolution, builder, decimal, nodes_for, uniform
from numerics.precision import EvaluationError, NotClosed, bits_of, working_precision
from numerics.sampled import chebyshev_nodes

NODES = ((20, 28), (28, 44), (44, 72), (72, 120))
SCAN = 61
SHIFT = 0.6180339887498949
DEGREE = 4  # the highest power of the growth rate that is looked for

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Merging:
    """Where two real growth rates merge: control and growth rate as decimal text, with a bound on the error of the control."""

    control: str
    growth_rate: str
    error: str


def hopf_module(emitted: str | Path | Mapping[str, Any]) -> Module:
    """Return the module, if its critical operator knows the growth rate."""
    module = Module(emitted)
    if module.KIND != "hopf":
        raise EvaluationError(f"{module.NAME}: found a steady bifurcation, whose emitted operator does not hold the growth rate; expected a Hopf bifurcation")
    return module


def growth_rates(emitted: str | Path | Mapping[str, Any], control: float) -> Complex:
    """Return the growth rates that two resolutions agree on, the rightmost first, as doubles.

    Raises
    ------
    EvaluationError
        The bifurcation is steady, or the operator is no polynomial in the growth rate.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        return rightmost(hopf_module(emitted), control)


def rightmost(module: Module, control: float) -> Complex:
    """Return the growth rates that two resolutions agree on, the rightmost first."""
    for coarse, fine in NODES if module.SPATIAL else ((0, 0),):
        first, second = (eigenvalues(pencil(module, control, nodes)) for nodes in (coarse, fine))
        if len(first) and len(second):
            agreed = np.abs(second[:, None] - first[None, :]).min(axis=1) <= 1e-5 * (1 + np.abs(second))
            good = second[agreed]
            if len(good) >= min(4, len(second)):
                return good[np.lexsort((-good.imag, -np.round(good.real, 9)))]
    raise EvaluationError(f"{module.NAME}: found no growth rates that two resolutions agree on at control {control}")


@dataclass(frozen=True, slots=True)
class Entries:
    """P at the nodes [i][j][node] (one node without space) and the boundary rows, at one growth rate or as one power of it."""

    matrix: Complex
    left: Complex
    right: Complex


def sampled(module: Module, control: float, growth: float, nodes: int) -> Entries:
    """Return the emitted operator at one growth rate."""
    a: Any = builder(module, "chebyshev", Resolution(nodes=max(nodes, 1), breaks=uniform(1)), 53)(acb(control), acb(0, -growth))
    operator = module.critical(a)
    n, m = operator.size, max(nodes, 1)

    def values(entry: Any) -> Any:
        return [complex(value) for value in entry.values] if hasattr(entry, "values") else complex(acb(entry))

    left, right = a.end_rows(operator) if module.SPATIAL else ((), ())
    return Entries(
        np.array([[np.broadcast_to(values(entry), m) for entry in row] for row in operator.matrix]),
        *(np.array([[complex(entry) for entry in row] for row in rows]).reshape(len(rows), n) for rows in (left, right)),
    )


def pencil(module: Module, control: float, nodes: int) -> list[Complex]:
    """Return K_0, K_1, ... of sum_k lambda^k K_k v = 0; with space v holds the slopes at the nodes and the state at the left end."""
    places = np.array([0.0, 1.0, -1.0, 2.0, -2.0, 3.0])
    with working_precision(64):
        samples = [sampled(module, control, growth, nodes) for growth in places]
        left_end, right_end = (float(acb(end).real) for end in module.interval(Constants(control=acb(0), frequency=acb(0), values={}))) if module.SPATIAL else (0.0, 0.0)
    powers = [by_powers(module, places, np.array([getattr(sample, part) for sample in samples])) for part in ("matrix", "left", "right")]
    entries = [Entries(*parts) for parts in zip(*powers, strict=True)]
    while len(entries) > 1 and not any(np.any(part) for part in (entries[-1].matrix, entries[-1].left, entries[-1].right)):
        entries.pop()
    if not module.SPATIAL:
        return [one.matrix[:, :, 0] for one in entries]
    return [discretised(one, nodes, (right_end - left_end) / 2, k == 0) for k, one in enumerate(entries)]


def by_powers(module: Module, places: NDArray[np.float64], values: Complex) -> list[Complex]:
    """Return the coefficients of a polynomial of the growth rate from its values, the last of which is a check."""
    flat = values.reshape(len(places), -1)
    coefficients = np.linalg.solve(np.vander(places[:-1], increasing=True), flat[:-1])
    size = np.abs(flat).max(axis=0)
    if np.any(np.abs(places[-1] ** np.arange(DEGREE + 1) @ coefficients - flat[-1]) > 1e-9 * size):
        raise EvaluationError(f"{module.NAME}: found an operator that is no polynomial in the growth rate; expected one of degree {DEGREE} at most")
    coefficients[np.abs(coefficients) < 1e-12 * size] = 0
    return [row.reshape(values.shape[1:]) for row in coefficients]


def discretised(entries: Entries, nodes: int, half: float, slopes: bool) -> Complex:
    """Return the rows v_i - sum_j P_ij (y_j(left) + integral of v_j) and the boundary rows; `slopes` tells whether v_i itself is there."""
    cumulative, weights = integration(nodes)
    n, m = len(entries.matrix), nodes
    interior = -np.einsum("ija,ab->iajb", entries.matrix, cumulative * half).reshape(n * m, n * m)
    if slopes:
        interior += np.eye(n * m)
    states = -entries.matrix.transpose(0, 2, 1).reshape(n * m, n)
    ends = np.vstack([entries.left, entries.right])
    reach = np.vstack([0 * entries.left, entries.right])
    integrals = np.einsum("kj,b->kjb", reach, weights * half).reshape(n, n * m)
    return np.block([[interior, states], [integrals, ends]])


@cache
def integration(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the matrix of integrals from -1 to the Chebyshev nodes, and the weights of that to 1."""
    with working_precision(64):
        rules = chebyshev_nodes(nodes)
        return np.array([[float(rules.integrate[i, j]) for j in range(nodes)] for i in range(nodes)]), np.array([float(w) for w in rules.weights])


def eigenvalues(matrices: Sequence[Complex]) -> Complex:
    """Return the finite eigenvalues, by inversion at a shift and restriction to the rows that hold lambda."""
    degree = len(matrices) - 1
    shifted = [sum((matrices[p] * (comb(p, k) * SHIFT ** (p - k)) for p in range(k, degree + 1)), np.zeros_like(matrices[0])) for k in range(degree + 1)]
    held = np.flatnonzero(sum((np.abs(matrix).sum(axis=1) for matrix in matrices[1:]), np.zeros(len(matrices[0]))))
    m = len(held)
    if not m:
        return np.zeros(0, dtype=complex)
    inverse = np.linalg.solve(shifted[0], np.eye(len(matrices[0]))[:, held])
    companion = np.zeros((degree * m, degree * m), dtype=complex)
    for k in range(1, degree + 1):
        companion[:m, (k - 1) * m:k * m] = -(shifted[k][held] @ inverse)
    companion[m:, :-m] = np.eye((degree - 1) * m)
    theta = np.linalg.eigvals(companion)
    theta = theta[np.abs(theta) > 1e-13 * np.abs(theta).max()]
    return SHIFT + 1 / theta


def first_complex_pair(emitted: str | Path | Mapping[str, Any], digits: int = 15) -> Merging:
    r"""Return the first control, from the lower end of its range, at which the two rightmost growth rates merge and become a pair.

    There :math:`D = 0` and :math:`\partial D/\partial\lambda = 0`.

    Raises
    ------
    EvaluationError
        There is no such control below the threshold, or the digits are not reached.
    """
    module = hopf_module(emitted)
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads only cost
        control, growth = merging_in_doubles(module)
    try:
        return refined(module, "closed", control, growth, digits)
    except NotClosed:
        return refined(module, "chebyshev", control, growth, digits)


def is_pair(values: Complex) -> bool | None:
    """Tell whether the two rightmost growth rates are a pair (True), both real (False), or neither (None)."""
    first, second = (values[0], values[1]) if len(values) > 1 else (values[0], values[0])
    tiny = 1e-6 * (1 + abs(first))
    if abs(first.imag) > tiny:
        return True if abs(second - first.conjugate()) < tiny else None
    return False if abs(second.imag) <= tiny else None


def merging_in_doubles(module: Module) -> tuple[float, float]:
    """Return control and growth rate of the first merging, by a scan and bisection."""
    low, high = float(module.CONTROL_RANGE[0]), float(module.ONSET[0])
    before: tuple[float, bool | None] | None = None
    for place in np.linspace(low, high, SCAN):
        now = (float(place), is_pair(rightmost(module, float(place))))
        if before is not None and before[1] is False and now[1] is True:
            real, pair = before[0], now[0]
            for _ in range(24):
                middle = (real + pair) / 2
                real, pair = (real, middle) if is_pair(rightmost(module, middle)) else (middle, pair)
            first, second = rightmost(module, pair)[:2]
            if abs(first - second) < 1e-2 * (1 + abs(first)):  # they meet, and are not overtaken by another pair
                return pair, float(first.real)
        before = now
    raise EvaluationError(f"{module.NAME}: found no control between {low:.6g} and the threshold at which the two rightmost growth rates change from real to a pair")


def refined(module: Module, route: str, control: float, growth: float, digits: int) -> Merging:
    """Return the double root to the digits asked for; computed twice, with more bits and other nodes, until both agree."""
    resolution = Resolution(nodes=nodes_for(bits_of(digits + 6)), breaks=UNIFORM)
    previous: tuple[arb, arb] | None = None
    for attempt in range(5):
        goal = bits_of(digits + 6 + 10 * attempt)
        current = double_root(module, route, resolution, control, growth, goal)
        if previous is not None:
            with working_precision(goal + 64):
                drift = max(abs(previous[0] - current[0]).mid(), abs(current[0]).mid() * arb(10) ** -(digits + 2))
                gap = abs(previous[1] - current[1]).mid()
                if drift < arb(10) ** -(digits + 1) * abs(current[0]) and gap < arb(10) ** -(digits + 1) * abs(current[1]):
                    return Merging(control=decimal(current[0], digits + 3, abs(current[0])), growth_rate=decimal(current[1], digits + 3, abs(current[1])),
                                   error=(drift * 4).str(2, radius=False).replace("e+", "e"))
        previous = current
        resolution = Resolution(nodes=resolution.nodes * 5 // 4, breaks=uniform(len(resolution.breaks) + 1))
    raise EvaluationError(f"{module.NAME}: {digits} digits of the control at which growth rates merge are not reached by {route}; ask for fewer digits")


def double_root(module: Module, route: str, resolution: Resolution, control: float, growth: float, goal: int) -> tuple[arb, arb]:
    """Return (control, lambda) with D = 0 and dD/dlambda = 0, by Newton's method; derivatives are central differences with step 2^-goal."""
    with working_precision(3 * goal + 64):
        build = builder(module, route, resolution, goal)
        minus_i = acb(0, -1)

        def D(growth: acb, control: acb) -> acb:
            a: Any = build(control, minus_i * growth)
            return midpoint(a.determinant(module.critical(a)))

        point = (acb(growth), acb(control))
        scales = tuple(arb(2) ** -goal * (1 + abs(value.real)).mid() for value in point)
        for _ in range(60):
            step = newton_step(D, point, scales)
            point = (midpoint(point[0] - step[0]), midpoint(point[1] - step[1]))
            sizes = [float(abs(part).mid() / (scale * arb(2) ** goal)) for part, scale in zip(step, scales, strict=True)]
            if not max(sizes) < 0.5:
                break
            if max(sizes) < 2.0 ** (8 - goal):
                if max(float(abs(value.imag)) for value in point) > 1e-8 * max(float(abs(value)) for value in point):
                    break
                return point[1].real.mid(), point[0].real.mid()
    raise EvaluationError(f"{module.NAME}: found no double growth rate near control {control:.8g}: Newton's method does not converge")


def newton_step(D: Callable[[acb, acb], acb], point: tuple[acb, acb], steps: tuple[arb, ...]) -> tuple[acb, acb]:
    """Return the Newton step of (D, D_lambda) = 0 in (lambda, control)."""
    growth, control = point
    h, k = (acb(step) for step in steps)
    centre, plus, minus = D(growth, control), D(growth + h, control), D(growth - h, control)
    corner = {(i, j): D(growth + i * h, control + j * k) for i in (1, -1) for j in (1, -1)}
    slope = (plus - minus) / (2 * h)
    bend = (plus - 2 * centre + minus) / (h * h)
    by_control = (corner[1, 1] + corner[-1, 1] - corner[1, -1] - corner[-1, -1]) / (4 * k)
    mixed = (corner[1, 1] - corner[-1, 1] - corner[1, -1] + corner[-1, -1]) / (4 * h * k)
    determinant = slope * mixed - by_control * bend
    return (centre * mixed - by_control * slope) / determinant, (slope * slope - bend * centre) / determinant
