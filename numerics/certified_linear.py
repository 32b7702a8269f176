"""Linear algebra in balls, and the certified algebra without space.

Every number is an enclosure. A matrix that is singular at the true threshold is known as a ball matrix that may hold regular ones
too: its null vector follows from all rows but one. If the ball solution of these rows succeeds they are independent for every
matrix in the ball, so that at the threshold the row left out depends on them and the vector is the null vector.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import flint
from flint import acb, acb_mat, arb

from numerics.algebra import Algebra, Constants, Operator, Row, number, scaled_to
from numerics.precision import EvaluationError, working_precision

Rows = Sequence[Sequence[acb]]


CHOICE = 128
"""Bits with which rows and columns are chosen."""


class Unproved(EvaluationError):
    """An enclosure is too wide at this precision: what was asked is neither proved nor disproved."""


def solved(rows: Rows, right: Sequence[acb]) -> list[acb]:
    """Return an enclosure of the solution of a square system, or refuse a matrix that may be singular."""
    return [row[0] for row in acb_mat_solved(acb_mat([list(row) for row in rows]), acb_mat([[value] for value in right])).tolist()]


def acb_mat_solved(matrix: acb_mat, right: acb_mat) -> acb_mat:
    """Return an enclosure of matrix^-1 right."""
    try:
        return matrix.solve(right)
    except ZeroDivisionError as singular:
        raise Unproved("found a linear problem that may be singular") from singular


def pivots(rows: Rows) -> tuple[int, int]:
    """Return the row and the column to leave out of a nearly singular square matrix: where its null vectors are largest."""
    n = len(rows)
    if n == 1:
        return 0, 0
    # Bordered by (any) vectors the matrix is regular; only the choice, not its proof, depends on them.
    if flint.ctx.prec > CHOICE:
        with working_precision(CHOICE):
            return pivots(rows)
    border = [acb((7 * k) % 11 + 1, (5 * k) % 7) for k in range(n)]
    result = []
    for table in ([[rows[j][i] for j in range(n)] for i in range(n)], [list(row) for row in rows]):
        bordered = acb_mat([*([*row, border[i]] for i, row in enumerate(table)), [*reversed(border), acb(0)]])
        vector = acb_mat_approximate(bordered, [acb(0)] * n + [acb(1)])
        result.append(max(range(n), key=lambda k: abs(vector[k].mid())))  # noqa: B023
    return result[0], result[1]


def acb_mat_approximate(matrix: acb_mat, right: Sequence[acb]) -> list[acb]:
    """Return the solution of a square system without a bound on its error."""
    try:
        return [row[0] for row in matrix.mid().solve(acb_mat([[value] for value in right]), algorithm="approx").tolist()]
    except ZeroDivisionError as singular:
        raise Unproved("found a matrix of corank higher than one") from singular


def schur(rows: Rows, corner: tuple[int, int]) -> acb:
    """Return det(rows) over the minor without the corner's row and column: it vanishes exactly where the matrix is singular.

    Unlike the determinant itself it does not cancel near a simple root; the minor is proved not to vanish.
    """
    row, column = corner
    if len(rows) == 1:
        return rows[0][0]
    kept = [[entry for k, entry in enumerate(line) if k != column] for index, line in enumerate(rows) if index != row]
    inner = solved(kept, [line[column] for index, line in enumerate(rows) if index != row])
    outer = [entry for k, entry in enumerate(rows[row]) if k != column]
    return rows[row][column] - sum((a * b for a, b in zip(outer, inner, strict=True)), acb(0))


def kernel(rows: Rows) -> list[acb]:
    """Return an enclosure of the null vector of a square matrix that is singular at the true threshold; one entry is 1."""
    n = len(rows)
    if n == 1:
        return [acb(1)]
    row, column = pivots(rows)
    kept = [line for index, line in enumerate(rows) if index != row]
    vector = solved([[entry for k, entry in enumerate(line) if k != column] for line in kept], [-line[column] for line in kept])
    return [*vector[:column], acb(1), *vector[column:]]


def solved_singular(rows: Rows, right: Sequence[acb], extra: Sequence[acb], size: acb) -> list[acb]:
    """Return y with rows y = right and extra y = size, for a matrix singular at the true threshold and a right side in its range."""
    row, _ = pivots(rows)
    kept = [[*line] for index, line in enumerate(rows) if index != row]
    return solved([*kept, list(extra)], [*(value for index, value in enumerate(right) if index != row), size])


ELEMENTARY = ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "asin", "acos", "atan", "asinh", "acosh", "atanh", "erf")


def elementary(name: str, z: Any) -> Any:
    """Return an elementary function of a ball or of a power series; not finite where a branch cut or a pole is touched."""
    i = acb(0, 1)
    ball = isinstance(z, acb)
    if name in {"sqrt", "log"}:
        return getattr(z, name)(analytic=True) if ball else getattr(z, name)()
    if name in {"exp", "sin", "cos", "tan", "erf"} or ball and name in {"sinh", "cosh", "tanh"}:
        return getattr(z, name)()

    def log(w: Any) -> Any:
        return elementary("log", w)

    def sqrt(w: Any) -> Any:
        return elementary("sqrt", w)

    formulas: dict[str, Callable[[], Any]] = {
        "sinh": lambda: (z.exp() - (-z).exp()) / 2,
        "cosh": lambda: (z.exp() + (-z).exp()) / 2,
        "tanh": lambda: 1 - 2 / ((2 * z).exp() + 1),
        "atan": lambda: (log(1 + i * z) - log(1 - i * z)) / (2 * i),
        "asin": lambda: -i * log(i * z + sqrt(1 - z * z)),
        "acos": lambda: acb.pi() / 2 + i * log(i * z + sqrt(1 - z * z)),
        "asinh": lambda: log(z + sqrt(z * z + 1)),
        "acosh": lambda: log(z + sqrt(z - 1) * sqrt(z + 1)),
        "atanh": lambda: (log(1 + z) - log(1 - z)) / 2,
    }
    return formulas[name]()


class Enclosing(Algebra):
    """Certified algebras share numbers and elementary functions: enclosures, analytic wherever they are finite."""

    def __getattr__(self, name: str) -> Callable[[Any], Any]:
        if name not in ELEMENTARY:
            raise AttributeError(name)

        def apply(value: Any) -> Any:
            if hasattr(value, "apply"):
                return value.apply(name)
            value = number(value)
            result = elementary(name, value)
            if result.is_finite():
                return result
            if value.is_exact() and value.imag == 0:  # an exact real number on a branch cut: the principal value
                return getattr(value, name)()
            raise Unproved(f"found {name} too near to a singular point or a branch cut")

        return apply

    def rows(self, operator: Operator) -> list[list[acb]]:
        """Return a square matrix that is singular exactly where the linear problem is."""
        raise NotImplementedError

    def corner(self, operator: Operator) -> tuple[int, int]:
        """Return the row and column whose minor stays away from zero near the threshold."""
        return pivots(self.rows(operator))

    def defect(self, operator: Operator, corner: tuple[int, int]) -> acb:
        """Return an analytic function of control and frequency that vanishes exactly where the linear problem is singular."""
        return schur(self.rows(operator), corner)


class CertifiedConstants(Enclosing, Constants):
    """The certified algebra without space."""

    name: ClassVar[str] = "closed"

    def rows(self, operator: Operator) -> list[list[acb]]:
        """Return M."""
        return [[number(entry) for entry in row] for row in operator.matrix]

    def kernel(self, operator: Operator, row: Row) -> tuple[acb, ...]:
        """Return y with M y = 0 and row y = 1."""
        vector = kernel(self.rows(operator))
        return scaled_to(vector, sum((number(entry) * value for entry, value in zip(row, vector, strict=True)), acb(0)))

    def left_kernel(self, operator: Operator) -> tuple[acb, ...]:
        """Return z with z M = 0."""
        return tuple(kernel([list(column) for column in zip(*self.rows(operator), strict=True)]))

    def solve(self, operator: Operator, forcing: Row) -> tuple[acb, ...]:
        """Return y with M y = forcing."""
        return tuple(solved(self.rows(operator), [number(entry) for entry in forcing]))

    def solve_singular(self, operator: Operator, forcing: Row, row: Row) -> tuple[acb, ...]:
        """Return y with M y = forcing and row y = 0."""
        return tuple(solved_singular(self.rows(operator), [number(entry) for entry in forcing], [number(entry) for entry in row], acb(0)))


def upper(value: acb | arb) -> arb:
    """Return an upper bound of the modulus."""
    return value.abs_upper() if isinstance(value, acb) else abs(value).upper()
