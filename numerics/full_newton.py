r"""Newton's method on all rows by least squares, with linear conditions that fix phase, amplitude, control or arclength."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular

from numerics.full_rows import Array, Discretisation, Linearisation
from numerics.precision import EvaluationError

STEPS = 16
CONVERGED = 1e-13


class NotConverged(EvaluationError):
    """Newton's method failed; the message says where and how."""


def check_finite(values: Array) -> None:
    """Refuse values of the rows outside the domain of the equations."""
    if not np.all(np.isfinite(values)):
        raise NotConverged("found values of the rows that are not finite; expected a state in the domain of the equations")


class LeastSquares:
    """A least-squares solver that keeps its factor: normal equations with refinement, orthogonal where those are too ill-conditioned."""

    def __init__(self, matrix: Array) -> None:
        check_finite(matrix)
        if matrix.shape[0] < matrix.shape[1]:
            raise NotConverged("found a singular linearisation: fewer rows than unknowns")
        self.columns = np.linalg.norm(matrix, axis=0)
        self.columns[self.columns == 0] = 1.0
        self.matrix = matrix / self.columns
        try:
            self.factor = cho_factor(self.matrix.T @ self.matrix, lower=False, check_finite=False)
            diagonal = np.diag(self.factor[0])
            self.orthogonal = not diagonal.min() > 1e-6 * diagonal.max()
        except LinAlgError:
            self.orthogonal = True
        if self.orthogonal:
            self.q, self.triangle = np.linalg.qr(self.matrix)
            diagonal = np.abs(np.diag(self.triangle))
            if not diagonal.min() > 1e-15 * diagonal.max():
                raise NotConverged("found a singular linearisation: fewer independent rows than unknowns")

    def once(self, right: Array) -> Array:
        """Return the solution without refinement."""
        if self.orthogonal:
            return solve_triangular(self.triangle, self.q.T @ right, check_finite=False)
        return cho_solve(self.factor, self.matrix.T @ right, check_finite=False)

    def solve(self, right: Array) -> Array:
        """Return the least-squares solution, refined once."""
        first = self.once(right)
        first = first + self.once(right - self.matrix @ first)
        return (first.T / self.columns).T


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A linear condition `row` X = `value` on X = (coefficients, frequency, control)."""

    row: Array
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """X = (coefficients, frequency, control) with the residual of all rows, scaled, and the last factor."""

    grid: Discretisation
    X: Array
    residual: float
    steps: int
    solver: LeastSquares

    @property
    def y(self) -> Array:
        """Return the coefficients."""
        return self.X[:-2]

    @property
    def omega(self) -> float:
        """Return the frequency."""
        return float(self.X[-2])

    @property
    def control(self) -> float:
        """Return the control."""
        return float(self.X[-1])


def system(grid: Discretisation, X: Array, conditions: Sequence[Condition]) -> Array:
    """Return the matrix of a Newton step; rows are scaled to unit size."""
    at = grid.linearise(X[:-2], X[-1], X[-2])
    matrix = at.matrix()
    check_finite(matrix)
    others = np.stack([at.in_omega, at.in_control], axis=1)
    scale = at.scales(matrix, others)
    matrix = np.hstack([matrix, others]) * scale[:, None]
    return np.vstack([matrix, [condition.row / np.linalg.norm(condition.row) for condition in conditions]])


def right_side(at: Linearisation, X: Array, conditions: Sequence[Condition], scale: Array) -> Array:
    """Return minus the scaled residual of rows and conditions."""
    misfit = [(condition.row @ X - condition.value) / np.linalg.norm(condition.row) for condition in conditions]
    return -np.concatenate([at.residual * scale, misfit])


def newton(grid: Discretisation, X: Array, conditions: Sequence[Condition], width: float, held: Sequence[int] = ()) -> Solution:
    """Return the state that meets all rows and the conditions.

    The factor is kept as long as it contracts well: what decides is the residual, which is always that of all rows.

    Parameters
    ----------
    width
        A size of the control against which its steps are small.
    held
        Which of frequency (-2) and control (-1) keep their values.

    Raises
    ------
    NotConverged
        The steps do not become small; the message gives the control and the last step.
    """
    X = X.copy()
    before, solver, factors = np.inf, None, 0
    free = np.delete(np.arange(len(X)), list(held))
    for count in range(1, 4 * STEPS + 1):
        at = grid.linearise(X[:-2], X[-1], X[-2])
        if solver is None:
            matrix = at.matrix()
            check_finite(matrix)
            others = np.stack([at.in_omega, at.in_control], axis=1)
            scale = at.scales(matrix, others)
            matrix = np.hstack([matrix, others])[scale > 0] * scale[scale > 0, None]
            extra = np.array([condition.row / np.linalg.norm(condition.row) for condition in conditions]).reshape(-1, len(X))
            solver = LeastSquares(np.vstack([matrix, extra])[:, free])
            factors += 1
        right = right_side(at, X, conditions, scale)
        step = np.zeros(len(X))
        step[free] = solver.solve(np.delete(right, np.flatnonzero(scale == 0)))
        X = X + step
        size = step_size(step, X, width)
        if not np.isfinite(size) or size > 1e6 or factors > STEPS:
            break
        if size < CONVERGED or (size < 1e-9 and size > 0.3 * before):
            return Solution(grid=grid, X=X, residual=float(np.abs(right).max()), steps=count, solver=solver)
        if size > 0.03 * before or size > 0.1:
            solver = None
        before = size
    raise NotConverged(f"at control {X[-1]:.6g}: Newton's method did not converge in {count} steps (last relative step {size:.1e})")


def step_size(step: Array, X: Array, width: float) -> float:
    """Return the relative size of a step."""
    shape = np.abs(step[:-2]).max(initial=0.0) / max(np.abs(X[:-2]).max(initial=0.0), 1e-300)
    return max(shape, abs(step[-2] / X[-2]) if X[-2] else 0.0, abs(step[-1]) / width)
