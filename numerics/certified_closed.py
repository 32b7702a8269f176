r"""The closed form in balls: sums of exponentials whose exponents and coefficients are enclosures.

The characteristic exponents are the roots of a polynomial in balls, in discs that are proved to hold one each. Which exponents are
exactly equal, opposite or conjugate is never read off balls but follows from structure: the adjoint has the opposite exponents;
where the entries of P connect two classes of unknowns only, exponents come as opposite pairs; those of a real matrix come as
conjugate pairs. What needs more (an exponent of the forcing that meets a characteristic one, multiple exponents other than 0) is
left to power series.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import flint
import numpy as np
from flint import acb, acb_mat, arb

from numerics.algebra import Operator, Row, number, scaled_to
from numerics.certified_linear import Enclosing, Unproved, kernel, pivots, schur, solved, solved_singular, upper
from numerics.closed import BASE, Closed, ExponentialSum, combined, unpacked
from numerics.precision import NotClosed

DIRECT = 640
"""Up to so many bits the determinant comes from the matrix exponential, which has no trouble with exponents that coincide."""


class CertifiedClosed(Enclosing, Closed):
    """The certified algebra of exponential sums."""

    name: ClassVar[str] = "closed"

    def __init__(self, **common: Any) -> None:
        super().__init__(**common)
        self.partners: list[tuple[int, int]] = []  # (index, sign) of the conjugate of each basic exponent

    # Exponents

    def add_basis(self, values: Sequence[acb], real: bool) -> list[int]:
        """Return keys for new basic exponents; of a real matrix the set is closed under conjugation and sign."""
        first = len(self.basis)
        if not real:
            for value in values:
                index = len(self.basis)
                self.basis += [value, value.conjugate()]
                self.partners += [(index + 1, 1), (index, 1)]
            return [BASE ** (first + 2 * k) for k in range(len(values))]
        self.basis += list(values)
        for value in values:
            mirrored = value.conjugate()
            found = [(first + k, sign) for k, other in enumerate(values) for sign in (1, -1) if mirrored.overlaps(other if sign == 1 else -other)]
            if len(found) != 1:
                raise Unproved("found characteristic exponents whose conjugates are not told apart")
            self.partners.append(found[0])
        return [BASE ** (first + k) for k in range(len(values))]

    def key(self, value: acb) -> int:
        """Return the key of an exponent that a coefficient of the equations holds."""
        if value.is_zero():
            return 0
        for index, known in enumerate(self.basis):
            if known.is_exact() and value.is_exact() and (known == value or known == -value):
                return int(BASE**index) if known == value else -int(BASE**index)
        return self.add_basis([value], False)[0]

    def exponent(self, key: int) -> acb:
        """Return the enclosure of an exponent."""
        if key not in self.exponents:
            self.exponents[key] = sum((self.basis[index] * count for index, count in unpacked(key)), acb(0))
        return self.exponents[key]

    def reflected_key(self, key: int) -> int:
        """Return the key of the conjugate exponent."""
        total = 0
        for index, count in unpacked(key):
            partner, sign = self.partners[index]
            total += sign * count * BASE**partner
        return total

    def constant_matrix(self, operator: Operator) -> list[list[acb]]:
        """Return P, or say that it depends on s."""
        result = []
        for row in operator.matrix:
            line = []
            for entry in row:
                if isinstance(entry, ExponentialSum):
                    if set(entry.terms) - {0} or len(entry.terms.get(0, [acb(0)])) > 1:
                        raise NotClosed("the coefficients depend on s")
                    entry = entry.terms.get(0, [acb(0)])[0]
                line.append(number(entry))
            result.append(line)
        return result

    def flow(self, operator: Operator, adjoint: bool = False) -> tuple[list[list[ExponentialSum]], list[tuple[acb, int, int]]]:
        """Return n independent solutions of y' = P y, as columns, and the exponents (value, multiplicity, key)."""
        known = self.flows.get(id(operator))
        if known is not None:
            return known[1], known[2]
        matrix = self.constant_matrix(operator)
        n = len(matrix)
        if adjoint:  # the emitted adjoint is -P^T
            exponents = [(-value, multiplicity, -key) for value, multiplicity, key in self.flow(self.store["critical"])[1]]
        else:
            exponents = self.exponents_of(matrix)
        columns: list[list[ExponentialSum]] = []
        for sigma, multiplicity, key in exponents:
            if multiplicity == 1:
                shifted = [[entry - sigma if i == j else entry for j, entry in enumerate(row)] for i, row in enumerate(matrix)]
                columns.append([ExponentialSum(self, {key: [value]}) for value in kernel(shifted)])
                continue
            power = acb_mat([[1 if i == j else 0 for j in range(n)] for i in range(n)])
            powers = [power]
            for _ in range(multiplicity):
                power = power * acb_mat(matrix)
                powers.append(power)
            for vector in null_space(power.tolist(), multiplicity):
                chain = []
                factor = 1
                for k in range(multiplicity):  # exp(P x) v = sum_k P^k v x^k / k!
                    chain.append([row[0] / factor for row in (powers[k] * acb_mat([[value] for value in vector])).tolist()])
                    factor *= k + 1
                columns.append([ExponentialSum(self, {0: [chain[k][i] for k in range(multiplicity)]}) for i in range(n)])
        self.flows[id(operator)] = (operator, columns, exponents)
        return columns, exponents

    def exponents_of(self, matrix: list[list[acb]]) -> list[tuple[acb, int, int]]:
        """Return the eigenvalues of P as (enclosure, multiplicity, key); only zero may be multiple."""
        coefficients = list(acb_mat(matrix).charpoly())
        n = len(matrix)
        paired = bipartite(matrix)
        if paired:  # p(-x) = +-p(x)
            coefficients = [c if (n - k) % 2 == 0 else acb(0) for k, c in enumerate(coefficients)]
        zeros = 0
        while zeros < n and coefficients[zeros].is_zero():
            zeros += 1
        real = all(entry.imag.is_zero() for row in matrix for entry in row)
        rest = coefficients[zeros:]
        result: list[tuple[acb, int, int]] = []
        if len(rest) > 1:
            values = [z.sqrt() for z in isolated_roots(rest[::2])] if paired else isolated_roots(rest)
            if any(value.contains(0) for value in values):
                raise NotClosed("a characteristic exponent is not told from zero")
            for value, key in zip(values, self.add_basis(values, real), strict=True):
                result.append((value, 1, key))
                if paired:
                    result.append((-value, 1, -key))
        if zeros:
            result.append((acb(0), zeros, 0))
        return result

    # Linear problems

    def defect(self, operator: Operator, corner: tuple[int, int]) -> acb:
        """Return det[S; T exp(PL)]: from the matrix exponential at few bits, from the exponents at many."""
        if flint.ctx.prec <= DIRECT:
            flow = (acb_mat(self.constant_matrix(operator)) * self.length).exp()
            rows = [[self.end(entry, self.left) for entry in row] for row in operator.left]
            right = [[self.end(entry, self.right) for entry in row] for row in operator.right]
            return determinant(rows + ((acb_mat(right) * flow).tolist() if right else []))
        columns, _ = self.flow(operator)
        start = acb_mat([[self.left(column[i]) for column in columns] for i in range(len(columns))])
        return determinant(self.boundary_matrix(operator, columns)) / start.det()

    def end(self, entry: Any, place: Any) -> acb:
        """Return an entry of a boundary row as a number."""
        return place(entry) if isinstance(entry, ExponentialSum) else number(entry)

    def corner(self, operator: Operator) -> tuple[int, int]:
        """No corner is needed: the determinant itself is used."""
        return (0, 0)

    def at_place(self, row: Row, functions: Sequence[ExponentialSum], place: Any) -> acb:
        """Return row y at a place."""
        x = number(place) - self.left_end
        x = self.length if x.is_exact() and x == self.length else x
        return sum((number(c) * y.at(x) for c, y in zip(row, functions, strict=True) if not isinstance(c, int) or c), acb(0))

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[ExponentialSum, ...]:
        """Return y with homogeneous boundary rows; row y = 1 at `place`. Without a row the operator is the adjoint, and the size is any."""
        columns, _ = self.flow(operator, adjoint=row is None)
        solution = combined(kernel(self.boundary_matrix(operator, columns)), columns)
        return tuple(solution) if row is None else scaled_to(solution, self.at_place(row, solution, place))

    def particular(self, operator: Operator, forcing: Row) -> list[ExponentialSum]:
        """Return a solution of y' = P y + forcing."""
        matrix = self.constant_matrix(operator)
        n = len(matrix)
        characteristic = {key for _, _, key in self.flow(operator)[1]}
        sources = [self.function(entry).terms for entry in forcing]
        result: list[dict[int, list[acb]]] = [{} for _ in range(n)]
        for key in sorted({key for source in sources for key in source}):
            if key in characteristic:
                raise NotClosed("the forcing holds a characteristic exponent")
            degree = max(len(source.get(key, ())) for source in sources) - 1
            mu = self.exponent(key)
            system = acb_mat([[mu - entry if i == j else -entry for j, entry in enumerate(row)] for i, row in enumerate(matrix)])
            parts: list[list[acb]] = [[]] * (degree + 1)
            for k in range(degree, -1, -1):
                given = [source[key][k] if key in source and k < len(source[key]) else acb(0) for source in sources]
                right = [given[i] - ((k + 1) * parts[k + 1][i] if k < degree else 0) for i in range(n)]
                try:
                    parts[k] = [line[0] for line in system.solve(acb_mat([[entry] for entry in right])).tolist()]
                except ZeroDivisionError as near:
                    raise NotClosed("a forcing exponent is not told from a characteristic one") from near
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
        if extra is None:
            weights = solved(rows, data)
        else:
            line = [self.at_place(extra[0], column, extra[1]) for column in columns]
            weights = solved_singular(rows, data, line, -self.at_place(extra[0], particular, extra[1]))
        return tuple(a + b for a, b in zip(combined(weights, columns), particular, strict=True))

    def probes(self, value: Any) -> list[acb]:
        """Return the function at a few places."""
        return [self.function(value).at(self.length * k / 4) for k in range(5)]


