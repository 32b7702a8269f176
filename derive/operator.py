r"""Linearisation: from differential-algebraic rows to a first-order system with boundary rows.

In a harmonic :math:`e^{\lambda t}` the linear parts of the rows form a linear differential-algebraic system in `s`,
:math:`\sum_{jk} l_{ijk}(s)\,\lambda^{k}\,\partial_s^{j}\psi = f_i`. Its algebraic rows are solved, differentiated where needed,
until :math:`y' = P y + R f` is left; every unknown is a combination of `y` and of derivatives of the forcing, and rows left
over say what the forcing must meet. Pivots free of :math:`\lambda`, of `s` and of symbols are taken first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sympy import Add, Expr, Integer, Matrix, Mul, Symbol, cancel, expand, fraction, together

from derive.expansion import Expansion, TaylorRow
from derive.formulation import Formulation, Jet
from derive.statement import DerivationError, ProblemError

Forcing = dict[tuple[str, int, int], Expr]
"""{(kind, row, derivative): coefficient}; kind is "row" for an interior row and "left" or "right" for a boundary row."""

LAMBDA = Symbol("lam")
OMEGA = Symbol("omega", real=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryRows:
    """Boundary rows in reduced echelon form: `matrix` y = `forcing`; `pivots` are the columns of the identity."""

    matrix: tuple[tuple[Expr, ...], ...]
    pivots: tuple[int, ...]
    forcing: tuple[Forcing, ...]
    spare: tuple[Forcing, ...]  # combinations of the forcing that must vanish (redundant rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrderOperator:
    r"""The system :math:`y' = P y + R f` of one weight and one harmonic, with its boundary rows.

    Attributes
    ----------
    matrix
        P, shape (n, n), in `s`, the control, the parameters and lambda.
    forcing
        R: for each of the n equations the combination of forcing terms and their derivatives.
    recovery
        {unknown: (coefficients over y, combination of forcing)}: the unknowns of the statement.
    left, right
        Boundary rows; n rows together.
    spare
        Combinations of the forcing that must vanish, from redundant rows.
    names
        What each entry of y is: (unknown, order of derivative).
    divisors
        Polynomials in lambda that were divided by: where one vanishes, an eigenvalue may be lost, and a point of the interval grows by itself.
    """

    matrix: tuple[tuple[Expr, ...], ...]
    forcing: tuple[Forcing, ...]
    recovery: Mapping[int, tuple[tuple[Expr, ...], Forcing]]
    left: BoundaryRows
    right: BoundaryRows
    spare: tuple[Forcing, ...]
    names: tuple[tuple[int, int], ...]
    scalar: bool
    divisors: tuple[Expr, ...] = ()

    @property
    def size(self) -> int:
        """Return n, the number of first-order equations."""
        return len(self.matrix)


class Elimination:
    """Exact row operations on rows {variable: coefficient}, with the forcing carried along."""

    def __init__(self, formulation: Formulation) -> None:
        self.formulation = formulation
        self.space = formulation.space
        self.divisors: list[Expr] = []

    def inverse(self, pivot: Expr) -> Expr:
        """Return 1/pivot, and remember a pivot that vanishes for some lambda."""
        numerator = fraction(together(pivot))[0] if LAMBDA in pivot.free_symbols else pivot
        if LAMBDA in numerator.free_symbols and numerator not in self.divisors:
            self.divisors.append(numerator)
        return 1 / pivot

    def tidy(self, expression: Expr) -> Expr:
        """Return a normal form: expanded, over one denominator where there is one; exact zeros become 0."""
        if expression.is_Rational or expression.is_Symbol:
            return expression
        expression = expand(expression)
        if expression.is_Rational or expression.is_Symbol:
            return expression
        if fraction(together(expression))[1].free_symbols:
            expression = cancel(expression)
        return Integer(0) if self.formulation.probe.is_zero(expression) else expression

    def add(self, target: dict, source: Mapping, factor: Expr) -> None:
        """Add `factor` times `source` to `target`, dropping what cancels."""
        if factor == 0:
            return
        for key, value in source.items():
            total = self.tidy(target.get(key, Integer(0)) + factor * value)
            if total == 0:
                target.pop(key, None)
            else:
                target[key] = total

    def scaled(self, source: Mapping, factor: Expr) -> dict:
        """Return `factor` times `source`."""
        result: dict = {}
        self.add(result, source, factor)
        return result

    def differentiated(self, forcing: Forcing) -> Forcing:
        """Return the space derivative of a combination of forcing terms."""
        result: Forcing = {}
        for (kind, row, order), value in forcing.items():
            self.add(result, {(kind, row, order): value.diff(self.space)}, Integer(1))
            self.add(result, {(kind, row, order + 1): value}, Integer(1))
        return result

    def cost(self, coefficient: Expr) -> tuple[bool, bool, bool, bool, int]:
        """Return how unwelcome a pivot is: it may vanish, holds lambda, holds s, holds symbols, and its length."""
        symbols = coefficient.free_symbols
        return (self.formulation.probe.may_vanish(coefficient), LAMBDA in symbols, self.space in symbols, bool(symbols), length(coefficient))


def length(expression: Expr) -> int:
    """Return the number of factors, blind to signs and to i: both circular components then take the same pivots."""
    return sum(1 + sum(max(factor.count_ops(), 1) for factor in Mul.make_args(term) if factor.free_symbols) for term in Add.make_args(expression))


@dataclass(slots=True)
class WorkingRow:
    """A row during elimination: coefficients of y', of y, and the forcing on the right."""

    slope: dict[int, Expr]
    value: dict[int, Expr]
    forcing: Forcing


