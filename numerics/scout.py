"""Where functions of s vary: panels on which none can hide a feature between the nodes of a rule.

The emitted text runs once over an algebra without values that notes every function of s made of coefficients alone. In balls such a function
is bounded on a disc about a panel, so that what a polynomial of degree N leaves of it is: a layer of any width is found, however few nodes see it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

from flint import acb, acb_poly, arb

from numerics.algebra import Operator, Row, number
from numerics.certified_linear import CertifiedConstants, upper
from numerics.certified_series import PowerSeries, Series, exact
from numerics.precision import EvaluationError, working_precision

if TYPE_CHECKING:
    from numerics.coefficients import Module

DEGREE = 160
GOAL = 60
NARROWEST = Fraction(1, 2**24)
MOST_PANELS = 300
NARROW = Fraction(1, 256)
SHARES = (Fraction(7, 51), Fraction(25, 51), Fraction(43, 51))
"""where on a panel the size of a function is read: no places of symmetry"""


class Scout(PowerSeries):
    """The algebra that notes functions of s; what it computes has no meaning."""

    name: ClassVar[str] = "scout"

    def __init__(self, **common: Any) -> None:
        super().__init__(breaks=(Fraction(0),), terms=1, real=False, **common)
        self.found: list[Callable[[Any], Any]] = []

    def expanded(self, at: Callable[[Any], Any]) -> list[acb_poly]:
        """Note a function of s."""
        self.found.append(at)
        return []

    def number_from(self, value: Any) -> acb:
        """Note a function, and return a number."""
        self.function(value)
        return acb(1)

    integral = left = right = number_from

    def integral_from_left(self, value: Any) -> Series:
        """Note a function."""
        return self.function(value)

    integral_to_right = integral_from_left

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Series, ...]:
        """Note the coefficients."""
        return tuple([self.function(entry) for line in operator.matrix for entry in line][:operator.size])

    def solve(self, operator: Operator, forcing: Row, left: Row, right: Row) -> tuple[Series, ...]:
        """Note the coefficients and the forcing."""
        self.kernel(operator)
        return tuple(self.function(entry) for entry in forcing)

    def solve_singular(self, operator: Operator, forcing: Row, left: Row, right: Row, row: Row, place: Any) -> tuple[Series, ...]:
        """Note the coefficients and the forcing."""
        return self.solve(operator, forcing, left, right)


def functions_of(module: Module, control: acb, frequency: acb) -> tuple[list[Callable[[Any], Any]], acb, acb]:
    """Return every function of s made of coefficients alone, and the ends of the interval."""
    probe = CertifiedConstants(control=acb(0), frequency=acb(0), values={})
    left, right = (acb(end) for end in module.interval(probe))
    scout = Scout(ends=(left, right), control=control, frequency=frequency, values={name: acb(value) for name, value in module.parameters(probe).items()})
    listed = [*module.COEFFICIENTS, *([module.QUADRATIC] if module.QUADRATIC is not None else [])]
    for name in ("xi", *(identifier for _, _, identifier in listed), *(name for name, _, _ in module.WEAK)):
        module.names[name](scout)
    return scout.found, left, right


def smooth(at: Callable[[Any], Any], centre: acb, half: acb, largest: arb) -> bool:
    """Tell whether a polynomial of degree N is, as is proved, near the function on a panel: |f - p| <= M rho^-N / (1 - 1/rho), M its bound on the disc |x| <= rho."""
    rho = arb("1.5")
    for _ in range(12):
        bound = number(at(centre + half * acb(arb(0, rho), arb(0, rho))))
        if not bound.is_finite():
            return False
        if upper(bound) * rho**-DEGREE / (1 - 1 / rho) <= largest * arb(2) ** -GOAL:
            return True
        rho = rho * arb("1.5")
    return False


def refined(functions: Sequence[Callable[[Any], Any]], left: acb, right: acb, breaks: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return `breaks` with more between them, until every function is smooth on every panel; a few are left where that cannot be proved."""
    found = set(breaks)
    for at in functions:
        values = [upper(number(at(left + (right - left) * exact(a + (b - a) * share)))) for a, b in zip(breaks, breaks[1:], strict=False) for share in SHARES]
        largest = max((size for size in values if size.is_finite()), default=arb(0))
        pending = list(zip(breaks, breaks[1:], strict=False))
        while pending:
            a, b = pending.pop()
            middle = (a + b) / 2
            if b - a <= NARROWEST or len(found) > MOST_PANELS or smooth(at, left + (right - left) * exact(middle), (right - left) * exact((b - a) / 2), largest):
                continue
            found.add(middle)
            pending += [(a, middle), (middle, b)]
    return tuple(sorted(found))


def scouted(module: Module, control: acb, frequency: acb, breaks: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return `breaks` refined for every function of s that the emitted text makes of coefficients alone."""
    try:
        return refined(*functions_of(module, control, frequency), breaks)
    except EvaluationError:
        return tuple(breaks)


def refuse_narrow(emitted: str) -> None:
    """Refuse a coefficient that varies within less than the full problem's polynomials on the whole interval resolve.

    Raises
    ------
    EvaluationError
        There is one; the message gives its width.
    """
    from numerics.coefficients import Module

    width = finest_variation(Module(emitted))
    if width < NARROW:
        raise EvaluationError(f"full problem: found a coefficient of the equations that varies within {float(width):.1g} of the interval; expected {float(NARROW):.1g} at least, "
                              "as the full problem is held by polynomials on the whole interval; the coefficients of the amplitude equation have no such limit")


def finest_variation(module: Module) -> Fraction:
    """Return the width, as a share of the interval, of the narrowest panel on which a function of s still varies by a thousandth of its size."""
    if not module.SPATIAL:
        return Fraction(1)
    with working_precision(GOAL + 50):
        try:
            functions, left, right = functions_of(module, acb(module.ONSET[0]), acb(module.ONSET[1] or 0))
        except EvaluationError:
            return Fraction(1)
        breaks = refined(functions, left, right, (Fraction(0), Fraction(1)))
        finest = Fraction(1)
        for at in functions:
            panels = []
            for a, b in zip(breaks, breaks[1:], strict=False):
                values = [number(at(left + (right - left) * exact(a + (b - a) * share))).mid() for share in SHARES]
                if all(value.is_finite() for value in values):
                    panels.append((b - a, max(abs(one - values[0]) for one in values), max(abs(one) for one in values)))
            largest = max((size for _, _, size in panels), default=arb(0))
            finest = min([finest, *(width for width, varied, _ in panels if varied > largest * arb("1e-3"))])
    return finest
