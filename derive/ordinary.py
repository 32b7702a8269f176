r"""Linearisation without space: the algebraic system :math:`M(\lambda)\,\psi = f` of a harmonic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sympy import Expr, Integer, degree

from derive.expansion import Expansion
from derive.operator import LAMBDA, Elimination, Forcing, Solved, WorkingRow, at_growth, check_redundant, length
from derive.statement import ProblemError


@dataclass(frozen=True, slots=True, kw_only=True)
class AlgebraicOperator:
    """Square system M y = R f; the unknowns follow from y and the forcing as in `FirstOrderOperator`."""

    matrix: tuple[tuple[Expr, ...], ...]
    forcing: tuple[Forcing, ...]
    recovery: Mapping[int, tuple[tuple[Expr, ...], Forcing]]
    spare: tuple[Forcing, ...]
    names: tuple[tuple[int, int], ...]

    @property
    def size(self) -> int:
        """Return the number of equations."""
        return len(self.matrix)


def reduce_ordinary(expansion: Expansion, weight: int, growth: Expr) -> AlgebraicOperator:
    r"""Return the algebraic system of the rows of `weight` in the harmonic :math:`e^{\lambda t}`.

    Rows are solved only by pivots free of lambda and of the control, so that nothing that may vanish is divided by.

    Raises
    ------
    ProblemError
        The equations leave a field undetermined.
    """
    formulation = expansion.formulation
    work = Elimination(formulation)
    control = formulation.control
    unknowns = [unknown.index for unknown in formulation.unknowns if unknown.weight == weight]
    rows = [
        WorkingRow({}, {unknown: c for (unknown, _), c in at_growth(row, growth, work).items()}, {("row", number, 0): Integer(1)})
        for number, row in enumerate(expansion.rows) if row.weight == weight
    ]
    remaining = list(unknowns)
    solved: list[Solved] = []
    while True:
        candidates = [
            ((bool(c.free_symbols), length(c), index, k), index, k)
            for index, row in enumerate(rows) for k, c in row.value.items()
            if LAMBDA not in c.free_symbols and control not in c.free_symbols and k not in formulation.normalised
        ]
        if not candidates:
            break
        _, index, pivot = min(candidates)
        solved.append(work.solve(rows.pop(index), pivot))
        remaining.remove(pivot)
        for row in rows:
            work.insert(solved[-1], row)
    spare = [row.forcing for row in rows if not row.value and row.forcing]
    rows = [row for row in rows if row.value]
    if len(rows) < len(remaining):
        free = ", ".join(sorted({formulation.unknowns[k].latex for k in remaining}))
        raise ProblemError(f"equations: found {len(rows)} independent equations for {free}; expected {len(remaining)}: something is left undetermined")
    if len(rows) > len(remaining):
        rows, more = independent(rows, remaining, work, expansion)
        spare.extend(more)
    check_redundant(spare, expansion)
    recovery = work.recovered(solved, remaining)
    return AlgebraicOperator(
        matrix=tuple(tuple(row.value.get(k, Integer(0)) for k in remaining) for row in rows),
        forcing=tuple(row.forcing for row in rows), recovery={k: recovery[k] for k in unknowns},
        spare=tuple(spare), names=tuple((k, 0) for k in remaining),
    )


def independent(rows: list[WorkingRow], remaining: list[int], work: Elimination, expansion: Expansion) -> tuple[list[WorkingRow], list[Forcing]]:
    """Return as many independent rows as unknowns, lowest in lambda first, and what the others demand of the forcing."""
    def degree_of(row: WorkingRow) -> int:
        return max(int(degree(c, LAMBDA)) if c.is_polynomial(LAMBDA) and LAMBDA in c.free_symbols else 0 for c in row.value.values())

    ranked = sorted(range(len(rows)), key=lambda k: (degree_of(rows[k]), k))
    kept: list[int] = []
    reduced: list[tuple[int, dict[int, Expr], Forcing]] = []
    spare: list[Forcing] = []
    for index in ranked:
        value, forcing = dict(rows[index].value), dict(rows[index].forcing)
        for pivot, other, forced in reduced:
            factor = value.pop(pivot, None)
            if factor is not None:
                work.add(value, {k: c for k, c in other.items() if k != pivot}, -factor)
                work.add(forcing, forced, -factor)
        if not value:
            if forcing:
                spare.append(forcing)
            continue
        if len(kept) == len(remaining):
            names = ", ".join(dict.fromkeys(expansion.rows[row].label for _, row, _ in forcing))
            raise ProblemError(f"equations: {names} contradict each other: found more independent equations than unknowns; expected as many")
        pivot = min(value, key=lambda k: work.cost(value[k]))
        head = value[pivot]
        reduced.append((pivot, work.scaled(value, 1 / head), work.scaled(forcing, 1 / head)))
        kept.append(index)
    return [rows[k] for k in sorted(kept)], spare
