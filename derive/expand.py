"""SymPy's algebra with the arguments of functions left as they are written.

exp(-(1000 (s - 1/3))^2) multiplied out is a product of exponentials that overflow, and its argument loses digits.
"""

from __future__ import annotations

import sympy
from sympy import Derivative, Dummy, Expr, Function, Poly, Symbol
from sympy.core.function import AppliedUndef


def shielded(expression: Expr, *inside: Symbol) -> tuple[Expr, dict[Dummy, Expr]]:
    """Return the expression with symbols for its functions, and what they stand for; fields and functions of `inside` stay."""
    functions = expression.atoms(Function)
    if not functions or any(isinstance(one, AppliedUndef) or one.has(*inside) for one in functions) or expression.has(Derivative):
        return expression, {}
    shield = {one: Dummy() for one in functions}
    return expression.xreplace(shield), {dummy: one for one, dummy in shield.items()}


def expand(expression: Expr) -> Expr:
    """Return the expression multiplied out."""
    bare, functions = shielded(expression)
    return sympy.expand(bare).xreplace(functions) if functions else sympy.expand(bare)


def cancel(expression: Expr) -> Expr:
    """Return the expression as a fraction in lowest terms."""
    bare, functions = shielded(expression)
    return sympy.cancel(bare).xreplace(functions) if functions else sympy.cancel(bare)


def coefficients_in(expression: Expr, symbol: Symbol) -> list[Expr]:
    """Return the coefficients of symbol^0, symbol^1, ... of a polynomial."""
    bare, functions = shielded(expression, symbol)
    return [one.as_expr().xreplace(functions) for one in reversed(Poly(bare, symbol).all_coeffs())]