def determinant(rows: list[list[acb]]) -> acb:
    """Return the determinant of a matrix that may be nearly singular: expansion where it is small, else over a regular minor."""
    n = len(rows)
    if n > 6:
        row, column = pivots(rows)
        minor = acb_mat([[entry for k, entry in enumerate(line) if k != column] for index, line in enumerate(rows) if index != row])
        return schur(rows, (row, column)) * minor.det() * (-1) ** (row + column)
    known: dict[int, acb] = {0: acb(1)}
    for i, row_values in enumerate(rows):  # minors of the first rows, by sets of columns
        following: dict[int, acb] = {}
        for mask, minor_value in known.items():
            for j, entry in enumerate(row_values):
                if not mask >> j & 1 and not entry.is_zero():
                    term = entry * minor_value
                    term = -term if (i - (mask & ((1 << j) - 1)).bit_count()) % 2 else term
                    following[mask | 1 << j] = following[mask | 1 << j] + term if mask | 1 << j in following else term
        known = following
    return known.get((1 << n) - 1, acb(0))


def bipartite(matrix: list[list[acb]]) -> bool:
    """Tell whether the entries that are not exactly zero connect two classes of unknowns only: then the spectrum is symmetric about 0."""
    n = len(matrix)
    side: dict[int, int] = {}
    for seed in range(n):
        if seed in side:
            continue
        side[seed] = 0
        pending = [seed]
        while pending:
            i = pending.pop()
            for j in range(n):
                if matrix[i][j].is_zero() and matrix[j][i].is_zero():
                    continue
                if j not in side:
                    side[j] = 1 - side[i]
                    pending.append(j)
                elif side[j] == side[i]:
                    return False
    return True


