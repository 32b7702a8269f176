r"""The algebra in double precision over NumPy arrays, a batch of parameter values at once.

Every quantity is computed side by side by two rules, Gauss-Legendre and Gauss-Radau nodes with different centres of expansion: their
difference is what truncation and rounding do to it. Numbers have the shape (2, batch, 1), functions of s (2, batch, nodes).

A linear problem is solved by its fundamental matrix on each panel, :math:`y = \Phi(s)\,(c_k + \int \Phi^{-1} f\,ds)`, and boundary rows and
continuity for the :math:`c_k`. For constant coefficients :math:`\Phi = e^{P(s - s_k)}` is a power series about the middle of the panel; else it
is collocated in integrated form (unknown slopes v, y = y_left + J v). Nothing is differentiated: more nodes lose no digits.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
from flint import arb, arb_mat
from numpy.polynomial import legendre
from scipy import special

from numerics.algebra import Operator, Row
from numerics.precision import working_precision

Array = np.ndarray[Any, Any]
CENTRES = np.array([0.0, 0.1])
"""centres of expansion of the two rules, on the panel (-1, 1)"""
ELEMENTARY = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "erf": special.erf,
              **{name: getattr(np, name) for name in ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt")}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Both rules with m nodes on (-1, 1); the first axis tells them apart."""

    nodes: Array
    weights: Array
    integrate: Array
    """transposed: f @ integrate is the integral from -1"""
    to_legendre: Array
    """coefficients over Legendre polynomials, shape (2, m, m)"""



