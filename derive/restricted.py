r"""The restricted linear problem in the fields of the statement: L, S, T, their adjoints, and the boundary form J.

The rows of the critical weight, in the harmonic of the critical mode, form :math:`L\psi = f`, :math:`S\psi = g`, :math:`T\psi = h`, as the
paper writes them (labels ``matrix operators``, ``J factor``, ``adjoint problem``). With
:math:`\langle a, b\rangle = \int a^{*}\cdot b\,ds` the adjoint follows by parts; the adjoint boundary rows are those that annihilate the
boundary form on the null space of S and of T. The first-order system of `derive.operator` is not used: the two confirm each other.

A problem with a rotation axis is written in + components; an entry that belongs to a field or row of odd parity under reflections
carries i, which in vectors is :math:`n\times`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

from sympy import Expr, I, Integer, Matrix, Symbol

from derive.expand import expand
from derive.expansion import Expansion, TaylorRow
from derive.functions import Functions
from derive.operator import FirstOrderOperator
from derive.solvability import Solvability
from derive.statement import DerivationError

Entry = dict[int, Expr]
"""{order of the space derivative: coefficient}"""
JetColumn = tuple[int, int]
"""(column of the array field, order of the space derivative)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class RestrictedProblem:
    """L, S, T in + components with the parity of every row and field under reflections that hold the axis.

    Attributes
    ----------
    fields
        The unknowns, one column each.
    operator
        L: one row for each equation, an entry {derivative: coefficient} a column.
    left, right
        S and T: rows {(column, derivative): coefficient}.
    parity, row_parity, left_parity, right_parity
        +1 for a true vector (or a scalar), -1 for a pseudovector.
    rows, left_rows, right_rows
        Which Taylor row each came from.
    """

    fields: tuple[int, ...]
    operator: tuple[tuple[Entry, ...], ...]
    left: tuple[dict[JetColumn, Expr], ...]
    right: tuple[dict[JetColumn, Expr], ...]
    parity: tuple[int, ...]
    row_parity: tuple[int, ...]
    left_parity: tuple[int, ...]
    right_parity: tuple[int, ...]
    rows: tuple[int, ...]
    left_rows: tuple[int, ...]
    right_rows: tuple[int, ...]
    space: Symbol

    def adjoint(self) -> tuple[tuple[Entry, ...], ...]:
        """Return L^dagger: (c d^k)^dagger = (-1)^k d^k c^*, row by row."""
        size = len(self.fields)
        result = []
        for i in range(size):
            line: list[Entry] = []
            for j in range(size):
                entry: Entry = {}
                for k, c in self.operator[j][i].items():
                    for m in range(k + 1):  # d^k (c^* .) = sum binom(k, m) (d^(k-m) c^*) d^m
                        value = expand((-1) ** k * comb(k, m) * conjugate(c).diff(self.space, k - m))
                        entry[m] = expand(entry.get(m, Integer(0)) + value)
                line.append({m: value for m, value in entry.items() if value != 0})
            result.append(tuple(line))
        return tuple(result)

    def boundary_form(self) -> dict[tuple[JetColumn, JetColumn], Expr]:
        r"""Return J: {(jet of psi_1, jet of psi_2): coefficient} of :math:`[\cdots]` at the ends, conjugate-linear in psi_1."""
        total: dict[tuple[JetColumn, JetColumn], Expr] = {}
        for i, line in enumerate(self.operator):
            for j, entry in enumerate(line):
                for k, c in entry.items():
                    for m in range(k):  # int (c d^k u)^* v = sum_m (-1)^m [d^(k-1-m) u^* d^m (c^* v)] + ...
                        for p in range(m + 1):
                            value = (-1) ** m * comb(m, p) * conjugate(c).diff(self.space, m - p)
                            key = ((j, k - 1 - m), (i, p))
                            total[key] = expand(total.get(key, Integer(0)) + value)
        return {key: value for key, value in sorted(total.items()) if value != 0}

    def adjoint_rows(self, side: str, place: Expr) -> tuple[tuple[dict[JetColumn, Expr], int], ...]:
        """Return the adjoint boundary rows at an end with their parity: what makes J vanish there for every psi that meets the direct rows."""
        form = {key: value.subs(self.space, place) for key, value in self.boundary_form().items()}
        direct = self.left if side == "left" else self.right
        jets = sorted({one for one, _ in form} | {jet for row in direct for jet in row})
        duals = sorted({other for _, other in form})
        if {jet for row in direct for jet in row} - {one for one, _ in form}:
            raise DerivationError("a boundary row holds a derivative that the boundary form does not")
        if direct:
            basis = Matrix([[row.get(jet, Integer(0)) for jet in jets] for row in direct]).nullspace()
        else:
            basis = [Matrix([1 if k == j else 0 for k in range(len(jets))]) for j in range(len(jets))]
        rows = [[sum((conjugate(vector[a]) * form.get((jet, dual), Integer(0)) for a, jet in enumerate(jets)), Integer(0)) for dual in duals] for vector in basis]
        if not rows:
            return ()
        reduced, pivots = Matrix(rows).rref(simplify=True)
        result = []
        for k in range(len(pivots)):
            row = {dual: expand(reduced[k, a]) for a, dual in enumerate(duals) if expand(reduced[k, a]) != 0}
            lead = min(row)
            result.append((row, self.row_parity[lead[0]]))
        return tuple(result)


