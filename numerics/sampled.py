"""Functions as values at nodes on panels, any smooth coefficients, any precision.

A linear problem y' = P y + f is solved for the slopes v = y' at the nodes, y = y_left + J v with J the integration matrix: nothing
is differentiated, so no digits are lost to the number of nodes. Panels are condensed to their ends and joined.

`Chebyshev` has Chebyshev nodes; `Gauss` has Gauss-Legendre nodes, a different polynomial and a different rule of integration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import flint
from flint import acb, acb_mat, arb, arb_mat, fmpq

from numerics.algebra import Algebra, Operator, Row, midpoint, null_vector, number, scaled_to, solve_rows

Nodes = tuple[list[arb], arb_mat, list[arb], list[arb], list[arb]]
"""nodes on (-1, 1), integration matrix from -1, weights, values at -1, values at 1"""


class Samples:
    """A function by its values at all nodes, panel after panel."""

    __slots__ = ("algebra", "values")

    def __init__(self, algebra: Sampled, values: list[acb]) -> None:
        self.algebra = algebra
        self.values = values

    def __add__(self, other: Any) -> Samples:
        if isinstance(other, Samples):
            return Samples(self.algebra, [a + b for a, b in zip(self.values, other.values, strict=True)])
        return Samples(self.algebra, [a + other for a in self.values])

    __radd__ = __add__

    def __neg__(self) -> Samples:
        return Samples(self.algebra, [-a for a in self.values])

    def __sub__(self, other: Any) -> Samples:
        return self + (-other)

    def __rsub__(self, other: Any) -> Samples:
        return -self + other

    def __mul__(self, other: Any) -> Samples:
        if isinstance(other, Samples):
            self.algebra.counts["products"] = self.algebra.counts.get("products", 0) + 1
            return Samples(self.algebra, [a * b for a, b in zip(self.values, other.values, strict=True)])
        return Samples(self.algebra, [a * other for a in self.values])

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Samples:
        if isinstance(other, Samples):
            return Samples(self.algebra, [a / b for a, b in zip(self.values, other.values, strict=True)])
        return Samples(self.algebra, [a / other for a in self.values])

    def __rtruediv__(self, other: Any) -> Samples:
        return Samples(self.algebra, [other / a for a in self.values])

    def __pow__(self, power: int) -> Samples:
        return Samples(self.algebra, [a**power for a in self.values])

    def apply(self, name: str) -> Samples:
        """Return an elementary function of this one."""
        return Samples(self.algebra, [getattr(a, name)() for a in self.values])

    def largest(self) -> float:
        """Return the largest modulus at the nodes."""
        return max(float(abs(a.mid())) for a in self.values)


_NODES: dict[tuple[str, int, int], Nodes] = {}


def chebyshev_nodes(count: int) -> Nodes:
    """Return Chebyshev nodes of the first kind and the exact integration of the interpolating polynomial."""
    angles = [arb.pi() * fmpq(2 * j + 1, 2 * count) for j in range(count)]
    nodes = [(-angle.cos()).mid() for angle in angles]
    # T_k at the nodes (x_j = -cos angle_j, T_k(x_j) = (-1)^k cos(k angle_j)) and the primitives of T_k.
    table = [[(angles[j] * k).cos().mid() * (-1) ** k for k in range(count + 1)] for j in range(count)]

    def primitive(values: Sequence[Any], k: int) -> Any:
        if k == 0:
            return values[1]
        if k == 1:
            return values[2] / 4 if len(values) > 2 else (values[1] * values[1] * 2 - 1) / 4
        return values[k + 1] / (2 * (k + 1)) - values[k - 1] / (2 * (k - 1))

    start = [arb((-1) ** k) for k in range(count + 1)]
    finish = [arb(1) for _ in range(count + 1)]
    base = [primitive(start, k) for k in range(count)]
    to_coefficients = arb_mat([[table[j][k] * (1 if k == 0 else 2) / count for j in range(count)] for k in range(count)])
    integrate = arb_mat([[primitive(table[j], k) - base[k] for k in range(count)] for j in range(count)]) * to_coefficients
    weights = arb_mat([[primitive(finish, k) - base[k] for k in range(count)]]) * to_coefficients
    left = arb_mat([start[:count]]) * to_coefficients
    right = arb_mat([finish[:count]]) * to_coefficients
    return nodes, centred(integrate), row_of(weights), row_of(left), row_of(right)


def gauss_nodes(count: int) -> Nodes:
    """Return Gauss-Legendre nodes and the integration of the interpolating polynomial by Legendre's recurrences."""
    nodes = [arb.legendre_p_root(count, count - 1 - j).mid() for j in range(count)] if hasattr(arb, "legendre_p_root") else legendre_roots(count)
    table = [legendre_values(x, count + 1) for x in nodes]
    # int_{-1}^x P_k = (P_{k+1}(x) - P_{k-1}(x)) / (2k + 1)
    slopes = [(count * (x * p[count] - p[count - 1]) / (x * x - 1)).mid() for x, p in zip(nodes, table, strict=True)]
    weights = [(2 / ((1 - x * x) * d * d)).mid() for x, d in zip(nodes, slopes, strict=True)]
    to_coefficients = arb_mat([[weights[j] * table[j][k] * (2 * k + 1) / 2 for j in range(count)] for k in range(count)])
    integrate = arb_mat([[x + 1 if k == 0 else (p[k + 1] - p[k - 1]) / (2 * k + 1) for k in range(count)] for x, p in zip(nodes, table, strict=True)]) * to_coefficients
    left = arb_mat([[arb((-1) ** k) for k in range(count)]]) * to_coefficients
    right = arb_mat([[arb(1) for _ in range(count)]]) * to_coefficients
    return nodes, centred(integrate), weights, row_of(left), row_of(right)


