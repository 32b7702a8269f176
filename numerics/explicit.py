r"""Recorded problems in double precision: two kernel problems with constant coefficients on one panel, and the tape of the coefficients.

Numbers have the shape (rules, batch), on the tape (rules, 1, batch), functions (rules, nodes, batch): the batch comes last, so that products with numbers
run along it. The boundary matrix is that of :math:`e^{P(s - c)}`, c the centre of expansion; bordered by a fixed column and row it gives the
mode and what vanishes at the threshold.

A few entries take few calls, powers of P by doubling; large batches few operations, Horner's rule row by row without the zeros and ones of P,
and one order of pivots for all entries.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np
from scipy import special

from numerics.doubles import CENTRES, Array, Scale, border, rules_of
from numerics.tape import NotRecorded, Problem, Recorded, Tape

LARGE = 4
"""from this batch on few operations count more than few calls"""
TAPE = 256
"""entries of a piece of the tape"""
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
        self.run = tape.compiled([flat[place] for place in self.changing], parameters).run
        self.flat = [0 if isinstance(entry, Recorded) else entry for entry in flat]
        self.through = horner_of(self.flat, self.changing, self.n)
        self.template = np.array(self.flat[:2 * self.n**2], dtype=complex)
        self.column, self.line = (one * size for one, size in zip(border(self.n), (scale.rows, scale.columns), strict=True))
        self.solve: list[tuple[Callable[[Any], list[Any]], ...]] = []
        """for each rule: what vanishes at the threshold, that with the null vector, and the same for the transposed matrix"""

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
        """Return how many terms of the exponential series every entry of the batch needs: moduli are rounded up to a power of 2^(1/16)."""
        sizes = [float(np.abs(entry).max()) if place < self.n**2 else 0.0 for place, entry in zip(self.changing, changing, strict=True)]
        key = tuple(math.ceil(16 * math.log2(size)) if 0 < size < math.inf else -1600 for size in sizes)
        return self.terms_known(key, half)

    @lru_cache(maxsize=256)  # noqa: B019  (an evaluator keeps few of these)
    def terms_known(self, key: tuple[int, ...], half: float) -> int:
        """Return the same by logarithms of the moduli."""
        bound = np.abs(self.template[:self.n**2])
        for place, size in zip(self.changing, key, strict=True):
            if place < bound.size:
                bound[place] = 2.0 ** (size / 16)
        radius = 1.05 * half * float(np.abs(np.linalg.eigvals(bound.reshape(self.n, self.n))).max())  # of the moduli: it bounds the exponents
        terms = 8
        while terms < 400 and terms * math.log(radius + 1e-9) - math.lgamma(terms + 1) > -38 + radius / 2:
            terms += 2
        return terms


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


def horner_of(flat: Sequence[Any], changing: Sequence[int], n: int) -> Callable[[Sequence[Any], Sequence[Sequence[float]], int], list[Array]]:
    """Return the function (entries, weights, batch) that sums weights[k][row] row P^k over k by Horner's rule, the last k first: for each column an array (rows, batch)."""
    names = {place: f"e[{k}]" for k, place in enumerate(changing)}

    def entry_of(place: int) -> str:
        return names.get(place) or ("" if is_zero(flat[place]) else repr(flat[place]))

    lines = ["def through(e, weights, batch):", f"    {', '.join(f'u{j}' for j in range(n))}, = (zeros(({n}, batch), complex) for _ in range({n}))", "    for w in weights:"]
    taken: set[int] = set()
    for j in range(n):
        total = ""
        for i in range(n):
            entry = entry_of(n * i + j)
            if entry in ("1", "-1", "1.0", "-1.0"):
                sign = "-" if entry[0] == "-" else "+" if total else ""
                total += f" {sign} u{i}"
                if not total.strip(f" u{i}"):
                    total += ".copy()" if i in taken else ""
                    taken.add(i)
            elif entry:
                total += f" {'+' if total else ''} {entry} * u{i}"
        lines.append(f"        t{j} = {total.strip() or f'zeros(({n}, batch), complex)'}")
    lines.append("        " + "; ".join(f"u{j} = t{j}" for j in range(n)))
    for r in range(n):
        for j in range(n):
            entry = entry_of(n * n + n * r + j)
            lines += [f"        u{j}[{r}] += w[{r}]" + (f" * {entry}" if entry not in ("1", "1.0") else "")] if entry else []
    lines.append(f"    return [{', '.join(f'u{j}' for j in range(n))}]")
    found: dict[str, Any] = {"zeros": np.zeros}
    exec(compile("\n".join(lines), "<horner>", "exec"), found)  # noqa: S102  (text made above)
    return found["through"]  # type: ignore[no-any-return]


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


