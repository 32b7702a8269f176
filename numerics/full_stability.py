r"""Growth rates and Floquet exponents: which disturbances :math:`e^{\lambda t} p` of a state meet the linearised rows.

The pencil :math:`A_0 + \lambda A_1 + \lambda^2 A_2` has more rows than columns and, the problem being differential-algebraic, infinite
eigenvalues. A shift sigma and least squares turn it into an ordinary eigenvalue problem for 1 / (lambda - sigma), in which these are zeros;
an eigenvector that leaves a residual in the rows, or is not resolved, is dropped. For a periodic state `p` is periodic (Hill's method): each
exponent then comes once in a strip of the width of the frequency, which also selects the eigenvectors with the least truncation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from numerics.full_newton import LeastSquares
from numerics.full_rows import Array, Discretisation, Linearisation
from numerics.full_states import Branch
from numerics.precision import EvaluationError

DENSE = 420
COUNT = 10
RESIDUAL = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Exponent:
    """A growth rate or Floquet exponent; `kind` says `neutral`, and `in plane` or `out of plane` where that makes sense."""

    value: complex
    kind: str

    @property
    def neutral(self) -> bool:
        """Tell whether it is zero by a symmetry."""
        return "neutral" in self.kind


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
        if largest <= 1e-12 * max(float(size.max()) for size in sizes):
            continue
        for size in members:
            if grid.rows.spatial:
                worst = max(worst, float(size[-2:].max()) / largest)
            if grid.harmonics:
                worst = max(worst, float(size[:, -2:].max()) / largest)
    return worst


def class_spectrum(at: Linearisation, grid: Discretisation, sigma: float, strip: float, count: int) -> Array:
    """Return the exponents of one class of disturbances, sorted from the most dangerous."""
    parts = [at.matrix(part, grid) for part in ("value", "growth", "growth2")]
    scale = at.scales(np.hstack([part * sigma**power for power, part in enumerate(parts)]))
    parts = [part[scale > 0] * scale[scale > 0, None] for part in parts]
    values, vectors = pencil_spectrum(parts, sigma, count)
    if grid.size <= DENSE:  # infinite eigenvalues of higher index move with the shift
        others, _ = pencil_spectrum(parts, 1.37 * sigma, count)
        same = np.array([np.abs(others - value).min(initial=np.inf) < 1e-5 * (abs(value) + sigma) for value in values], dtype=bool)
        values, vectors = values[same], vectors[:, same]
    if strip:
        inside = np.abs(values.imag) <= strip / 2 * (1 + 1e-9)
        values, vectors = values[inside], vectors[:, inside]
    values = values[genuine(parts, grid, sigma, values, vectors)]
    return values[np.lexsort((-values.imag, np.round(-values.real, 9)))]


def exponents_of(branch: Branch, grid: Discretisation, y: Array, control: float, omega: float, count: int = COUNT) -> tuple[Exponent, ...]:
    """Return the leading exponents of a state, neutral ones recognised.

    Raises
    ------
    EvaluationError
        An exponent that must be zero by a symmetry is not.
    """
    full, state, motion = branch.full, branch.state, branch.form.motion
    at = grid.linearise(y, control, omega)
    mu = control - full.threshold
    rate = abs(full.coefficient("mu*A").real * mu)
    sigma = 0.137 * abs(omega or full.frequency) if full.hopf else 0.618 * rate if rate else 1.0
    strip = (2 if motion.symmetric else 1) * abs(omega) if motion.kind == "periodic" else 0.0
    planar = full.vector and state in ("beating", "branch")
    classes = [("in plane" if planar else "", grid)]
    if branch.form.others and any(group.members for group in branch.form.others):
        classes.append(("out of plane", Discretisation(full.rows, motion, branch.form.others, grid.nodes, grid.harmonics)))
    return labelled(branch, [(kind, class_spectrum(at, space, sigma, strip, count)) for kind, space in classes], omega, rate)


def labelled(branch: Branch, classes: Sequence[tuple[str, Array]], omega: float, rate: float = 0.0) -> tuple[Exponent, ...]:
    """Return the exponents of all classes, the one of each that a symmetry makes zero recognised.

    Raises
    ------
    EvaluationError
        An exponent that must be zero by a symmetry is not.
    """
    found: list[Exponent] = []
    for kind, values in classes:
        neutral = 1 if branch.state in ("beating", "whirling", "cycle") or kind == "out of plane" else 0
        order = np.argsort(np.abs(values))[:neutral]
        if neutral and (not len(values) or abs(values[order[0]]) > 1e-4 * max(abs(omega), rate)):
            raise EvaluationError(f"exponents: found {values[order] if len(values) else 'none'} {kind}; expected a neutral one by symmetry: the state is not resolved well enough, ask for a smaller tolerance")
        why = "rotation" if kind == "out of plane" or branch.state == "whirling" else "phase"
        for k, value in enumerate(values):
            label = f"neutral ({why})" if k in order else ""
            found.append(Exponent(value=complex(value), kind=", ".join(part for part in (kind, label) if part)))
    return tuple(sorted(found, key=lambda one: (-round(one.value.real, 9), -one.value.imag)))