def conjugate(expression: Expr) -> Expr:
    """Return the conjugate of a coefficient: all its symbols are real."""
    return expression.xreplace({I: -I})


def restricted_problem(expansion: Expansion, weight: int, growth: Expr) -> RestrictedProblem:
    """Return L, S and T of the critical weight.

    Raises
    ------
    DerivationError
        The rows of that weight are not as many as the fields (redundant rows), or have no parity under reflections.
    """
    fields = tuple(unknown.index for unknown in expansion.formulation.unknowns if unknown.weight == weight)
    column = {index: j for j, index in enumerate(fields)}
    rows = {kind: linear_rows(stated, weight, column, growth) for kind, stated in expansion.groups}
    if len(rows["row"]) != len(fields):
        raise DerivationError("the rows of the critical weight are not as many as its fields")
    parity, row_parity = parities(expansion, weight, column, growth, rows)

    def parity_of(kind: str) -> tuple[int, ...]:
        return tuple(row_parity.get((kind, number), 1) for number in rows[kind])

    return RestrictedProblem(
        fields=fields,
        operator=tuple(tuple({ds: value for (j, ds), value in sorted(row.items()) if j == k} for k in range(len(fields))) for row in rows["row"].values()),
        left=tuple(rows["left"].values()), right=tuple(rows["right"].values()), parity=tuple(parity.get(j, 1) for j in range(len(fields))),
        row_parity=parity_of("row"), left_parity=parity_of("left"), right_parity=parity_of("right"),
        rows=tuple(rows["row"]), left_rows=tuple(rows["left"]), right_rows=tuple(rows["right"]), space=expansion.formulation.space,
    )


def linear_rows(rows: Sequence[TaylorRow], weight: int, column: Mapping[int, int], growth: Expr) -> dict[int, dict[JetColumn, Expr]]:
    """Return {number: linear part in the harmonic} of the rows of one weight; `column` maps its unknowns to columns."""
    result: dict[int, dict[JetColumn, Expr]] = {}
    for number, row in enumerate(rows):
        total: dict[JetColumn, Expr] = {}
        for (unknown, ds, dt), c in row.linear().items():
            if row.weight == weight and unknown in column:
                key = (column[unknown], ds)
                total[key] = expand(total.get(key, Integer(0)) + c * growth**dt)
        total = {key: value for key, value in total.items() if value != 0}
        if total:
            result[number] = total
    return result


def parities(expansion: Expansion, weight: int, column: Mapping[int, int], growth: Expr,
             rows: Mapping[str, Mapping[int, Mapping[JetColumn, Expr]]]) -> tuple[dict[int, int], dict[tuple[str, int], int]]:
    """Return {column: parity} and {(kind, row): parity} under reflections that hold the axis, from the normalised field on.

    A reflection exchanges the circular components: a row is compared with that of the opposite weight.
    """
    mirrored: Mapping[str, Mapping[int, Mapping[JetColumn, Expr]]] = rows
    if weight:
        unknowns = expansion.formulation.unknowns
        partner = {next(other.index for other in unknowns if other.field == unknowns[index].field and other.weight == -weight): j for index, j in column.items()}
        mirrored = {}
        for kind, stated in expansion.groups:
            opposite = linear_rows(stated, -weight, partner, growth)
            if len(opposite) != len(rows[kind]):
                raise DerivationError("the two senses of rotation have different rows")
            mirrored[kind] = dict(zip(rows[kind], opposite.values(), strict=True))
    parity = {column[index]: 1 for index in expansion.formulation.normalised if index in column}
    row_parity: dict[tuple[str, int], int] = {}
    everything = [(kind, number, row) for kind, group in rows.items() for number, row in group.items()]
    for _ in range(len(everything) + len(column)):
        for kind, number, row in everything:
            for key, value in row.items():
                other = mirrored[kind][number].get(key)
                if other is None:
                    continue
                sign = 1 if expand(other - value) == 0 else -1 if expand(other + value) == 0 else 0
                if sign == 0:
                    raise DerivationError("a row has no parity under reflections")
                if key[0] in parity:
                    row_parity.setdefault((kind, number), sign * parity[key[0]])
                elif (kind, number) in row_parity:
                    parity.setdefault(key[0], sign * row_parity[kind, number])
    return parity, row_parity


