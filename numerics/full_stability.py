r"""Growth rates and Floquet exponents: which disturbances :math:`e^{\lambda t} p` of a state meet the linearised rows.

The pencil :math:`A_0 + \lambda A_1 + \lambda^2 A_2` has more rows than columns and, the problem being differential-algebraic, infinite
eigenvalues. A shift sigma and least squares turn it into an ordinary eigenvalue problem for 1 / (lambda - sigma), in which these are zeros;
an eigenvector that leaves a residual in the rows, or is not resolved, is dropped. For a periodic state `p` is periodic (Hill's method): each
exponent then comes once in a strip of the width of the frequency, which also selects the eigenvectors with the least truncation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eig
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from numerics.full_newton import LeastSquares, NotConverged, Solution
from numerics.full_rows import Array, Discretisation, Linearisation
from numerics.full_states import MAX_HARMONICS, MAX_NODES, Branch
from numerics.precision import EvaluationError

DENSE = 420
COUNT, FEWEST = 10, 3
RESIDUAL = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Exponent:
    """A growth rate or Floquet exponent; `kind` says `neutral`, and `in plane` or `out of plane` where that makes sense; `error` is its change between two resolutions."""

    value: complex
    kind: str
    error: float = 0.0

    @property
    def neutral(self) -> bool:
        """Tell whether it is zero by a symmetry."""
        return "neutral" in self.kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Class:
    """The exponents of one class of disturbances, from the most dangerous, with their changes between two resolutions (0 when there is one only)."""

    kind: str
    values: Array
    errors: Array


def ordered(values: Array) -> Array:
    """Return the order of exponents from the most dangerous; of those that grow alike, infinitely many in a damped beam, the slowest oscillation comes first."""
    if not len(values):
        return np.zeros(0, dtype=int)
    alike = 1e-6 * np.sort(np.abs(values))[min(2, len(values) - 1)]
    order = np.argsort(-values.real, kind="stable")
    group = np.concatenate([[0], np.cumsum(-np.diff(values.real[order]) > alike)])
    return order[np.lexsort((-values.imag[order], np.abs(values.imag[order]), group))]


def pencil_spectrum(parts: Sequence[Array], sigma: float, count: int) -> tuple[Array, Array]:
    """Return eigenvalues nearest to sigma and eigenvectors of the rectangular pencil A0 + lambda A1 + lambda^2 A2."""
    zero, one, two = parts
    solver = LeastSquares(zero + sigma * one + sigma**2 * two)
    n = zero.shape[1]
    first = one + 2 * sigma * two
    second = np.flatnonzero(np.any(two, axis=0))  # columns with a second time derivative

    def apply(z: Array) -> Array:
        x, w = z[:n], z[n:]
        top = solver.once(first @ x + (two[:, second] @ w if len(second) else 0.0)) / solver.columns
        return np.concatenate([-top, x[second]])

    size = n + len(second)
    if size <= DENSE:
        matrix = np.zeros((size, size))
        matrix[:n, :n] = -solver.solve(first)
        if len(second):
            matrix[:n, n:] = -solver.solve(two[:, second])
            matrix[n + np.arange(len(second)), second] = 1.0
        theta, vectors = eig(matrix, check_finite=False)
    else:
        operator = LinearOperator((size, size), matvec=apply, dtype=float)
        start = np.cos(1.0 + np.arange(size) ** 2)
        try:
            theta, vectors = eigs(operator, k=min(count, size - 2), v0=start, tol=1e-11)
        except ArpackError as failure:
            raise EvaluationError(f"exponents: Arnoldi's method did not converge: {failure}") from failure
    found = np.abs(theta) > 1e-12 * np.abs(theta).max()
    return sigma + 1 / theta[found], vectors[:n, found]


def genuine(parts: Sequence[Array], grid: Discretisation, sigma: float, values: Array, vectors: Array) -> Array:
    """Tell which eigenpairs meet all rows and are resolved in space and time."""
    zero, one, two = parts
    with np.errstate(over="ignore"):
        terms = (zero @ vectors, (one @ vectors) * values, (two @ vectors) * values**2)
    size = np.linalg.norm((np.abs(zero) + sigma * np.abs(one) + sigma**2 * np.abs(two)) @ np.abs(vectors), axis=0)  # what cancels when the rows are met
    misfit = np.linalg.norm(sum(terms), axis=0) / np.maximum(size, 1e-300)
    kept = misfit < RESIDUAL
    for k in np.flatnonzero(kept):
        kept[k] = truncation(grid, vectors[:, k]) < 1e-3
    return kept


def truncation(grid: Discretisation, vector: Array) -> float:
    """Return the share of the last coefficients in space and in time."""
    worst = 0.0
    parts = [grid.unpack(part, 0.0, 0.0) for part in (vector.real, vector.imag)]
    sizes = [np.abs(a) + np.abs(b) for a, b in zip(parts[0].coefficients, parts[1].coefficients, strict=True)]
    for field in sorted(set(grid.rows.field)):
        members = [size for size, belongs in zip(sizes, grid.rows.field, strict=True) if belongs == field]
        largest = max(float(size.max()) for size in members)
        if largest <= 1e-8 * max(float(size.max()) for size in sizes):  # rounding, amplified where a multiplier is found from the rows alone
            continue
        for size in members:
            if grid.rows.spatial:
                worst = max(worst, float(size[-2:].max()) / largest)
            if grid.harmonics:
                worst = max(worst, float(size[:, -2:].max()) / largest)
    return worst


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Where exponents are looked for: near the shifts (those found at all of them count), in a strip about the real axis (0: everywhere)."""

    shifts: tuple[float, ...]
    strip: float
    count: int = COUNT


