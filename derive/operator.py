r"""Linearisation: from differential-algebraic rows to a first-order system with boundary rows.

In a harmonic :math:`e^{\lambda t}` the linear parts of the rows form a linear differential-algebraic system in `s`,
:math:`\sum_{jk} l_{ijk}(s)\,\lambda^{k}\,\partial_s^{j}\psi = f_i`. Its algebraic rows are solved, differentiated where needed,
until :math:`y' = P y + R f` is left; every unknown is a combination of `y` and of derivatives of the forcing, and rows left
over say what the forcing must meet. Pivots free of :math:`\lambda`, of `s` and of symbols are taken first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sympy import Add, Expr, Integer, Matrix, Mul, Symbol, fraction, together

from derive.expand import cancel, expand
from derive.expansion import Expansion, TaylorRow
from derive.formulation import Formulation
from derive.statement import ProblemError

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

    def solve(self, row: WorkingRow, variable: int) -> Solved:
        """Return an algebraic row solved for a variable."""
        head = row.value[variable]
        value = self.scaled({k: c for k, c in row.value.items() if k != variable}, -self.inverse(head))
        return Solved(variable=variable, value=value, forcing=self.scaled(row.forcing, 1 / head))

    def insert(self, solved: Solved, row: WorkingRow) -> None:
        """Put a solved variable, and its derivative, into a row."""
        factor = row.value.pop(solved.variable, None)
        if factor is not None:
            self.add(row.value, solved.value, factor)
            self.add(row.forcing, solved.forcing, -factor)
        factor = row.slope.pop(solved.variable, None)
        if factor is not None:  # y_k' = sum value y' + value' y + forcing'
            self.add(row.slope, solved.value, factor)
            self.add(row.value, {k: c.diff(self.space) for k, c in solved.value.items()}, factor)
            self.add(row.forcing, self.differentiated(solved.forcing), -factor)

    def recovered(self, solved: Sequence[Solved], remaining: Sequence[int]) -> dict[int, tuple[tuple[Expr, ...], Forcing]]:
        """Return every variable as (coefficients over the remaining ones, combination of forcing), by substitution from the last one back."""
        sums: dict[int, tuple[dict[int, Expr], Forcing]] = {k: ({place: Integer(1)}, {}) for place, k in enumerate(remaining)}
        for one in reversed(solved):
            total: dict[int, Expr] = {}
            forcing: Forcing = dict(one.forcing)
            for k, coefficient in one.value.items():
                self.add(total, sums[k][0], coefficient)
                self.add(forcing, sums[k][1], coefficient)
            sums[one.variable] = (total, forcing)
        return {k: (tuple(total.get(j, Integer(0)) for j in range(len(remaining))), forcing) for k, (total, forcing) in sums.items()}

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """A variable in terms of others: y_k = sum value y + forcing."""

    variable: int
    value: Mapping[int, Expr]
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
    if formulation.interval is None:
        raise AssertionError("ordinary differential equations have no space to reduce")
    work = Elimination(formulation)
    unknowns = [unknown.index for unknown in formulation.unknowns if unknown.weight == weight and (block is None or unknown.index in block)]

    def linear(rows: Iterable[TaylorRow]) -> dict[int, dict[tuple[int, int], Expr]]:
        belonging = ((number, row) for number, row in enumerate(rows) if row.weight == weight and (block is None or any(jet[0] in block for jet in row.linear())))
        return {number: at_growth(row, growth, work) for number, row in belonging}

    interior = linear(expansion.rows)
    ends = [linear(end) for end in expansion.ends]
    variables, rows = first_order_rows(unknowns, interior)
    rows, solved, spare = eliminate(rows, [(unknown not in formulation.normalised, order) for unknown, order in variables], work)
    gone = {one.variable for one in solved}
    remaining = [k for k in range(len(variables)) if k not in gone]
    n = len(remaining)
    if len(rows) < n:
        pivots = {min(row.slope, key=lambda k: (abs(float(row.slope[k] != 1)), k)) for row in rows}
        free = sorted({formulation.unknowns[variables[k][0]].latex for k in remaining if k not in pivots})
        raise ProblemError(f"equations: found {len(rows)} independent equations for {n} unknown functions; "
                           f"expected as many: nothing determines {', '.join(free)}")
    check_redundant(spare, expansion)
    matrix, forcing = solved_slopes(rows, remaining, work)
    check_finite(matrix, formulation)
    if n == 0 and spare:
        raise ProblemError(contradiction(expansion, [expansion.rows[number] for number in interior]))
    recovery = work.recovered(solved, remaining)
    fields = {unknown: recovery[variables.index((unknown, 0))] for unknown in unknowns}
    system = Unbounded(matrix=matrix, forcing=forcing, recovery=fields, names=tuple(variables[k] for k in remaining), work=work)
    system = leading_scalar(system, formulation.normalised, formulation)
    left, right = (boundary_rows(system, linear, place, side) for linear, place, side in zip(ends, formulation.interval, ("left", "right"), strict=True))
    if len(left.matrix) + len(right.matrix) != n:
        raise ProblemError(count_message(formulation.interval, (len(left.matrix), len(right.matrix)), n))
    return FirstOrderOperator(
        matrix=tuple(tuple(row) for row in system.matrix), forcing=tuple(system.forcing), recovery=system.recovery,
        left=left, right=right, spare=tuple(spare), names=system.names, scalar=system.scalar, divisors=tuple(work.divisors),
    )


def first_order_rows(unknowns: Sequence[int], linear: Mapping[int, Mapping[tuple[int, int], Expr]]) -> tuple[list[tuple[int, int]], list[WorkingRow]]:
    """Return the variables, which are derivatives of the unknowns below the highest that occurs, and the rows over them and their slopes."""
    highest = dict.fromkeys(unknowns, 0)
    for coefficients in linear.values():
        for unknown, ds in coefficients:
            highest[unknown] = max(highest[unknown], ds)
    variables = [(unknown, k) for unknown in unknowns for k in range(max(highest[unknown], 1))]
    number_of = {variable: k for k, variable in enumerate(variables)}
    rows = [WorkingRow({number_of[unknown, k]: Integer(1)}, {number_of[unknown, k + 1]: Integer(-1)}, {}) for unknown, k in variables if (unknown, k + 1) in number_of]
    for number, coefficients in linear.items():
        slope, value = {}, {}
        for (unknown, ds), coefficient in coefficients.items():
            if (unknown, ds) in number_of:
                value[number_of[unknown, ds]] = coefficient
            else:
                slope[number_of[unknown, ds - 1]] = coefficient
        rows.append(WorkingRow(slope, value, {("row", number, 0): Integer(1)}))
    return variables, rows


def eliminate(rows: list[WorkingRow], unwelcome: Sequence[tuple[bool, int]], work: Elimination) -> tuple[list[WorkingRow], list[Solved], list[Forcing]]:
    """Return the rows with slopes, the variables solved for, in order, and what is demanded of the forcing.

    Algebraic rows are solved, and differentiated where they are put into a slope, until none is left. `unwelcome` holds, for each variable, whether
    it does not belong to the normalised field, and the order of its derivative.
    """
    solved: list[Solved] = []
    spare: list[Forcing] = []
    while True:
        echelon(rows, work)
        algebraic = [row for row in rows if not row.slope]
        rows = [row for row in rows if row.slope]
        spare.extend(row.forcing for row in algebraic if not row.value and row.forcing)
        algebraic = [row for row in algebraic if row.value]
        if not algebraic:
            return rows, solved, spare
        # The best pivot of all algebraic rows.
        _, best, pivot = min(
            ((*work.cost(coefficient)[:4], not unwelcome[k][0], -unwelcome[k][1], work.cost(coefficient)[4], k), index, k)
            for index, one in enumerate(algebraic) for k, coefficient in one.value.items()
        )
        solved.append(work.solve(algebraic[best], pivot))
        rows = rows + algebraic[:best] + algebraic[best + 1:]
        for row in rows:
            work.insert(solved[-1], row)


def solved_slopes(rows: Sequence[WorkingRow], remaining: Sequence[int], work: Elimination) -> tuple[list[list[Expr]], list[Forcing]]:
    """Return P and R f of y' = P y + R f from rows that hold one slope each."""
    order = {k: place for place, k in enumerate(remaining)}
    matrix: list[list[Expr]] = [[Integer(0)] * len(remaining) for _ in remaining]
    forcing: list[Forcing] = [{} for _ in remaining]
    for row in rows:
        ((k, head),) = row.slope.items()
        for j, coefficient in row.value.items():
            matrix[order[k]][order[j]] = work.tidy(-coefficient / head)
        forcing[order[k]] = work.scaled(row.forcing, 1 / head)
    return matrix, forcing


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


def count_message(ends: tuple[Expr, Expr], found: tuple[int, int], n: int) -> str:
    """Return the message for a wrong number of boundary rows; it names the end."""
    few = sum(found) < n
    fault = min(found) if few else max(found)
    at_fault = [str(end) for end, count in zip(ends, found, strict=True) if count == fault]
    return (f"boundary: found {found[0]} independent rows at the end {ends[0]} and {found[1]} at the end {ends[1]}; "
            f"expected {n} in all for a system of order {n}: too {'few' if few else 'many'} at the end{'s' if len(at_fault) > 1 else ''} {' and '.join(at_fault)}")


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
