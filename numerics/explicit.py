r"""Recorded problems in double precision: two kernel problems with constant coefficients on one panel, and the tape of the coefficients.

Numbers have the shape (rules, batch), on the tape (rules, 1, batch), functions (rules, nodes, batch): the batch comes last, so that products with numbers
run along it. The boundary matrix is that of :math:`e^{P(s - c)}`, c the centre of expansion; bordered by a fixed column and row it gives the
mode and what vanishes at the threshold.

Small batches take few calls, powers of P by doubling and LAPACK; large ones few operations, Horner's rule row by row without the zeros and ones of P,
and one order of pivots for all entries.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np
from scipy import special

from numerics.doubles import CENTRES, Array, Scale, border, each_solved, rules_of, terms_for
from numerics.tape import NotRecorded, Problem, Recorded, Tape

LARGE = 24
"""from this batch on few operations count more than few calls"""
Numbers = Sequence[Sequence[Any]]


class Kernel:
    """The critical problem: its text, and the orders of pivots of each rule for the bordered matrix and its transpose."""

    def __init__(self, tape: Tape, problem: Problem, parameters: Sequence[str], scale: Scale) -> None:
        operator = problem.operator
        self.n, self.k = operator.size, len(operator.left)
        self.row, self.place, self.scale = problem.row or (), problem.place, scale
        lines = [*operator.matrix, *operator.left, *operator.right, self.row]
        flat = [entry for line in lines for entry in line]
        self.changing = [place for place, entry in enumerate(flat) if isinstance(entry, Recorded)]
        self.run = tape.compiled([flat[place] for place in self.changing], parameters)
        self.flat = [0 if isinstance(entry, Recorded) else entry for entry in flat]
        self.template = np.array(self.flat[:2 * self.n**2], dtype=complex)
        self.column, self.line = (one * size for one, size in zip(border(self.n), (scale.rows, scale.columns), strict=True))
        self.order: list[tuple[list[tuple[int, int]], list[tuple[int, int]]]] = []

    def numbers(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[list[list[Any]], tuple[Any, ...]]:
        """Return the lines of the matrix, the boundary rows and the normalising row, an entry being a number or an array, and the entries that change."""
        flat, n = self.flat.copy(), self.n
        changing = self.run(control, frequency, parameters)
        for place, entry in zip(self.changing, changing, strict=True):
            flat[place] = entry
        return [flat[place:place + n] for place in range(0, len(flat), n)], changing

    def stacked(self, changing: Sequence[Any], shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Return P and the boundary rows as arrays of matrices."""
        flat = np.empty((*shape, self.template.size), dtype=complex)
        flat[...] = self.template
        for place, entry in zip(self.changing, changing, strict=True):
            if place < self.template.size:
                flat[..., place] = entry
        whole = flat.reshape(*shape, 2 * self.n, self.n)
        return whole[..., :self.n, :], whole[..., self.n:, :]

    def terms(self, changing: Sequence[Any], half: float) -> int:
        """Return how many terms of the exponential series every entry of the batch needs: moduli are rounded up to a power of 2^(1/4)."""
        sizes = [float(np.abs(entry).max()) if place < self.n**2 else 0.0 for place, entry in zip(self.changing, changing, strict=True)]
        key = tuple(math.ceil(4 * math.log2(size)) if 0 < size < math.inf else -400 for size in sizes)
        return self.terms_known(key, half)

    @lru_cache(maxsize=256)  # noqa: B019  (an evaluator keeps few of these)
    def terms_known(self, key: tuple[int, ...], half: float) -> int:
        """Return the same by logarithms of the moduli."""
        bound = np.abs(self.template[:self.n**2])
        for place, size in zip(self.changing, key, strict=True):
            if place < bound.size:
                bound[place] = 2.0 ** (size / 4)
        return terms_for(half * bound.reshape(1, 1, self.n, self.n))


def is_zero(entry: Any) -> bool:
    """Tell a plain zero."""
    return not isinstance(entry, np.ndarray) and entry == 0