def class_spectrum(at: Linearisation, grid: Discretisation, search: Search) -> Array:
    """Return the exponents of one class of disturbances, sorted from the most dangerous."""
    sigma, strip = search.shifts[0], search.strip
    parts = [at.matrix(part, grid) for part in ("value", "growth", "growth2")]
    scale = at.scales(np.hstack([part * sigma**power for power, part in enumerate(parts)]))
    parts = [part[scale > 0] * scale[scale > 0, None] for part in parts]
    values, vectors = pencil_spectrum(parts, sigma, search.count)
    for other in search.shifts[1:] if grid.size <= DENSE else ():  # infinite eigenvalues of higher index move with the shift
        others, _ = pencil_spectrum(parts, other, search.count)
        same = np.array([np.abs(others - value).min(initial=np.inf) < 1e-5 * (abs(value) + sigma) for value in values], dtype=bool)
        values, vectors = values[same], vectors[:, same]
    if strip:
        inside = np.abs(values.imag) <= strip / 2 * (1 + 1e-9)
        values, vectors = values[inside], vectors[:, inside]
    values = values[genuine(parts, grid, sigma, values, vectors)]
    if strip and len(values) < FEWEST and grid.size > DENSE and search.count < 4 * COUNT:  # the nearest are copies of one exponent
        return class_spectrum(at, grid, replace(search, count=2 * search.count))
    return values[ordered(values)]


def class_values(branch: Branch, grid: Discretisation, X: Array, shifts: Sequence[float]) -> list[Class]:
    """Return the exponents of a state X = (coefficients, frequency, control) by class, found from all the shifts, which are factors of a size of the problem."""
    full, state, motion = branch.full, branch.state, branch.form.motion
    omega, control = float(X[-2]), float(X[-1])
    at = grid.linearise(X[:-2], control, omega)
    sigma = 0.137 * abs(omega or full.frequency) if full.hopf else steady_shift(at, grid, growth_scale(branch, control) or 1.0)
    strip = (2 if motion.symmetric else 1) * abs(omega) if motion.kind == "periodic" else 0.0
    search = Search(shifts=tuple(sigma * factor for factor in shifts), strip=strip)
    classes = [("in plane" if full.vector and state in ("beating", "branch") else "", grid)]
    if branch.form.others and any(group.members for group in branch.form.others):
        classes.append(("out of plane", Discretisation(full.rows, motion, branch.form.others, grid.nodes, grid.harmonics)))
    found = [(kind, class_spectrum(at, space, search)) for kind, space in classes]
    return [Class(kind=kind, values=values, errors=np.zeros(len(values))) for kind, values in found]


