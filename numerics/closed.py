r"""Sums of exponentials :math:`\sum_m e^{\sigma_m x} p_m(x)`, exact products and integrals: constant coefficients.

Exponents are integer vectors over the basic exponents, packed into one Python integer, so that equal exponents and the exponent
zero are recognised exactly; x is measured from the left end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import flint
import numpy as np
from flint import acb, acb_mat

from numerics.algebra import Algebra, Operator, Row, midpoint, null_vector, number, scaled_to, solve_rows
from numerics.precision import NotClosed

BASE = 4096
NEAR = 1e-9


class ExponentialSum:
    """A function {exponent key: coefficients of 1, x, x^2, ...}."""

    __slots__ = ("algebra", "terms")

    def __init__(self, algebra: Closed, terms: dict[int, list[acb]]) -> None:
        self.algebra = algebra
        self.terms = terms

    def _coerced(self, other: Any) -> ExponentialSum:
        return other if isinstance(other, ExponentialSum) else ExponentialSum(self.algebra, {0: [number(other)]})

    def __add__(self, other: Any) -> ExponentialSum:
        terms = dict(self.terms)
        for key, b in self._coerced(other).terms.items():
            a = terms.get(key)
            terms[key] = b if a is None else add(a, b)
        return ExponentialSum(self.algebra, terms)

    __radd__ = __add__

    def __neg__(self) -> ExponentialSum:
        return ExponentialSum(self.algebra, {key: [-c for c in a] for key, a in self.terms.items()})

    def __sub__(self, other: Any) -> ExponentialSum:
        return self + (-self._coerced(other))

    def __rsub__(self, other: Any) -> ExponentialSum:
        return self._coerced(other) - self

    def __mul__(self, other: Any) -> ExponentialSum:
        if not isinstance(other, ExponentialSum):
            return ExponentialSum(self.algebra, {key: [c * other for c in a] for key, a in self.terms.items()})
        self.algebra.counts["products"] = self.algebra.counts.get("products", 0) + 1
        if self.plain() and other.plain():
            right = [(m, b[0]) for m, b in other.terms.items()]
            sums: dict[int, acb] = {}
            for k, (factor,) in self.terms.items():
                for m, own in right:
                    key = k + m
                    sums[key] = sums[key] + factor * own if key in sums else factor * own
            return ExponentialSum(self.algebra, {key: [total] for key, total in sums.items()})
        terms: dict[int, list[acb]] = {}
        for k, a in self.terms.items():
            for m, b in other.terms.items():
                key, c = k + m, convolve(a, b)
                terms[key] = add(terms[key], c) if key in terms else c
        return ExponentialSum(self.algebra, terms)

    def plain(self) -> bool:
        """Tell whether no exponential is multiplied by a power of x."""
        return all(len(a) == 1 for a in self.terms.values())

    def __rmul__(self, other: Any) -> ExponentialSum:
        return self * other

    def __truediv__(self, other: Any) -> ExponentialSum:
        if isinstance(other, ExponentialSum):
            if list(other.terms) == [0] and len(other.terms[0]) == 1:
                return self / other.terms[0][0]
            raise NotClosed("the closed form holds no quotient of functions of s; use --route chebyshev")
        return ExponentialSum(self.algebra, {key: [c / other for c in a] for key, a in self.terms.items()})

    def __rtruediv__(self, other: Any) -> ExponentialSum:
        return self._coerced(other) / self

    def __pow__(self, power: int) -> ExponentialSum:
        result = self
        for _ in range(power - 1):
            result = result * self
        return result

    def apply(self, name: str) -> ExponentialSum:
        """Return exp, sin, cos, sinh, cosh of a function linear in s, as exponentials."""
        if set(self.terms) - {0}:
            raise NotClosed(f"the closed form holds no {name} of an exponential; use --route chebyshev")
        c = self.terms.get(0, [acb(0)])
        if len(c) == 1:
            return ExponentialSum(self.algebra, {0: [getattr(c[0], name)()]})
        if len(c) > 2 or name not in {"exp", "sin", "cos", "sinh", "cosh"}:
            raise NotClosed(f"the closed form holds no {name} of a function of s that is not linear; use --route chebyshev")

        def power(factor: acb) -> ExponentialSum:
            return ExponentialSum(self.algebra, {self.algebra.key(c[1] * factor): [(c[0] * factor).exp()]})

        i = self.algebra.i
        if name == "exp":
            return power(acb(1))
        if name in {"sinh", "cosh"}:
            return (power(acb(1)) + power(acb(-1)) * (1 if name == "cosh" else -1)) / 2
        if name == "cos":
            return (power(i) + power(-i)) / 2
        return (power(i) - power(-i)) / (2 * i)

    def at(self, x: acb) -> acb:
        """Return the value at distance x from the left end."""
        total = acb(0)
        for key, a in self.terms.items():
            value = a[-1]
            for c in reversed(a[:-1]):
                value = value * x + c
            total += value * self.algebra.exponential(key, x)
        return total

    def largest(self) -> float:
        """Return the size of the largest coefficient."""
        return max((float(abs(c.mid())) for a in self.terms.values() for c in a), default=0.0)

    def primitive(self) -> ExponentialSum:
        """Return the primitive that vanishes at the left end."""
        terms: dict[int, list[acb]] = {}
        constant = acb(0)
        for key, a in self.terms.items():
            if key == 0:
                terms[0] = add(terms.get(0, [acb(0)]), [acb(0), *(c / (k + 1) for k, c in enumerate(a))])
                continue
            sigma = self.algebra.exponent(key)
            b = [acb(0)] * len(a)
            for k in range(len(a) - 1, -1, -1):  # b_k sigma + (k + 1) b_{k+1} = a_k
                b[k] = (a[k] - ((k + 1) * b[k + 1] if k + 1 < len(a) else 0)) / sigma
            terms[key] = b
            constant -= b[0]
        terms[0] = add(terms.get(0, [acb(0)]), [constant])
        return ExponentialSum(self.algebra, terms)


def add(a: list[acb], b: list[acb]) -> list[acb]:
    """Return the sum of two coefficient lists."""
    if len(a) == 1 == len(b):
        return [a[0] + b[0]]
    if len(a) < len(b):
        a, b = b, a
    return [c + b[k] if k < len(b) else c for k, c in enumerate(a)]


def convolve(a: list[acb], b: list[acb]) -> list[acb]:
    """Return the product of two coefficient lists."""
    c = [acb(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            c[i + j] += x * y
    return c


class Closed(Algebra):
    """The algebra of exponential sums on an interval."""

    name = "closed"

    def __init__(self, *, ends: tuple[acb, acb], **common: Any) -> None:
        super().__init__(**common)
        self.left_end, self.right_end = ends
        self.length = ends[1] - ends[0]
        self.basis: list[acb] = []
        self.exponents: dict[int, acb] = {0: acb(0)}
        self.exponentials: dict[tuple[int, bool], acb] = {}
        self.moments: dict[int, acb] = {}
        self.s = ExponentialSum(self, {0: [self.left_end, acb(1)]})
        self.flows: dict[int, tuple[Operator, list[list[ExponentialSum]], list[tuple[acb, int, int]]]] = {}

    def exponent(self, key: int) -> acb:
        """Return the value of an exponent key."""
        if key not in self.exponents:
            total = acb(0)
            for index, count in unpacked(key):
                total += self.basis[index] * count
            if abs(total) < NEAR * max((abs(self.basis[index]) for index, _ in unpacked(key)), default=acb(1).real):
                raise NotClosed("two characteristic exponents nearly coincide: the closed form is 0/0; use --route chebyshev")
            self.exponents[key] = total
        return self.exponents[key]

    def exponential(self, key: int, x: acb) -> acb:
        """Return exp(exponent x), remembered at the right end."""
        if key == 0:
            return acb(1)
        if x is self.length:
            if (key, True) not in self.exponentials:
                value = acb(1)
                for index, count in unpacked(key):
                    unit = BASE**index
                    if (unit, True) not in self.exponentials:
                        self.exponentials[unit, True] = (self.basis[index] * self.length).exp()
                    value *= self.exponentials[unit, True] ** count
                self.exponentials[key, True] = value
            return self.exponentials[key, True]
        return (self.exponent(key) * x).exp()

    def key(self, value: acb) -> int:
        """Return the key of a basic exponent; one that is there already, or its negative or conjugate, is reused."""
        value = midpoint(value)
        tiny = acb(2).real ** (-(flint.ctx.prec * 3 // 5)) * (1 + abs(value))
        if abs(value) < tiny:
            return 0
        for index, known in enumerate(self.basis):
            if abs(known - value) < tiny:
                return int(BASE**index)
            if abs(known + value) < tiny:
                return -int(BASE**index)
        self.basis.append(value)
        self.basis.append(value.conjugate())
        index = len(self.basis) - 2
        if abs(value.imag) < tiny or abs(value.real) < tiny:  # the conjugate is +- the exponent itself
            self.basis.pop()
            self.basis.append(acb(0))
        return int(BASE**index)

    def reflected_key(self, key: int) -> int:
        """Return the key of the conjugate exponent."""
        total = 0
        for index, count in unpacked(key):
            partner = index ^ 1
            if self.basis[partner] != 0:
                total += count * BASE**partner
            else:
                value = self.basis[index]
                total += count * BASE**index * (1 if abs(value.imag) < abs(value.real) else -1)
        return total

    def reflect(self, value: Any) -> Any:
        """Return the function with conjugate coefficients and exponents."""
        if not isinstance(value, ExponentialSum):
            return number(value).conjugate()
        return ExponentialSum(self, {self.reflected_key(key): [c.conjugate() for c in a] for key, a in value.terms.items()})

    def function(self, value: Any) -> ExponentialSum:
        """Return a number as a constant function."""
        return value if isinstance(value, ExponentialSum) else ExponentialSum(self, {0: [number(value)]})

    def integral(self, value: Any) -> acb:
        """Return the integral over the interval."""
        self.counts["integrals"] = self.counts.get("integrals", 0) + 1
        total = acb(0)
        for key, a in self.function(value).terms.items():
            total += a[0] * self.moment(key) if len(a) == 1 else ExponentialSum(self, {key: a}).primitive().at(self.length)
        return total

    def moment(self, key: int) -> acb:
        """Return the integral of an exponential over the interval."""
        if key not in self.moments:
            self.moments[key] = (self.exponential(key, self.length) - 1) / self.exponent(key) if key else self.length
        return self.moments[key]

    def integral_from_left(self, value: Any) -> ExponentialSum:
        """Return the integral from the left end to s."""
        return self.function(value).primitive()

    def integral_to_right(self, value: Any) -> ExponentialSum:
        """Return the integral from s to the right end."""
        primitive = self.function(value).primitive()
        return primitive.at(self.length) - primitive

    def left(self, value: Any) -> acb:
        """Return the value at the left end."""
        return sum((a[0] for a in self.function(value).terms.values()), acb(0))

    def right(self, value: Any) -> acb:
        """Return the value at the right end."""
        return self.function(value).at(self.length)

    # Linear problems

    def constant_matrix(self, operator: Operator) -> list[list[acb]]:
        """Return P, or say that it depends on s."""
        result = []
        for row in operator.matrix:
            line = []
            for entry in row:
                if isinstance(entry, ExponentialSum):
                    terms = {key: a for key, a in entry.terms.items() if any(c != 0 for c in a)}
                    if set(terms) - {0} or len(terms.get(0, [acb(0)])) > 1:
                        raise NotClosed("the coefficients depend on s; use --route chebyshev")
                    entry = terms.get(0, [acb(0)])[0]
                line.append(midpoint(number(entry)))
            result.append(line)
        return result

    def flow(self, operator: Operator) -> tuple[list[list[ExponentialSum]], list[tuple[acb, int, int]]]:
        """Return n independent solutions of y' = P y, as columns, and the exponents (value, multiplicity, key)."""
        known = self.flows.get(id(operator))
        if known is not None:
            return known[1], known[2]
        matrix = self.constant_matrix(operator)
        n = len(matrix)
        roots = characteristic_exponents(matrix)
        columns: list[list[ExponentialSum]] = []
        exponents: list[tuple[acb, int, int]] = []
        for sigma, multiplicity in roots:
            key = self.key(sigma)
            exponents.append((sigma, multiplicity, key))
            shifted = [[entry - (sigma if i == j else 0) for j, entry in enumerate(row)] for i, row in enumerate(matrix)]
            powers = [identity(n), shifted]
            while len(powers) < multiplicity + 1:
                powers.append(product(powers[-1], shifted))
            for vector in null_space(powers[multiplicity], multiplicity):
                chain = []
                factor = acb(1)
                for k in range(multiplicity):
                    chain.append([entry * factor for entry in times(powers[k], vector)])
                    factor = factor / (k + 1)
                columns.append([ExponentialSum(self, {key: trimmed([chain[k][i] for k in range(multiplicity)])}) for i in range(n)])
        self.flows[id(operator)] = (operator, columns, exponents)
        return columns, exponents

    def boundary_matrix(self, operator: Operator, columns: Sequence[Sequence[ExponentialSum]]) -> list[list[acb]]:
        """Return the boundary rows applied to each column."""
        rows = []
        for lines, place in ((operator.left, self.left), (operator.right, self.right)):
            values = [[place(entry) for entry in column] for column in columns] if lines else []
            for line in lines:
                exact = [place(entry) if isinstance(entry, ExponentialSum) else number(entry) for entry in line]
                rows.append([sum((c * v for c, v in zip(exact, value, strict=True)), acb(0)) for value in values])
        return rows

    def determinant(self, operator: Operator) -> acb:
        """Return the determinant of the boundary rows over the fundamental matrix that is 1 at the left end."""
        columns, _ = self.flow(operator)
        start = acb_mat([[self.left(column[i]) for column in columns] for i in range(len(columns))])
        return acb_mat(self.boundary_matrix(operator, columns)).det() / start.det()

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[ExponentialSum, ...]:
        """Return y with homogeneous boundary rows; row y = 1 at `place`, or of unit size."""
        columns, _ = self.flow(operator)
        weights = null_vector(self.boundary_matrix(operator, columns))
        solution = combined(weights, columns)
        if row is None:
            return tuple(solution)
        x = number(place) - self.left_end
        size = sum((number(c) * y.at(x) for c, y in zip(row, solution, strict=True) if not isinstance(c, int) or c), acb(0))
        return scaled_to(solution, size)

    def particular(self, operator: Operator, forcing: Row) -> list[ExponentialSum]:
        """Return a solution of y' = P y + forcing."""
        matrix = self.constant_matrix(operator)
        n = len(matrix)
        _, exponents = self.flow(operator)
        sources = [self.function(entry).terms for entry in forcing]
        result: list[dict[int, list[acb]]] = [{} for _ in range(n)]
        for key in sorted({key for source in sources for key in source}):
            degree = max(len(source.get(key, ())) for source in sources) - 1
            given = [[source[key][k] if key in source and k < len(source[key]) else acb(0) for source in sources] for k in range(degree + 1)]
            mu = self.exponent(key)
            resonance = next((multiplicity for _, multiplicity, known in exponents if known == key), 0)
            shifted = [[(mu if i == j else 0) - entry for j, entry in enumerate(row)] for i, row in enumerate(matrix)]
            if not resonance:
                near = min((abs(sigma - mu) for sigma, _, _ in exponents), default=None)
                if near is not None and near < NEAR * (1 + abs(mu)):
                    raise NotClosed("a forcing exponent nearly coincides with a characteristic one: the closed form is 0/0; use --route chebyshev")
                parts: list[list[acb]] = [[]] * (degree + 1)
                system = acb_mat(shifted)
                for k in range(degree, -1, -1):
                    right = [given[k][i] - ((k + 1) * parts[k + 1][i] if k < degree else 0) for i in range(n)]
                    solved = system.solve(acb_mat([[entry] for entry in right]))
                    parts[k] = [midpoint(solved[i, 0]) for i in range(n)]
            else:
                parts = resonant(shifted, given, resonance)
            for i in range(n):
                result[i][key] = [part[i] for part in parts]
        return [ExponentialSum(self, terms) for terms in result]

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row, corank: int = 0, extra: tuple[Row, Any] | None = None) -> tuple[ExponentialSum, ...]:
        """Return y with y' = P y + forcing and the boundary rows equal to `left` and `right`."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        columns, _ = self.flow(operator)
        particular = self.particular(operator, forcing)
        rows = self.boundary_matrix(operator, columns)
        offsets = [row[0] for row in self.boundary_matrix(operator, [particular])]
        data = [number(value) - offset for value, offset in zip((*left, *right), offsets, strict=True)]
        if extra is not None:
            row, place = extra
            x = number(place) - self.left_end
            rows.append([sum((number(c) * y.at(x) for c, y in zip(row, column, strict=True)), acb(0)) for column in columns])
            data.append(-sum((number(c) * y.at(x) for c, y in zip(row, particular, strict=True)), acb(0)))
        weights = solve_rows(rows, data, corank)
        homogeneous = combined(weights, columns)
        return tuple(a + b for a, b in zip(homogeneous, particular, strict=True))

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[ExponentialSum, ...]:
        """Return the solution with row y = 0 at `place` of a singular problem with a forcing that it can bear."""
        return self.solve(operator, forcing, left, right, 1, (row, place))


def unpacked(key: int) -> list[tuple[int, int]]:
    """Return [(basis index, count)] of a packed exponent."""
    result = []
    index = 0
    while key:
        digit = key % BASE
        if digit >= BASE // 2:
            digit -= BASE
        if digit:
            result.append((index, digit))
        key = (key - digit) // BASE
        index += 1
    return result


def trimmed(coefficients: list[acb]) -> list[acb]:
    """Return the list without trailing zeros."""
    while len(coefficients) > 1 and coefficients[-1] == 0:
        coefficients = coefficients[:-1]
    return coefficients


def identity(n: int) -> list[list[acb]]:
    """Return the unit matrix."""
    return [[acb(1) if i == j else acb(0) for j in range(n)] for i in range(n)]


def product(a: list[list[acb]], b: list[list[acb]]) -> list[list[acb]]:
    """Return the matrix product."""
    return [[sum((a[i][k] * b[k][j] for k in range(len(b))), acb(0)) for j in range(len(b[0]))] for i in range(len(a))]


def times(a: list[list[acb]], v: Sequence[acb]) -> list[acb]:
    """Return a matrix times a vector."""
    return [sum((entry * value for entry, value in zip(row, v, strict=True)), acb(0)) for row in a]


def combined(weights: Sequence[acb], columns: Sequence[Sequence[ExponentialSum]]) -> list[ExponentialSum]:
    """Return the combination of columns."""
    n = len(columns[0])
    result = []
    for i in range(n):
        total = columns[0][i] * weights[0]
        for weight, column in zip(weights[1:], columns[1:], strict=True):
            total = total + column[i] * weight
        result.append(total)
    return result


def null_space(matrix: list[list[acb]], dimension: int) -> list[list[acb]]:
    """Return `dimension` independent null vectors, by elimination with complete pivoting."""
    n = len(matrix)
    if dimension == 1 and n > 1:
        return [null_vector(matrix)]
    rows = [list(row) for row in matrix]
    columns = list(range(n))
    pivots: list[tuple[int, list[acb]]] = []
    for _ in range(n - dimension):
        _, index, k = max(((abs(row[k]), index, k) for index, row in enumerate(rows) for k in columns), key=lambda item: item[0])
        row = rows.pop(index)
        row = [entry / row[k] for entry in row]
        rows = [[a - other[k] * b for a, b in zip(other, row, strict=True)] for other in rows]
        columns.remove(k)
        pivots.append((k, row))
    vectors = []
    for free in columns:
        vector = [acb(0)] * n
        vector[free] = acb(1)
        for k, row in reversed(pivots):
            vector[k] = midpoint(-sum((row[j] * vector[j] for j in range(n) if j != k), acb(0)))
        vectors.append(vector)
    return vectors


def resonant(shifted: list[list[acb]], given: list[list[acb]], multiplicity: int) -> list[list[acb]]:
    """Return polynomial coefficients w_k with shifted w_k + (k + 1) w_{k+1} = given_k, for a singular `shifted`."""
    n, degree = len(shifted), len(given) - 1
    count = degree + multiplicity + 1
    rows, right = [], []
    for k in range(count):
        for i in range(n):
            row = [acb(0)] * (n * count)
            row[k * n:(k + 1) * n] = shifted[i]
            if k + 1 < count:
                row[(k + 1) * n + i] = acb(k + 1)
            rows.append(row)
            right.append(given[k][i] if k <= degree else acb(0))
    tiny = acb(2).real ** (-(flint.ctx.prec // 2))
    matrix = [[*map(midpoint, row), midpoint(value)] for row, value in zip(rows, right, strict=True)]
    columns = list(range(n * count))
    pivots: list[tuple[int, list[acb]]] = []
    scale = max((abs(entry) for row in matrix for entry in row[:-1]), default=acb(1).real)
    while matrix and columns:
        size, index, k = max(((abs(row[k]), index, k) for index, row in enumerate(matrix) for k in columns), key=lambda item: item[0])
        if size < tiny * scale:
            break
        row = matrix.pop(index)
        row = [midpoint(entry / row[k]) for entry in row]
        matrix = [[midpoint(a - other[k] * b) for a, b in zip(other, row, strict=True)] if other[k] != 0 else other for other in matrix]
        columns.remove(k)
        pivots.append((k, row))
    solution = [acb(0)] * (n * count)
    for k, row in reversed(pivots):
        solution[k] = midpoint(row[-1] - sum((row[j] * solution[j] for j in range(n * count) if j != k and row[j] != 0), acb(0)))
    return [solution[k * n:(k + 1) * n] for k in range(count)]


def characteristic_exponents(matrix: list[list[acb]]) -> list[tuple[acb, int]]:
    """Return the eigenvalues of P with multiplicity; only zero may be multiple.

    Raises
    ------
    NotClosed
        Two others coincide or nearly do.
    """
    n = len(matrix)
    coefficients = list(acb_mat(matrix).charpoly())
    coefficients = [midpoint(c) for c in coefficients]
    scale = max(abs(c) for c in coefficients)
    tiny = acb(2).real ** (-(flint.ctx.prec * 3 // 4)) * scale
    zeros = 0
    while zeros < n and abs(coefficients[zeros]) < tiny:
        zeros += 1
    reduced = coefficients[zeros:]
    roots = polished_roots(reduced)
    result = [(root, 1) for root in roots]
    if zeros:
        result.append((acb(0), zeros))
    for j, (a, _) in enumerate(result):
        for b, _ in result[:j]:
            if abs(a - b) < NEAR * (abs(a) + abs(b)):
                raise NotClosed("two characteristic exponents coincide or nearly do: the closed form is 0/0; use --route chebyshev")
    return result


def polished_roots(coefficients: list[acb]) -> list[acb]:
    """Return the simple roots of a polynomial: doubles, then Newton steps that double the digits."""
    degree = len(coefficients) - 1
    if degree == 0:
        return []
    scale = max(float(abs(c / coefficients[-1])) ** (1 / (degree - k)) if c != 0 else 0.0 for k, c in enumerate(coefficients[:-1]))
    if not np.isfinite(scale) or scale == 0:
        raise NotClosed("the characteristic exponents are out of the range of doubles; use --route chebyshev")
    doubles = [complex(c / coefficients[-1] / acb(scale) ** (degree - k)) for k, c in enumerate(coefficients)]
    start = np.roots(doubles[::-1])
    roots = []
    for guess in start:
        z = acb(float(guess.real), float(guess.imag)) * acb(scale)
        for _ in range(60):
            value, slope = coefficients[-1], acb(0)
            for c in reversed(coefficients[:-1]):
                slope = slope * z + value
                value = value * z + c
            if slope.mid() == 0:
                raise NotClosed("two characteristic exponents coincide: the closed form is 0/0; use --route chebyshev")
            step = midpoint(value) / midpoint(slope)
            z = midpoint(z - step)
            if abs(step) < acb(2).real ** (-flint.ctx.prec + 12) * abs(z) or step == 0:
                break
        else:
            raise NotClosed("two characteristic exponents coincide or nearly do (Newton's method stalls): the closed form is 0/0; use --route chebyshev")
        roots.append(z)
    return roots
