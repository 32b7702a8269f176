"""Functions of `s` by name: what each is, and what its derivative is. Nothing is ever expanded or differentiated numerically."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sympy import Add, Expr, I, Integer, Mul, Symbol

from derive.expand import expand
from derive.statement import ordered_symbols


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """A named function: `symbol` = `expression` over functions named before it."""

    symbol: Symbol
    expression: Expr


@dataclass(slots=True)
class Functions:
    """The names in use, with the derivative of each."""

    space: Symbol
    slopes: dict[Symbol, Expr] = field(default_factory=dict)
    definitions: dict[Symbol, Definition] = field(default_factory=dict)
    reserved: frozenset[str] = frozenset()
    known: dict[Expr, Expr] = field(default_factory=dict)

    def declare(self, symbol: Symbol, slope: Expr) -> None:
        """Add a function whose derivative is known."""
        self.slopes[symbol] = slope

    def derivative(self, expression: Expr, order: int = 1) -> Expr:
        """Return the space derivative of an expression over named functions."""
        for _ in range(order):
            total = expression.diff(self.space) if self.space in expression.free_symbols else Integer(0)
            for symbol in ordered_symbols(expression):
                if self.slopes.get(symbol, Integer(0)) != 0:
                    total += expression.diff(symbol) * self.slopes[symbol]
            expression = total
        return expression

    def named(self, name: str, expression: Expr) -> Expr:
        """Return a symbol for the expression; a single term needs no name."""
        expression = expand(expression)
        if not expression.free_symbols & set(self.slopes) or not isinstance(expression, Add) and len(
            [factor for factor in Mul.make_args(expression) if factor.free_symbols & set(self.slopes)]
        ) < 2 and not any(factor.is_Pow for factor in Mul.make_args(expression)):
            return expression
        for sign in (1, -1):  # one name for a function and its negative
            if sign * expression in self.known:
                return sign * self.known[sign * expression]
        while name in self.reserved:
            name += "_"
        symbol = Symbol(name)
        if symbol in self.definitions:
            raise AssertionError(f"{name} is named twice")
        self.known[expression] = symbol
        self.definitions[symbol] = Definition(symbol=symbol, expression=expression)
        self.declare(symbol, self.derivative(expression))
        return symbol

    def is_function(self, expression: Expr) -> bool:
        """Tell whether the expression depends on s."""
        return bool(expression.free_symbols & (set(self.slopes) | {self.space}))


def conjugated(expression: Expr, bars: Mapping[Symbol, Symbol]) -> Expr:
    """Return the reflection: I becomes -I and each function its reflected one; all other symbols are real."""
    if expression == 0:
        return Integer(0)
    return expression.xreplace({I: -I, **bars})