@dataclass(frozen=True, slots=True, kw_only=True)
class ScalarAdjoint:
    r"""The homogeneous adjoint solution by one scalar function :math:`\phi`, conjugate to the multipliers of the solvability condition.

    Attributes
    ----------
    multipliers
        {row: coefficients of phi, phi', ...}: the adjoint array field zeta.
    equation
        Coefficients c with phi^(n) = sum c_k phi^(k).
    left, right
        Boundary rows over phi, phi', ..., reduced.
    substitution
        {adjoint function of the emitted code: coefficients of phi^*, phi^*', ...}.
    """

    multipliers: Mapping[int, tuple[Expr, ...]]
    equation: tuple[Expr, ...]
    left: tuple[tuple[Expr, ...], ...]
    right: tuple[tuple[Expr, ...], ...]
    substitution: Mapping[Symbol, tuple[Expr, ...]]


def scalar_adjoint(operator: FirstOrderOperator, solvability: Solvability, functions: Functions, rows: tuple[int, ...]) -> ScalarAdjoint | None:
    """Return the adjoint solution by the first multiplier that generates all others by differentiation, or None where none does."""
    n = operator.size
    zeta = solvability.zeta
    adjoint = solvability.adjoint
    if adjoint is None or any(functions.space in entry.free_symbols for line in operator.matrix for entry in line):
        return None
    slope = Matrix([[conjugate(entry) for entry in line] for line in adjoint.matrix])

    def over(expression: Expr) -> list[Expr]:
        expression = conjugate(expand(expression))
        return [expression.coeff(symbol) for symbol in zeta]

    multipliers = {row: over(solvability.interior[row]) for row in rows if row in solvability.interior}
    for row in rows:
        if row not in multipliers or any(functions.space in entry.free_symbols for entry in multipliers[row]):
            continue
        table = [Matrix([multipliers[row]])]
        for _ in range(n):
            table.append((table[-1] * slope).applyfunc(expand))
        change = Matrix.vstack(*table[:n])
        determinant = expand(change.det(method="berkowitz"))
        if determinant == 0:
            continue
        inverse = (change.adjugate(method="berkowitz") / determinant).applyfunc(lambda entry: expand(entry.cancel()))

        def to_phi(line: Sequence[Expr]) -> tuple[Expr, ...]:
            return tuple(expand(entry.cancel()) for entry in Matrix([line]) * inverse)

        return ScalarAdjoint(
            multipliers={key: to_phi(line) for key, line in multipliers.items()},
            equation=to_phi(list(table[n])),
            left=reduced_rows([to_phi([conjugate(entry) for entry in line]) for line in adjoint.left]),
            right=reduced_rows([to_phi([conjugate(entry) for entry in line]) for line in adjoint.right]),
            substitution={symbol: tuple(conjugate(entry) for entry in to_phi([Integer(int(k == j)) for k in range(n)])) for j, symbol in enumerate(zeta)},
        )
    return None


def reduced_rows(rows: list[tuple[Expr, ...]]) -> tuple[tuple[Expr, ...], ...]:
    """Return rows in reduced echelon form, highest derivatives eliminated last."""
    if not rows:
        return ()
    width = len(rows[0])
    flipped = Matrix([list(reversed(row)) for row in rows])
    reduced, pivots = flipped.rref(simplify=True)
    return tuple(tuple(expand(reduced[k, width - 1 - j]) for j in range(width)) for k in reversed(range(len(pivots))))
