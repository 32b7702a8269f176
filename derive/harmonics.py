r"""The harmonics of each order: the rows of the two-time expansion with the solutions of lower orders inserted.

Monomials are (power of chi, mark, exponents of the amplitudes); the mark is 1 for a slow derivative and 2 for a weak effect. Nothing of
`derive.response` is used but the solutions themselves, so that what is written confirms what is integrated.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from sympy import Expr, I, Integer

from derive.amplitude import Reduction
from derive.expand import expand
from derive.expansion import Expansion
from derive.operator import OMEGA
from derive.two_times import Equation, Factor

Monomial = tuple[int, ...]


class Harmonics:
    """Inserts the mode, the responses and the shift of the base state into the rows."""

    def __init__(self, expansion: Expansion, reduction: Reduction) -> None:
        self.formulation = expansion.formulation
        self.reduction = reduction
        self.count = len(reduction.amplitudes)
        self.hopf = reduction.kind == "hopf"
        self.first: dict[Monomial, Mapping[int, Expr]] = {(0, 0, *one.monomial): one.values for one in reduction.mode.contributions}
        self.second: dict[Monomial, Mapping[int, Expr]] = {(0, 0, *one.monomial): one.values for one in reduction.responses}
        self.shift: Monomial = (1, 0, *(0,) * self.count)
        moved = {unknown.index: self.formulation.base[unknown.index].diff(self.formulation.control) for unknown in self.formulation.unknowns}
        self.known: dict[tuple[Equation, str, int], dict[Monomial, Expr]] = {}
        self.second[self.shift] = {index: value for index, value in moved.items() if value != 0}

    def single(self, index: int) -> Monomial:
        """Return the monomial of one amplitude."""
        return (0, 0, *(int(k == index) for k in range(self.count)))

    def slow(self, index: int) -> Monomial:
        """Return the monomial of the slow derivative of one amplitude."""
        return (0, 1, *self.single(index)[2:])

    def weak(self, index: int) -> Monomial:
        """Return the monomial of a weak effect on one amplitude."""
        return (0, 2, *self.single(index)[2:])

    def shifted(self, index: int) -> Monomial:
        """Return the monomial of chi times one amplitude."""
        return (1, 0, *self.single(index)[2:])

    def values(self, unknown: int) -> dict[Monomial, Expr]:
        """Return an unknown at second order by monomial."""
        return {monomial: values[unknown] for monomial, values in self.second.items() if values.get(unknown, 0) != 0}

    def value(self, unknown: int, monomial: Monomial) -> Expr:
        """Return an unknown at one monomial."""
        return {**self.first, **self.second}.get(monomial, {}).get(unknown, Integer(0))

    def harmonic(self, monomial: Monomial) -> int:
        """Return the harmonic of a monomial."""
        return sum(power * one.harmonic for power, one in zip(monomial[2:], self.reduction.amplitudes, strict=True))

    def factor(self, factor: Factor) -> list[tuple[Monomial, Expr]]:
        """Return a factor of a term by monomial, with its derivatives taken."""
        known = self.first if factor.half_order == 1 else self.second
        functions = self.reduction.functions
        result = []
        for monomial, values in known.items():
            value = values.get(factor.unknown, Integer(0))
            rate = I * OMEGA * self.harmonic(monomial) if self.hopf else Integer(0)
            if value == 0 or factor.fast and rate == 0:
                continue
            value = functions.derivative(value, factor.space) * rate**factor.fast
            if factor.slow:
                if factor.half_order != 1:
                    continue  # a slow derivative of a response is beyond third order
                monomial = (monomial[0], 1, *monomial[2:])
            if value != 0:
                result.append((monomial, value))
        return result

    def forcing(self, equation: Equation, component: str, half_order: int) -> dict[Monomial, Expr]:
        """Return the right side of one component at `half_order` by monomial: minus all that is not linear in that order.

        The weak effect is marked 2; with `half_order` 2 or 3 every factor is of first or second order.
        """
        if (equation, component, half_order) in self.known:
            return self.known[equation, component, half_order]
        total: dict[Monomial, Expr] = {}
        for (control, weak, factors), coefficient in equation.at_order(half_order)[component].items():
            if any(factor.half_order == half_order and not factor.slow for factor in factors):
                continue
            for choice in product(*(self.factor(factor) for factor in factors)):
                monomial = tuple(map(sum, zip(*(one for one, _ in choice), strict=True))) if choice else (0,) * (self.count + 2)
                monomial = (monomial[0] + control, monomial[1] + 2 * weak, *monomial[2:])
                value = -coefficient
                for _, one in choice:
                    value = value * one
                total[monomial] = total.get(monomial, Integer(0)) + value
        tidy = {monomial: expand(value) for monomial, value in total.items()}
        self.known[equation, component, half_order] = {monomial: tidy[monomial] for monomial in sorted(tidy) if not self.formulation.probe.is_zero(tidy[monomial])}
        return self.known[equation, component, half_order]
