r"""The first loss of stability, to the accuracy of a double: kind, weight, control and frequency.

The eigenvalue problem :math:`y' = P(s;\lambda) y` with its boundary rows is discretised in integrated form (the unknowns are
the slopes at Chebyshev nodes and the state at the left end), which does not lose digits with the number of nodes. Infinite
eigenvalues are removed by keeping only the equations that hold lambda. What is found here fixes the *form* of the derivation;
the digits come from `numerics.threshold`.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Function, I, Integer, Matrix, Poly, Rational, Symbol, expand, fraction, lambdify, lcm, together
from sympy.printing.numpy import NumPyPrinter
from threadpoolctl import threadpool_limits

from derive.expansion import Expansion
from derive.formulation import Formulation
from derive.operator import LAMBDA, FirstOrderOperator
from derive.ordinary import AlgebraicOperator
from derive.statement import DerivationError, ProblemError

SCAN = 61
NODES = (28, 44, 72, 120, 200)
PANEL_NODES = (8, 12, 16)
MOST_PANELS = 64
RESOLVED = 1e-8
GROWTH = 8.0
AXIS = 1e-6
SHIFT = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True)
class Onset:
    """The first loss of stability.

    `kind` is "hopf" or "steady"; `weight` that of the critical mode under rotations; `control` and `frequency` are doubles.
    """

    kind: str
    weight: int
    control: float
    frequency: float | None
    other_eigenvalues: tuple[complex, ...]  # of those that stay stable the rightmost and the smallest


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
        self.spatial = isinstance(operator, FirstOrderOperator)
        self.interval = tuple(float(end) for end in formulation.interval) if formulation.interval else (0.0, 0.0)
        self.size = operator.size
        self.formulation = formulation
        if isinstance(operator, FirstOrderOperator):
            rows = [[*row, None] for row in operator.matrix]
            polynomials = [polynomial_row([*row[:-1]], True, formulation.control) for row in rows]
            ends = [polynomial_row(list(row), False, formulation.control) for row in operator.left.matrix], [polynomial_row(list(row), False, formulation.control) for row in operator.right.matrix]
            self.counts = (len(ends[0]), len(ends[1]))
            table = polynomials + ends[0] + ends[1]
        else:
            table = [polynomial_row(list(row), False, formulation.control) for row in operator.matrix]
            self.counts = (0, 0)
        self.finite = None if isinstance(operator, FirstOrderOperator) else finite_eigenvalues(operator, formulation)
        self.degree = max((len(entry) - 1 for row in table for entry in row), default=0)
        flat = [entry[k] if k < len(entry) else 0 for row in table for entry in row for k in range(self.degree + 1)]
        self.width = [len(row) for row in table]
        values = {symbol: value for symbol, value in formulation.parameters.items()}
        arguments = (formulation.space, formulation.control)
        divisors = operator.divisors if isinstance(operator, FirstOrderOperator) else ()
        self.poles = [compiled(arguments, [entry.subs(values) for entry in in_lambda(pole)]) for pole in divisors]
        self.constant = not any(isinstance(entry, Expr) and formulation.control in entry.free_symbols for entry in flat)
        exacts = [entry.subs(values) if isinstance(entry, Expr) else entry for entry in flat]
        self.entries: Callable[..., Sequence[Any]] = compiled(arguments, exacts)

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
        """Return the last Chebyshev coefficients of the entries on a panel, relative to their largest values."""
        points, _ = integration(nodes)
        transform = np.polynomial.chebyshev.chebvander(points, nodes - 1)[:, -3:].T * (2.0 / nodes)
        values = [entry for row in self.table(left + (right - left) * (points + 1) / 2, control) for line in row for entry in line]
        return max((float(np.abs(transform @ entry).max() / np.abs(entry).max()) for entry in values if np.any(entry)), default=0.0)

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
        # Coefficients in mu = lambda - shift.
        shifted = []
        for k in range(degree + 1):
            total = np.zeros_like(matrices[0])
            for power in range(k, degree + 1):
                total = total + matrices[power] * (comb(power, k) * shift ** (power - k))
            shifted.append(total)
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
    entries = [[entry.subs(formulation.parameters).subs(formulation.control, control) if isinstance(entry, Expr) else entry for entry in row] for row in operator.matrix]
    determinant = expand(Matrix(entries).det(method="berkowitz")) if entries else Integer(1)
    if LAMBDA not in determinant.free_symbols:
        return 0
    coefficients = Poly(fraction(together(determinant))[0], LAMBDA).all_coeffs()
    return next((len(coefficients) - 1 - k for k, coefficient in enumerate(coefficients) if not formulation.probe.is_zero(coefficient)), 0)


def compiled(arguments: tuple[Symbol, Symbol], expressions: list[Any]) -> Callable[..., Sequence[Any]]:
    """Return the expressions as a NumPy function; SciPy is loaded for special functions only."""
    names = {type(node).__name__ for one in expressions if isinstance(one, Expr) for node in one.atoms(Function)}
    elementary = {"exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh"}
    function: Callable[..., Sequence[Any]]
    if names <= elementary:  # what is in NumPy already: `from numpy import *`, which SymPy would run, loads all that NumPy has
        printer = NumPyPrinter({"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True})
        function = lambdify(arguments, expressions, modules=[vars(np)], printer=printer)
    else:
        function = lambdify(arguments, expressions, modules=["scipy", "numpy"])
    return function


def polynomial_row(entries: list[Expr], slope: bool, control: Symbol) -> list[list[Expr]]:
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
    return [coefficient.as_expr() for coefficient in reversed(Poly(expression, LAMBDA).all_coeffs())]


_TABLES: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}


def integration(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Chebyshev nodes on (-1, 1) and the matrix of integrals from -1 to each node and, last, to 1."""
    if nodes not in _TABLES:
        points = -np.cos((2 * np.arange(nodes) + 1) * np.pi / (2 * nodes))
        vandermonde = np.polynomial.chebyshev.chebvander(points, nodes - 1)
        inverse = vandermonde.T * (2.0 / nodes)
        inverse[0] /= 2
        ends = np.append(points, 1.0)
        integrals = np.empty((nodes + 1, nodes))
        for k in range(nodes):
            unit = np.zeros(nodes)
            unit[k] = 1
            primitive = np.polynomial.chebyshev.chebint(unit, lbnd=-1)
            integrals[:, k] = np.polynomial.chebyshev.chebval(ends, primitive)
        _TABLES[nodes] = (points, integrals @ inverse)
    return _TABLES[nodes]