def elimination_of(order: Sequence[tuple[int, int]], whole: bool) -> Callable[[Sequence[Sequence[Any]]], list[Any]]:
    """Return the function of the rows of a bordered system, its last row equal to 1 and the others to 0, that gives [*x, g], or only g; entries are numbers or arrays."""
    n = len(order)
    left, columns, right = list(range(n + 1)), list(range(n)), [""] * n + ["1"]
    lines = ["def solve(rows):", f"    {''.join('(' + ''.join(f'a{i}_{j}, ' for j in range(n + 1)) + '), ' for i in range(n + 1))} = rows"]
    for r, c in order:
        left.remove(r)
        columns.remove(c)
        lines.append(f"    inverse = 1 / a{r}_{c}")
        for other in left:
            lines.append(f"    share = a{other}_{c} * inverse")
            lines += [f"    a{other}_{j} = a{other}_{j} - share * a{r}_{j}" for j in (*columns, n)]
            if right[r]:
                lines.append(f"    b{other} = {right[other]} - share * {right[r]}")
                right[other] = f"b{other}"
    lines.append(f"    g = {right[left[0]]} / a{left[0]}_{n}")
    for r, c in reversed(order) if whole else ():
        lines.append(f"    x{c} = ({right[r]} - a{r}_{n} * g{''.join(f' - a{r}_{j} * x{j}' for j in columns)}) / a{r}_{c}")
        columns.append(c)
    lines.append(f"    return [{''.join(f'x{j}, ' for j in range(n)) if whole else ''}g]")
    found: dict[str, Any] = {}
    exec(compile("\n".join(lines), "<elimination>", "exec"), found)  # noqa: S102  (text made above)
    return found["solve"]  # type: ignore[no-any-return]


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
        self.tape = tape.compiled(outputs, parameters)
        self.kernel = Kernel(tape, tape.problems["mode"], parameters, scale)
        adjoint = tape.problems["adjoint"].operator
        self.adjoint_run = tape.compiled([entry for lines in (adjoint.matrix, adjoint.left, adjoint.right) for line in lines for entry in line], parameters).run
        self.nodes, self.half = nodes, (ends[1] - ends[0]) / 2
        self.counts: dict[str, int] = {}
        self.places = (-1.0, 1.0, (self.kernel.place - ends[0]) / self.half - 1)
        rules = rules_of(nodes)
        weights, before = rules.weights[:, None, :] * self.half, rules.integrate.real.swapaxes(1, 2) * self.half
        self.tables = {"integral": weights, "before": np.ascontiguousarray(before), "after": weights - before}
        self.some = [*range(0, nodes, max(1, nodes // 4)), nodes, nodes + 1]

    def prepare(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> None:
        """Choose the orders of pivots at a threshold, and make sure that the adjoint mode taken from the critical problem is that of the emitted text."""
        kernel, n = self.kernel, self.kernel.n
        matrix, powers, lines = self.bordered(control, frequency, parameters)
        scaled = matrix[:, 0].copy()
        scaled[:, :-1] /= kernel.scale.rows[:, None]
        scaled[:, :, :-1] /= kernel.scale.columns
        kernel.solve = []
        for rule, one in enumerate(scaled):
            order, transposed_order = pivots(one, rule == 0), pivots(one.T, rule == 0)
            kernel.solve.append((elimination_of(order, False), elimination_of(order, True), elimination_of(transposed_order, True)))
        adjoint = stacked_lines(self.adjoint_run(control, frequency, parameters), n, control.shape)
        transposed = stacked_lines([-lines[j][i] for i in range(n) for j in range(n)], n, control.shape)
        (_, adjoints), terms, _ = self.sequences(control, frequency, parameters)
        at_ends = series(self.nodes, self.half, self.places, terms)[0]
        ends = np.stack([(at_ends @ one)[..., 0] for one, _ in adjoints], axis=1)
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

    def null_of(self, matrix: Array, which: int) -> Array:
        """Return g (0), or (x, g) of a few bordered matrices (1) or of their transposes (2)."""
        result = []
        for solve, some in zip(self.kernel.solve, matrix.tolist(), strict=False):
            for rows in some:
                try:
                    result.append(solve[which](rows))
                except ZeroDivisionError:
                    result.append([math.nan] * (len(rows) if which else 1))
        return np.array(result, dtype=complex).reshape(*matrix.shape[:2], -1)

    def rows(self, rule: int, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[list[list[Any]], list[list[Any]], int]:
        """Return the bordered matrix of one rule as lists of arrays, the lines of the problem and the number of terms."""
        kernel, n = self.kernel, self.kernel.n
        lines, changing = kernel.numbers(control, frequency, parameters)
        terms = kernel.terms(changing, self.half)
        ends = series(self.nodes, self.half, self.places, terms)[0][rule]
        columns = kernel.through(changing, ends[[0] * kernel.k + [1] * (n - kernel.k), ::-1].T.tolist(), control.size)
        return [*([*(columns[j][i] for j in range(n)), kernel.column[i]] for i in range(n)), [*kernel.line, 0.0]], lines, terms

    def criticality(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> Array:
        """Return what vanishes at the threshold, shape (rules, batch)."""
        self.count("residuals")
        if control.shape[1] < LARGE:
            return self.null_of(self.bordered(control, frequency, parameters)[0], 0)[..., -1]
        return np.array([self.kernel.solve[rule][0](self.rows(rule, c, w, [one[rule] for one in parameters])[0])[0]
                         for rule, (c, w) in enumerate(zip(control, frequency, strict=True))])

    def determinant(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> Array:
        """Return the phase of the critical determinant, by the first rule."""
        n = self.kernel.n
        if control.shape[1] < LARGE:
            return np.linalg.slogdet(self.bordered(control, frequency, parameters)[0][0, :, :n, :n])[0]  # type: ignore[no-any-return]
        rows = self.rows(0, control[0], frequency[0], [one[0] for one in parameters])[0]
        return np.linalg.slogdet(np.moveaxis(np.array([row[:n] for row in rows[:n]]), -1, 0))[0]  # type: ignore[no-any-return]

    def sequences(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[list[list[tuple[Array, int]]], int, Sequence[Any]]:
        """Return what the power series of mode and adjoint mode multiply: for each component (rules, terms, batch) and its sign; the terms; the normalising row.

        With l M = 0 for the rows M of the boundary matrix, those of the left end give the adjoint mode at the centre: z = sum l_i M_i meets z' = -P^T z,
        and at the ends it is a combination of the boundary rows.
        """
        kernel, (rules, batch) = self.kernel, control.shape
        n, k = kernel.n, kernel.k
        if batch < LARGE:
            matrix, powers, lines = self.bordered(control, frequency, parameters)
            start = self.null_of(matrix.swapaxes(-1, -2), 2)[..., None, :k] @ matrix[..., :k, :n]
            direct, adjoint = powers @ self.null_of(matrix, 1)[:, None, :, :n, None], start[:, None] @ powers
            adjoint[:, 1::2] *= -1
            return [[(np.ascontiguousarray(one[..., j]), 1) for j in range(n)] for one in (direct[..., 0], adjoint[..., 0, :])], powers.shape[1], lines[2 * n]
        parts = [self.rows(rule, control[rule], frequency[rule], [one[rule] for one in parameters]) for rule in range(rules)]
        terms = max(part[2] for part in parts)
        made = []
        for rule, (rows, lines, _) in enumerate(parts):
            _, whole, transposed = kernel.solve[rule]
            weights = transposed(list(zip(*rows, strict=True)))[:k]
            initial = [sum(weight * row[j] for weight, row in zip(weights, rows, strict=False)) for j in range(n)]
            made.append((recurred(lines[:n], whole(rows)[:n], terms), recurred([[negative(lines[j][i]) for j in range(n)] for i in range(n)], initial, terms)))
        row = [np.stack(np.broadcast_arrays(*entries)) if isinstance(entries[0], np.ndarray) else entries[0] for entries in zip(*(part[1][2 * n] for part in parts), strict=True)]
        both = [[(np.stack([one[which][j][0] for one in made]) if rules > 1 else made[0][which][j][0][None], made[0][which][j][1]) for j in range(n)] for which in (0, 1)]
        return both, terms, row

    # Coefficients

    def values(self, control: Array, frequency: Array, parameters: Sequence[Array]) -> tuple[dict[str, Array], Array, list[tuple[Array, str]]]:
        """Return the coefficients, shape (rules, batch), how ill-conditioned each entry is, and the entries that have none, with the reason."""
        self.count("kernels")
        rules, batch = control.shape
        (modes, adjoints), terms, row = self.sequences(control, frequency, parameters)
        table = series(self.nodes, self.half, self.places, terms)[1][:rules]
        signed = {1: table, -1: -table}
        at_place = table[:, None, -1]
        numbers = [one[:, None].astype(complex) for one in (control, frequency, *parameters)]
        # the mode is one at its place: its power series is divided by the value there
        size: Any = sum((sign * entry if np.ndim(entry) == 0 else sign * entry[:, None]) * (at_place @ one.view(float)).view(complex) for entry, (one, sign) in zip(row, modes, strict=True) if not is_zero(entry))
        share = 1 / size
        pieces = [self.piece(slice(k, k + TAPE), modes, adjoints, signed, share, numbers) for k in range(0, batch, TAPE)]
        values = {name: np.concatenate(parts, axis=-1) for name, parts in zip(self.identifiers, zip(*(one[0] for one in pieces), strict=True), strict=True)}
        total, largest, other = (np.concatenate(parts, axis=-1) for parts in zip(*(one[1:] for one in pieces), strict=True))
        scale, whole = largest * other, np.abs(total).min(axis=0)
        return values, 1 + scale / whole, [(~(largest < 1e10), "normalisation: the critical mode vanishes there")]

    def piece(self, some: slice, modes: list[tuple[Array, int]], adjoints: list[tuple[Array, int]], signed: dict[int, Array], share: Array, numbers: list[Array]) -> tuple[list[Array], Array, Array, Array]:
        """Return coefficients, xi and the sizes of the modes for some entries: what one piece needs stays in the cache."""
        self.count("tapes")
        c, w, *others = (one[..., some] for one in numbers)
        rules, m, batch = c.shape[0], self.nodes, c.shape[-1]
        places, count = m + 3, self.tape.buffers
        room = WORKSPACE.room((len(self.tape.used), rules, places, batch))
        functions: dict[str, dict[int, Array]] = {"mode": {}, "adjoint": {}}
        ends: dict[str, dict[int, list[Array]]] = {"mode": {}, "adjoint": {}}
        for out, (name, j) in zip(room, self.tape.used, strict=True):
            one, sign = (modes if name == "mode" else adjoints)[j]
            np.matmul(signed[sign], one[..., some].view(float), out=out.view(float))
            if name == "mode":
                out *= share[..., some]
            functions[name][j] = out[:, :m]
            ends[name][j] = [out[:, m + end, None] for end in (0, 1)]
        total, *results = self.tape.run(c, w, others, functions, ends, {name: table[:rules] for name, table in self.tables.items()}, WORKSPACE.room((count, rules, m, batch)))
        kinds = [name == "mode" for name, _ in self.tape.used]
        moduli = np.abs(room[:, :, self.some]).max(axis=(1, 2))
        sizes = [moduli[[kind == which for kind in kinds]].max(axis=0) for which in (True, False)]
        return [one[:, 0] if isinstance(one, np.ndarray) else np.full((rules, batch), one) for one in results], total[:, 0], *sizes  # type: ignore[return-value]

def negative(entry: Any) -> Any:
    """Return -entry, a plain zero for zero."""
    return entry if is_zero(entry) else -entry


def stacked_lines(entries: Sequence[Any], n: int, shape: tuple[int, ...]) -> Array:
    """Return numbers and arrays, line after line, as arrays of matrices."""
    result = np.zeros((*shape, len(entries)), dtype=complex)
    for place, entry in enumerate(entries):
        result[..., place] = entry
    return result.reshape(*shape, -1, n)


def recurred(matrix: Numbers, vector: Sequence[Any], terms: int) -> list[tuple[Array, int]]:
    """Return P^k vector for each component, shape (terms, batch), and a sign: y_i' = y_j makes the sequence of y_j that of y_i less its first, kept once."""
    n = len(matrix)
    lines = [[(j, entry) for j, entry in enumerate(line) if not is_zero(entry)] for line in matrix]
    unit = [int(line[0][0]) if len(line) == 1 and not isinstance(line[0][1], np.ndarray) and line[0][1] in (1, -1) else None for line in lines]
    spots: dict[int, tuple[int, int, int]] = {}  # component: chain, shift, sign
    chains: list[int] = []  # the last component of each chain
    for root in sorted(range(n), key=lambda j: j in unit):
        j, shift, sign = root, 0, 1
        if root in spots:
            continue
        while True:
            spots[j] = (len(chains), shift, sign)
            following = unit[j]
            if following is None or following in spots:
                break
            j, shift, sign = following, shift + 1, sign * int(lines[j][0][1])
        chains.append(j)
    batch = np.broadcast(*vector).size
    kept = [np.empty((terms + n, batch), dtype=complex) for _ in chains]
    for j, (chain, shift, sign) in spots.items():
        np.multiply(vector[j], sign, out=kept[chain][shift])
    steps = []
    for chain, j in enumerate(chains):
        _, shift, sign = spots[j]
        steps.append((kept[chain][shift + 1:], [(kept[spots[i][0]][spots[i][1]:], entry * (sign * spots[i][2])) for i, entry in lines[j]]))
    for k in range(terms - 1):
        for sequence, parts in steps:
            if k < len(sequence):
                out = sequence[k]
                if not parts:
                    out[...] = 0
                for place, (source, entry) in enumerate(parts):
                    if place == 0:
                        np.multiply(entry, source[k], out=out)
                    elif isinstance(entry, np.ndarray):
                        out += entry * source[k]
                    else:
                        (np.add if entry == 1 else np.subtract)(out, source[k] if entry in (1, -1) else -entry * source[k], out=out)
    return [(kept[spots[j][0]][spots[j][1]:spots[j][1] + terms], spots[j][2]) for j in range(n)]


class Workspace(threading.local):
    """Buffers of a thread, used again by the next piece: fresh pages cost more than the arithmetic on them."""

    def __init__(self) -> None:
        self.rooms: dict[tuple[int, ...], Array] = {}

    def room(self, shape: tuple[int, ...]) -> Array:
        """Return an array of that shape, whatever it holds."""
        if shape not in self.rooms:
            if len(self.rooms) > 12:
                self.rooms.clear()
            self.rooms[shape] = np.empty(shape, dtype=complex)
        return self.rooms[shape]


WORKSPACE = Workspace()


__all__ = ["Explicit"]
