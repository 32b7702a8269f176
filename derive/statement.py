"""What a statement is made of: fields, exact numbers, vectors; and the errors that say what is wrong with one."""

from __future__ import annotations

from typing import Any

from sympy import Dummy, Expr, Float, Function, ImmutableMatrix, Limit, MatrixBase, Rational, Subs, Symbol, SympifyError, nan, oo, sympify, zoo
from sympy.concrete.expr_with_limits import ExprWithLimits

epsilon = Dummy("epsilon", real=True)
"""The size of a weak effect; see design section 2."""


class ProblemError(ValueError):
    """A mistake in the statement: says what was found, what was expected, what to do."""


class DerivationError(ArithmeticError):
    """The mathematics of the statement does not lead to an amplitude equation of the class."""


def one_line(message: str) -> str:
    """Return a message on one line."""
    return " ".join(message.split())


def field(name: str, *arguments: Symbol) -> Expr:
    """Return a real scalar field `name` of space and time, or of time alone."""
    return Function(name, real=True)(*arguments)


def vector_field(name: str, *arguments: Symbol) -> ImmutableMatrix:
    """Return a real vector field, shape (3, 1), with Cartesian components `name.x, name.y, name.z`."""
    return ImmutableMatrix([field(f"{name}.{axis}", *arguments) for axis in "xyz"])


def exact(value: Any, what: str) -> Expr:
    """Return `value` as an exact SymPy expression or say what to write instead."""
    if isinstance(value, float):
        advice = "write a finite exact number" if value != value or value in (float("inf"), float("-inf")) else exact_advice(value)
        raise ProblemError(f"{what}: found the float {value!r}; expected an exact number: {advice}")
    try:
        expression = sympify(value, strict=not isinstance(value, int))
    except (SympifyError, TypeError, ValueError, AttributeError) as problem:
        raise ProblemError(f"{what}: found {value!r}; expected an exact number or a SymPy expression") from problem
    if not isinstance(expression, Expr):
        raise ProblemError(f"{what}: found {value!r}; expected a scalar expression")
    floats = sorted(expression.atoms(Float), key=str)
    if floats:
        raise ProblemError(f"{what}: found the float {floats[0]}; expected an exact number: {exact_advice(floats[0])}")
    if expression.has(nan, zoo, oo, -oo):
        raise ProblemError(f"{what}: found {expression}; expected a finite expression")
    return expression


def evaluated(value: Any, what: str) -> Expr:
    """Return an exact expression with all that can be evaluated done; refuse an integral, a sum or a limit that is left."""
    expression = exact(exact(value, what).doit(), what)
    left = sorted(expression.atoms(ExprWithLimits, Limit, Subs), key=str)
    if left:
        raise ProblemError(f"{what}: found {left[0]}; expected an expression at one place: for an integral over s introduce a field whose derivative is the integrand")
    return expression


def exact_advice(value: Any) -> str:
    """Say which exact number to write for a float."""
    ratio = Rational(str(value)).limit_denominator(10**6)
    return f"write Rational({ratio.p}, {ratio.q})" if ratio.q != 1 else f"write {ratio.p}"


def is_vector(value: Any) -> bool:
    """Tell whether `value` is a SymPy matrix."""
    return isinstance(value, MatrixBase)


def components(value: Any, what: str) -> tuple[Any, ...]:
    """Return the entries of a scalar or of a 3-vector."""
    if not is_vector(value):
        return (value,)
    if value.shape != (3, 1):
        raise ProblemError(f"{what}: found a matrix of shape {value.shape}; expected a scalar or a vector of shape (3, 1)")
    return tuple(value)


def as_tuple(value: Any, what: str) -> tuple[Any, ...]:
    """Return a tuple for a tuple or list; a lone expression is a mistake that gets named."""
    if isinstance(value, (tuple, list)):
        return tuple(value)
    raise ProblemError(f"{what}: found {value!r}; expected a tuple; write ({value},) for a single entry")


def ordered_symbols(*expressions: Expr) -> list[Symbol]:
    """Return the free symbols by name, so that nothing unordered is iterated."""
    found: set[Any] = {symbol for expression in expressions for symbol in expression.free_symbols}
    return sorted(found, key=lambda symbol: symbol.name)
