r"""Two times: every row at any half-integer order of the multiple-scale expansion.

With :math:`\partial_t \to \partial_\tau + \epsilon\,\partial_T`, :math:`c = c_c + \epsilon\chi` and
:math:`u = u_0 + \epsilon^{1/2}u_{1/2} + \epsilon\,u_1 + \cdots`, where :math:`u_0` is the base state *at the threshold*, a row at
order m/2 is a sum of products of disturbances of lower orders. The rows themselves are differentiated, exactly; the Taylor rows of
`derive.expansion`, about the base state at the actual control, are not used, so that the two confirm each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import comb, factorial
from typing import Any

from sympy import Expr, I, Integer, Rational, Symbol

from derive.expand import expand
from derive.formulation import Formulation, Jet, RawRow, base_jets
from derive.statement import ordered_symbols


@dataclass(frozen=True, slots=True, order=True)
class Factor:
    """A derivative of a disturbance: of which unknown, how often in s, tau and T, and of which half-order (0: the whole field)."""

    unknown: int
    space: int
    fast: int
    slow: int
    half_order: int


Term = tuple[int, int, tuple[Factor, ...]]
"""(power of chi, power of the weak effect, sorted factors)"""


@dataclass(frozen=True, eq=False)
class Equation:
    """An equation of the statement: a scalar row, or a vector one in circular components; at `place` for a boundary row.

    `components` maps "" (a scalar) or "p", "m", "n" (plus, minus, along the axis) to an expression in jets.
    """

    label: str
    place: Expr | None
    side: str
    components: Mapping[str, Expr]
    formulation: Formulation
    jets: Mapping[Symbol, Jet]
    base: Mapping[Symbol, Expr]

    @cached_property
    def orders(self) -> dict[int, dict[str, dict[Term, Expr]]]:
        """Orders found so far."""
        return {}

    @cached_property
    def derivatives(self) -> dict[tuple[str, int, int, tuple[tuple[int, int, int], ...]], Expr]:
        """Derivatives found so far, by component, powers of control and weak effect, and jets."""
        return {}

    def at_order(self, half_order: int) -> dict[str, dict[Term, Expr]]:
        """Return {component: {term: coefficient}} at order `half_order`/2, the linear part included."""
        if half_order not in self.orders:
            self.orders[half_order] = {component: order_terms(self, component, half_order) for component in self.components}
        return self.orders[half_order]


def equations_of(formulation: Formulation) -> tuple[Equation, ...]:
    """Return interior equations, then those of the left and of the right end, as the user grouped them."""
    groups: list[tuple[tuple[RawRow, ...], Expr | None, str]] = [(rows, None, "row") for rows in formulation.rows]
    for (place, equations), side in zip(formulation.boundary, ("left", "right"), strict=False):
        groups += [(rows, place, side) for rows in equations]
    result = []
    shared: dict[str, Any] = {"formulation": formulation, "jets": {symbol: jet for jet, symbol in formulation.jets.items()}, "base": base_jets(formulation)}
    for rows, place, side in groups:
        label = rows[0].label.removesuffix("[0]") if len(rows) == 3 else rows[0].label
        if len(rows) == 3 and formulation.frame is not None:
            e1, e2, normal = formulation.frame
            mixed = {
                "p": sum(((e1[k] + I * e2[k]) * rows[k].expression for k in range(3)), Integer(0)),
                "m": sum(((e1[k] - I * e2[k]) * rows[k].expression for k in range(3)), Integer(0)),
                "n": sum((normal[k] * rows[k].expression for k in range(3)), Integer(0)),
            }
            symbols = [symbol for symbol in shared["jets"] if any(symbol in one.free_symbols for one in mixed.values())]
            if all(one.is_polynomial(*symbols) for one in mixed.values()):  # multiplied out once, what rotations forbid cancels
                mixed = {component: expand(one) for component, one in mixed.items()}
            result.append(Equation(label=label, place=place, side=side, components=mixed, **shared))
        else:
            result += [Equation(label=row.label, place=place, side=side, components={"": row.expression}, **shared) for row in rows]
    return tuple(result)


def order_terms(equation: Equation, component: str, half_order: int) -> dict[Term, Expr]:
    """Return the terms of one component at order `half_order`/2."""
    formulation = equation.formulation
    total: dict[Term, Expr] = {}
    for control_power, weak_power in ((p, w) for p in range(half_order // 2 + 1) for w in range(min(1, half_order // 2) + 1)):
        left_over = half_order - 2 * control_power - 2 * weak_power
        if left_over < 0:
            continue
        for degree in range(left_over + 1):
            if degree == 0 and left_over:
                continue
            for jets, coefficient in taylor_terms(equation, component, control_power, weak_power, degree):
                for factors, count in arranged(jets, left_over):
                    key = (control_power, weak_power, factors)
                    total[key] = total.get(key, Integer(0)) + count * coefficient
    tidy = {key: expand(value) for key, value in total.items()}
    return {key: tidy[key] for key in sorted(tidy) if not formulation.probe.is_zero(tidy[key])}


def taylor_terms(equation: Equation, component: str, control_power: int, weak_power: int, degree: int) -> Iterator[tuple[tuple[tuple[int, int, int], ...], Expr]]:
    """Return (jets, coefficient) of the Taylor terms of one degree: derivatives over factorials, at the base state."""
    formulation = equation.formulation
    known = equation.derivatives

    def derivative(jets: tuple[tuple[int, int, int], ...]) -> Expr:
        key = (component, control_power, weak_power, jets)
        if key not in known:
            if jets:
                known[key] = slope(derivative(jets[:-1]), formulation.jets[jets[-1]])
            else:
                expression = equation.components[component]
                for _ in range(weak_power):
                    expression = slope(expression, formulation.weak)
                expression = expression.xreplace({formulation.weak: Integer(0)})
                for _ in range(control_power):
                    expression = slope(expression, formulation.control)
                known[key] = expression
        return known[key]

    def extended(jets: tuple[tuple[int, int, int], ...], depth: int) -> Iterator[tuple[tuple[int, int, int], ...]]:
        if depth == 0:
            yield jets
            return
        for jet in sorted(equation.jets[symbol] for symbol in ordered_symbols(derivative(jets)) if symbol in equation.jets):
            if (not jets or jet >= jets[-1]) and derivative((*jets, jet)) != 0:
                yield from extended((*jets, jet), depth - 1)

    for jets in extended((), degree):
        value = derivative(jets).xreplace(equation.base)
        if equation.place is not None:
            value = value.subs(formulation.space, equation.place)
        repeats = factorial(control_power) * factorial(weak_power)
        for jet in sorted(set(jets)):
            repeats *= factorial(jets.count(jet))
        value = expand(value * Rational(1, repeats))
        if not formulation.probe.is_zero(value):
            yield jets, value


def slope(expression: Expr, symbol: Symbol) -> Expr:
    """Return a derivative; 0 at once where the symbol does not occur."""
    return expression.diff(symbol) if symbol in expression.free_symbols else Integer(0)


def arranged(jets: Sequence[tuple[int, int, int]], half_order: int) -> Iterator[tuple[tuple[Factor, ...], int]]:
    r"""Return (factors, count) of a product of jets at `half_order`: each jet of some order, each time derivative fast or slow."""
    if not jets:
        yield (), 1
        return
    for slow in product(*(range(dt + 1) for _, _, dt in jets)):
        left_over = half_order - 2 * sum(slow)
        count = 1
        for (_, _, dt), b in zip(jets, slow, strict=True):
            count *= comb(dt, b)  # (d_tau + epsilon d_T)^dt
        for orders in compositions(left_over, len(jets)):
            factors = tuple(sorted(Factor(unknown, ds, dt - b, b, k) for (unknown, ds, dt), b, k in zip(jets, slow, orders, strict=True)))
            yield factors, count


def compositions(total: int, parts: int) -> Iterator[tuple[int, ...]]:
    """Return the ordered ways to write `total` as `parts` positive integers."""
    if parts == 1:
        if total >= 1:
            yield (total,)
        return
    for first in range(1, total - parts + 2):
        for rest in compositions(total - first, parts - 1):
            yield (first, *rest)


def stated_terms(equation: Equation) -> dict[str, dict[Term, Expr]] | None:
    """Return the whole equation as a polynomial in its fields (half-order 0), or None where it is not one."""
    formulation, symbols = equation.formulation, equation.jets
    result: dict[str, dict[Term, Expr]] = {}
    for component, expression in equation.components.items():
        present = sorted((symbol for symbol in ordered_symbols(expression) if symbol in symbols), key=lambda symbol: symbols[symbol])
        if not expression.is_polynomial(*present, formulation.weak):
            return None
        terms: dict[Term, Expr] = {}
        polynomial = expand(expression).as_poly(*present, formulation.weak) if present else None
        if polynomial is None:
            return None
        for powers, coefficient in polynomial.terms():
            factors = tuple(sorted(Factor(*symbols[symbol][:2], symbols[symbol][2], 0, 0) for symbol, power in zip(present, powers, strict=False) for _ in range(power)))
            if not formulation.probe.is_zero(coefficient):
                terms[0, powers[-1], factors] = expand(coefficient)
        result[component] = {key: terms[key] for key in sorted(terms)}
    return result