@cache
def series(m: int, half: float, places: tuple[float, ...], terms: int) -> tuple[Array, Array]:
    """Return x^k/k! about the centres: at the ends, shape (2, 2, terms), and at the nodes and further places, shape (2, m + places, terms)."""
    factors = np.exp(-special.gammaln(np.arange(terms) + 1))
    spots = np.concatenate([rules_of(m).nodes, np.tile(np.array(places), (2, 1))], axis=1)
    ends, inside = ((half * (x - CENTRES[:, None]))[..., None] ** np.arange(terms) * factors for x in (np.array([[-1.0, 1.0]] * 2), spots))
    return ends, inside


def through(matrix: Numbers, rows: Numbers, weights: Array, shape: int) -> list[Array]:
    """Return sum_k weights[row, k] row P^k by Horner's rule: for each column an array (rows, batch)."""
    n = len(matrix)
    columns = [[(i, matrix[i][j]) for i in range(n) if not is_zero(matrix[i][j])] for j in range(n)]
    entries = [(r, j, entry) for r, row in enumerate(rows) for j, entry in enumerate(row) if not is_zero(entry)]
    sums = [np.zeros((len(rows), shape), dtype=complex) for _ in range(n)]
    for k in range(weights.shape[1] - 1, -1, -1):
        if k < weights.shape[1] - 1:
            before, taken = sums, set()
            sums = []
            for column in columns:
                total: Any = None
                for i, entry in column:
                    if not isinstance(entry, np.ndarray) and entry in (1, -1):
                        if total is None:
                            total = (before[i] if i not in taken else before[i].copy()) if entry == 1 else -before[i]
                            taken.add(i)
                        else:
                            total = total + before[i] if entry == 1 else total - before[i]
                    else:
                        total = entry * before[i] if total is None else total + entry * before[i]
                sums.append(np.zeros((len(rows), shape), dtype=complex) if total is None else total)
        for r, j, entry in entries:
            sums[j][r] += weights[r, k] * entry
    return sums


def pivots(matrix: Array, complete: bool) -> list[tuple[int, int]]:
    """Return the order of elimination of a bordered matrix, its last column left to the end: complete pivoting, or by columns."""
    matrix, n = matrix.copy(), matrix.shape[0] - 1
    rows, columns, order = list(range(n + 1)), list(range(n)), []
    for step in range(n):
        some = columns if complete else [step]
        size = np.abs(matrix[np.ix_(rows, some)])
        i, j = np.unravel_index(int(np.argmax(size)), size.shape)
        r, c = rows[i], some[j]
        order.append((r, c))
        rows.remove(r)
        columns.remove(c)
        for other in rows:
            matrix[other] -= matrix[other, c] / matrix[r, c] * matrix[r]
    return order


def eliminated(rows: list[list[Any]], order: Sequence[tuple[int, int]], whole: bool) -> tuple[list[Any], Any]:
    """Return (x, g) of the bordered system, its last row equal to 1 and the others to 0, entries being arrays; x only where `whole`."""
    n = len(rows) - 1
    left, columns, right = list(range(n + 1)), list(range(n)), [0] * n + [1]
    for r, c in order:
        left.remove(r)
        columns.remove(c)
        inverse = 1 / rows[r][c]
        for other in left:
            share = rows[other][c] * inverse
            for j in (*columns, n):
                rows[other][j] = rows[other][j] - share * rows[r][j]
            if not (isinstance(right[r], int) and right[r] == 0):
                right[other] = right[other] - share * right[r]
    g = right[left[0]] / rows[left[0]][n]
    x: list[Any] = [None] * n
    for r, c in reversed(order) if whole else ():
        total = right[r] - rows[r][n] * g
        for j in columns:
            total = total - rows[r][j] * x[j]
        x[c] = total / rows[r][c]
        columns.append(c)
    return x, g