def reduce_operator(expansion: Expansion, weight: int, growth: Expr, block: frozenset[int] | None = None) -> FirstOrderOperator:
    r"""Return the first-order system of the rows of `weight` in the harmonic :math:`e^{\lambda t}`, lambda = `growth`.

    Parameters
    ----------
    block
        Only the unknowns of one block and the rows that hold them; see `coupled_block`.

    Raises
    ------
    ProblemError
        The equations leave a field undetermined, contradict each other, or have too few or too many boundary rows.
    """
    formulation = expansion.formulation
    work = Elimination(formulation)
    unknowns = [unknown.index for unknown in formulation.unknowns if unknown.weight == weight and (block is None or unknown.index in block)]

    def belongs(row: TaylorRow) -> bool:
        return row.weight == weight and (block is None or any(jet[0] in block for jet in row.linear()))

    chosen = [(number, row) for number, row in enumerate(expansion.rows) if belongs(row)]
    linear = {number: at_growth(row, growth, work) for number, row in chosen}
    ends = [[(number, row) for number, row in enumerate(end) if belongs(row)] for end in expansion.ends]
    end_linear = [{number: at_growth(row, growth, work) for number, row in end} for end in ends]
    spatial = formulation.interval is not None

    # Variables: derivatives of the unknowns below the highest that occurs in the interior.
    highest = {unknown: 0 for unknown in unknowns}
    for coefficients in linear.values():
        for unknown, ds in coefficients:
            highest[unknown] = max(highest[unknown], ds)
    variables: list[tuple[int, int]] = [(unknown, k) for unknown in unknowns for k in range(max(highest[unknown], 1))]
    number_of = {variable: k for k, variable in enumerate(variables)}
    rows: list[WorkingRow] = []
    for unknown, k in variables:
        if (unknown, k + 1) in number_of:
            rows.append(WorkingRow({number_of[unknown, k]: Integer(1)}, {number_of[unknown, k + 1]: Integer(-1)}, {}))
    for number, coefficients in linear.items():
        slope, value = {}, {}
        for (unknown, ds), coefficient in coefficients.items():
            if (unknown, ds) in number_of:
                value[number_of[unknown, ds]] = coefficient
            else:
                slope[number_of[unknown, ds - 1]] = coefficient
        rows.append(WorkingRow(slope, value, {("row", number, 0): Integer(1)}))

    remaining = list(range(len(variables)))
    solved: list[tuple[int, dict[int, Expr], Forcing]] = []  # y_k = sum value y + forcing
    spare: list[Forcing] = []
    leading = formulation.normalised
    unwelcome = {number_of[unknown, k]: (unknown not in leading, k) for unknown, k in variables}
    while True:
        echelon(rows, work)
        algebraic = [row for row in rows if not row.slope]
        rows = [row for row in rows if row.slope]
        spare.extend(row.forcing for row in algebraic if not row.value and row.forcing)
        algebraic = [row for row in algebraic if row.value]
        if not algebraic:
            break
        # The best pivot of all algebraic rows.
        _, best, pivot = min(
            (((*work.cost(coefficient)[:4], not unwelcome[k][0], -unwelcome[k][1], work.cost(coefficient)[4], k), index, k)
             for index, one in enumerate(algebraic) for k, coefficient in one.value.items()),
        )
        chosen_row = algebraic[best]
        head = chosen_row.value[pivot]
        value = work.scaled({k: c for k, c in chosen_row.value.items() if k != pivot}, -work.inverse(head))
        forcing = work.scaled(chosen_row.forcing, 1 / head)
        others = rows + algebraic[:best] + algebraic[best + 1:]
        for other in others:
            factor = other.value.pop(pivot, None)
            if factor is not None:
                work.add(other.value, value, factor)
                work.add(other.forcing, forcing, -factor)
            factor = other.slope.pop(pivot, None)
            if factor is not None:  # y_k' = sum value y' + value' y + forcing'
                work.add(other.slope, value, factor)
                work.add(other.value, {k: c.diff(formulation.space) for k, c in value.items()}, factor)
                work.add(other.forcing, work.differentiated(forcing), -factor)
        solved.append((pivot, value, forcing))
        remaining.remove(pivot)
        rows = others
    if not spatial:
        raise AssertionError("ordinary differential equations have no space to reduce")
    pivots = {min(row.slope, key=lambda k: (abs(float(row.slope[k] != 1)), k)): row for row in rows}
    if len(rows) < len(remaining):
        free = sorted({formulation.unknowns[variables[k][0]].latex for k in remaining if k not in pivots})
        raise ProblemError(f"equations: found {len(rows)} independent equations for {len(remaining)} unknown functions; "
                           f"expected as many: nothing determines {', '.join(free)}")
    check_redundant(spare, expansion)
    order = {k: place for place, k in enumerate(remaining)}
    matrix = [[Integer(0)] * len(remaining) for _ in remaining]
    forcings: list[Forcing] = [{} for _ in remaining]
    for row in rows:
        (k,) = row.slope
        for j, coefficient in row.value.items():
            matrix[order[k]][order[j]] = work.tidy(-coefficient / row.slope[k])
        forcings[order[k]] = work.scaled(row.forcing, 1 / row.slope[k])
    check_finite(matrix, formulation)
    recovery: dict[int, tuple[dict[int, Expr], Forcing]] = {k: ({order[k]: Integer(1)}, {}) for k in remaining}
    for pivot, value, forcing in reversed(solved):
        total: dict[int, Expr] = {}
        forced: Forcing = dict(forcing)
        for k, coefficient in value.items():
            work.add(total, recovery[k][0], coefficient)
            work.add(forced, recovery[k][1], coefficient)
        recovery[pivot] = (total, forced)
    n = len(remaining)
    fields = {
        unknown: (tuple(recovery[number_of[unknown, 0]][0].get(j, Integer(0)) for j in range(n)), recovery[number_of[unknown, 0]][1])
        for unknown in unknowns
    }
    operator = Unbounded(matrix=matrix, forcing=forcings, recovery=fields, names=tuple(variables[k] for k in remaining), work=work)
    if n == 0 and spare:
        raise ProblemError(contradiction(expansion, [row for _, row in chosen]))
    operator = leading_scalar(operator, leading, formulation)
    sides = [boundary_rows(operator, end_linear[side], formulation.interval[side], "left" if side == 0 else "right") for side in (0, 1)]  # type: ignore[index]
    found = [len(side.matrix) for side in sides]
    if sum(found) != n:
        raise ProblemError(count_message(formulation, found, n))
    return FirstOrderOperator(
        matrix=tuple(tuple(row) for row in operator.matrix), forcing=tuple(operator.forcing), recovery=operator.recovery,
        left=sides[0], right=sides[1], spare=tuple(spare), names=operator.names, scalar=operator.scalar, divisors=tuple(work.divisors),
    )


