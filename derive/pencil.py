r"""The eigenvalue problem of one weight as matrices, to the accuracy of a double.

:math:`y' = P(s;\lambda) y` with its boundary rows is discretised in integrated form (the unknowns are the slopes at Chebyshev nodes and the
state at the left end), which does not lose digits with the number of nodes. Infinite eigenvalues are removed by keeping only the equations
that hold lambda.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Function, Integer, Matrix, Rational, Symbol, fraction, lambdify, lcm, together
from sympy.printing.numpy import NumPyPrinter

from derive.expand import coefficients_in, expand
from derive.formulation import Formulation
from derive.operator import LAMBDA, FirstOrderOperator
from derive.ordinary import AlgebraicOperator
from derive.statement import ProblemError

NODES = (28, 44, 72, 120, 200)
PANEL_NODES = (8, 12, 16)
MOST_PANELS = 64
RESOLVED = 1e-8
BETWEEN = 32
"""places between the nodes, for each node, where a polynomial is compared with its function"""
SHARES = (0.13, 0.49, 0.83)
CUBIC = np.vander(np.linspace(0, 1, 25), 4) @ np.linalg.inv(np.vander(np.linspace(0, 1, 4), 4))
"""from a cubic at four places to its values at 25"""
GROWTH = 8.0
SHIFT = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Panels between `breaks` (shares of the interval, from 0 to 1) with so many Chebyshev nodes each."""

    breaks: tuple[float, ...]
    nodes: int

    @property
    def size(self) -> int:
        """Return the number of all nodes."""
        return (len(self.breaks) - 1) * self.nodes

    def integration(self, left: float, right: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the nodes and the matrix of integrals from the left end to each node and, last, to the right end."""
        points, cumulative = integration(self.nodes)
        places, total = np.empty(self.size), np.zeros((self.size + 1, self.size))
        for k, (low, high) in enumerate(zip(self.breaks, self.breaks[1:], strict=False)):
            half, own = (right - left) * (high - low) / 2, slice(k * self.nodes, (k + 1) * self.nodes)
            places[own] = left + (right - left) * low + half * (points + 1)
            total[own, own] = half * cumulative[:-1]
            total[own.stop:, own] = half * cumulative[-1]
        return places, total


class Pencil:
    """The coefficients of lambda^k in one weight's equations, as NumPy functions of (s, control)."""

    def __init__(self, operator: FirstOrderOperator | AlgebraicOperator, formulation: Formulation) -> None:
        self.formulation = formulation
        self.interval = tuple(float(end) for end in formulation.interval) if formulation.interval else (0.0, 0.0)
        self.size = operator.size
        self.spatial = isinstance(operator, FirstOrderOperator)
        ends = (operator.left.matrix, operator.right.matrix) if isinstance(operator, FirstOrderOperator) else ((), ())
        self.counts = (len(ends[0]), len(ends[1]))
        self.finite = finite_eigenvalues(operator, formulation) if isinstance(operator, AlgebraicOperator) else None
        table = [polynomial_row(row, self.spatial, formulation.control) for row in operator.matrix] + [polynomial_row(row, False, formulation.control) for side in ends for row in side]
        self.width = [len(row) for row in table]
        self.degree = max((len(entry) - 1 for row in table for entry in row), default=0)
        flat = [entry[k] if k < len(entry) else Integer(0) for row in table for entry in row for k in range(self.degree + 1)]
        self.constant = not any(formulation.control in entry.free_symbols for entry in flat)
        self.entries = compiled(formulation, flat)
        divisors = operator.divisors if isinstance(operator, FirstOrderOperator) else ()
        self.poles = [compiled(formulation, in_lambda(pole)) for pole in divisors]

    def pointwise(self, control: float) -> NDArray[np.complex128]:
        """Return the continuous spectrum, at a few points of the interval: where the elimination divides by zero."""
        left, right = self.interval
        found = []
        for place in np.linspace(left, right, 9):
            for pole in self.poles:
                coefficients = [complex(one) for one in pole(place, control)]
                found.append(np.roots(coefficients[::-1]))
        return np.concatenate(found) if found else np.zeros(0, dtype=complex)

    def table(self, s: NDArray[np.float64] | float, control: float) -> list[list[list[NDArray[np.complex128]]]]:
        """Return [row][column][power of lambda] at the nodes `s`."""
        values = self.evaluated(s, control + 0j)
        if not np.isfinite(values).all() and self.spatial:  # exp(1000 s)/(1 + exp(1000 s)) is in the range of a long double
            values = self.evaluated(np.asarray(s, dtype=np.longdouble), np.clongdouble(control))
        if not np.isfinite(values).all():
            raise FloatingPointError
        iterator = iter(values)
        return [[[next(iterator) for _ in range(self.degree + 1)] for _ in range(width)] for width in self.width]

    def evaluated(self, s: Any, control: Any) -> NDArray[np.complex128]:
        """Return all entries at the places `s`, in their precision; what is not finite is left to the caller."""
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = self.entries(s, control)
            except ZeroDivisionError as singular:
                raise FloatingPointError from singular
            values = np.empty((len(found), *np.shape(s)), dtype=complex)
            for k, value in enumerate(found):
                values[k] = value
        return values

    def bends(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far the rows, scaled to length 1, are from cubics on intervals of the control, at the place of three where they are least so."""
        controls = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, len(CUBIC))
        least = np.full(len(low), np.inf)
        for share in SHARES:
            place = np.full(controls.size, self.interval[0] + share * (self.interval[1] - self.interval[0]))
            entries = self.evaluated(place, controls.ravel().astype(complex))
            rows = np.split(entries, np.cumsum([width * (self.degree + 1) for width in self.width])[:-1])
            with np.errstate(all="ignore"):
                scaled = np.concatenate([row / np.sqrt((np.abs(row) ** 2).sum(axis=0)) for row in rows]).reshape(-1, *controls.shape)
            apart = np.abs(scaled - scaled[:, :, ::len(CUBIC) // 3] @ CUBIC.T).max(axis=(0, 2))
            least = np.minimum(least, np.where(np.isfinite(apart), apart, 0))
            if not self.spatial:
                break
        return least

    def ladder(self, control: float) -> tuple[Mesh, ...]:
        """Return meshes of growing resolution: the whole interval, or panels where a coefficient has layers; at last panels graded towards both ends."""
        low, high = (float(end) for end in self.formulation.control_range)
        found = set(self.panels(control))
        with contextlib.suppress(FloatingPointError):  # a layer may be in what the control multiplies, and not be there at 0
            found |= set(self.panels(low + SHIFT * (high - low)))
        breaks = tuple(sorted(found))
        first = tuple(Mesh(breaks=breaks, nodes=nodes) for nodes in (NODES if len(breaks) == 2 else PANEL_NODES))
        dyadic = [2.0**-k for k in range(10, 0, -1)]
        graded = tuple(sorted({*breaks, *dyadic, *(1 - x for x in dyadic)}))
        return (*first, *(Mesh(breaks=graded, nodes=nodes) for nodes in PANEL_NODES[:2]))

    def panels(self, control: float) -> tuple[float, ...]:
        """Return the breaks of panels on which every coefficient is resolved."""
        left, right = self.interval
        if self.tail(control, left, right, NODES[2]) <= RESOLVED:
            return (0.0, 1.0)
        done, pending = [0.0], [(0.5, 1.0), (0.0, 0.5)]
        while pending:
            low, high = pending.pop()
            ends = left + (right - left) * low, left + (right - left) * high
            if high - low > 2.0**-16 and len(done) + len(pending) < MOST_PANELS and self.tail(control, *ends, PANEL_NODES[-1]) > RESOLVED:
                pending += [((low + high) / 2, high), (low, (low + high) / 2)]
            else:
                done.append(high)
        return tuple(done)

    def tail(self, control: float, left: float, right: float, nodes: int) -> float:
        """Return what the entries on a panel leave of their Chebyshev polynomials, in the last coefficients and between the nodes, relative to their largest values."""
        points, _ = integration(nodes)
        between = np.linspace(-1.0, 1.0, BETWEEN * nodes)
        transform = np.polynomial.chebyshev.chebvander(points, nodes - 1).T * (2.0 / nodes)
        transform[0] /= 2
        every = self.table(left + (right - left) * (np.concatenate([points, between]) + 1) / 2, control)
        varying = np.array([entry for row in every for line in row for entry in line if np.any(entry != entry[0])]).reshape(-1, len(points) + len(between)).T
        if not varying.size:
            return 0.0
        coefficients = transform @ varying[:nodes]
        apart = np.polynomial.chebyshev.chebvander(between, nodes - 1) @ coefficients - varying[nodes:]
        return float((np.abs(np.concatenate([coefficients[-3:], apart])).max(axis=0) / np.abs(varying).max(axis=0)).max())

    def matrices(self, control: float, mesh: Mesh | None) -> list[NDArray[Any]]:
        """Return the matrices K_0, K_1, ... of the discretised problem sum_k lambda^k K_k v = 0; `mesh` is None without space.

        Where the coefficients make all solutions grow (or decay) by a large factor e^g, the unknown is y exp(-int sigma), sigma = tr P / n:
        the eigenvalues are the same, and rounding is not amplified by that factor.
        """
        n = self.size
        if mesh is None:
            table = self.table(0.0, control)
            return [np.array([[table[i][j][k] for j in range(n)] for i in range(n)], dtype=complex) for k in range(self.degree + 1)]
        left, right = self.interval
        nodes = mesh.size
        points, cumulative = mesh.integration(left, right)
        table = self.table(points, control)
        shift = mean_exponent(table)
        if abs(cumulative[-1] @ shift) > GROWTH:
            for i in range(n):
                for k in range(self.degree + 1):
                    table[i][i][k] = table[i][i][k] - shift * table[i][n][k]
        ends = [self.table(np.array([place]), control) for place in (left, right)]
        total = n * (nodes + 1)
        result = []
        for k in range(self.degree + 1):
            matrix = np.zeros((total, total), dtype=complex)
            for i in range(n):
                rows = slice(i * nodes, (i + 1) * nodes)
                for j in range(n):
                    entry = table[i][j][k]
                    if np.any(entry):
                        matrix[rows, j * nodes:(j + 1) * nodes] -= entry[:, None] * cumulative[:-1]
                        matrix[rows, n * nodes + j] -= entry
                matrix[rows, rows] += np.diag(table[i][n][k])
            row = n * nodes
            for side in (0, 1):
                start = n + (0 if side == 0 else self.counts[0])
                for i in range(self.counts[side]):
                    for j in range(n):
                        entry = ends[side][start + i][j][k][0]
                        if side == 1:
                            matrix[row, j * nodes:(j + 1) * nodes] += entry * cumulative[-1]
                        matrix[row, n * nodes + j] += entry
                    row += 1
            result.append(matrix)
        return result if any(np.any(matrix.imag) for matrix in result) else [matrix.real for matrix in result]

    def eigenvalues(self, control: float, mesh: Mesh | None) -> NDArray[np.complex128]:
        """Return the finite eigenvalues at one control and one resolution."""
        if self.size == 0:
            return np.zeros(0, dtype=complex)
        matrices = self.matrices(control, mesh)
        held = np.flatnonzero(sum((np.abs(matrix).sum(axis=1) for matrix in matrices[1:]), np.zeros(len(matrices[0]))))
        if not len(held):
            return np.zeros(0, dtype=complex)
        degree = len(matrices) - 1
        shift = SHIFT
        found: list[NDArray[np.complex128]] = []
        reach = np.inf
        for _ in range(3):
            values = self.shifted_eigenvalues(matrices, held, degree, shift)
            values = values[np.abs(values) < reach]
            smallest = float(np.abs(values).min(initial=np.inf))
            if not smallest < 1e-3 * shift:
                break
            # An eigenvalue far below the shift drowns in rounding: keep the others and look again nearer to zero.
            reach = 1e-3 * shift
            found.append(values[np.abs(values) >= reach])
            shift = max(SHIFT * smallest, 1e-18)
        values = np.where(np.abs(values) < 1e-17, 0, values)  # what is left of an eigenvalue zero
        return np.concatenate([*found, values])

    def shifted_eigenvalues(self, matrices: list[NDArray[Any]], held: NDArray[np.intp], degree: int, shift: float) -> NDArray[np.complex128]:
        """Return the eigenvalues from the inverse at a shift, restricted to the equations that hold lambda."""
        # coefficients of the powers of lambda - shift
        shifted = [sum((matrices[power] * (comb(power, k) * shift ** (power - k)) for power in range(k, degree + 1)), np.zeros_like(matrices[0])) for k in range(degree + 1)]
        scale = np.abs(shifted[0]).max(axis=1)
        scale[scale == 0] = 1
        identity = np.zeros((len(scale), len(held)))
        identity[held, np.arange(len(held))] = 1 / scale[held]
        try:
            inverse = np.linalg.solve(shifted[0] / scale[:, None], identity)
        except np.linalg.LinAlgError:
            return np.array([np.nan + 0j])
        if not np.all(np.isfinite(inverse)):
            return np.array([np.nan + 0j])
        m = len(held)
        companion = np.zeros((degree * m, degree * m), dtype=inverse.dtype)
        for k in range(1, degree + 1):
            companion[:m, (k - 1) * m:k * m] = -(shifted[k][held] @ inverse)
        companion[m:, :-m] = np.eye((degree - 1) * m)
        theta = np.linalg.eigvals(companion).astype(complex)
        if self.finite is not None:  # what rounding leaves of a defective infinite eigenvalue is not small: their number is known
            theta = theta[np.argsort(-np.abs(theta), kind="stable")[:self.finite]]
        theta = theta[np.abs(theta) > 1e-13 * max(1.0, float(np.abs(theta).max(initial=0.0)))]
        return shift + 1 / theta


def mean_exponent(table: list[list[list[NDArray[np.complex128]]]]) -> NDArray[np.float64]:
    """Return tr P / n without lambda, at the nodes; 0 where lambda multiplies a slope."""
    n = len(table[0]) - 1
    slopes = [table[i][n][0] for i in range(n)]
    if any(np.any(table[i][n][k]) for i in range(n) for k in range(1, len(table[i][n]))) or not all(np.all(slope) for slope in slopes):
        return np.zeros(len(slopes[0]))
    return sum((table[i][i][0].real / slopes[i].real for i in range(n)), np.zeros(len(slopes[0]))) / n


def finite_eigenvalues(operator: AlgebraicOperator, formulation: Formulation) -> int:
    """Return the degree of det M in lambda, at a control without meaning."""
    low, high = formulation.control_range
    control = low + (high - low) * Rational(61803, 100000)
    entries = [[entry.subs(formulation.parameters).subs(formulation.control, control) for entry in row] for row in operator.matrix]
    determinant = expand(Matrix(entries).det(method="berkowitz")) if entries else Integer(1)
    if formulation.probe.is_zero(determinant):
        raise ProblemError("equations: found rows whose linear parts about the base state depend on each other; expected as many independent ones as unknowns: something is left undetermined")
    if LAMBDA not in determinant.free_symbols:
        return 0
    coefficients = coefficients_in(fraction(together(determinant))[0], LAMBDA)
    return max((k for k, coefficient in enumerate(coefficients) if not formulation.probe.is_zero(coefficient)), default=0)


def compiled(formulation: Formulation, expressions: Sequence[Expr]) -> Callable[..., Sequence[Any]]:
    """Return the expressions as a NumPy function of (s, control), the parameters at their values; SciPy is loaded for special functions only."""
    arguments = (formulation.space, formulation.control)
    values = [one.subs(formulation.parameters) for one in expressions]
    names = {type(node).__name__ for one in values for node in one.atoms(Function)}
    elementary = {"exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh"}
    function: Callable[..., Sequence[Any]]
    if names <= elementary:  # what is in NumPy already: `from numpy import *`, which SymPy would run, loads all that NumPy has
        printer = NumPyPrinter({"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True})
        function = lambdify(arguments, values, modules=[vars(np)], printer=printer)
    else:
        function = lambdify(arguments, values, modules=["scipy", "numpy"])
    return function


def polynomial_row(entries: Sequence[Expr], slope: bool, control: Symbol) -> list[list[Expr]]:
    """Return the coefficients in lambda of a row, over its common denominator (appended as the last entry for a slope row).

    A boundary row is cleared of denominators in the control too: it holds where they vanish.
    """
    cleared = {LAMBDA} if slope else {LAMBDA, control}
    fractions = [fraction(together(entry)) if cleared & entry.free_symbols else (entry, Integer(1)) for entry in entries]
    denominator: Expr = Integer(1)
    for _, bottom in fractions:
        if cleared & bottom.free_symbols:
            denominator = lcm(denominator, bottom)
    tops = [entry if denominator == 1 else together(top * denominator / bottom) for (top, bottom), entry in zip(fractions, entries, strict=True)]
    return [in_lambda(top) for top in (*tops, *([denominator] if slope else []))]


def in_lambda(expression: Expr) -> list[Expr]:
    """Return the coefficients of lambda^0, lambda^1, ..."""
    if LAMBDA not in expression.free_symbols:
        return [expression]
    return coefficients_in(expression, LAMBDA)


@cache
def integration(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Chebyshev nodes on (-1, 1) and the matrix of integrals from -1 to each node and, last, to 1."""
    points = -np.cos((2 * np.arange(nodes) + 1) * np.pi / (2 * nodes))
    inverse = np.polynomial.chebyshev.chebvander(points, nodes - 1).T * (2.0 / nodes)
    inverse[0] /= 2
    primitives = np.polynomial.chebyshev.chebint(np.eye(nodes), lbnd=-1)
    return points, np.polynomial.chebyshev.chebval(np.append(points, 1.0), primitives).T @ inverse
