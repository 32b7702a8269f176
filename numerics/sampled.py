"""Functions as values at nodes on panels, any smooth coefficients, any precision.

On a panel a linear problem y' = P y + f becomes a recurrence for the powers of y, from the powers of the polynomials through the
values of P and f: O(N) products a solution where P is a polynomial, and nothing is differentiated. Going from values to powers costs
1.3 bits a node, which the working precision carries. Panels are joined by elimination from left to right with pivots on both sides,
which holds growing and decaying solutions apart. A panel on which a function does not fall below the goal is reported in `unresolved`.

`Chebyshev` has Chebyshev nodes; `Gauss` has Gauss-Legendre nodes, a different polynomial and a different rule of integration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import flint
from flint import acb, acb_mat, acb_poly, arb, arb_mat, fmpq

from numerics.algebra import Algebra, Operator, Row, midpoint, null_vector, number, scaled_to, solve_rows
from numerics.precision import EvaluationError

Powers = list[list[acb]]  # [column][power of x]


@dataclass(frozen=True, slots=True)
class Nodes:
    """Nodes on (-1, 1) and what follows from the polynomial through them."""

    points: list[arb]
    integrate: arb_mat  # values -> integrals from -1 to the nodes
    weights: list[arb]
    at_left: list[arb]
    at_right: list[arb]
    to_coefficients: arb_mat  # values -> coefficients of the orthogonal polynomials
    to_powers: acb_mat
    from_powers: acb_mat  # powers 0 ... count -> values


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
SHORT = 12


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
    # T_{k+1} = 2 x T_k - T_{k-1}
    monomials = [[1], [0, 1]]
    while len(monomials) < count:
        before, last = monomials[-2:]
        monomials.append([2 * a - b for a, b in zip([0, *last], [*before, 0, 0], strict=True)])
    return nodes_of(nodes, integrate, row_of(weights), left, right, to_coefficients, monomials[:count])


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
    # (k + 1) P_{k+1} = (2 k + 1) x P_k - k P_{k-1}
    monomials: list[list[Any]] = [[fmpq(1)], [fmpq(0), fmpq(1)]]
    for k in range(1, count - 1):
        before, last = monomials[-2:]
        monomials.append([((2 * k + 1) * a - k * b) / (k + 1) for a, b in zip([0, *last], [*before, 0, 0], strict=True)])
    return nodes_of(nodes, integrate, weights, left, right, to_coefficients, monomials[:count])


def nodes_of(points: list[arb], integrate: arb_mat, weights: list[arb], left: arb_mat, right: arb_mat, to_coefficients: arb_mat, monomials: list[list[Any]]) -> Nodes:
    """Return the tables of a rule; `monomials` are the powers of its orthogonal polynomials."""
    count = len(points)
    powers = arb_mat([[arb(monomials[k][j]) if j < len(monomials[k]) else arb(0) for k in range(count)] for j in range(count)])
    values = []
    for x in points:
        row = [arb(1)]
        for _ in range(count):
            row.append((row[-1] * x).mid())
        values.append(row)
    return Nodes(points, centred(integrate), weights, row_of(left), row_of(right), centred(to_coefficients), acb_mat(centred(powers * to_coefficients)), acb_mat(arb_mat(values)))


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


def recurrence(table: Sequence[Sequence[list[acb]]], start: Sequence[acb], forcing: Sequence[list[acb]] | None, count: int) -> Powers:
    """Return the powers 0 ... count of y with y' = P y + f and y(0) = start: (k + 1) y_{k+1} = sum_l P_l y_{k-l} + f_k.

    Products of a known and a growing series are taken in blocks (a semi-relaxed product), so that long ones run in FLINT.
    """
    n = len(start)
    right = [[forcing[i][k] if forcing is not None and k < len(forcing[i]) else acb(0) for k in range(count)] for i in range(n)]
    y: Powers = [[value] for value in start]
    entries = [(i, j, table[i][j]) for i in range(n) for j in range(n) if table[i][j]]

    def fill(low: int, high: int) -> None:
        if high - low <= SHORT:
            for k in range(low, high):
                if k:
                    for i in range(n):
                        y[i].append((right[i][k - 1] / k).mid())
                for i, j, p in entries:
                    factor = y[j][k]
                    if factor != 0:
                        line = right[i]
                        for offset in range(min(len(p), high - 1 - k)):
                            line[k + offset] += p[offset] * factor
            return
        middle = (low + high) // 2
        fill(low, middle)
        known = [acb_poly(y[j][low:middle]) for j in range(n)]
        for i, j, p in entries:  # rows middle - 1 ... high - 2 from the powers low ... middle - 1
            line, share = right[i], list(known[j] * acb_poly(p[:high - 1 - low]))
            for k in range(middle - 1, min(high - 1, low + len(share))):
                line[k] += share[k - low]
        fill(middle, high)

    fill(0, count + 1)
    return y


def alternating(powers: Sequence[acb]) -> tuple[acb, acb]:
    """Return the values at -1 and 1."""
    even = sum(powers[0::2], acb(0))
    odd = sum(powers[1::2], acb(0))
    return (even - odd).mid(), (even + odd).mid()


@dataclass(frozen=True, slots=True)
class Panel:
    """The solutions on one panel that are the unit vectors at its centre: powers [column][state], values at both ends."""

    table: list[list[list[acb]]]
    columns: list[Powers]
    left: list[list[acb]]
    right: list[list[acb]]


class Elimination:
    """Left boundary rows, continuity between panels, right boundary rows; unknowns are the states at the centres of the panels."""

    def __init__(self, panels: Sequence[Panel], left: list[list[acb]], right: list[list[acb]], offsets: Sequence[tuple[list[acb], list[acb]]] | None, data: Sequence[acb]) -> None:
        n = len(panels[0].left)
        zero = [acb(0)] * n
        lows = [offset[0] for offset in offsets] if offsets else [zero] * len(panels)
        highs = [offset[1] for offset in offsets] if offsets else [zero] * len(panels)
        self.size, self.steps, self.scale = n, [], acb(1)
        count = len(left)
        active = [[*applied(row, panels[0].left), d - dot(row, lows[0])] for row, d in zip(left, data[:count], strict=True)]
        for k in range(len(panels) - 1):
            rows = [[*row[:n], *zero, row[n]] for row in active]
            rows += [[*panels[k].right[i], *(-entry for entry in panels[k + 1].left[i]), lows[k + 1][i] - highs[k][i]] for i in range(n)]
            pivots, active = self.eliminate(rows)
            self.steps.append(pivots)
        self.last = active + [[*applied(row, panels[-1].right), d - dot(row, highs[-1])] for row, d in zip(right, data[count:], strict=True)]

    def eliminate(self, rows: list[list[acb]]) -> tuple[list[tuple[int, list[acb]]], list[list[acb]]]:
        """Return the pivots for the first n unknowns, and the rows that are left over in the other ones."""
        n = self.size
        columns, pivots = list(range(n)), []
        for _ in range(n):
            size, index, place = max(((abs(row[c]), r, q) for r, row in enumerate(rows) for q, c in enumerate(columns)), key=lambda item: item[0])
            if not size > 0:
                raise EvaluationError("response: found a singular linear problem; expected independent boundary rows")
            k, row = columns.pop(place), rows.pop(index)
            self.scale = (self.scale * (row[k] if (index + place) % 2 == 0 else -row[k])).mid()
            row = [(entry / row[k]).mid() if entry != 0 else entry for entry in row]
            rows = [[(a - other[k] * b).mid() if b != 0 else a for a, b in zip(other, row, strict=True)] if other[k] != 0 else other for other in rows]
            pivots.append((k, row))
        return pivots, [row[n:] for row in rows]

    def determinant(self) -> acb:
        """Return the determinant of the whole system."""
        return midpoint(acb_mat([row[:-1] for row in self.last]).det() * self.scale)

    def states(self, last: list[acb], forced: bool) -> list[list[acb]]:
        """Return the states of all panels from those of the last one."""
        n, found = self.size, [last]
        for pivots in reversed(self.steps):
            state = [acb(0)] * n
            for k, row in reversed(pivots):
                value = (row[-1] if forced else acb(0)) - dot(row[n:2 * n], found[-1])
                state[k] = (value - sum((row[j] * state[j] for j in range(n) if j != k and row[j] != 0), acb(0))).mid()
            found.append(state)
        return found[::-1]


def dot(row: Sequence[Any], vector: Sequence[Any]) -> acb:
    """Return the product without conjugation."""
    return sum((a * b for a, b in zip(row, vector, strict=True) if a != 0), acb(0))


def applied(row: Sequence[acb], matrix: Sequence[Sequence[acb]]) -> list[acb]:
    """Return row times matrix."""
    return [midpoint(dot(row, column)) for column in zip(*matrix, strict=True)]


class Sampled(Algebra):
    """Functions at `nodes` nodes on each of the panels between `breaks` (shares of the interval, from 0 to 1)."""

    rule: ClassVar[str] = ""

    def __init__(self, *, ends: tuple[acb, acb], nodes: int, breaks: tuple[Fraction, ...], goal: int, **common: Any) -> None:
        super().__init__(**common)
        self.left_end, self.right_end = (end.real for end in ends)
        self.length = self.right_end - self.left_end
        self.nodes, self.breaks, self.panels = nodes, breaks, len(breaks) - 1
        self.tolerance = arb(2) ** -goal
        self.unresolved: set[int] = set()
        self.reference = arb(0)
        key = (self.rule, nodes, flint.ctx.prec)
        if key not in _NODES:
            if len(_NODES) > 24:
                _NODES.clear()
            _NODES[key] = chebyshev_nodes(nodes) if self.rule == "chebyshev" else gauss_nodes(nodes)
        self.rules = _NODES[key]
        self.weights = self.rules.weights
        self.last_coefficients = acb_mat(arb_mat([[self.rules.to_coefficients[i, j] for j in range(nodes)] for i in range(nodes - 3, nodes)]))
        self.halves = [self.length * fraction(b - a) / 2 for a, b in zip(breaks, breaks[1:], strict=False)]
        centres = [self.left_end + self.length * fraction(a + b) / 2 for a, b in zip(breaks, breaks[1:], strict=False)]
        self.s = Samples(self, [acb((centre + half * x).mid()) for centre, half in zip(centres, self.halves, strict=True) for x in self.rules.points])
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

    def columns_of(self, functions: Sequence[Samples]) -> acb_mat:
        """Return the values as columns, function after function and panel after panel, and mark panels that do not resolve them."""
        m = self.nodes
        columns = acb_mat([[f.values[k * m + j].mid() for f in functions for k in range(self.panels)] for j in range(m)])
        tails = self.last_coefficients * columns
        for place, f in enumerate(functions):
            sizes = [max(abs(a) for a in self.panel(f.values, k)) for k in range(self.panels)]
            # what rounding leaves of a function that vanishes is never smooth: it is measured against the largest function so far
            self.reference = max(self.reference, *sizes)
            bound = self.tolerance * max(max(sizes), self.reference * arb(2) ** -24)
            for k in range(self.panels):
                if any(abs(tails[i, place * self.panels + k]) > bound for i in range(3)):
                    self.unresolved.add(k)
        return columns

    def integral(self, value: Any) -> acb:
        """Return the integral over the interval."""
        self.counts["integrals"] = self.counts.get("integrals", 0) + 1
        if not isinstance(value, Samples):
            return number(value) * self.length
        sums = acb_mat(arb_mat([self.weights])) * self.columns_of([value])
        return sum((sums[0, k] * half for k, half in enumerate(self.halves)), acb(0)).mid()

    def integral_from_left(self, value: Any) -> Samples:
        """Return the integral from the left end to s."""
        given = self.columns_of([self.function(value)])
        columns, sums = acb_mat(self.rules.integrate) * given, acb_mat(arb_mat([self.weights])) * given
        result: list[acb] = []
        before = acb(0)
        for k, half in enumerate(self.halves):
            result.extend((before + columns[j, k] * half).mid() for j in range(self.nodes))
            before = (before + sums[0, k] * half).mid()
        return Samples(self, result)

    def integral_to_right(self, value: Any) -> Samples:
        """Return the integral from s to the right end."""
        return self.integral(value) - self.integral_from_left(value)

    def left(self, value: Any) -> acb:
        """Return the value at the left end."""
        return dot(self.rules.at_left, self.panel(self.function(value).values, 0)).mid()

    def right(self, value: Any) -> acb:
        """Return the value at the right end."""
        return dot(self.rules.at_right, self.panel(self.function(value).values, self.panels - 1)).mid()

    # Linear problems

    def powers_of(self, functions: Sequence[Samples]) -> list[list[list[acb]]]:
        """Return for each function and panel the powers of the interpolating polynomial, times the half-width; what is negligible is dropped."""
        if not functions:
            return []
        table = self.rules.to_powers * self.columns_of(functions)
        largest = [max(f.values, key=abs) for f in functions]
        result = []
        for place, size in enumerate(largest):
            bound = abs(size) * self.tolerance * arb(2) ** -24
            lines = []
            for k, half in enumerate(self.halves):
                powers = [table[j, place * self.panels + k].mid() for j in range(self.nodes)]
                while powers and abs(powers[-1]) <= bound:
                    powers.pop()
                lines.append([(power * half).mid() for power in powers])
            result.append(lines)
        return result

    def flow(self, operator: Operator) -> list[Panel]:
        """Return the solutions without forcing, panel by panel."""
        known = self.flows.get(id(operator))
        if known is not None:
            return known[1]  # type: ignore[no-any-return]
        n = operator.size
        variable = [(i, j) for i in range(n) for j in range(n) if isinstance(operator.matrix[i][j], Samples)]
        powers = dict(zip(variable, self.powers_of([operator.matrix[i][j] for i, j in variable]), strict=True))
        panels: list[Panel] = []
        alike: dict[Fraction, int] = {}  # without variable coefficients: the first panel of a width
        for k, half in enumerate(self.halves):
            width = self.breaks[k + 1] - self.breaks[k]
            if not variable and width in alike:
                panels.append(panels[alike[width]])
                if alike[width] in self.unresolved:
                    self.unresolved.add(k)
                continue
            table = [[powers[i, j][k] if (i, j) in powers else [(number(operator.matrix[i][j]) * half).mid()] if operator.matrix[i][j] != 0 else [] for j in range(n)] for i in range(n)]
            columns, ends = [], []
            for c in range(n):
                column = recurrence(table, [acb(1 if i == c else 0) for i in range(n)], None, self.nodes)
                self.check_tail(column, k)
                columns.append(column)
                ends.append([alternating(one) for one in column])
            panel = Panel(table, columns, [[ends[c][i][0] for c in range(n)] for i in range(n)], [[ends[c][i][1] for c in range(n)] for i in range(n)])
            alike[width] = k
            panels.append(panel)
        self.flows[id(operator)] = (operator, panels)
        return panels

    def check_tail(self, column: Powers, k: int) -> None:
        """Mark a panel on which the powers do not fall below the goal."""
        size = max(abs(one) for powers in column for one in powers)
        if any(abs(one) > size * self.tolerance for powers in column for one in powers[-3:]):
            self.unresolved.add(k)

    def end_rows(self, operator: Operator) -> tuple[list[list[acb]], list[list[acb]]]:
        """Return the boundary rows as numbers."""
        left = [[self.left(entry) if isinstance(entry, Samples) else number(entry) for entry in row] for row in operator.left]
        right = [[self.right(entry) if isinstance(entry, Samples) else number(entry) for entry in row] for row in operator.right]
        return left, right

    def joined(self, operator: Operator, offsets: Sequence[tuple[list[acb], list[acb]]] | None = None, data: Sequence[acb] | None = None) -> Elimination:
        """Return the eliminated system of all panels."""
        left, right = self.end_rows(operator)
        return Elimination(self.flow(operator), left, right, offsets, data if data is not None else [acb(0)] * operator.size)

    def determinant(self, operator: Operator) -> acb:
        """Return the determinant of boundary rows and continuity between panels."""
        return self.joined(operator).determinant()

    def assembled(self, panels: Sequence[Panel], states: Sequence[Sequence[acb]], particular: Sequence[Powers] | None) -> list[Samples]:
        """Return the functions from the states at the centres of the panels."""
        n, m = len(states[0]), self.nodes
        lines = []  # one for each state and panel
        for i in range(n):
            for k, (panel, state) in enumerate(zip(panels, states, strict=True)):
                total = [particular[k][i]] if particular else []
                lines.append(combination([column[i] for column in panel.columns], state, total, m + 1))
        values = self.rules.from_powers * acb_mat([list(one) for one in zip(*lines, strict=True)])
        count = len(panels)
        return [Samples(self, [values[a, i * count + k].mid() for k in range(count) for a in range(m)]) for i in range(n)]

    def row_at(self, row: Row, functions: Sequence[Samples], place: Any) -> acb:
        """Return row y at a place, by barycentric interpolation on its panel."""
        share = (number(place).real - self.left_end) / self.length
        k = max((k for k in range(self.panels) if fraction(self.breaks[k]).mid() <= share.mid()), default=0)
        low, high = fraction(self.breaks[k]), fraction(self.breaks[k + 1])
        x = ((2 * share - low - high) / (high - low)).mid()
        values = [sum((number(c) * y for c, y in zip(row, line, strict=True) if not isinstance(c, int) or c), acb(0))
                  for line in zip(*(self.panel(f.values, k) for f in functions), strict=True)]
        for node, value in zip(self.rules.points, values, strict=True):
            if (x - node).mid() == 0:
                return value
        top, bottom = acb(0), acb(0)
        for w, node, value in zip(barycentric(self.rule, self.rules.points, self.weights), self.rules.points, values, strict=True):
            part = w / (x - node)
            top, bottom = top + part * value, bottom + part
        return midpoint(top / bottom)

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Samples, ...]:
        """Return y with homogeneous boundary rows; row y = 1 at `place`, or of unit size."""
        functions = self.assembled(self.flow(operator), self.free_states(operator), None)
        if row is None:
            return tuple(functions)
        return scaled_to(functions, self.row_at(row, functions, place))

    def free_states(self, operator: Operator) -> list[list[acb]]:
        """Return the states of the kernel."""
        system = self.joined(operator)
        return system.states(null_vector([row[:-1] for row in system.last]), False)

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row, corank: int = 0, extra: tuple[Row, Any] | None = None) -> tuple[Samples, ...]:
        """Return y with y' = P y + forcing and the boundary rows equal to `left` and `right`."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        n, panels = operator.size, self.flow(operator)
        given = [(i, self.function(entry)) for i, entry in enumerate(forcing) if isinstance(entry, Samples) or number(entry) != 0]
        powers = dict(zip([i for i, _ in given], self.powers_of([f for _, f in given]), strict=True))
        particular = []
        for k, panel in enumerate(panels):
            column = recurrence(panel.table, [acb(0)] * n, [powers[i][k] if i in powers else [] for i in range(n)], self.nodes)
            particular.append(column)
        size = max(self.reference * arb(2) ** -24, *(abs(one) for column in particular for powers_ in column for one in powers_))
        for k, column in enumerate(particular):
            if any(abs(one) > size * self.tolerance for powers_ in column for one in powers_[-3:]):
                self.unresolved.add(k)
        ends = [[alternating(one) for one in column] for column in particular]
        offsets = [([low for low, _ in end], [high for _, high in end]) for end in ends]
        system = self.joined(operator, offsets, [*map(number, left), *map(number, right)])
        rows, data = [row[:-1] for row in system.last], [row[-1] for row in system.last]
        if not corank:
            return tuple(self.assembled(panels, system.states(solve_rows(rows, data, 0), True), particular))
        kernel = null_vector(rows)
        last = solve_rows([*rows, [entry.conjugate() for entry in kernel]], [*data, acb(0)], corank)
        functions = self.assembled(panels, system.states(last, True), particular)
        assert extra is not None
        homogeneous = self.assembled(panels, system.states(kernel, False), None)
        share = self.row_at(extra[0], functions, extra[1]) / self.row_at(extra[0], homogeneous, extra[1])
        return tuple(f - h * share for f, h in zip(functions, homogeneous, strict=True))

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[Samples, ...]:
        """Return the solution with row y = 0 at `place` of a singular problem with a forcing that it can bear."""
        return self.solve(operator, forcing, left, right, 1, (row, place))


def fraction(value: Fraction) -> arb:
    """Return a fraction as a number."""
    return arb(fmpq(value.numerator, value.denominator))


def combination(columns: Sequence[list[acb]], weights: Sequence[acb], total: list[list[acb]], count: int) -> list[acb]:
    """Return sum_c weights_c columns_c (+ total), padded to `count` powers."""
    result = acb_poly(total[0]) if total else acb_poly([])
    for column, weight in zip(columns, weights, strict=True):
        if weight != 0:
            result += acb_poly(column) * weight
    powers = [one.mid() for one in result]
    return powers + [acb(0)] * (count - len(powers))


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