def coupled_block(expansion: Expansion, weight: int, unknowns: Iterable[int]) -> frozenset[int]:
    """Return the unknowns that the linear rows of `weight` couple with some of them; the others vanish where these alone are driven."""
    block = set(unknowns)
    rows = [{jet[0] for jet in row.linear()} for group in (expansion.rows, *expansion.ends) for row in group if row.weight == weight]
    while True:
        reached = set().union(*(row for row in rows if row & block), block)
        if reached == block:
            return frozenset(block)
        block = reached


def check_redundant(spare: Sequence[Forcing], expansion: Expansion) -> None:
    """Refuse a relation between rows in which no row follows from the others: there are more equations than unknowns.

    A redundant row is a combination of the others and their derivatives, so it stands in the relation alone, undifferentiated,
    and over it the other coefficients are polynomials in lambda.
    """
    for relation in spare:
        rows = sorted({row for _, row, _ in relation})
        for row in rows:
            if any(order for _, other, order in relation if other == row):
                continue
            unit = relation["row", row, 0]
            if all(LAMBDA not in fraction(together(c / unit))[1].free_symbols for c in relation.values()):
                break
        else:
            labels = ", ".join(dict.fromkeys(expansion.rows[row].label for row in rows))
            raise ProblemError(f"equations: {labels} contradict each other: found more independent equations than unknowns; expected as many, or redundant ones that follow from the others")