class Explicit:
    """Threshold condition and coefficients of a recorded problem."""

    def __init__(self, names: Mapping[str, Any], ends: tuple[float, float], nodes: int, parameters: Sequence[str], scale: Scale) -> None:
        tape = Tape(ends)
        identifiers = [identifier for _, _, identifier in names["COEFFICIENTS"]] + [name for name, _, _ in names["WEAK"]]
        if names["QUADRATIC"] is not None:
            identifiers.append(names["QUADRATIC"][2])
        self.identifiers = tuple(identifiers)
        outputs = [names["xi"](tape), *(names[identifier](tape) for identifier in identifiers)]
        names["mode"](tape), names["adjoint_mode"](tape)
        self.run = tape.compiled(outputs, parameters)
        self.kernel = Kernel(tape, tape.problems["mode"], parameters, scale)
        adjoint = tape.problems["adjoint"].operator
        self.adjoint_run = tape.compiled([entry for lines in (adjoint.matrix, adjoint.left, adjoint.right) for line in lines for entry in line], parameters)
        self.nodes, self.half = nodes, (ends[1] - ends[0]) / 2
        self.counts: dict[str, int] = {}
        self.places = (-1.0, 1.0, (self.kernel.place - ends[0]) / self.half - 1)
        rules = rules_of(nodes)
        self.weights = rules.weights[:, None, :] * self.half
        self.before = rules.integrate.real.swapaxes(1, 2) * self.half
        self.after = self.weights - self.before
        self.some = [*range(0, nodes, max(1, nodes // 4)), nodes, nodes + 1]

    def prepare(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> None:
        """Choose the orders of pivots at a threshold, and make sure that the adjoint mode taken from the critical problem is that of the emitted text."""
        kernel, n = self.kernel, self.kernel.n
        matrix, powers, lines = self.bordered(control, frequency, parameters)
        scaled = matrix[:, 0].copy()
        scaled[:, :-1] /= kernel.scale.rows[:, None]
        scaled[:, :, :-1] /= kernel.scale.columns
        kernel.order = [(pivots(one, rule == 0), pivots(one.T, rule == 0)) for rule, one in enumerate(scaled)]
        adjoint = stacked_lines(self.adjoint_run(control, frequency, parameters), n, control.shape)
        transposed = stacked_lines([-lines[j][i] for i in range(n) for j in range(n)], n, control.shape)
        ends = self.functions(control, frequency, parameters)[1][:, :, self.nodes:self.nodes + 2, 0]
        k = n - kernel.k
        left, right = adjoint[:, 0, n:n + k] @ ends[:, :, :1], adjoint[:, 0, n + k:] @ ends[:, :, 1:]
        apart = max(float(np.abs(one).max(initial=0)) for one in (left, right)) / (float(np.abs(ends).max()) * (1 + float(np.abs(adjoint[:, :, n:]).max())))
        if not (np.abs(adjoint[:, :, :n] - transposed).max() <= 1e-12 * np.abs(transposed).max() and apart < 1e-7):
            raise NotRecorded("an adjoint in another form")

    def count(self, what: str) -> None:
        """Count what costs time."""
        self.counts[what] = self.counts.get(what, 0) + 1

    # The critical problem

    def bordered(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[Array, Array, Any]:
        """Return the bordered boundary matrices (rules, batch, n + 1, n + 1) by doubling, with the powers of P (rules, terms, batch, n, n) and the lines of the problem."""
        kernel = self.kernel
        n, k, (rules, batch) = kernel.n, kernel.k, control.shape
        lines, changing = kernel.numbers(control, frequency, parameters)
        matrix, rows = kernel.stacked(changing, control.shape)
        terms = kernel.terms(changing, self.half)
        powers = np.empty((rules, terms, batch, n, n), dtype=complex)
        powers[:, 0], powers[:, 1] = np.eye(n), matrix
        done = 2
        while done < terms:
            matrix = matrix @ matrix
            np.matmul(powers[:, :min(done, terms - done)], matrix[:, None], out=powers[:, done:min(2 * done, terms)])
            done *= 2
        table = series(self.nodes, self.half, self.places, terms)[0][:rules]
        ends = (table @ powers.reshape(rules, terms, -1).view(float)).view(complex).reshape(rules, 2, batch, n, n)
        result = np.empty((rules, batch, n + 1, n + 1), dtype=complex)
        np.matmul(rows[..., :k, :], ends[:, 0], out=result[..., :k, :n])
        np.matmul(rows[..., k:, :], ends[:, 1], out=result[..., k:n, :n])
        result[..., :n, n], result[..., n, :n], result[..., n, n] = kernel.column, kernel.line, 0
        return result, powers, lines

    def rows(self, rule: int, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[list[list[Any]], list[list[Any]], int]:
        """Return the bordered matrix of one rule as lists of arrays, the lines of the problem and the number of terms."""
        kernel, n = self.kernel, self.kernel.n
        lines, changing = kernel.numbers(control, frequency, parameters)
        terms = kernel.terms(changing, self.half)
        ends = series(self.nodes, self.half, self.places, terms)[0][rule]
        columns = through(lines[:n], lines[n:2 * n], ends[[0] * kernel.k + [1] * (n - kernel.k)], control.size)
        return [*([*(columns[j][i] for j in range(n)), kernel.column[i]] for i in range(n)), [*kernel.line, 0.0]], lines, terms

    def criticality(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> Array:
        """Return what vanishes at the threshold, shape (rules, batch)."""
        self.count("residuals")
        n = self.kernel.n
        if control.shape[1] < LARGE:
            return null_of(self.bordered(control, frequency, parameters)[0])[..., n]  # type: ignore[no-any-return]
        return np.array([eliminated(self.rows(rule, c, w, [one[rule] for one in parameters])[0], self.kernel.order[rule][0], False)[1]
                         for rule, (c, w) in enumerate(zip(control, frequency, strict=True))])

    def determinant(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> Array:
        """Return the phase of the critical determinant, by the first rule."""
        n = self.kernel.n
        if control.shape[1] < LARGE:
            return np.linalg.slogdet(self.bordered(control, frequency, parameters)[0][0, :, :n, :n])[0]  # type: ignore[no-any-return]
        rows = self.rows(0, control[0], frequency[0], [one[0] for one in parameters])[0]
        return np.linalg.slogdet(np.moveaxis(np.array([row[:n] for row in rows[:n]]), -1, 0))[0]  # type: ignore[no-any-return]

    def functions(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[Array, Array, Sequence[Any]]:
        """Return mode and adjoint mode at nodes, ends and the place of the normalisation, shape (rules, n, places, batch), and the normalising row.

        With l M = 0 for the rows M of the boundary matrix, those of the left end give the adjoint mode at the centre: z = sum l_i M_i meets z' = -P^T z,
        and at the ends it is a combination of the boundary rows.
        """
        kernel, (rules, batch) = self.kernel, control.shape
        n, k = kernel.n, kernel.k
        if batch < LARGE:
            matrix, powers, lines = self.bordered(control, frequency, parameters)
            terms, row = powers.shape[1], lines[2 * n]
            vector = null_of(matrix)[:, None, :, :n, None]
            weights = null_of(matrix.swapaxes(-1, -2))[..., None, :k] if k else None
            start = weights @ matrix[..., :k, :n] if weights is not None else None
            if start is None:
                raise NotRecorded("no rows at the left end")
            sequences = [(powers @ vector)[..., 0], (start[:, None] @ powers)[..., 0, :]]
            sequences[1][:, 1::2] *= -1
            pair = np.ascontiguousarray(np.stack(sequences).transpose(0, 1, 4, 2, 3))
        else:
            parts = [self.rows(rule, control[rule], frequency[rule], [one[rule] for one in parameters]) for rule in range(rules)]
            terms = max(part[2] for part in parts)
            pair = np.empty((2, rules, n, terms, batch), dtype=complex)
            for rule, (rows, lines, _) in enumerate(parts):
                first, second = kernel.order[rule]
                weights = eliminated([[rows[i][j] for i in range(n + 1)] for j in range(n + 1)], second, True)[0][:k]
                start = [sum(weight * row[j] for weight, row in zip(weights, rows, strict=False)) for j in range(n)]
                recurred(lines[:n], eliminated(rows, first, True)[0], pair[0, rule])
                recurred([[negative(lines[j][i]) for j in range(n)] for i in range(n)], start, pair[1, rule])
            row = [np.stack(np.broadcast_arrays(*entries)) if isinstance(entries[0], np.ndarray) else entries[0] for entries in zip(*(part[1][2 * n] for part in parts), strict=True)]
        table = series(self.nodes, self.half, self.places, terms)[1][:rules, None]
        modes, adjoints = (table @ pair.view(float)).view(complex)
        return modes, adjoints, row

    # Coefficients

    def values(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[dict[str, Array], Array, list[tuple[Array, str]]]:
        """Return the coefficients, shape (rules, batch), how ill-conditioned each entry is, and the entries that have none, with the reason."""
        self.count("kernels")
        self.count("tapes")
        rules, m = control.shape[0], self.nodes
        modes, adjoints, row = self.functions(control, frequency, parameters)
        size: Any = sum(entry * modes[:, j, m + 2] for j, entry in enumerate(row) if not is_zero(entry))
        largest = self.largest(modes)
        smallest = np.abs(size).min(axis=0)
        modes *= (1 / size)[:, None, None]

        def by(table: Array) -> Callable[[Array], Array]:
            return lambda function: (table @ function.view(float)).view(complex)

        both = {"mode": modes, "adjoint": adjoints}
        functions = {name: [one[:, j, :m] for j in range(one.shape[1])] for name, one in both.items()}
        ends = {name: [one[:, j, m:m + 2].swapaxes(0, 1)[:, :, None] for j in range(one.shape[1])] for name, one in both.items()}
        c, w, *others = (one[:, None].astype(complex) for one in (control, frequency, *parameters))
        total, *results = self.run(c, w, others, functions, ends, by(self.weights[:rules]), by(self.before[:rules]), by(self.after[:rules]))
        scale = largest / smallest * self.largest(adjoints)
        whole = np.abs(total).min(axis=(0, 1))
        troubles = [(~(whole > 1e-9 * scale), "threshold: the product of direct and adjoint mode vanishes: the critical eigenvalue is defective"),
                    (~(smallest > 1e-10 * largest), "normalisation: the critical mode vanishes there")]
        return {name: one[:, 0] if isinstance(one, np.ndarray) else np.full(control.shape, one) for name, one in zip(self.identifiers, results, strict=True)}, 1 + scale / whole, troubles

    def largest(self, functions: Array) -> Array:
        """Return about the largest modulus of functions in each entry of the batch."""
        return np.abs(functions[:, :, self.some]).max(axis=(0, 1, 2))  # type: ignore[no-any-return]


def negative(entry: Any) -> Any:
    """Return -entry, a plain zero for zero."""
    return entry if is_zero(entry) else -entry


def null_of(matrix: Array) -> Array:
    """Return (x, g) of bordered matrices; the second rule takes the rows in reverse order."""
    right = np.zeros((len(matrix), 1, matrix.shape[-1], 1), dtype=complex)
    right[0, :, -1] = 1
    if len(matrix) > 1:
        matrix = np.stack([matrix[0], matrix[1, :, ::-1]])
        right[1, :, 0] = 1
    return each_solved(matrix, right)


def stacked_lines(entries: Sequence[Any], n: int, shape: tuple[int, ...]) -> Array:
    """Return numbers and arrays, line after line, as arrays of matrices."""
    result = np.zeros((*shape, len(entries)), dtype=complex)
    for place, entry in enumerate(entries):
        result[..., place] = entry
    return result.reshape(*shape, -1, n)


def recurred(matrix: Numbers, vector: Sequence[Array], sequence: Array) -> None:
    """Write P^k vector for each k, shape (n, terms, batch)."""
    for out, entry in zip(sequence[:, 0], vector, strict=True):
        out[...] = entry
    lines = [[(j, entry) for j, entry in enumerate(line) if not is_zero(entry)] for line in matrix]
    for k in range(1, sequence.shape[1]):
        for line, out in zip(lines, sequence[:, k], strict=True):
            if not line:
                out[...] = 0
            for place, (j, entry) in enumerate(line):
                if place:
                    out += entry * sequence[j, k - 1]
                elif not isinstance(entry, np.ndarray) and entry in (1, -1):
                    (np.positive if entry == 1 else np.negative)(sequence[j, k - 1], out=out)
                else:
                    np.multiply(entry, sequence[j, k - 1], out=out)


__all__ = ["Explicit"]