def legendre_at(x: arb, m: int) -> list[arb]:
    """Return P_0 ... P_m at x."""
    values = [arb(1), x]
    for k in range(1, m):
        values.append((((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1)).mid())
    return values


def node_near(guess: float, m: int, share: int) -> arb:
    """Return the zero of P_m + share P_{m-1} near a double."""
    x = arb(guess)
    for _ in range(4):
        p = legendre_at(x, m)
        slope = m * (x * p[m] - p[m - 1]) + share * (m - 1) * (x * p[m - 1] - p[m - 2])  # times 1/(x^2 - 1)
        x = (x - (p[m] + share * p[m - 1]) * (x * x - 1) / slope).mid()
    return x


@cache
def rules_of(m: int) -> Rules:
    """Return Gauss-Legendre and left Gauss-Radau nodes, their weights and exact integration of the interpolating polynomials.

    Worked out with 128 bits: weights from double-precision root finders lose up to four digits.
    """
    nodes, weights, integrate, to_legendre = [], [], [], []
    with working_precision(128):
        gauss = [node_near(x, m, 0) for x in special.roots_legendre(m)[0]]
        radau = [arb(-1), *(node_near(x, m, 1) for x in special.roots_jacobi(m - 1, 0, 1)[0])]
        for rule, places in enumerate((gauss, radau)):
            table = [legendre_at(x, m) for x in places]
            if rule == 0:
                share = [2 * (1 - x * x) / (m * p[m - 1]) ** 2 for x, p in zip(places, table, strict=True)]
            else:
                share = [(1 - x) / (m * p[m - 1]) ** 2 for x, p in zip(places, table, strict=True)]
            project = arb_mat([[arb(2 * k + 1) / 2 * w * p[k] for w, p in zip(share, table, strict=True)] for k in range(m)])
            # int_{-1}^x P_k = (P_{k+1} - P_{k-1})/(2k + 1), and x + 1 for k = 0
            primitive = arb_mat([[(p[k + 1] - p[k - 1]) / (2 * k + 1) if k else p[1] + 1 for k in range(m)] for p in table])
            nodes.append([float(x) for x in places])
            weights.append([float(w.mid()) for w in share])
            integrate.append([[float(entry) for entry in row] for row in (primitive * project).mid().tolist()])
            to_legendre.append([[float(entry) for entry in row] for row in project.mid().tolist()])
    return Rules(nodes=np.array(nodes), weights=np.array(weights), integrate=np.array(integrate).swapaxes(1, 2).astype(complex), to_legendre=np.array(to_legendre))


@cache
def reading_at(m: int, x: float) -> Array:
    """Return the row that reads the interpolating polynomials at x, shape (2, m, 1)."""
    return (legendre.legvander(np.array([x]), m - 1)[0] @ rules_of(m).to_legendre)[..., None].astype(complex)


@cache
def series_of(m: int, terms: int) -> tuple[Array, Array, Array]:
    """Return x^k/k! about the centres of expansion, shape (2, points, terms): at the ends -1 and 1, at the nodes, and at the nodes with x for -x."""
    factors = np.exp(-special.gammaln(np.arange(terms) + 1))

    def table(x: Array, sign: int) -> Array:
        return (sign * (x - CENTRES[:, None]))[..., None] ** np.arange(terms) * factors

    return table(np.array([[-1.0, 1.0]] * 2), 1), table(rules_of(m).nodes, 1), table(rules_of(m).nodes, -1)


TERMS = np.array([16, 20, 24, 28, 32, 36, 40, 48, 56, 64, 80, 96, 128, 160, 200, 256, 320, 400])
REACH = np.exp((special.gammaln(TERMS + 1) - 39) / TERMS)
"""norms for which so many terms leave less than e^-39"""


def terms_for(matrix: Array) -> int:
    """Return how many terms the exponential series of every matrix needs: the bound is the spectral radius of the largest moduli."""
    bound = np.maximum.reduce(np.abs(matrix), axis=(0, 1))
    for _ in range(4):
        bound = bound @ bound
    norm = 1.1 * float(np.add.reduce(bound, axis=-1).max()) ** (1 / 16)
    return int(TERMS[min(int(np.searchsorted(REACH, norm)), TERMS.size - 1)]) if np.isfinite(norm) else 16


def doubled(matrix: Array) -> Array:
    """Return the powers of stacks of matrices, shape (2, terms, n, n, batch), by products of whole stacks: few calls, for small batches."""
    terms, (batch, n) = terms_for(matrix), matrix.shape[1:3]
    powers = np.empty((2, terms, batch, n, n), dtype=complex)
    powers[:, 0], powers[:, 1] = np.eye(n), matrix
    k = 2
    while k < terms:
        matrix = matrix @ matrix
        np.matmul(powers[:, :min(k, terms - k)], matrix[:, None], out=powers[:, k:min(2 * k, terms)])
        k *= 2
    return np.ascontiguousarray(powers.transpose(0, 1, 3, 4, 2))


class Workspace(threading.local):
    """Buffers of a thread, used again by the next algebra: fresh pages cost more than the arithmetic on them."""

    def __init__(self) -> None:
        self.buffers: dict[tuple[int, tuple[int, ...]], Array] = {}

    def zeros(self, place: int, shape: tuple[int, ...]) -> Array:
        """Return zeros in the buffer of the flow number `place` of an algebra."""
        if (place, shape) not in self.buffers:
            if len(self.buffers) > 12:
                self.buffers.clear()
            self.buffers[place, shape] = np.empty(shape, dtype=complex)
        buffer = self.buffers[place, shape]
        buffer.fill(0)
        return buffer


_WORKSPACE = Workspace()


def in_turn(operator: Operator, matrix: Array, place: int) -> Array:
    """Return the same, one power after the other, over the entries that are not zero: few operations, for large batches."""
    terms, (batch, n) = terms_for(matrix), matrix.shape[1:3]
    powers = _WORKSPACE.zeros(place, (2, terms, n, n, batch))
    powers[:, 0, range(n), range(n)] = 1
    entries = [[(j, np.ascontiguousarray(matrix[:, None, :, i, j])) for j, entry in enumerate(row) if not (isinstance(entry, int) and entry == 0)] for i, row in enumerate(operator.matrix)]
    for k in range(terms - 1):
        for i, row in enumerate(entries):
            for place, (j, entry) in enumerate(row):
                if place == 0:
                    np.multiply(entry, powers[:, k, j], out=powers[:, k + 1, i])
                else:
                    powers[:, k + 1, i] += entry * powers[:, k, j]
    return powers


@cache
def border(n: int) -> tuple[Array, Array]:
    """Return a fixed column and row of unit modulus that make a matrix of corank one regular when they border it."""
    angles = np.random.default_rng(n).uniform(0, 2 * math.pi, (2, n))
    return np.exp(1j * angles[0]), np.exp(1j * angles[1])


def each_solved(matrix: Array, right: Array) -> Array:
    """Return matrix^-1 right; NaN where a matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)[..., 0]  # type: ignore[no-any-return]
    except np.linalg.LinAlgError:
        result = np.full(matrix.shape[:-1], np.nan, dtype=complex)
        every = np.broadcast_to(right, (*matrix.shape[:-1], 1))
        for place in np.ndindex(matrix.shape[:2]):
            with suppress(np.linalg.LinAlgError):
                result[place] = np.linalg.solve(matrix[place], every[place])[..., 0]
        return result


def solved(matrix: Array, right: Array) -> Array:
    """Return matrix^-1 right for stacks of matrices and vectors, rows and columns scaled to unit size; the second rule takes the rows in reverse order.

    NaN where a matrix is singular or not finite.
    """
    columns = np.maximum.reduce(np.abs(matrix), axis=-2, keepdims=True) + 1e-300
    matrix = matrix / columns
    rows = np.maximum.reduce(np.abs(matrix), axis=-1, keepdims=True) + 1e-300
    matrix /= rows
    right = right[..., None] / rows
    matrix[1], right[1] = matrix[1, :, ::-1].copy(), right[1, :, ::-1].copy()
    result = each_solved(matrix, right)
    result /= columns[..., 0, :]
    return result


def bordered(matrix: Array, row: Array) -> Array:
    """Return the matrix with a fixed column of the size of its rows, and below it `row`."""
    n = matrix.shape[-1]
    result = np.empty((*matrix.shape[:2], n + 1, n + 1), dtype=complex)
    result[..., :n, :n] = matrix
    size = np.maximum.reduce(np.abs(matrix), axis=-1)
    result[..., :n, n] = border(n)[0] * np.maximum(size, 1e-12 * size.max(axis=-1, keepdims=True) + 1e-300)  # a row may vanish at the threshold
    result[..., n, :n] = row
    result[..., n, n] = 0
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Sizes of the rows and columns of a matrix away from the threshold: at the threshold a row or column may vanish."""

    rows: Array
    columns: Array


def scale_of(matrix: Array) -> Scale:
    """Return sizes that bring rows and columns to one."""
    size = np.abs(matrix).max(axis=(0, 1))
    columns = size.max(axis=0)
    columns[~(columns > 0)] = 1
    rows = (size / columns).max(axis=1)
    rows[~(rows > 0)] = 1
    return Scale(rows=rows, columns=columns)


def null_pair(matrix: Array, scale: Scale) -> tuple[Array, Array]:
    """Return (x, g) with matrix x + g column = 0: where g vanishes, x is the null vector; the second rule takes the rows in reverse order."""
    n = matrix.shape[-1]
    column, line = border(n)
    result = np.empty((*matrix.shape[:2], n + 1, n + 1), dtype=complex)
    np.multiply(matrix, 1 / np.outer(scale.rows, scale.columns), out=result[..., :n, :n])
    result[..., :n, n] = column
    result[..., n, :n] = line
    result[..., n, n] = 0
    result[1] = result[1, :, ::-1].copy()
    right = np.zeros((2, 1, n + 1, 1), dtype=complex)
    right[0, :, n], right[1, :, 0] = 1, 1
    solution = each_solved(result, right)
    return solution[..., :n] / scale.columns, solution[..., n]


def largest_of(functions: Sequence[Array]) -> Array:
    """Return the largest modulus of functions or numbers in each entry of the batch."""
    return np.maximum.reduce(np.abs(np.concatenate(functions, axis=-1)), axis=(0, 2))  # type: ignore[no-any-return]


class DoubleNumbers:
    """Numbers, and linear algebra without space."""

    name: ClassVar[str] = "doubles"
    one = 1.0
    zero = 0.0
    i = 1j
    pi = math.pi

    def __init__(self, *, control: Array, frequency: Array, values: dict[str, Array], scales: dict[str, Scale] | None = None) -> None:
        self.control, self.frequency, self.values = control, frequency, values
        self.batch = control.shape[1]
        self.store: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.troubles: list[tuple[Array, str]] = []
        self.scales: dict[str, Scale] = {} if scales is None else scales
        """of the critical problem and its adjoint, from where they are first met"""

    def rational(self, p: int, q: int) -> float:
        """Return p/q."""
        return p / q

    def parameter(self, name: str) -> Array:
        """Return the values of a parameter."""
        return self.values[name]

    def __getattr__(self, name: str) -> Callable[[Any], Any]:
        if name not in ELEMENTARY:
            raise AttributeError(name)

        def apply(value: Any) -> Any:
            return ELEMENTARY[name](np.asarray(value, dtype=complex))

        return apply

    def reflect(self, value: Any) -> Any:
        """Return the conjugate: functions are sampled at real s."""
        return np.conj(value)

    def number(self, value: Any) -> Array:
        """Return a number with the shape (2, batch)."""
        if isinstance(value, np.ndarray) and value.shape == (2, self.batch, 1):
            return value[..., 0]
        return np.broadcast_to(np.asarray(value, dtype=complex)[..., 0], (2, self.batch)) if np.ndim(value) else np.full((2, self.batch), value, dtype=complex)

    def table(self, rows: Sequence[Row]) -> Array:
        """Return a matrix of numbers, shape (2, batch, rows, columns)."""
        result = np.zeros((2, self.batch, len(rows), len(rows[0])), dtype=complex)
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                if isinstance(entry, np.ndarray) and entry.ndim:
                    result[..., i, j] = entry[..., 0]
                elif entry:
                    result[..., i, j] = entry
        return result

    def split(self, solution: Array) -> tuple[Array, ...]:
        """Return the components of a vector as numbers."""
        return tuple(solution[..., k:k + 1] for k in range(solution.shape[-1]))

    def scaled(self, functions: Sequence[Array], size: Array) -> tuple[Array, ...]:
        """Return the mode divided by its value at the normalisation."""
        self.troubles.append((~(np.abs(size).min(axis=(0, 2)) > 1e-10 * largest_of(functions)), "normalisation: the critical mode vanishes there"))
        share = 1 / size
        return tuple(one * share for one in functions)

    def null(self, matrix: Array, name: str) -> tuple[Array, Array]:
        """Return the null vector and what vanishes at the threshold."""
        if name not in self.scales:
            self.scales[name] = scale_of(matrix)
        return null_pair(matrix, self.scales[name])

    def criticality(self, operator: Operator) -> Array:
        """Return what vanishes at the threshold, shape (2, batch)."""
        return self.null(self.table(operator.matrix), "mode")[1]

    def kernel(self, operator: Operator, row: Row) -> tuple[Array, ...]:
        """Return y with M y = 0 and row y = 1."""
        vector = self.null(self.table(operator.matrix), "mode")[0]
        return self.scaled(self.split(vector), (self.table([row])[..., 0, :] * vector).sum(axis=-1, keepdims=True))

    def left_kernel(self, operator: Operator) -> tuple[Array, ...]:
        """Return z with z M = 0."""
        return self.split(self.null(self.table(operator.matrix).swapaxes(-1, -2), "adjoint")[0])

    def solve(self, operator: Operator, forcing: Row) -> tuple[Array, ...]:
        """Return y with M y = forcing."""
        return self.split(solved(self.table(operator.matrix), self.table([forcing])[..., 0, :]))

    def solve_singular(self, operator: Operator, forcing: Row, row: Row) -> tuple[Array, ...]:
        """Return y with M y = forcing and row y = 0, for a singular M and a forcing in its range."""
        matrix = bordered(self.table(operator.matrix), self.table([row])[..., 0, :])
        return self.split(solved(matrix, self.table([[*forcing, 0]])[..., 0, :])[..., :-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Fundamental matrices: at the ends of panels (2, batch, panels or 1, n, n), and what applies them at the nodes."""

    start: Array
    finish: Array
    apply: Callable[[Array], Array]
    """(2, batch, panels, n) constants or (2, batch, panels, m, n) values to (2, batch, panels, m, n)"""
    unapply: Callable[[Array], Array]
    """the same by the inverse matrices"""


class Doubles(DoubleNumbers):
    """Functions at m nodes on each of equal panels."""

    def __init__(self, *, ends: tuple[float, float], nodes: int, panels: int, **common: Any) -> None:
        super().__init__(**common)
        self.left_end, self.length = ends[0], ends[1] - ends[0]
        self.nodes, self.panels, self.rules = nodes, panels, rules_of(nodes)
        self.half = self.length / (2 * panels)
        middles = self.left_end + self.half * (2 * np.arange(panels) + 1)
        self.s = (middles[:, None] + self.half * self.rules.nodes[:, None, :]).reshape(2, 1, -1).astype(complex)
        self.weights = np.tile(self.rules.weights * self.half, (1, panels))[:, None, :]
        self.flows: dict[int, tuple[Operator, Flow, Array]] = {}

    def is_function(self, value: Any) -> bool:
        """Tell a function from a number."""
        return isinstance(value, np.ndarray) and value.ndim == 3 and value.shape[-1] == self.s.shape[-1]

    def function(self, value: Any) -> Array:
        """Return a number as a constant function."""
        if isinstance(value, np.ndarray) and value.shape == (2, self.batch, self.s.shape[-1]):
            return value
        return np.broadcast_to(np.asarray(value, dtype=complex), (2, self.batch, self.s.shape[-1]))

    def integral(self, value: Any) -> Array:
        """Return the integral over the interval."""
        self.counts["integrals"] = self.counts.get("integrals", 0) + 1
        return np.add.reduce(self.function(value) * self.weights, axis=-1, keepdims=True)

    def integral_from_left(self, value: Any) -> Array:
        """Return the integral from the left end to s."""
        values = self.function(value)
        inside = (values.reshape(2, -1, self.nodes) @ self.rules.integrate).reshape(2, self.batch, self.panels, self.nodes) * self.half
        if self.panels > 1:
            totals = (values * self.weights).reshape(inside.shape).sum(axis=-1, keepdims=True)
            inside = inside + (np.cumsum(totals, axis=2) - totals)
        return inside.reshape(2, self.batch, -1)

    def integral_to_right(self, value: Any) -> Array:
        """Return the integral from s to the right end."""
        return self.integral(value) - self.integral_from_left(value)

    def left(self, value: Any) -> Array:
        """Return the value at the left end."""
        return self.function(value)[..., :self.nodes] @ reading_at(self.nodes, -1.0)

    def right(self, value: Any) -> Array:
        """Return the value at the right end."""
        return self.function(value)[..., -self.nodes:] @ reading_at(self.nodes, 1.0)

    def row_at(self, row: Row, place: Any) -> tuple[int, Array, Array]:
        """Return panel, reading row (2, m, 1) and the row's numbers, for row y at a place."""
        position = (float(np.real(place)) - self.left_end) / (2 * self.half)
        k = min(max(int(position), 0), self.panels - 1)
        return k, reading_at(self.nodes, 2 * (position - k) - 1), self.table([row])[..., 0, :]

    # Linear problems

    def end_rows(self, operator: Operator) -> tuple[Array, Array]:
        """Return the boundary rows as numbers."""
        def rows(lines: Sequence[Row], read: Callable[[Any], Array]) -> Array:
            if not lines:
                return np.zeros((2, self.batch, 0, operator.size), dtype=complex)
            return self.table([[read(entry) if self.is_function(entry) else entry for entry in line] for line in lines])

        return rows(operator.left, self.left), rows(operator.right, self.right)

    def flow(self, operator: Operator) -> tuple[Flow, Array]:
        """Return the flow, and the matrix of boundary rows and continuity for the constants of all panels."""
        if id(operator) not in self.flows:
            constant = not any(self.is_function(entry) for row in operator.matrix for entry in row)
            flow = self.exponential(operator) if constant else self.collocated(operator)
            self.flows[id(operator)] = (operator, flow, self.joined(operator, flow))
        return self.flows[id(operator)][1:]

    def joined(self, operator: Operator, flow: Flow) -> Array:
        """Return boundary rows and y(end of panel k) = y(start of panel k + 1), shape (2, batch, n panels, n panels)."""
        left, right = self.end_rows(operator)
        n, p = operator.size, self.panels
        k = left.shape[2]
        matrix = np.zeros((2, self.batch, n * p, n * p), dtype=complex)
        matrix[..., :k, :n] = left @ flow.start[:, :, 0]
        matrix[..., k:n, n * (p - 1):] = right @ flow.finish[:, :, -1]
        if p == 1:
            return matrix
        start, finish = (np.broadcast_to(one, (2, self.batch, p, n, n)) for one in (flow.start, flow.finish))
        for j in range(p - 1):
            matrix[..., n * (j + 1):n * (j + 2), n * j:n * (j + 1)] = finish[:, :, j]
            matrix[..., n * (j + 1):n * (j + 2), n * (j + 1):n * (j + 2)] = -start[:, :, j + 1]
        return matrix

    def exponential(self, operator: Operator) -> Flow:
        """Return exp(P (s - s_k)) as a power series about s_k on each panel."""
        matrix = self.table(operator.matrix) * self.half
        powers = in_turn(operator, matrix, len(self.flows)) if self.batch >= 16 else doubled(matrix)
        terms = powers.shape[1]
        at_ends, nodes, backwards = series_of(self.nodes, terms)

        def summed(weights: Array, sequence: Array) -> Array:
            """Return sum_k weights[k] sequence[k], batch last: real times complex."""
            flat = sequence.view(float).reshape(2, terms, -1)
            return (weights @ flat).view(complex).reshape(2, weights.shape[1], *sequence.shape[2:])

        ends = summed(at_ends, powers).transpose(0, 4, 1, 2, 3)

        def through(weights: Array) -> Callable[[Array], Array]:
            def apply(values: Array) -> Array:
                if values.ndim == 4 and self.panels == 1:  # constants: the powers act on the vector
                    columns = values[:, :, 0].transpose(0, 2, 1)
                    sequence = powers[:, :, :, 0] * columns[:, None, None, 0]
                    for j in range(1, columns.shape[1]):
                        sequence += powers[:, :, :, j] * columns[:, None, None, j]
                    return summed(weights, sequence).transpose(0, 3, 1, 2)[:, :, None]  # type: ignore[no-any-return]
                table = summed(weights, powers).transpose(0, 4, 1, 2, 3)
                return (table[:, :, None] @ (values[:, :, :, None] if values.ndim == 4 else values)[..., None])[..., 0]  # type: ignore[no-any-return]
            return apply

        return Flow(start=ends[:, :, 0:1], finish=ends[:, :, 1:2], apply=through(nodes), unapply=through(backwards))

    def collocated(self, operator: Operator) -> Flow:
        """Return the fundamental matrix that is 1 at the left end of each panel, for coefficients that depend on s."""
        n, m, p = operator.size, self.nodes, self.panels
        table = np.zeros((2, self.batch, p, m, n, n), dtype=complex)
        for i, row in enumerate(operator.matrix):
            for j, entry in enumerate(row):
                if not isinstance(entry, int) or entry:
                    table[..., i, j] = self.function(entry).reshape(2, self.batch, p, m)
        integrate = self.rules.integrate.real.swapaxes(1, 2) * self.half
        # v = P (1 + J v): unknown slopes (node, component), one right-hand side for each column of 1
        system = -(table[..., :, :, None, :] * integrate[:, None, None, :, None, :, None]).reshape(2, self.batch, p, m * n, m * n)
        system[..., np.arange(m * n), np.arange(m * n)] += 1
        right = table.reshape(2, self.batch, p, m * n, n)
        bad = np.logical_not(np.isfinite(system).all(axis=(-2, -1)))
        system[bad] = np.eye(m * n)
        slopes = np.linalg.solve(system, np.where(np.asarray(bad)[..., None, None], 0, right).astype(complex)).reshape(2, self.batch, p, m, n * n)
        slopes[bad] = np.nan
        one = np.eye(n)
        nodes = (integrate[:, None, None] @ slopes).reshape(2, self.batch, p, m, n, n) + one
        finish = ((self.rules.weights * self.half)[:, None, None, None] @ slopes).reshape(2, self.batch, p, n, n) + one

        def apply(values: Array) -> Array:
            return (nodes @ (values[:, :, :, None, :, None] if values.ndim == 4 else values[..., None]))[..., 0]

        def unapply(values: Array) -> Array:
            return np.linalg.solve(nodes, values[..., None])[..., 0]

        return Flow(start=np.broadcast_to(one.astype(complex), finish.shape), finish=finish, apply=apply, unapply=unapply)

    def functions(self, values: Array) -> tuple[Array, ...]:
        """Return (2, batch, panels, m, n) as n functions."""
        return tuple(np.ascontiguousarray(values[..., k]).reshape(2, self.batch, -1) for k in range(values.shape[-1]))

    def criticality(self, operator: Operator) -> Array:
        """Return what vanishes at the threshold, shape (2, batch)."""
        self.counts["criticality"] = self.counts.get("criticality", 0) + 1
        return self.null(self.flow(operator)[1], "mode")[1]

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Array, ...]:  # type: ignore[override]
        """Return y with homogeneous boundary rows; row y = 1 at `place`, or of unit size."""
        flow, matrix = self.flow(operator)
        constants = self.null(matrix, "adjoint" if row is None else "mode")[0].reshape(2, self.batch, self.panels, operator.size)
        functions = self.functions(flow.apply(constants))
        if row is None:
            return functions
        k, reading, numbers = self.row_at(row, place)
        values = np.concatenate([one[..., k * self.nodes:(k + 1) * self.nodes] @ reading for one in functions], axis=-1)
        return self.scaled(functions, (numbers * values).sum(axis=-1, keepdims=True))

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row) -> tuple[Array, ...]:  # type: ignore[override]
        """Return y with y' = P y + forcing and the boundary rows equal to `left` and `right`."""
        return self.forced(operator, forcing, left, right, None)

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[Array, ...]:  # type: ignore[override]
        """Return the solution with row y = 0 at `place` of a singular problem with a forcing that it can bear."""
        return self.forced(operator, forcing, left, right, (row, place))

    def forced(self, operator: Operator, forcing: Row, left: Row, right: Row, extra: tuple[Row, Any] | None) -> tuple[Array, ...]:
        """Return Phi (c_k + U), U the integral of Phi^-1 f from the start of the panel."""
        self.counts["solves"] = self.counts.get("solves", 0) + 1
        n, m, p = operator.size, self.nodes, self.panels
        flow, matrix = self.flow(operator)
        source = np.stack([self.function(entry).reshape(2, self.batch, p, m) for entry in forcing], axis=-1)
        pulled = flow.unapply(source) * self.half
        inside = self.rules.integrate.swapaxes(1, 2)[:, None, None] @ pulled
        total = (self.rules.weights[:, None, None, None] @ pulled)[..., 0, :]
        start, finish = (np.broadcast_to(one, (2, self.batch, p, n, n)) for one in (flow.start, flow.finish))
        end = (finish @ total[..., None])[..., 0]
        data = np.zeros((2, self.batch, n * p), dtype=complex)
        lines_left, lines_right = self.end_rows(operator)
        k = lines_left.shape[2]
        for j, entry in enumerate(left):
            data[..., j] = self.number(entry)
        for j, entry in enumerate(right):
            data[..., k + j] = self.number(entry)
        data[..., k:n] -= (lines_right @ end[:, :, p - 1, :, None])[..., 0]
        data[..., n:] = -end[:, :, :p - 1].reshape(2, self.batch, -1)
        if extra is None:
            constants = solved(matrix, data)
        else:
            where, reading, numbers = self.row_at(*extra)
            row = np.zeros((2, self.batch, n * p), dtype=complex)
            for j in range(n):  # the row read on the j-th fundamental solution
                unit = np.zeros((2, self.batch, p, n), dtype=complex)
                unit[..., where, j] = 1
                row[..., where * n + j] = ((flow.apply(unit)[:, :, where].swapaxes(-1, -2) @ reading[:, None])[..., 0] * numbers).sum(axis=-1)
            known = ((flow.apply(inside)[:, :, where].swapaxes(-1, -2) @ reading[:, None])[..., 0] * numbers).sum(axis=-1)
            constants = solved(bordered(matrix, row), np.concatenate([data, -known[..., None]], axis=-1))[..., :-1]
        shape = constants.reshape(2, self.batch, p, 1, n)
        return self.functions(flow.apply(shape + inside))


__all__ = ["DoubleNumbers", "Doubles", "rules_of"]