def steady_shift(at: Linearisation, grid: Discretisation, rate: float) -> float:
    """Return a shift of the size of the third slowest exponent: near the threshold the slowest is too small a measure to tell the others apart."""
    wanted = min(3, grid.size)
    for power in range(13):
        try:
            sizes = np.sort(np.abs(class_spectrum(at, grid, Search(shifts=(0.618 * rate * 10**power,), strip=0.0))))
        except NotConverged:  # too near to an exponent
            continue
        if len(sizes) >= wanted and sizes[wanted - 1]:
            return 0.618 * float(sizes[wanted - 1])
    return rate


def growth_scale(branch: Branch, control: float) -> float:
    """Return the growth rate of the base state that the amplitude equation gives."""
    return abs(branch.full.coefficient("mu*A").real * (control - branch.full.threshold))


def exponents_of(branch: Branch, grid: Discretisation, y: Array, control: float, omega: float) -> tuple[Exponent, ...]:
    """Return the leading exponents of a state, neutral ones recognised.

    Raises
    ------
    EvaluationError
        An exponent that must be zero by a symmetry is not.
    """
    return labelled(branch, class_values(branch, grid, np.concatenate([y, [omega, control]]), (1.0, 1.37)), omega, growth_scale(branch, control))


def settled_exponents(branch: Branch, solution: Solution) -> tuple[tuple[Exponent, ...], float]:
    """Return the leading exponents of a state, from two resolutions and two shifts, and the change of those that grow or decay least.

    Raises
    ------
    EvaluationError
        The two do not agree, or an exponent that must be zero by a symmetry is not.
    """
    grid = solution.grid
    if branch.form.motion.kind != "periodic" and grid.nodes > 32:  # exponents settle before the last digits of the state; if not, the loop refines
        grid = branch.grid(3 * grid.nodes // 4, 0)
        solution = branch.at_control(grid, branch.on(grid, solution), solution.control)
    while True:
        grid = solution.grid
        rate = growth_scale(branch, solution.control)
        scale = max(abs(solution.omega), rate, 1e-300)
        if not branch.full.rows.spatial and not grid.harmonics:  # nothing to resolve: two shifts
            found, error = class_values(branch, grid, solution.X, (1.0, 1.37)), 1e-12 * scale
        else:
            coarse = branch.grid(grid.nodes - max(2, grid.nodes // 8), grid.harmonics - 2 if grid.harmonics > 4 else grid.harmonics)
            found, error = agreed(class_values(branch, grid, solution.X, (1.0,)), class_values(branch, coarse, branch.on(coarse, solution), (1.37,)), scale)
        if error <= 1e-6 * scale:
            return labelled(branch, found, solution.omega, rate), max(error, 1e-13 * scale)
        nodes, harmonics = grid.nodes + max(4, grid.nodes // 4), grid.harmonics + 4 if grid.harmonics else 0
        if nodes > MAX_NODES or harmonics > MAX_HARMONICS:
            raise EvaluationError(f"{branch.state} at control {solution.control:.8g}: found exponents that differ by {error:.1e} between two resolutions; expected less than {1e-6 * scale:.1e}")
        finer = branch.grid(nodes, harmonics)
        solution = branch.at_control(finer, branch.on(finer, solution), solution.control)


def resting_exponents(branch: Branch, control: float) -> tuple[tuple[Exponent, ...], float, Discretisation]:
    """Return the leading growth rates of the base state, the change of those that decide, and the discretisation, the coarsest that settles them.

    Raises
    ------
    EvaluationError
        They do not settle.
    """
    full, nodes = branch.full, 20
    grid = branch.grid(nodes, 0)
    if grid.nodes == 1:  # nothing to resolve
        found = exponents_of(branch, grid, np.zeros(grid.size), control, 0.0)
        return found, 1e-12 * max((abs(one.value) for one in found), default=1.0), grid
    before: list[Class] | None = None
    while True:
        classes = class_values(branch, grid, np.concatenate([np.zeros(grid.size), [0.0, control]]), (1.0,) if nodes % 2 else (1.37,))
        error = np.inf
        if before is not None:
            scale = max(full.frequency, growth_scale(branch, control), *(float(np.sort(np.abs(one.values))[:3].max(initial=0.0)) for one in classes))
            kept, error = agreed(classes, before, scale)
            if error < 1e-9 * scale:
                return labelled(branch, kept, 0.0), max(error, 1e-14 * scale), grid
        before, nodes = classes, nodes + nodes // 8 * 2 + 1  # odd and even in turn, with other shifts
        if nodes > MAX_NODES:
            raise EvaluationError(f"{branch.state} at control {control:.8g}: found leading growth rates that still change by {error:.1e} at {grid.nodes} nodes; expected them to settle")
        grid = branch.grid(nodes, 0)


def agreed(fine: Sequence[Class], coarse: Sequence[Class], scale: float) -> tuple[list[Class], float]:
    """Return the exponents that two resolutions share, by class, and the largest change of those that decide.

    Those are the ones that grow and the three next that are not much faster than the slowest ones: no resolution settles all modes of a beam that decay alike.
    One that grows and is found by one resolution only counts as an infinite change; one that decays must be found by the coarser one too.
    """
    kept, worst = [], 0.0
    for now, before in zip(fine, coarse, strict=True):
        new, old = now.values, before.values
        change = np.array([np.abs(old - value).min(initial=np.inf) for value in new])
        lost = np.array([np.abs(new - value).min(initial=np.inf) for value in old])
        same = change < 1e-4 * (np.abs(new) + scale)
        growing = new.real > 1e-5 * scale
        missed = not same.any() or (growing & ~same).any() or ((old.real > 1e-5 * scale) & (lost > 1e-4 * (np.abs(old) + scale))).any()
        reach = 10 * max(scale, float(np.sort(np.abs(new))[:3].max(initial=0.0)))
        next_ones = np.flatnonzero(~growing & (np.abs(new) < reach))[:3]
        worst = max(worst, np.inf if missed else float(np.concatenate([change[growing], change[next_ones]]).max(initial=0.0)))
        kept.append(Class(kind=now.kind, values=new[same], errors=change[same]))
    return kept, worst


def labelled(branch: Branch, classes: Sequence[Class], omega: float, rate: float = 0.0) -> tuple[Exponent, ...]:
    """Return the exponents of all classes, the one of each that a symmetry makes zero recognised.

    Raises
    ------
    EvaluationError
        An exponent that must be zero by a symmetry is not.
    """
    found: list[Exponent] = []
    for one in classes:
        kind, values = one.kind, one.values
        neutral = 1 if branch.state in ("beating", "whirling", "cycle") or kind == "out of plane" else 0
        order = np.argsort(np.abs(values))[:neutral]
        if neutral and (not len(values) or abs(values[order[0]]) > 1e-4 * max(abs(omega), rate)):
            raise EvaluationError(f"exponents: found {values[order] if len(values) else 'none'} {kind}; expected a neutral one by symmetry: the state is not resolved well enough, ask for a smaller tolerance")
        why = "rotation" if kind == "out of plane" or branch.state == "whirling" else "phase"
        for k, value in enumerate(values):
            label = f"neutral ({why})" if k in order else ""
            found.append(Exponent(value=complex(value), kind=", ".join(part for part in (kind, label) if part), error=float(one.errors[k])))
    if not found:
        raise EvaluationError(f"exponents: found none of {branch.state} that meets the rows and is resolved; expected at least one")
    return tuple(found[k] for k in ordered(np.array([one.value for one in found])))
