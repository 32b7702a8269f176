r"""Piecewise power series in balls: any analytic coefficients, every number an enclosure.

On a panel with centre c and half-width h a function of s = c + h x is a ball polynomial: at every x in [-1, 1] the value is that
of the polynomial for some choice of its coefficients in their balls. Sums, products, integrals and the cut of the high orders
(added to the constant's radius) keep that property.

Solutions of y' = P y + f come from a truncated series without any claim, then the residual is bounded and Gronwall's inequality
gives the distance e of the true solution: with e(0) = 0 and a weighted maximum norm,

.. math:: |e(x)| \le e^{hL|x|}\,\sup|hP\tilde y + hf - \tilde y'|, \qquad L = \sup\|P\| .

Coefficients of the equations are kept as functions that can be evaluated anywhere, in the plane too: their power series on a
panel have a tail below :math:`M\rho^{-N}/(1 - 1/\rho)`, M a bound on the disc :math:`|x|\le\rho`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, ClassVar

import flint
import numpy as np
from flint import acb, acb_mat, acb_poly, acb_series, arb

from numerics.algebra import Operator, Row, number, scaled_to
from numerics.certified_linear import Enclosing, Unproved, elementary, kernel, solved, solved_singular, upper
from numerics.precision import EvaluationError

REACH = 4.0
"""The largest h L of a panel."""


class TooCoarse(Unproved):
    """Panels that have to be halved: a coefficient varies too fast on them, or a solution grows too much."""

    def __init__(self, panels: Sequence[int]) -> None:
        super().__init__("found panels on which the equations vary too fast")
        self.panels = tuple(panels)


class Explicit:
    """An analytic function of s that can be evaluated at any ball or series: a coefficient of the equations."""

    __slots__ = ("algebra", "at", "known")

    def __init__(self, algebra: PowerSeries, at: Callable[[Any], Any]) -> None:
        self.algebra = algebra
        self.at = at
        self.known: Series | None = None

    def series(self) -> Series:
        """Return the function on the panels."""
        if self.known is None:
            self.known = Series(self.algebra, tuple(self.algebra.expanded(self.at)))
        return self.known

    def combined(self, other: Any, operation: Callable[[Any, Any], Any]) -> Any:
        """Return operation(self, other); explicit as long as both are."""
        if isinstance(other, Series):
            return operation(self.series(), other)
        at = self.at
        if isinstance(other, Explicit):
            second = other.at
            return Explicit(self.algebra, lambda z: operation(at(z), second(z)))
        value = number(other)
        return Explicit(self.algebra, lambda z: operation(at(z), value))

    def __add__(self, other: Any) -> Any:
        return self.combined(other, lambda a, b: a + b)

    __radd__ = __add__

    def __neg__(self) -> Explicit:
        return Explicit(self.algebra, lambda z: -self.at(z))

    def __sub__(self, other: Any) -> Any:
        return self.combined(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        return self.combined(other, lambda a, b: a * b)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self.combined(other, lambda a, b: a / b)

    def __rtruediv__(self, other: Any) -> Any:
        return Explicit(self.algebra, lambda z: 1 / self.at(z)) * other

    def __pow__(self, power: int) -> Explicit:
        return Explicit(self.algebra, lambda z: repeated(self.at(z), power))

    def apply(self, name: str) -> Explicit:
        """Return an elementary function of this one."""
        return Explicit(self.algebra, lambda z: elementary(name, self.at(z)))


def repeated(value: Any, power: int) -> Any:
    """Return a positive integer power."""
    result = value
    for _ in range(power - 1):
        result = result * value
    return result


class Series:
    """A function as one ball polynomial a panel."""

    __slots__ = ("algebra", "pieces")

    def __init__(self, algebra: PowerSeries, pieces: Sequence[acb_poly]) -> None:
        self.algebra = algebra
        self.pieces = pieces

    def __add__(self, other: Any) -> Series:
        if isinstance(other, Explicit):
            other = other.series()
        if isinstance(other, Series):
            return Series(self.algebra, [a + b for a, b in zip(self.pieces, other.pieces, strict=True)])
        return Series(self.algebra, [a + other for a in self.pieces])

    __radd__ = __add__

    def __neg__(self) -> Series:
        return Series(self.algebra, [-a for a in self.pieces])

    def __sub__(self, other: Any) -> Series:
        return self + (-other)

    def __rsub__(self, other: Any) -> Series:
        return -self + other

    def __mul__(self, other: Any) -> Series:
        if isinstance(other, Explicit):
            other = other.series()
        if not isinstance(other, Series):
            return Series(self.algebra, [a * other for a in self.pieces])
        self.algebra.counts["products"] = self.algebra.counts.get("products", 0) + 1
        return Series(self.algebra, [self.algebra.cut(a * b) for a, b in zip(self.pieces, other.pieces, strict=True)])

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Series:
        if isinstance(other, Explicit):
            return self * (1 / other)
        if isinstance(other, Series):
            raise Unproved("found a quotient of solutions")
        return self * (1 / number(other))

    def __pow__(self, power: int) -> Series:
        return repeated(self, power)  # type: ignore[no-any-return]

    def apply(self, name: str) -> Series:
        """Refuse: only coefficients of the equations stand inside elementary functions."""
        raise Unproved(f"found {name} of a solution")

    def largest(self) -> float:
        """Return the size of the function at a few places."""
        return max(float(abs(piece(acb(x)).mid())) for piece in self.pieces for x in (-1, -0.4, 0.3, 1))


WHOLE = arb(0, 1)
"""The ball [-1, 1]."""


class PowerSeries(Enclosing):
    """The certified algebra on panels between `breaks` (exact shares of the interval), series of `terms` terms."""

    name: ClassVar[str] = "series"

    def __init__(self, *, ends: tuple[acb, acb], breaks: Sequence[Fraction], terms: int, real: bool, **common: Any) -> None:
        super().__init__(**common)
        self.left_end, self.right_end = ends
        self.length = ends[1] - ends[0]
        self.breaks, self.terms, self.real = tuple(breaks), terms, real
        self.panels = len(breaks) - 1
        pairs = list(zip(breaks[:-1], breaks[1:], strict=True))
        self.centres = [self.left_end + self.length * exact((a + b) / 2) for a, b in pairs]
        self.halves = [self.length * exact((b - a) / 2) for a, b in pairs]
        self.s = Explicit(self, lambda z: z)
        self.flows: dict[int, Any] = {}

    # Functions

    def cut(self, piece: acb_poly) -> acb_poly:
        """Return the polynomial with at most `terms` terms; what is dropped is added to the radius of the constant."""
        if piece.length() <= self.terms:
            return piece
        dropped = piece.right_shift(self.terms)(acb(WHOLE))
        return piece.truncate(self.terms) + self.within(upper(dropped))

    def within(self, size: arb) -> acb:
        """Return the ball of a radius about zero; on the real line in a real problem."""
        size = size.upper()
        return acb(arb(0, size)) if self.real else acb(arb(0, size), arb(0, size))

    def expanded(self, at: Callable[[Any], Any]) -> list[acb_poly]:
        """Return the series of an explicit function on every panel, with a bound on the tail."""
        pieces, coarse = [], []
        middle = (upper(number(at(centre))) for centre in self.centres)
        largest = max((size for size in middle if size.is_finite()), default=arb(0))
        for k in range(self.panels):
            piece = self.expanded_on(at, k, largest)
            if piece is None:
                coarse.append(k)
            else:
                pieces.append(piece)
        if coarse:
            raise TooCoarse(coarse)
        return pieces

    def expanded_on(self, at: Callable[[Any], Any], k: int, largest: arb) -> acb_poly | None:
        """Return the series on one panel, or None where singularities are too near for the tail to be negligible, beside the `largest` value of all panels too."""
        centre, half = self.centres[k], self.halves[k]
        try:
            value = at(acb_series([centre, half], self.terms))
        except (ValueError, ZeroDivisionError):  # singular at the centre
            return None
        if not isinstance(value, acb_series):
            return acb_poly([number(value)])
        if value.prec < self.terms:
            return None
        tail: arb | None = None
        size = arb(1)
        rho = arb(2)
        for _ in range(40):
            bound = at(centre + half * acb(arb(0, rho), arb(0, rho)))
            if not bound.is_finite():
                break
            size = upper(bound) if tail is None else size
            candidate = upper(bound) * rho ** (-self.terms) / (1 - 1 / rho)
            if tail is not None and not candidate < tail:
                break
            tail = candidate
            rho = rho * arb("1.5")
        coefficients = value.coeffs()
        if tail is None or tail > size.max(largest) * arb(2) ** (24 - flint.ctx.prec) or not all(c.is_finite() for c in coefficients):
            return None
        return acb_poly(coefficients) + self.within(tail)

    def function(self, value: Any) -> Series:
        """Return a number as a constant function."""
        if isinstance(value, Explicit):
            return value.series()
        return value if isinstance(value, Series) else Series(self, [acb_poly([number(value)])] * self.panels)

    def reflect(self, value: Any) -> Any:
        """Return the conjugate on the real line."""
        if isinstance(value, Explicit):
            value = value.series()
        if isinstance(value, Series):
            return Series(self, [acb_poly([c.conjugate() for c in piece.coeffs()]) for piece in value.pieces])
        return number(value).conjugate()

    def integral(self, value: Any) -> acb:
        """Return the integral over the interval."""
        self.counts["integrals"] = self.counts.get("integrals", 0) + 1
        if not isinstance(value, (Series, Explicit)):
            return number(value) * self.length
        return sum((self.over(piece, half) for piece, half in zip(self.function(value).pieces, self.halves, strict=True)), acb(0))

    def over(self, piece: acb_poly, half: acb) -> acb:
        """Return the integral of one piece over its panel."""
        primitive = piece.integral()
        return (primitive(acb(1)) - primitive(acb(-1))) * half

    def integral_from_left(self, value: Any) -> Series:
        """Return the integral from the left end to s."""
        before, pieces = acb(0), []
        for piece, half in zip(self.function(value).pieces, self.halves, strict=True):
            primitive = piece.integral() * half
            start = primitive(acb(-1))
            pieces.append(self.cut(primitive + (before - start)))
            before = before + primitive(acb(1)) - start
        return Series(self, pieces)

    def integral_to_right(self, value: Any) -> Series:
        """Return the integral from s to the right end."""
        return self.integral(value) - self.integral_from_left(value)

    def left(self, value: Any) -> acb:
        """Return the value at the left end."""
        if isinstance(value, Explicit):
            return finite(value.at(self.left_end))
        return value.pieces[0](acb(-1)) if isinstance(value, Series) else number(value)

    def right(self, value: Any) -> acb:
        """Return the value at the right end."""
        if isinstance(value, Explicit):
            return finite(value.at(self.right_end))
        return value.pieces[-1](acb(1)) if isinstance(value, Series) else number(value)

    def probes(self, value: Any) -> list[acb]:
        """Return the function at a few places."""
        return [piece(acb(x)) for piece in self.function(value).pieces for x in (-1, -0.5, 0, 0.5, 1)]

    def row_at(self, row: Row, functions: Sequence[Series], place: Any) -> acb:
        """Return row y at a place of the interval; on every panel that may hold it."""
        result: acb | None = None
        for k in range(self.panels):
            x = ((number(place) - self.centres[k]) / self.halves[k]).real
            if not x.overlaps(WHOLE):
                continue
            x = x.intersection(WHOLE)
            value = sum((number(c) * y.pieces[k](acb(x)) for c, y in zip(row, functions, strict=True) if not isinstance(c, int) or c), acb(0))
            result = value if result is None else result.union(value)
        if result is None:
            raise EvaluationError("normalisation: found a place outside the interval; expected one inside")
        return result

    # Linear problems

    def panel_matrix(self, operator: Operator, k: int) -> list[list[acb_poly | None]]:
        """Return h P on one panel; None for an exact zero."""
        half = self.halves[k]
        table: list[list[acb_poly | None]] = []
        for row in operator.matrix:
            line: list[acb_poly | None] = []
            for entry in row:
                if isinstance(entry, (Series, Explicit)):
                    line.append(self.function(entry).pieces[k] * half)
                else:
                    value = number(entry)
                    line.append(None if value == 0 else acb_poly([value * half]))
            table.append(line)
        return table

    def flow(self, operator: Operator) -> list[tuple[list[list[acb_poly | None]], list[arb], arb, list[list[acb_poly]]]]:
        """Return for each panel h P, the weights of the norm, the growth factor, and n solutions (columns) that are 1 at its centre."""
        key = id(operator)
        if key not in self.flows:
            constant = not any(isinstance(entry, (Series, Explicit)) for row in operator.matrix for entry in row)
            tables = [self.panel_matrix(operator, k) for k in range(self.panels)]
            norms = [norm_of(table) for table in tables]
            coarse = [k for k, (_, rate) in enumerate(norms) if not float(rate.mid()) <= REACH * max(1.0, self.terms / 60)]
            if coarse:
                raise TooCoarse(coarse)
            result: list[Any] = []
            n = operator.size
            for k, (table, (weights, rate)) in enumerate(zip(tables, norms, strict=True)):
                if constant and k and (self.breaks[k + 1] - self.breaks[k]) == (self.breaks[k] - self.breaks[k - 1]):
                    result.append(result[-1])
                    continue
                grow = rate.exp().upper()
                columns = [self.enclosed(table, weights, grow, [acb(1) if i == j else acb(0) for i in range(n)], None) for j in range(n)]
                result.append((table, weights, grow, columns))
            self.flows[key] = (operator, result)
        return self.flows[key][1]  # type: ignore[no-any-return]

    def enclosed(self, table: list[list[acb_poly | None]], weights: list[arb], grow: arb, start: list[acb], forcing: list[acb_poly] | None) -> list[acb_poly]:
        """Return the solution of y' = h P y + forcing with the value `start` at the centre, as an enclosure."""
        n = len(table)
        trial = [acb_poly(one) for one in self.recurrence(table, start, forcing)]
        residuals = []
        for i in range(n):
            residual = -trial[i].derivative()
            for entry, one in zip(table[i], trial, strict=True):
                if entry is not None:
                    residual = residual + entry * one
            if forcing is not None:
                residual = residual + forcing[i]
            residuals.append(residual(acb(WHOLE)))
        if not all(one.is_finite() for one in residuals):
            raise Unproved("found a linear problem whose solution grows without bound")
        size = max_of([upper(one) / weight for one, weight in zip(residuals, weights, strict=True)]) * grow
        return [one + self.within(size * weight) for one, weight in zip(trial, weights, strict=True)]

    def recurrence(self, table: list[list[acb_poly | None]], start: list[acb], forcing: list[acb_poly] | None) -> list[list[acb]]:
        """Return the power series, (m + 1) y_{m+1} = sum_i (h P)_i y_{m-i} + f_m."""
        n = len(table)
        entries: list[list[tuple[int, list[acb]]]] = [[(j, [c.mid() for c in entry.coeffs()]) for j, entry in enumerate(line) if entry is not None] for line in table]
        given = [[c.mid() for c in one.coeffs()] for one in forcing] if forcing is not None else [[]] * n
        series = [[value] for value in start]
        for m in range(self.terms - 1):
            following = []
            for i in range(n):
                total = given[i][m] if m < len(given[i]) else acb(0)
                for j, coefficients in entries[i]:
                    known = series[j]
                    if len(coefficients) == 1:
                        total = total + coefficients[0] * known[m]
                    else:
                        for c, y in zip(coefficients, known[m::-1], strict=False):
                            total = total + c * y
                following.append((total / (m + 1)).mid())
            for i in range(n):
                series[i].append(following[i])
        return series

    def end_rows(self, operator: Operator) -> tuple[list[list[acb]], list[list[acb]]]:
        """Return the boundary rows as numbers."""
        left = [[self.left(entry) for entry in row] for row in operator.left]
        right = [[self.right(entry) for entry in row] for row in operator.right]
        return left, right

    def rows(self, operator: Operator) -> list[list[acb]]:
        """Return the rows for the states at the centres of the panels: boundary rows, and continuity at the breaks."""
        n, total = operator.size, operator.size * self.panels
        flow = self.flow(operator)
        values = [[acb_mat([[columns[j][i](acb(x)) for j in range(n)] for i in range(n)]) for x in (-1, 1)] for _, _, _, columns in flow]
        left, right = self.end_rows(operator)
        zero = [acb(0)] * (total - n)
        rows = [[*line, *zero] for line in (acb_mat(left) * values[0][0]).tolist()] if left else []
        rows += [[*zero, *line] for line in (acb_mat(right) * values[-1][1]).tolist()] if right else []
        for k in range(self.panels - 1):
            before, after = values[k][1].tolist(), values[k + 1][0].tolist()
            for i in range(n):
                row = [acb(0)] * total
                row[k * n:(k + 1) * n] = before[i]
                row[(k + 1) * n:(k + 2) * n] = [-entry for entry in after[i]]
                rows.append(row)
        return rows

    def assembled(self, operator: Operator, states: Sequence[acb], particular: Sequence[Sequence[acb_poly]] | None) -> list[Series]:
        """Return the functions from the states at the centres."""
        n = operator.size
        flow = self.flow(operator)
        result = []
        for i in range(n):
            pieces = []
            for k, (_, _, _, columns) in enumerate(flow):
                total = particular[k][i] if particular is not None else acb_poly([acb(0)])
                for j in range(n):
                    total = total + columns[j][i] * states[k * n + j]
                pieces.append(total)
            result.append(Series(self, pieces))
        return result

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Series, ...]:
        """Return y with homogeneous boundary rows; row y = 1 at `place`, or of any size."""
        functions = self.assembled(operator, kernel(self.rows(operator)), None)
        return tuple(functions) if row is None else scaled_to(functions, self.row_at(row, functions, place))

    def forced(self, operator: Operator, forcing: Row, left: Row, right: Row) -> tuple[list[list[acb_poly]], list[acb]]:
        """Return a particular solution on each panel, zero at its centre, and the right side of the global rows."""
        n = operator.size
        sources = [self.function(entry) for entry in forcing]
        particular = [self.enclosed(table, weights, grow, [acb(0)] * n, [source.pieces[k] * self.halves[k] for source in sources])
                      for k, (table, weights, grow, _) in enumerate(self.flow(operator))]
        at = [[[one(acb(x)) for one in pieces] for x in (-1, 1)] for pieces in particular]
        rows_left, rows_right = self.end_rows(operator)
        data = [number(value) - dot(row, at[0][0]) for value, row in zip(left, rows_left, strict=True)]
        data += [number(value) - dot(row, at[-1][1]) for value, row in zip(right, rows_right, strict=True)]
        data += [at[k + 1][0][i] - at[k][1][i] for k in range(self.panels - 1) for i in range(n)]
        return particular, data

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row) -> tuple[Series, ...]:
        """Return y with y' = P y + forcing and the boundary rows equal to `left` and `right`."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        particular, data = self.forced(operator, forcing, left, right)
        return tuple(self.assembled(operator, solved(self.rows(operator), data), particular))

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[Series, ...]:
        """Return the solution with row y = 0 at `place` of a problem singular at the true threshold, with a forcing in its range."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        particular, data = self.forced(operator, forcing, left, right)
        rows = self.rows(operator)
        mode = self.assembled(operator, kernel(rows), None)
        # Any solution will do: the one with the state that the mode has largest at zero; then the mode is taken off.
        n = len(rows)
        pick = [acb(0)] * n
        states = kernel(rows)
        pick[max(range(n), key=lambda j: abs(states[j].mid()))] = acb(1)
        functions = self.assembled(operator, solved_singular(rows, data, pick, acb(0)), particular)
        share = self.row_at(row, functions, place) / self.row_at(row, mode, place)
        return tuple(f - one * share for f, one in zip(functions, mode, strict=True))


