"""Is an exact expression identically zero?

Rational arithmetic on the expression settles most cases. The others (exp, sin, roots, ...) are evaluated at random points
with 40 digits: an analytic expression that vanishes at three random points of its domain vanishes. A sum vanishes there if nothing
is left of its largest term: exp(-10^6) is small, not zero.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product

from sympy import Add, Expr, I, Integer, Mul, Pow, Rational, Symbol, exp, nan, oo, zoo
from sympy.core.evalf import PrecisionExhausted

from derive.expand import expand
from derive.statement import ordered_symbols

DIGITS = 40
TINY = 1e-100
POINTS = 3
SAMPLES = 9


@dataclass(frozen=True, slots=True)
class Probe:
    """Where symbols may lie: fixed values of parameters, ranges of the control and of space."""

    fixed: Mapping[Symbol, Expr]
    ranges: Mapping[Symbol, tuple[Expr, Expr]]
    cache: dict = field(default_factory=dict, compare=False, repr=False)
    held: set = field(default_factory=set, compare=False, repr=False)
    """parameters at whose value, and not elsewhere, an expression was found to vanish"""

    def is_zero(self, expression: Expr) -> bool:
        """Tell whether the expression vanishes for every value of its symbols (parameters at their values)."""
        if expression.is_number and expression.is_Rational:
            return bool(expression == 0)
        known = self.cache.get(expression)
        if known is None:
            known = self.cache[expression] = self._is_zero(expression)
        return known

    def _is_zero(self, expression: Expr) -> bool:
        if expression.is_Symbol:
            return False
        expanded = expand(expression)
        if expanded == 0:
            return True
        if expanded.is_number and expanded.is_Rational:
            return False
        if isinstance(expanded, Mul):
            return any([self.is_zero_factor(factor) for factor in expanded.args])
        if isinstance(expanded, (Pow, exp)):
            return self.is_zero_factor(expanded)
        found_finite = False
        for attempt in range(POINTS):
            value = self.number(expanded, attempt)
            if value is None:
                continue
            found_finite = True
            if abs(value) > TINY or value != 0 and abs(value) > TINY * self.largest_term(expanded, attempt):
                return False
        if found_finite:
            self.held.update(symbol for symbol in expanded.free_symbols & set(self.fixed) if self.depends(expanded, symbol))
        return found_finite

    def is_zero_factor(self, factor: Expr) -> bool:
        """Tell whether a factor of a product vanishes."""
        if isinstance(factor, exp) or isinstance(factor, Pow) and not factor.exp.is_positive:
            return False
        if isinstance(factor, Pow):
            return self.is_zero_factor(factor.base)
        if factor.is_Symbol and self.fixed.get(factor) == 0:
            self.held.add(factor)
            return True
        return self.is_zero(factor)

    def largest_term(self, total: Expr, attempt: int) -> Expr:
        """Return the modulus of the largest term of a sum at a point, and at least 1 for what is no sum."""
        sizes = (self.number(term, attempt) for term in Add.make_args(total))
        return max((abs(size) for size in sizes if size is not None), default=Integer(1)) if isinstance(total, Add) else Integer(1)

    def depends(self, expression: Expr, symbol: Symbol) -> bool:
        """Tell whether an expression that vanishes no longer does at another value of a parameter."""
        moved = Probe(fixed={**self.fixed, symbol: self.fixed[symbol] * Rational(17, 16)}, ranges=self.ranges)
        value = moved.value(expression, 0)
        return value is None or abs(value) > 1e-30

    def may_vanish(self, expression: Expr) -> bool:
        """Tell whether the expression vanishes or changes sign somewhere in the ranges of its symbols, ends included; by samples."""
        if not expression.free_symbols & set(self.ranges):
            return False
        key = ("may_vanish", expression)
        if key not in self.cache:
            self.cache[key] = self._may_vanish(expression)
        return bool(self.cache[key])

    def _may_vanish(self, expression: Expr) -> bool:
        expression = Mul(*(factor for factor in Mul.make_args(expression) if not isinstance(factor, exp)))  # these never do
        first = None
        for shares in product(range(SAMPLES), repeat=len(self.ranges)):
            point = dict(self.fixed)
            for share, (symbol, (low, high)) in zip(shares, self.ranges.items(), strict=True):
                point[symbol] = low + (high - low) * Rational(share, SAMPLES - 1)
            if set(expression.free_symbols) - set(point):
                return False
            value = expression.subs(point).evalf(15)
            if not value.is_number or value == 0 or value.has(nan, zoo, oo):
                return True
            first = first or value
            if complex((value / first).evalf(15)).real <= 1e-12:
                return True
        return False

    def value(self, expression: Expr, attempt: int) -> complex | None:
        """Return the expression at the random point number `attempt` as a double, or None where it has no finite value."""
        number = self.number(expression, attempt)
        return None if number is None else complex(number)

    def number(self, expression: Expr, attempt: int) -> Expr | None:
        """Return the expression at the random point number `attempt`, or None where it has no finite value; no number is too small."""
        chooser = random.Random(7919 * (attempt + 1))
        values: dict[Symbol, Expr] = {}
        for symbol in ordered_symbols(expression):
            share = Rational(chooser.randint(100, 899), 1000)
            if symbol in self.fixed:
                values[symbol] = self.fixed[symbol]
            elif symbol in self.ranges:
                low, high = self.ranges[symbol]
                values[symbol] = low + (high - low) * share
            elif symbol.is_real:
                values[symbol] = share + Rational(1, 3)
            else:
                values[symbol] = share + I * Rational(chooser.randint(100, 899), 1000)
        try:
            number = expression.evalf(DIGITS, subs=values, maxn=200)
            if not number.is_number:
                number = expression.subs(values).evalf(DIGITS, maxn=200)
            size = abs(complex(number))
        except (TypeError, ValueError, OverflowError, PrecisionExhausted, ZeroDivisionError):
            return None
        return number if size < 1e200 else None
