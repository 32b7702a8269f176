r"""The orders of the expansion: what stands in each row at each monomial of the amplitudes, and the non-resonant responses.

A disturbance is a sum of monomials in the amplitudes, each with one temporal harmonic and one weight under rotations, times
functions of `s`. A row at a monomial is the sum over its Taylor terms of all ordered products of contributions whose
monomials multiply to it: that is where every 2, 3 and 6 comes from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from sympy import Expr, I, Integer, Symbol

from derive.expansion import Expansion, TaylorRow
from derive.formulation import Jet
from derive.functions import Functions
from derive.operator import OMEGA, FirstOrderOperator, Forcing, reduce_operator
from derive.ordinary import AlgebraicOperator, reduce_ordinary

Monomial = tuple[int, ...]
"""Exponents over the amplitudes of the kind of bifurcation."""

Operator = FirstOrderOperator | AlgebraicOperator


@dataclass(frozen=True, slots=True, kw_only=True)
class Amplitude:
    """One of the amplitudes: `A`, its conjugate, or a circular component of either."""

    name: str
    harmonic: int
    weight: int
    conjugate: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Contribution:
    """A term of the expansion: a monomial times functions of `s`, one for each unknown."""

    monomial: Monomial
    order: int
    harmonic: int
    values: Mapping[int, Expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The response to a non-resonant monomial of second order.

    `states` solve `operator` with `forcing` and boundary data `left`, `right`: functions of its `own`, or else zero or those of a response to the
    same forcing. `values` are the unknowns of the statement.
    """

    name: str
    monomial: Monomial
    harmonic: int
    operator: Operator
    operator_name: str
    own: tuple[Symbol, ...]
    states: tuple[Expr, ...]
    forcing: tuple[Expr, ...]
    left: tuple[Expr, ...]
    right: tuple[Expr, ...]
    values: Mapping[int, Expr]
    spare: tuple[tuple[str, tuple[str, ...], Expr], ...]  # ("" or the end, the rows, what must vanish)
    singular: bool
    explicit: tuple[tuple[int, str, Expr, Expr], ...] | None  # (state, side, integrand, constant), in order


class Orders:
    """The expansion so far; asks each row for its coefficient at a monomial."""

    def __init__(self, expansion: Expansion, amplitudes: Sequence[Amplitude], functions: Functions, growth: Expr, leading: Sequence[Contribution]) -> None:
        self.expansion = expansion
        self.amplitudes = tuple(amplitudes)
        self.functions = functions
        self.growth = growth  # i omega, or 0 for a steady bifurcation
        self.contributions = list(leading)
        self.solved: dict[Any, tuple[Symbol, ...]] = {}
        self.cache: dict[tuple[Monomial, Jet, str | None], Expr] = {}

    def harmonic(self, monomial: Monomial) -> int:
        """Return the temporal harmonic of a monomial."""
        return sum(count * amplitude.harmonic for count, amplitude in zip(monomial, self.amplitudes, strict=True))

    def weight(self, monomial: Monomial) -> int:
        """Return the weight of a monomial under rotations."""
        return sum(count * amplitude.weight for count, amplitude in zip(monomial, self.amplitudes, strict=True))

    def value(self, contribution: Contribution, jet: Jet) -> Expr:
        """Return a jet of a contribution: space derivatives by the known slopes, time derivatives by the harmonic."""
        unknown, ds, dt = jet
        base = contribution.values.get(unknown, Integer(0))
        if base == 0:
            return base
        key = (contribution.monomial, (unknown, ds, 0), None)
        if key not in self.cache:
            derivative = self.functions.derivative(base, ds)
            if ds and contribution.order > 1:
                name = f"{self.expansion.formulation.unknowns[unknown].name}_{label(contribution.monomial, self.amplitudes)}{'_s' * ds}"
                derivative = self.functions.named(name, derivative)
            self.cache[key] = derivative
        return self.cache[key] * (contribution.harmonic * I * OMEGA if self.growth != 0 else Integer(0)) ** dt if dt else self.cache[key]

    def at(self, row: TaylorRow, monomial: Monomial, degree_from: int = 2) -> Expr:
        """Return the coefficient of `monomial` in the nonlinear part of `row`."""
        order = sum(monomial)
        total: Expr = Integer(0)
        for jets, coefficient in row.terms.items():
            if len(jets) < degree_from:
                continue
            for choice in product(self.contributions, repeat=len(jets)):
                if sum(one.order for one in choice) != order:
                    continue
                if tuple(map(sum, zip(*(one.monomial for one in choice), strict=True))) != monomial:
                    continue
                term = coefficient
                for one, jet in zip(choice, jets, strict=True):
                    factor = self.value(one, jet)
                    if factor == 0:
                        break
                    term = term * factor
                else:
                    total += term
        return total

    def linear(self, coefficients: Mapping[Jet, Expr], contribution: Contribution) -> Expr:
        """Return a linear form of one contribution."""
        total: Expr = Integer(0)
        for jet, coefficient in coefficients.items():
            total += coefficient * self.value(contribution, jet)
        return total

    def slow(self, coefficients: Mapping[Jet, Expr], contribution: Contribution) -> Expr:
        """Return the coefficient of d/dT of the amplitude: dt -> dtau + epsilon dT, so dt^j gives j (i omega)^(j-1)."""
        total: Expr = Integer(0)
        for (unknown, ds, dt), coefficient in coefficients.items():
            if dt == 1:
                total += coefficient * self.value(contribution, (unknown, ds, 0))
            elif dt == 2:
                total += 2 * coefficient * self.value(contribution, (unknown, ds, 1))
        return total


