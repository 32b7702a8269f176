"""The interface that emitted code is written against.

An algebra has numbers (`acb`), functions of `s` that add and multiply, and a few operations: integrals, end values, and the
solution of linear boundary-value problems. One emitted text runs over every algebra below; they share nothing else.

* `Constants`: no space; functions are numbers, problems are linear systems.
* `numerics.closed.Closed`: sums of exponentials, exact integrals.
* `numerics.sampled.Sampled`: values at nodes, Chebyshev or Gauss-Legendre, on panels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, ClassVar

from flint import acb, acb_mat, fmpq

from numerics.precision import EvaluationError

Row = Sequence[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Operator:
    """y' = `matrix` y with `left` y and `right` y given at the ends; without space, `matrix` y is given."""

    matrix: Sequence[Row]
    left: Sequence[Row] = ()
    right: Sequence[Row] = ()

    @property
    def size(self) -> int:
        """Return n."""
        return len(self.matrix)


def stage(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Compute a stage once for each algebra: evaluation is lazy, and what is not asked for is not computed."""

    @wraps(function)
    def once(a: Any) -> Any:
        key = function.__name__
        if key not in a.store:
            a.store[key] = function(a)
            a.counts["stages"] = a.counts.get("stages", 0) + 1
        return a.store[key]

    return once


def number(value: Any) -> acb:
    """Return an exact int or a number as `acb`."""
    return value if isinstance(value, acb) else acb(value)


def across(table: Mapping[tuple[int, int], Any], zero: Any, i: Any) -> dict[str, Any]:
    """Return the entries of a linear map of the directions e1, e2 across the axis, from those of the circular components (row, column), 0 for + and 1 for -."""
    a, b, c, d = (table.get(key, zero) for key in ((0, 0), (0, 1), (1, 0), (1, 1)))
    # A_1 = (A_+ + A_-)/2, A_2 = (A_+ - A_-)/(2i)
    return {"11": (a + b + c + d) / 2, "12": i * (a + c - b - d) / 2, "21": (a - c + b - d) / (2 * i), "22": (a - c - b + d) / 2}


class Algebra:
    """Numbers and elementary functions; the threshold and the parameters at which the emitted text is run."""

    name: ClassVar[str] = ""

    def __init__(self, *, control: acb, frequency: acb, values: dict[str, acb]) -> None:
        self.control = control
        self.frequency = frequency
        self.values = values
        self.store: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.one = acb(1)
        self.zero = acb(0)
        self.i = acb(0, 1)

    @property
    def pi(self) -> acb:
        """The number pi."""
        return acb.pi()

    def rational(self, p: int, q: int) -> acb:
        """Return p/q."""
        return acb(fmpq(p, q))

    def parameter(self, name: str) -> acb:
        """Return the value of a parameter."""
        return self.values[name]

    def __getattr__(self, name: str) -> Callable[[Any], Any]:
        if name not in {"exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "asin", "acos", "atan", "asinh", "acosh", "atanh", "erf"}:
            raise AttributeError(name)

        def apply(value: Any) -> Any:
            value = value if hasattr(value, "apply") or isinstance(value, acb) else acb(value)
            return value.apply(name) if hasattr(value, "apply") else getattr(value, name)()

        return apply


class Constants(Algebra):
    """The algebra without space: linear algebra only."""

    name = "closed"

    def determinant(self, operator: Operator) -> acb:
        """Return det M."""
        return acb_mat([[number(entry) for entry in row] for row in operator.matrix]).det()

    def kernel(self, operator: Operator, row: Row) -> tuple[acb, ...]:
        """Return y with M y = 0 and row y = 1."""
        vector = null_vector([[number(entry) for entry in line] for line in operator.matrix])
        return scaled_to(vector, sum((number(entry) * value for entry, value in zip(row, vector, strict=True)), acb(0)))

    def left_kernel(self, operator: Operator) -> tuple[acb, ...]:
        """Return z with z M = 0."""
        n = operator.size
        return tuple(null_vector([[number(operator.matrix[j][i]) for j in range(n)] for i in range(n)]))

    def solve(self, operator: Operator, forcing: Row) -> tuple[acb, ...]:
        """Return y with M y = forcing."""
        return tuple(solve_rows([[number(entry) for entry in row] for row in operator.matrix], [number(entry) for entry in forcing], 0))

    def solve_singular(self, operator: Operator, forcing: Row, row: Row) -> tuple[acb, ...]:
        """Return y with M y = forcing and row y = 0, for a singular M and a forcing in its range."""
        matrix = [[number(entry) for entry in line] for line in operator.matrix] + [[number(entry) for entry in row]]
        return tuple(solve_rows(matrix, [*(number(entry) for entry in forcing), acb(0)], 1))

    def reflect(self, value: Any) -> acb:
        """Return the conjugate."""
        return number(value).conjugate()


def scaled_to(vector: Sequence[Any], size: acb) -> tuple[Any, ...]:
    """Return the vector divided by its value at the normalisation, or refuse a mode that vanishes there."""
    largest = max(float(abs(entry.mid())) if isinstance(entry, acb) else entry.largest() for entry in vector)
    if not float(abs(size.mid())) > 1e-12 * largest:
        raise EvaluationError("normalisation: found a critical mode that vanishes there; expected a field and a place where it does not")
    return tuple(entry / size for entry in vector)


def magnitude(value: acb) -> Any:
    """Return |value| as a comparable float, safe for huge and tiny values."""
    size = abs(value.mid())
    return size


def null_vector(rows: list[list[acb]]) -> list[acb]:
    """Return the null vector of a matrix of corank one, by elimination with complete pivoting; largest entry 1."""
    n = len(rows[0])
    if n == 1:
        return [acb(1)]
    matrix = [list(map(midpoint, row)) for row in rows]  # not scaled: what rounding leaves of a row that vanishes must stay small
    columns = list(range(n))
    pivots: list[tuple[int, list[acb]]] = []
    for _ in range(n - 1):
        best = max(((abs(row[k]), index, k) for index, row in enumerate(matrix) for k in columns), key=lambda item: item[0])
        size, index, k = best
        if not size > 0:
            raise EvaluationError("threshold: found a critical eigenvalue of multiplicity higher than one; expected a simple one")
        row = matrix.pop(index)
        row = [entry / row[k] for entry in row]
        matrix = [[a - other[k] * b for a, b in zip(other, row, strict=True)] if other[k] != 0 else other for other in matrix]
        columns.remove(k)
        pivots.append((k, row))
    free = columns[0]
    result = [acb(0)] * n
    result[free] = acb(1)
    for k, row in reversed(pivots):
        result[k] = -sum((row[j] * result[j] for j in range(n) if j != k), acb(0))
    return result


def midpoint(value: acb) -> acb:
    """Return the centre of a ball: these routes estimate their error from two computations."""
    return value.mid()


def solve_rows(rows: list[list[acb]], right: list[acb], corank: int) -> list[acb]:
    """Return the solution of a consistent system with `corank` more rows than unknowns, by complete pivoting."""
    n = len(rows[0]) if rows else 0
    matrix = [[*map(midpoint, row), midpoint(value)] for row, value in zip(rows, right, strict=True)]
    columns = list(range(n))
    pivots: list[tuple[int, list[acb]]] = []
    for _ in range(n):
        size, index, k = max(((abs(row[k]), index, k) for index, row in enumerate(matrix) for k in columns), key=lambda item: item[0])
        if not size > 0:
            raise EvaluationError("response: found a singular linear problem; expected no other eigenvalue of the linear problem at this harmonic (a resonance)")
        row = matrix.pop(index)
        row = [entry / row[k] for entry in row]
        matrix = [[a - other[k] * b for a, b in zip(other, row, strict=True)] for other in matrix]
        columns.remove(k)
        pivots.append((k, row))
    result = [acb(0)] * n
    for k, row in reversed(pivots):
        result[k] = row[n] - sum((row[j] * result[j] for j in range(n) if j != k), acb(0))
    return result