def isolated_roots(coefficients: list[acb]) -> list[acb]:
    """Return discs that hold one root each of the polynomial (lowest power first), or refuse.

    With approximate roots z_i and W_i = p(z_i) / prod_j (z_i - z_j) the discs of radius n |W_i| about z_i hold all roots, and each that
    is disjoint from the others holds one (Smith). The approximate roots come from doubles by Newton's method at doubling precision.
    """
    n = len(coefficients) - 1
    lead = coefficients[-1]
    monic = [c / lead for c in coefficients]
    if n == 1:
        return [-monic[0]]
    if n == 2:
        half = -monic[1] / 2
        square = half * half - monic[0]
        if square.contains(0):
            raise NotClosed("two characteristic exponents are not told apart")
        root = square.sqrt()
        return [half + root, half - root]
    middle = [c.mid() for c in monic]
    size = max(float(abs(c)) ** (1 / (n - k)) for k, c in enumerate(middle[:-1]))
    if not np.isfinite(size) or size == 0:
        raise NotClosed("the characteristic exponents are out of the range of doubles")
    doubles = [complex(c / acb(size) ** (n - k)) for k, c in enumerate(middle)]
    roots = []
    for guess in np.roots(doubles[::-1]):
        z = acb(float(guess.real), float(guess.imag)) * acb(size)
        for _ in range(8 + flint.ctx.prec.bit_length()):
            value, slope = middle[-1], acb(0)
            for c in reversed(middle[:-1]):
                slope = slope * z + value
                value = value * z + c
            step = (value / slope).mid()
            z = (z - step).mid()
            if not z.is_finite():
                raise NotClosed("two characteristic exponents nearly coincide")
            if step == 0 or abs(step) < abs(z) * arb(2) ** (-flint.ctx.prec // 2 - 8):
                break
        roots.append(z)
    discs = []
    for i, z in enumerate(roots):
        spread, value = acb(1), monic[-1]
        for j, other in enumerate(roots):
            if j != i:
                spread = spread * (z - other)
        for c in reversed(monic[:-1]):
            value = value * z + c
        radius = upper(value / spread) * n
        if not radius.is_finite():
            raise NotClosed("two characteristic exponents are not told apart")
        discs.append(z + acb(arb(0, radius), arb(0, radius)))
    if any(one.overlaps(other) for k, one in enumerate(discs) for other in discs[:k]):
        raise NotClosed("two characteristic exponents are not told apart")
    if all(c.imag.is_zero() for c in coefficients):  # a disc that meets none but its own mirror image holds a real root
        return [acb(one.real) if sum(one.conjugate().overlaps(other) for other in discs) == 1 and one.imag.contains(0) else one for one in discs]
    return discs


def null_space(rows: list[list[acb]], dimension: int) -> list[list[acb]]:
    """Return `dimension` independent null vectors of a matrix that is known to have so many."""
    n = len(rows)
    unit = [[acb(1) if i == j else acb(0) for i in range(n)] for j in range(n)]
    if dimension == n:
        return unit
    middle = [[entry.mid() for entry in row] for row in rows]
    left, free, chosen = list(range(n)), list(range(n)), []
    for _ in range(n - dimension):  # complete pivoting on the midpoints chooses rows and columns; the solution in balls proves them
        index, k = max(((i, j) for i in left for j in free), key=lambda at: abs(middle[at[0]][at[1]]))  # noqa: B023
        for i in left:
            if i != index:
                factor = middle[i][k] / middle[index][k]
                middle[i] = [(a - factor * b).mid() for a, b in zip(middle[i], middle[index], strict=True)]
        left.remove(index)
        free.remove(k)
        chosen.append((index, k))
    columns = [k for _, k in chosen]
    vectors = []
    for own in free:
        values = solved([[rows[i][k] for k in columns] for i, _ in chosen], [-rows[i][own] for i, _ in chosen])
        vector = list(unit[own])
        for k, value in zip(columns, values, strict=True):
            vector[k] = value
        vectors.append(vector)
    return vectors