def label(monomial: Monomial, amplitudes: Sequence[Amplitude]) -> str:
    """Return a monomial as part of an identifier, such as `A_Ac` for A conj(A)."""
    return "_".join("_".join([amplitude.name] * count) for count, amplitude in zip(monomial, amplitudes, strict=True) if count)


def forced(forcing: Forcing, given: Mapping[tuple[str, int], Expr], functions: Functions) -> Expr:
    """Return a combination of forcing terms and their derivatives, for the forcing terms `given`."""
    total: Expr = Integer(0)
    for (kind, row, order), coefficient in forcing.items():
        value = given.get((kind, row), Integer(0))
        if value != 0:
            total += coefficient * functions.derivative(value, order)
    return total


def reduced(expansion: Expansion, weight: int, growth: Expr) -> Operator:
    """Return the reduced operator of a weight and harmonic, with or without space."""
    reduce = reduce_operator if expansion.formulation.interval is not None else reduce_ordinary
    return reduce(expansion, weight, growth)


def right_hand_sides(orders: Orders, monomial: Monomial, weight: int) -> dict[tuple[str, int], Expr]:
    """Return the forcing (minus the nonlinear part) of every interior and boundary row of `weight` at `monomial`."""
    result: dict[tuple[str, int], Expr] = {}
    expansion = orders.expansion
    for kind, rows in expansion.groups:
        for number, row in enumerate(rows):
            if row.weight == weight:
                value = -orders.at(row, monomial)
                if value != 0:
                    result[kind, number] = value
    return result


def respond(orders: Orders, monomial: Monomial, operator: Operator, operator_name: str, singular: bool = False) -> Response | None:
    """Return the response to a monomial of second order, or None where there is no forcing; adds it to the expansion."""
    functions, amplitudes = orders.functions, orders.amplitudes
    weight = orders.weight(monomial)
    given = right_hand_sides(orders, monomial, weight)
    if not given:
        return None
    name = label(monomial, amplitudes)
    given = {key: functions.named(f"f_{name}_{key[0]}_{key[1]}", value) if key[0] == "row" else value for key, value in given.items()}
    own = tuple(Symbol(f"w_{name}_{orders.expansion.formulation.unknowns[unknown].name}{'_s' * order}") for unknown, order in operator.names)
    for state in own:
        functions.declare(state, Integer(0))
    states: tuple[Expr, ...] = own
    forcing = tuple(forced(row, given, functions) for row in operator.forcing)
    left: tuple[Expr, ...] = ()
    right: tuple[Expr, ...] = ()
    spare = [("", labels_of(row, orders.expansion), forced(row, given, functions)) for row in operator.spare]
    explicit = None
    if isinstance(operator, FirstOrderOperator):
        left = tuple(forced(row, given, functions) for row in operator.left.forcing)
        right = tuple(forced(row, given, functions) for row in operator.right.forcing)
        for side, rows in (("left", operator.left), ("right", operator.right)):
            spare += [(side, labels_of(row, orders.expansion), forced(row, given, functions)) for row in rows.spare]
        problem = (operator_name, forcing, left, right)
        if not singular and not any((*forcing, *left, *right)):
            own, states = (), tuple(Integer(0) for _ in own)
        elif problem in orders.solved:
            own, states = (), orders.solved[problem]
        else:
            orders.solved[problem] = own
            for i, state in enumerate(own):
                functions.declare(state, sum((operator.matrix[i][j] * states[j] for j in range(operator.size)), forcing[i]))
            explicit = None if singular else direct_integration(operator, own, forcing, left, right)
    values: dict[int, Expr] = {}
    for unknown, (over, extra) in operator.recovery.items():
        total = sum((over[j] * states[j] for j in range(len(states))), Integer(0)) + forced(extra, given, functions)
        if total != 0:
            values[unknown] = functions.named(f"{orders.expansion.formulation.unknowns[unknown].name}_{name}", total)
    orders.contributions.append(Contribution(monomial=monomial, order=2, harmonic=orders.harmonic(monomial), values=values))
    return Response(
        name=name, monomial=monomial, harmonic=orders.harmonic(monomial), operator=operator, operator_name=operator_name,
        own=own, states=states, forcing=forcing, left=left, right=right, values=values, spare=tuple(one for one in spare if one[2] != 0), singular=singular, explicit=explicit,
    )


def labels_of(forcing: Forcing, expansion: Expansion) -> tuple[str, ...]:
    """Return where the user wrote the rows of a combination."""
    rows = dict(expansion.groups)
    return tuple(dict.fromkeys(rows[kind][row].label for kind, row, _ in sorted(forcing)))


def direct_integration(operator: FirstOrderOperator, states: Sequence[Symbol], forcing: Sequence[Expr], left: Sequence[Expr],
                       right: Sequence[Expr]) -> tuple[tuple[int, str, Expr, Expr], ...] | None:
    """Return the response as nested quadratures, where the system is triangular and each state has its own boundary row."""
    solved: list[int] = []
    steps: list[tuple[int, str, Expr, Expr]] = []
    sides = (("left", operator.left.matrix, left), ("right", operator.right.matrix, right))
    while len(solved) < operator.size:
        for i in range(operator.size):
            if i in solved or any(operator.matrix[i][j] != 0 and j not in solved for j in range(operator.size)):
                continue
            start = None
            for side, rows, data in sides:
                for row, value in zip(rows, data, strict=True):
                    if row[i] != 0 and all(entry == 0 or j == i or j in solved for j, entry in enumerate(row)):
                        # the other states of the row are read at that end
                        start = (side, (value - sum((row[j] * states[j] for j in solved), Integer(0))) / row[i])
            if start is None:
                continue
            slope = sum((operator.matrix[i][j] * states[j] for j in solved), forcing[i])
            steps.append((i, start[0], slope, start[1]))
            solved.append(i)
            break
        else:
            return None
    return tuple(steps)