def legendre_values(x: arb, count: int) -> list[arb]:
    """Return P_0(x), ..., P_count(x) by the three-term recurrence."""
    values = [arb(1), x]
    for k in range(1, count):
        values.append((((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1)).mid())
    return values


def legendre_roots(count: int) -> list[arb]:
    """Return the zeros of the Legendre polynomial, by Newton's method from doubles."""
    import numpy as np

    roots = []
    for guess in np.polynomial.legendre.leggauss(count)[0]:
        x = arb(float(guess))
        for _ in range(60):
            values = legendre_values(x, count)
            step = (values[count] * (x * x - 1) / (count * (x * values[count] - values[count - 1]))).mid()
            x = (x - step).mid()
            if abs(step) < arb(2) ** (-flint.ctx.prec // 2 - 8):
                break
        roots.append(x)
    return roots


def centred(matrix: arb_mat) -> arb_mat:
    """Return the matrix of midpoints."""
    return matrix.mid()


def row_of(matrix: arb_mat) -> list[arb]:
    """Return the first row, midpoints."""
    return [matrix[0, j].mid() for j in range(matrix.ncols())]


class Sampled(Algebra):
    """Functions at `nodes` nodes on each of the panels between `breaks` (shares of the interval)."""

    rule: ClassVar[str] = ""

    def __init__(self, *, ends: tuple[acb, acb], nodes: int, panels: int, **common: Any) -> None:
        super().__init__(**common)
        self.left_end, self.right_end = (end.real for end in ends)
        self.length = self.right_end - self.left_end
        self.nodes, self.panels = nodes, panels
        key = (self.rule, nodes, flint.ctx.prec)
        if key not in _NODES:
            if len(_NODES) > 24:
                _NODES.clear()
            _NODES[key] = chebyshev_nodes(nodes) if self.rule == "chebyshev" else gauss_nodes(nodes)
        self.points, self.integrate, self.weights, self.at_left, self.at_right = _NODES[key]
        self.half = self.length / (2 * panels)
        self.s = Samples(self, [acb(self.left_end + self.half * (2 * k + 1 + x)) for k in range(panels) for x in self.points])
        self.flows: dict[int, Any] = {}

    def function(self, value: Any) -> Samples:
        """Return a number as a constant function."""
        return value if isinstance(value, Samples) else Samples(self, [number(value)] * (self.nodes * self.panels))

    def reflect(self, value: Any) -> Any:
        """Return the conjugate."""
        return Samples(self, [a.conjugate() for a in value.values]) if isinstance(value, Samples) else number(value).conjugate()

    def panel(self, values: Sequence[acb], k: int) -> list[acb]:
        """Return the values on panel k."""
        return list(values[k * self.nodes:(k + 1) * self.nodes])

    def integral(self, value: Any) -> acb:
        """Return the integral over the interval."""
        self.counts["integrals"] = self.counts.get("integrals", 0) + 1
        values = self.function(value).values
        return sum((sum((w * v for w, v in zip(self.weights, self.panel(values, k), strict=True)), acb(0)) for k in range(self.panels)), acb(0)) * self.half

    def integral_from_left(self, value: Any) -> Samples:
        """Return the integral from the left end to s."""
        values = self.function(value).values
        columns = acb_mat(self.integrate) * acb_mat([[values[k * self.nodes + j] for k in range(self.panels)] for j in range(self.nodes)])
        result: list[acb] = []
        before = acb(0)
        for k in range(self.panels):
            result.extend((before + columns[j, k] * self.half) for j in range(self.nodes))
            before += sum((w * v for w, v in zip(self.weights, self.panel(values, k), strict=True)), acb(0)) * self.half
        return Samples(self, [midpoint(v) for v in result])

    def integral_to_right(self, value: Any) -> Samples:
        """Return the integral from s to the right end."""
        return self.integral(value) - self.integral_from_left(value)

    def left(self, value: Any) -> acb:
        """Return the value at the left end."""
        return sum((w * v for w, v in zip(self.at_left, self.panel(self.function(value).values, 0), strict=True)), acb(0))

    def right(self, value: Any) -> acb:
        """Return the value at the right end."""
        return sum((w * v for w, v in zip(self.at_right, self.panel(self.function(value).values, self.panels - 1), strict=True)), acb(0))

    # Linear problems

    def panel_operator(self, operator: Operator) -> list[tuple[list[list[list[acb]]], bool]]:
        """Return, for each panel, P at the nodes [i][j][node], and whether it is that of the first panel again."""
        constant = not any(isinstance(entry, Samples) for row in operator.matrix for entry in row)
        tables = []
        for k in range(self.panels):
            tables.append(([[self.panel(self.function(entry).values, k) for entry in row] for row in operator.matrix], constant and k > 0))
        return tables

    def condense(self, operator: Operator, forcing: Row | None) -> list[acb_mat]:
        """Return for each panel the slopes, shape (n m, n or n + 1), for unit states at its left end and for the forcing."""
        n, m = operator.size, self.nodes
        integrate = [[self.integrate[a, b] * self.half for b in range(m)] for a in range(m)]
        sources = [self.function(entry).values for entry in forcing] if forcing is not None else []
        tables = self.panel_operator(operator)
        groups: list[list[int]] = []  # panels with the same P share one factorisation
        for k, (_, repeated) in enumerate(tables):
            if repeated:
                groups[-1].append(k)
            else:
                groups.append([k])
        slopes: list[acb_mat] = [acb_mat(0, 0)] * self.panels
        for group in groups:
            table = tables[group[0]][0]
            rows = []
            for i in range(n):
                for a in range(m):
                    row: list[Any] = []
                    for j in range(n):
                        p = table[i][j][a]
                        row.extend([0] * m if p == 0 else [-p * w for w in integrate[a]])
                    row[i * m + a] = row[i * m + a] + 1
                    rows.append(row)
            right = [[*(table[i][j][a] for j in range(n)), *(source[k * m + a] for k in group for source in sources[i:i + 1])] for i in range(n) for a in range(m)]
            solved = acb_mat(rows).mid().solve(acb_mat(right), algorithm="approx").mid()
            if forcing is None:
                for k in group:
                    slopes[k] = solved
                continue
            entries = matrix_rows(solved)
            for place, k in enumerate(group):
                slopes[k] = acb_mat([[*line[:n], line[n + place]] for line in entries])
        return slopes

    def joined(self, operator: Operator, slopes: Sequence[acb_mat], forced: bool) -> tuple[list[acb_mat], list[list[acb]]]:
        """Return the transfer matrix and the offset of each panel."""
        n, m = operator.size, self.nodes
        weights = [w * self.half for w in self.weights]
        transfers, offsets = [], []
        seen: dict[int, tuple[acb_mat, list[acb]]] = {}
        for slope in slopes:
            if id(slope) not in seen:
                gains = [[sum((weights[a] * slope[i * m + a, c] for a in range(m)), acb(0)) for c in range(slope.ncols())] for i in range(n)]
                transfer = acb_mat([[midpoint(gains[i][c] + (1 if i == c else 0)) for c in range(n)] for i in range(n)])
                seen[id(slope)] = (transfer, [midpoint(gains[i][n]) if forced else acb(0) for i in range(n)])
            transfers.append(seen[id(slope)][0])
            offsets.append(seen[id(slope)][1])
        return transfers, offsets

    def flow(self, operator: Operator) -> tuple[list[acb_mat], list[acb_mat]]:
        """Return slopes and transfers without forcing."""
        key = id(operator)
        if key not in self.flows:
            slopes = self.condense(operator, None)
            self.flows[key] = (operator, slopes, self.joined(operator, slopes, False)[0])
        return self.flows[key][1], self.flows[key][2]

    def end_rows(self, operator: Operator) -> tuple[list[list[acb]], list[list[acb]]]:
        """Return the boundary rows as numbers."""
        left = [[self.left(entry) if isinstance(entry, Samples) else number(entry) for entry in row] for row in operator.left]
        right = [[self.right(entry) if isinstance(entry, Samples) else number(entry) for entry in row] for row in operator.right]
        return left, right

    def determinant(self, operator: Operator) -> acb:
        """Return the determinant of the boundary rows over the fundamental matrix that is 1 at the left end."""
        _, transfers = self.flow(operator)
        total = transfers[0]
        for transfer in transfers[1:]:
            total = (transfer * total).mid()
        left, right = self.end_rows(operator)
        rows = left + (matrix_rows(acb_mat(right) * total) if right else [])
        return midpoint(acb_mat(rows).det())

    def global_rows(self, operator: Operator, transfers: Sequence[acb_mat]) -> list[list[acb]]:
        """Return the rows for the states at all breaks: boundary rows and y_{k+1} = Phi_k y_k."""
        n, total = operator.size, operator.size * (self.panels + 1)
        left, right = self.end_rows(operator)
        rows = [[*row, *[acb(0)] * (total - n)] for row in left] + [[*[acb(0)] * (total - n), *row] for row in right]
        for k, transfer in enumerate(transfers):
            for i in range(n):
                row = [acb(0)] * total
                for j in range(n):
                    row[k * n + j] = -transfer[i, j]
                row[(k + 1) * n + i] = acb(1)
                rows.append(row)
        return rows

    def assembled(self, operator: Operator, slopes: Sequence[acb_mat], states: Sequence[acb], forced: bool) -> list[Samples]:
        """Return the functions from the states at the left ends of the panels."""
        n, m = operator.size, self.nodes
        integrate = acb_mat(self.integrate)
        values: list[list[acb]] = [[] for _ in range(n)]
        for k in range(self.panels):
            start = [states[k * n + i] for i in range(n)] + ([acb(1)] if forced else [])
            slope = slopes[k] * acb_mat([[entry] for entry in start])
            columns = integrate * acb_mat([[slope[i * m + a, 0] for i in range(n)] for a in range(m)])
            for i in range(n):
                values[i].extend(midpoint(start[i] + columns[a, i] * self.half) for a in range(m))
        return [Samples(self, one) for one in values]

    def row_at(self, row: Row, functions: Sequence[Samples], place: Any) -> acb:
        """Return row y at a place, by barycentric interpolation on its panel."""
        position = (number(place).real - self.left_end) / (2 * self.half)
        k = min(max(int(float(position.mid())), 0), self.panels - 1)
        x = (2 * (position - k) - 1).mid()
        values = [sum((number(c) * y for c, y in zip(row, line, strict=True) if not isinstance(c, int) or c), acb(0))
                  for line in zip(*(self.panel(f.values, k) for f in functions), strict=True)]
        for node, value in zip(self.points, values, strict=True):
            if (x - node).mid() == 0:
                return value
        top, bottom = acb(0), acb(0)
        for w, node, value in zip(barycentric(self.rule, self.points, self.weights), self.points, values, strict=True):
            share = w / (x - node)
            top, bottom = top + share * value, bottom + share
        return midpoint(top / bottom)

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Samples, ...]:
        """Return y with homogeneous boundary rows; row y = 1 at `place`, or of unit size."""
        slopes, transfers = self.flow(operator)
        states = null_vector(self.global_rows(operator, transfers))
        functions = self.assembled(operator, slopes, states, False)
        if row is None:
            return tuple(functions)
        return scaled_to(functions, self.row_at(row, functions, place))

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row, corank: int = 0, extra: tuple[Row, Any] | None = None) -> tuple[Samples, ...]:
        """Return y with y' = P y + forcing and the boundary rows equal to `left` and `right`."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        slopes = self.condense(operator, forcing)
        transfers, offsets = self.joined(operator, slopes, True)
        rows = self.global_rows(operator, transfers)
        data = [*map(number, left), *map(number, right), *(entry for offset in offsets for entry in offset)]
        if corank:
            free, transfers_free = self.flow(operator)
            kernel = null_vector(self.global_rows(operator, transfers_free))
            norm = [entry.conjugate() for entry in kernel]
            states = solve_rows([*rows, norm], [*data, acb(0)], corank)
            functions = self.assembled(operator, slopes, states, True)
            assert extra is not None
            homogeneous = self.assembled(operator, free, kernel, False)
            share = self.row_at(extra[0], functions, extra[1]) / self.row_at(extra[0], homogeneous, extra[1])
            return tuple(f - h * share for f, h in zip(functions, homogeneous, strict=True))
        return tuple(self.assembled(operator, slopes, solve_rows(rows, data, 0), True))

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[Samples, ...]:
        """Return the solution with row y = 0 at `place` of a singular problem with a forcing that it can bear."""
        return self.solve(operator, forcing, left, right, 1, (row, place))


def matrix_rows(matrix: acb_mat) -> list[list[acb]]:
    """Return a matrix as rows."""
    return [[matrix[i, j] for j in range(matrix.ncols())] for i in range(matrix.nrows())]


def barycentric(rule: str, nodes: Sequence[arb], weights: Sequence[arb]) -> list[arb]:
    """Return barycentric weights: (-1)^j sqrt(1 - x^2), times the square root of the Gauss weight for Legendre nodes."""
    if rule == "chebyshev":
        return [(1 - x * x).sqrt() * (-1) ** j for j, x in enumerate(nodes)]
    return [((1 - x * x) * w).sqrt() * (-1) ** j for j, (x, w) in enumerate(zip(nodes, weights, strict=True))]


class Chebyshev(Sampled):
    """The algebra on Chebyshev nodes."""

    name = "chebyshev"
    rule = "chebyshev"


class Gauss(Sampled):
    """The algebra on Gauss-Legendre nodes: quadrature in the strict sense."""

    name = "quadrature"
    rule = "gauss"


__all__ = ["Chebyshev", "Gauss", "Samples"]