def check_finite(matrix: Sequence[Sequence[Expr]], formulation: Formulation) -> None:
    """Refuse a coefficient with a pole on the interval, at the lower end of the control range."""
    lowest = {formulation.control: formulation.control_range[0]}
    for entry in dict.fromkeys(entry for row in matrix for entry in row if formulation.space in entry.free_symbols):
        bottom = fraction(together(entry))[1]
        if formulation.space in bottom.free_symbols and LAMBDA not in bottom.free_symbols and formulation.probe.may_vanish(bottom.subs(lowest)):
            raise ProblemError(f"equations: found a coefficient that is not finite on the interval (it is divided by {bottom}); expected coefficients that are finite and smooth, ends included")


def contradiction(expansion: Expansion, rows: Sequence[TaylorRow]) -> str:
    """Return the message for equations that leave no disturbance possible."""
    labels = ", ".join(dict.fromkeys(row.label for row in rows))
    return f"equations: {labels} together allow no disturbance at all: they contradict each other; expected as many independent equations as unknowns"


def count_message(formulation: Formulation, found: Sequence[int], n: int) -> str:
    """Return the message for a wrong number of boundary rows; it names the end."""
    ends = formulation.interval
    total = sum(found)
    if total < n:
        side = 0 if found[0] < found[1] else 1 if found[1] < found[0] else None
        which = f"at the end {ends[side]}" if side is not None else f"at the ends {ends[0]} and {ends[1]}"  # type: ignore[index]
        verdict = f"too few {which}"
    else:
        side = 0 if found[0] > found[1] else 1 if found[1] > found[0] else None
        which = f"at the end {ends[side]}" if side is not None else f"at the ends {ends[0]} and {ends[1]}"  # type: ignore[index]
        verdict = f"too many {which}"
    return (f"boundary: found {found[0]} independent rows at the end {ends[0]} and {found[1]} at the end {ends[1]}; "  # type: ignore[index]
            f"expected {n} in all for a system of order {n}: {verdict}")


def at_growth(row: TaylorRow, growth: Expr, work: Elimination) -> dict[tuple[int, int], Expr]:
    """Return {(unknown, space derivative): coefficient} of the linear part in the harmonic of `growth`."""
    result: dict[tuple[int, int], Expr] = {}
    for (unknown, ds, dt), coefficient in row.linear().items():
        work.add(result, {(unknown, ds): coefficient * growth**dt}, Integer(1))
    return result


def echelon(rows: list[WorkingRow], work: Elimination) -> None:
    """Bring the coefficients of y' to reduced echelon form, in place."""
    used: set[int] = set()
    while True:
        candidates = [
            ((*work.cost(coefficient), k, index), index, k)
            for index, row in enumerate(rows) if index not in used for k, coefficient in row.slope.items()
        ]
        if not candidates:
            return
        _, index, k = min(candidates)
        used.add(index)
        pivot = rows[index]
        head = pivot.slope[k]
        if head != 1:
            pivot.slope = {key: Integer(1) if key == k else value for key, value in work.scaled(pivot.slope, work.inverse(head)).items()}
            pivot.value = work.scaled(pivot.value, 1 / head)
            pivot.forcing = work.scaled(pivot.forcing, 1 / head)
        for other_index, other in enumerate(rows):
            if other_index != index and k in other.slope:
                factor = -other.slope[k]
                work.add(other.slope, pivot.slope, factor)
                other.slope.pop(k, None)
                work.add(other.value, pivot.value, factor)
                work.add(other.forcing, pivot.forcing, factor)


@dataclass(slots=True, kw_only=True)
class Unbounded:
    """A first-order system before its boundary rows are known."""

    matrix: list[list[Expr]]
    forcing: list[Forcing]
    recovery: dict[int, tuple[tuple[Expr, ...], Forcing]]
    names: tuple[tuple[int, int], ...]
    work: Elimination
    scalar: bool = False

    def derivative(self, row: Sequence[Expr], forcing: Forcing) -> tuple[list[Expr], Forcing]:
        """Return the space derivative of `row` y + forcing as another such combination."""
        work, n = self.work, len(self.matrix)
        slope = [work.tidy(row[j].diff(work.space) + sum((row[i] * self.matrix[i][j] for i in range(n) if row[i] != 0), Integer(0))) for j in range(n)]
        forced = work.differentiated(forcing)
        for i in range(n):
            work.add(forced, self.forcing[i], row[i])
        return slope, forced