def exact(value: Fraction) -> acb:
    """Return a dyadic or other fraction."""
    return acb(value.numerator) / value.denominator


def finite(value: Any) -> acb:
    """Return a value that must be finite."""
    value = number(value)
    if not value.is_finite():
        raise Unproved("found a coefficient of the equations that is singular at an end")
    return value


def dot(row: Sequence[acb], values: Sequence[acb]) -> acb:
    """Return sum row_i values_i."""
    return sum((a * b for a, b in zip(row, values, strict=True)), acb(0))


def max_of(values: Sequence[arb]) -> arb:
    """Return an upper bound of non-negative numbers."""
    result = values[0]
    for value in values[1:]:
        result = result.max(value)
    return result.upper()


def norm_of(table: list[list[acb_poly | None]]) -> tuple[list[arb], arb]:
    """Return weights w and a bound of max_i sum_j |h P_ij| w_j / w_i; w is near the Perron vector, where that is smallest."""
    n = len(table)
    sizes = [[upper(entry(acb(WHOLE))) if entry is not None else arb(0) for entry in line] for line in table]
    doubles = np.array([[float(size.mid()) for size in line] for line in sizes])
    if not np.all(np.isfinite(doubles)):
        return [arb(1)] * n, arb("inf")
    doubles = doubles + 1e-9 * max(1e-30, float(doubles.max(initial=0.0)))
    vector = np.ones(n)
    for _ in range(60):
        vector = doubles @ vector + 1e-3 * doubles.max() * vector
        vector = np.maximum(vector / vector.max(), 1e-30)
    weights = [arb(float(value)) for value in vector]
    rate = max_of([sum((size * w for size, w in zip(line, weights, strict=True)), arb(0)) / own for line, own in zip(sizes, weights, strict=True)])
    return weights, rate