class Spectrum:
    """The rightmost eigenvalues of all weights, resolved."""

    def __init__(self, operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> None:
        self.pencils = {weight: Pencil(operator, formulation) for weight, operator in operators.items()}
        self.formulation = formulation
        self.ladders: dict[Pencil, tuple[Mesh, ...]] = {}  # the meshes that are still of use: the first two are compared
        self.scales: dict[Pencil, float] = {}
        self.known: dict[Pencil, list[complex]] = {}
        self.bases = compiled((formulation.space, formulation.control), [base.subs(formulation.parameters) for base in formulation.base])

    def rightmost(self, control: float) -> list[tuple[complex, int]]:
        """Return the converged eigenvalues (value, weight), rightmost first.

        Raises
        ------
        FloatingPointError
            The base state or a coefficient is not finite and real there.
        """
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            place = np.linspace(float(self.formulation.interval[0]), float(self.formulation.interval[1]), 7) if self.formulation.interval else 0.0
            try:
                values = self.bases(place, control + 0j)
            except ZeroDivisionError as singular:
                raise FloatingPointError from singular
            for value in values:
                value = np.asarray(value, dtype=complex)
                if not np.all(np.isfinite(value)) or np.any(np.abs(value.imag) > 1e-9 * (1 + np.abs(value))):
                    raise FloatingPointError
        found: list[tuple[complex, int]] = []
        for weight, pencil in self.pencils.items():
            if weight < 0 and -weight in self.pencils:
                continue
            found.extend((value, weight) for value in self.resolved(pencil, control))
        return sorted(found, key=lambda pair: (-pair[0].real, -pair[0].imag))

    def resolved(self, pencil: Pencil, control: float) -> list[complex]:
        """Return the eigenvalues that two resolutions agree on; refine until no other could be the rightmost."""
        if not pencil.spatial:
            return [complex(value) for value in pencil.eigenvalues(control, None)]
        if pencil.constant and pencil in self.known:
            return self.known[pencil]
        self.known[pencil] = self.converged(pencil, control)
        return self.known[pencil]

    def converged(self, pencil: Pencil, control: float) -> list[complex]:
        """Return the eigenvalues that two resolutions agree on, raising the resolution where they do not."""
        meshes = self.ladders.get(pencil) or pencil.ladder(control)
        while True:
            self.ladders[pencil] = meshes
            coarse, fine = (pencil.eigenvalues(control, mesh) for mesh in meshes[:2])
            if not len(fine):
                return []
            distance = np.abs(fine[:, None] - coarse[None, :]).min(axis=1) if len(coarse) else np.full(len(fine), np.inf)
            # what counts as equal, and as zero, is measured by the second smallest eigenvalue met on the way
            scale = self.scales[pencil] = max(self.scales.get(pencil, 0.0), float(np.sort(np.abs(fine))[:2][-1]))
            agreed = distance <= 1e-5 * (scale + np.abs(fine))
            good = fine[agreed]
            if len(good):
                # Discretisation spoils large eigenvalues first: an unresolved one counts only among the smallest.
                reach = 2 * np.sort(np.abs(good))[min(len(good), 6) - 1]
                doubtful = fine[~agreed & (np.abs(fine) <= reach)]
                if not np.any(doubtful.real > good.real.max() + AXIS * scale):
                    return sorted((complex(value) for value in good), key=lambda z: -z.real)[:40]
            elif np.abs(fine).min() > 1e6:
                return []
            if len(meshes) == 2 and not len(good):
                raise DerivationError(f"threshold: found eigenvalues at {self.formulation.problem.control} = {control:.10g} that {meshes[1].size} nodes do not resolve; "
                                      "expected a mode that is smooth on that scale")
            if len(meshes) == 2:
                return sorted((complex(value) for value in good), key=lambda z: -z.real)[:40]
            meshes = meshes[1:]

    def check_pointwise(self, control: float, name: Symbol) -> None:
        """Refuse a state that loses stability at single points of the interval: no boundary-value problem, no mode."""
        found = np.concatenate([pencil.pointwise(control) for pencil in self.pencils.values()])
        unstable = found[found.real > 1e-9 * np.abs(found)]
        if len(unstable):
            worst = complex(unstable[np.argmax(unstable.real)])
            raise DerivationError(f"equations: found a continuous spectrum that reaches {shown(worst)} at {name} = {control:.10g}: single points of the interval grow by themselves; "
                                  "expected a loss of stability by one mode; correct the sign, or add the missing space derivative")

    def growth(self, control: float) -> float:
        """Return the largest real part."""
        values = self.rightmost(control)
        return values[0][0].real if values else -1e30


def holds_mode(operator: FirstOrderOperator, expansion: Expansion, onset: Onset) -> bool:
    """Tell whether the critical eigenvalue is one of this operator, which is a block of the whole linear problem."""
    with threadpool_limits(limits=1, user_api="blas"):
        found = Spectrum({0: operator}, expansion.formulation).rightmost(onset.control)
    wanted = onset.frequency or 0.0
    return any(abs(value.real + 1j * (abs(value.imag) - wanted)) < 1e-4 * wanted for value, _ in found)


def find_onset(operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> Onset:
    """Return the first loss of stability from the lower end of the control range; see `first_loss`."""
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads only cost
        return first_loss(operators, formulation)


def first_loss(operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> Onset:
    """Return the first loss of stability from the lower end of the control range.

    Raises
    ------
    ProblemError
        The base state is not strictly stable at the lower end, or stays stable in the whole range.
    DerivationError
        The critical eigenvalue is not simple (or, with a rotation axis, not double), or others lie on the axis too.
    """
    spectrum = Spectrum(operators, formulation)
    name = formulation.problem.control
    low, high = (float(end) for end in formulation.control_range)
    try:
        start = spectrum.rightmost(low)
    except FloatingPointError:
        raise ProblemError(f"base_state: found no finite real state, or coefficients of the equations that are not finite on the interval, "
                           f"at {name} = {formulation.control_range[0]}; expected both at the lower end of control_range") from None
    if not start:
        raise ProblemError("equations: found no eigenvalue at all; expected equations with time derivatives that can lose stability")
    spectrum.check_pointwise(low, name)
    if start[0][0].real >= -1e-13 * abs(start[0][0]) - 1e-18:
        raise ProblemError(f"control_range: found the eigenvalue {shown(start[0][0])} at {name} = {formulation.control_range[0]}; expected a base state that is "
                           "strictly stable at the lower end; lower it, or remove the neutral or unstable mode")
    grid = np.linspace(low, high, SCAN)
    previous, growth_before = low, start[0][0].real
    bracket: tuple[float, float] | None = None
    history = [(low, growth_before)]
    for control in grid[1:]:
        try:
            growth = spectrum.growth(float(control))
        except FloatingPointError:
            bracket = singular_end(spectrum, previous, float(control), name, abs(start[0][0].real))
            break
        history.append((float(control), growth))
        if growth > 0:
            bracket = (previous, float(control))
            break
        previous = float(control)
        if len(history) >= 3 and near_zero_peak(history[-3:]):
            top = peak_of(spectrum.growth, history[-3][0], history[-1][0], 1e-6 * (high - low))
            if spectrum.growth(top) > 0:
                bracket = (history[-3][0], top)
                break
    if bracket is None:
        last = history[-1]
        raise ProblemError(f"control_range: found no loss of stability between {formulation.control_range[0]} and {formulation.control_range[1]} (largest growth rate "
                           f"{max(value for _, value in history):.6g}, at the upper end {last[1]:.6g}); expected one; widen control_range")
    threshold = bracket[0]
    if bracket[1] > bracket[0]:
        threshold = crossing(spectrum.growth, *bracket)
    spectrum.check_pointwise(threshold, name)
    return classify(spectrum, threshold, abs(growth_before), formulation)


def crossing(growth: Callable[[float], float], low: float, high: float) -> float:
    """Return where `growth` changes sign between two controls: secant steps (Illinois), halving the bracket every third time."""
    below, above = growth(low), growth(high)
    tolerance = 1e-11 * max(abs(low), abs(high), 1e-300)
    ends = {low: abs(below), high: abs(above)}  # the true values: the weights of the secant are halved
    moved, small = 0, 1e-13 * min(abs(below), abs(above))
    for step in range(400):
        if high - low <= tolerance or 0 in (below, above):
            break
        middle = (low + high) / 2 if step % 3 == 2 else low + min(max(below / (below - above), 1e-3), 1 - 1e-3) * (high - low)
        value = growth(middle)
        if value > 0:
            high, above, below, moved = middle, value, below / 2 if moved > 0 else below, 1
        else:
            low, below, above, moved = middle, value, above / 2 if moved < 0 else above, -1
        ends[middle] = abs(value)
        if ends[middle] <= small:
            return middle
    return low if ends[low] <= ends[high] else high


def peak_of(growth: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Return where `growth` is largest between two controls, by golden sections."""
    share = (5**0.5 - 1) / 2
    left, right = high - share * (high - low), low + share * (high - low)
    at_left, at_right = growth(left), growth(right)
    while high - low > tolerance:
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - share * (high - low)
            at_left = growth(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + share * (high - low)
            at_right = growth(right)
    return left if at_left > at_right else right


def near_zero_peak(points: Sequence[tuple[float, float]]) -> bool:
    """Tell whether a parabola through three points has a maximum between them that could reach zero."""
    (_, a), (_, b), (_, c) = points
    if b <= max(a, c):
        return False
    top = b + (a - c) ** 2 / (8 * (2 * b - a - c))
    return top + 2 * (top - min(a, c)) > 0


def singular_end(spectrum: Spectrum, inside: float, outside: float, name: Symbol, rate: float) -> tuple[float, float]:
    """Return the last control with a real base state, if stability is lost before it; refuse a fold."""
    for _ in range(200):
        middle = (inside + outside) / 2
        if middle in (inside, outside):
            break
        try:
            growth = spectrum.growth(middle)
        except FloatingPointError:
            outside = middle
            continue
        if growth > AXIS * rate:
            return (inside, middle)
        inside = middle
    raise DerivationError(f"base_state: found a state that ends (is no longer finite and real) at {name} = {inside:.12g}, before any loss of stability; "
                          f"the rightmost eigenvalue there is {shown(spectrum.rightmost(inside)[0][0])}; a fold, or another singular point of the base state, is not of this class")


def shown(value: complex, rounding: float = 0.0) -> str:
    """Return an eigenvalue for a message; what is below `rounding` is 0."""
    value = complex(value.real if abs(value.real) > rounding else 0, value.imag if abs(value.imag) > rounding else 0)
    if abs(value.real) <= 1e-9 * abs(value):
        value = complex(0, value.imag)
    real = f"{value.real:.6g}"
    return real if abs(value.imag) <= 1e-9 * (1 + abs(value)) else f"{real} {'+' if value.imag > 0 else '-'} {abs(value.imag):.6g}i"


def classify(spectrum: Spectrum, threshold: float, rate: float, formulation: Formulation) -> Onset:
    """Tell what kind of bifurcation it is, or refuse it by name."""
    values = spectrum.rightmost(threshold)
    name = formulation.problem.control
    # An eigenvalue is on the axis within rounding of the growth rates met on the way; a defective one moves as a square root.
    scale = max(rate, abs(values[0][0]))
    tolerance = AXIS * scale
    critical = [(value, weight) for value, weight in values if abs(value.real) <= tolerance]
    stable = [value for value, _ in values if abs(value.real) > tolerance]
    rest = tuple(dict.fromkeys([*stable[:4], *sorted(stable, key=abs)[:4]]))
    listing = ", ".join(shown(value, tolerance) for value, _ in critical)
    where = f"at {name} = {threshold:.10g}"
    rotating = formulation.frame is not None
    oscillating = [(value, weight) for value, weight in critical if abs(value.imag) > 30 * tolerance]
    still = [(value, weight) for value, weight in critical if abs(value.imag) <= 30 * tolerance]
    if oscillating and still:
        raise DerivationError(f"threshold: found a zero eigenvalue together with a pair {where}: {listing}; expected no other eigenvalue on the imaginary axis")
    weights = {abs(weight) for _, weight in critical}
    if rotating and weights != {1}:
        raise DerivationError(f"threshold: found critical eigenvalues {listing} {where} of a mode along the rotation axis; expected a mode across it; drop rotation_axis")
    if still:
        if len(still) > 1:
            if rotating:
                raise DerivationError(f"threshold: found the eigenvalues {listing} in each of the two directions {where}; expected one: a defective or multiple eigenvalue is not of this class")
            raise DerivationError(f"threshold: found a double eigenvalue {listing} {where}; expected a simple one; if the problem is unchanged by rotations declare rotation_axis; "
                                  "a defective (Takens-Bogdanov) eigenvalue is not of this class")
        return Onset(kind="steady", weight=still[0][1], control=threshold, frequency=None, other_eigenvalues=rest)
    upper = sorted((value for value, _ in oscillating if value.imag > 0), key=lambda z: z.imag)
    lower = [value for value, _ in oscillating if value.imag < 0]
    if len(upper) != 1 or len(lower) != 1:
        if rotating and len(upper) + len(lower) == 1:
            raise DerivationError(f"threshold: found the eigenvalue {listing} {where} in one sense of rotation only: it is simple; expected the double eigenvalue of a problem that is "
                                  "also unchanged by reflections; drop rotation_axis")
        close = len(upper) == 2 and abs(upper[0] - upper[1]) <= 1e-3 * abs(upper[0])
        hint = "a double eigenvalue: if the problem is unchanged by rotations declare rotation_axis; a defective one is not of this class" if close else \
            "several modes are critical together (a resonance or a double Hopf point), which is not of this class"
        raise DerivationError(f"threshold: found the eigenvalues {listing} {where}; expected a simple pair; {hint}")
    if rotating and abs(upper[0] + lower[0]) > 1e-5 * abs(upper[0]):
        raise DerivationError(f"threshold: found the eigenvalues {listing} {where} in one sense of rotation; expected a conjugate pair: the problem is not unchanged by reflections; drop rotation_axis")
    return Onset(kind="hopf", weight=oscillating[0][1], control=threshold, frequency=float(upper[0].imag), other_eigenvalues=rest)


__all__ = ["Onset", "find_onset", "I"]