def leading_scalar(operator: Unbounded, leading: Sequence[int], formulation: Formulation) -> Unbounded:
    """Return the system in terms of the leading field and its derivatives, where that is possible.

    y = C^-1 (phi, phi', ..., phi^(n-1)): one scalar equation of order n, and every other field in terms of phi.
    """
    n = len(operator.matrix)
    mine = [unknown for unknown in leading if unknown in operator.recovery]
    if not mine or n == 0:
        return operator
    work = operator.work
    row, forced = list(operator.recovery[mine[0]][0]), operator.recovery[mine[0]][1]
    rows: list[list[Expr]] = []
    forcings: list[Forcing] = []
    for _ in range(n + 1):
        if any(entry.has(work.space) for entry in row):
            return operator
        rows.append(row)
        forcings.append(forced)
        row, forced = operator.derivative(row, forced)
    change = Matrix(rows[:n])
    if any(LAMBDA in entry.free_symbols for entry in change):
        return operator
    determinant = work.tidy(change.det(method="berkowitz"))
    if determinant == 0 or LAMBDA in determinant.free_symbols or formulation.control in determinant.free_symbols:
        return operator
    inverse = (change.adjugate(method="berkowitz") / determinant).applyfunc(work.tidy)
    last = [work.tidy(sum((rows[n][k] * inverse[k, j] for k in range(n)), Integer(0))) for j in range(n)]

    def combined(row: Sequence[Expr], forcing: Forcing) -> tuple[tuple[Expr, ...], Forcing]:
        # row y + forcing with y = C^-1 (Phi - forcings)
        new = tuple(work.tidy(sum((row[k] * inverse[k, j] for k in range(n)), Integer(0))) for j in range(n))
        total: Forcing = dict(forcing)
        for j in range(n):
            work.add(total, forcings[j], -new[j])
        return new, total

    matrix = [[Integer(1) if j == i + 1 else Integer(0) for j in range(n)] for i in range(n - 1)] + [last]
    forcing: list[Forcing] = [{} for _ in range(n - 1)] + [combined(rows[n], forcings[n])[1]]
    recovery = {unknown: combined(*entry) for unknown, entry in operator.recovery.items()}
    return Unbounded(matrix=matrix, forcing=forcing, recovery=recovery, names=tuple((mine[0], k) for k in range(n)), work=work, scalar=True)


def boundary_rows(operator: Unbounded, linear: Mapping[int, Mapping[tuple[int, int], Expr]], place: Expr, side: str) -> BoundaryRows:
    """Return the rows at one end over y, in reduced echelon form."""
    work, n = operator.work, len(operator.matrix)
    jets: dict[tuple[int, int], tuple[list[Expr], Forcing]] = {}

    def jet(unknown: int, ds: int) -> tuple[list[Expr], Forcing]:
        if (unknown, ds) not in jets:
            if ds == 0:
                row, forcing = operator.recovery[unknown]
                jets[unknown, ds] = (list(row), forcing)
            else:
                jets[unknown, ds] = operator.derivative(*jet(unknown, ds - 1))
        return jets[unknown, ds]

    rows: list[WorkingRow] = []
    for number, coefficients in linear.items():
        value: dict[int, Expr] = {}
        forcing: Forcing = {(side, number, 0): Integer(1)}
        for (unknown, ds), coefficient in coefficients.items():
            over, forced = jet(unknown, ds)
            work.add(value, {j: work.tidy(over[j].subs(work.space, place)) for j in range(n) if over[j] != 0}, coefficient)
            work.add(forcing, {key: c.subs(work.space, place) for key, c in forced.items()}, -coefficient)
        rows.append(WorkingRow({k: c for k, c in value.items() if c != 0}, {}, forcing))
    echelon(rows, work)
    kept = [row for row in rows if row.slope]
    spare = tuple(row.forcing for row in rows if not row.slope)
    pivots = []
    for row in kept:
        ones = [k for k, c in row.slope.items() if c == 1 and all(k not in other.slope for other in kept if other is not row)]
        pivots.append(ones[0])
    arranged = sorted(zip(pivots, kept, strict=True), key=lambda pair: pair[0])
    return BoundaryRows(
        matrix=tuple(tuple(row.slope.get(j, Integer(0)) for j in range(n)) for _, row in arranged),
        pivots=tuple(pivot for pivot, _ in arranged),
        forcing=tuple(row.forcing for _, row in arranged), spare=spare,
    )


def jets_of(coefficients: Mapping[Jet, Expr]) -> list[Jet]:
    """Return the jets, sorted."""
    return sorted(coefficients)


__all__ = ["BoundaryRows", "DerivationError", "FirstOrderOperator", "Forcing", "LAMBDA", "OMEGA", "reduce_operator"]
