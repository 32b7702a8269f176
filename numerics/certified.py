"""Certified coefficients: every printed number with a proved bound on its distance from the true one.

The threshold is a proved root (`certified_root`); the emitted text then runs over an algebra of enclosures with control and frequency
as balls, so that each coefficient holds everything, the threshold's own uncertainty included. What is proved are the numbers, given
the emitted text; that the text is the right one is the matter of the derivation's own checks. The precision is raised until the
radii are small enough.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import flint
from flint import acb, arb

from numerics.algebra import Algebra, across
from numerics.certified_closed import CertifiedClosed
from numerics.certified_count import first_instability
from numerics.certified_linear import CertifiedConstants, Unproved, upper
from numerics.certified_root import ProvedRoot, approach, prove_root, slopes_at
from numerics.certified_series import PowerSeries, TooCoarse
from numerics.precision import EvaluationError, NotClosed, bits_of, working_precision

if TYPE_CHECKING:
    from numerics.coefficients import Module, Result

MOST_PANELS = 96
GUARD = 64
DEAR = 1000
"""beyond so many digits the cancellation is measured at 30 digits first"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How the algebra of a route is made: on which panels (shares of the interval)."""

    route: str
    breaks: tuple[Fraction, ...] = (Fraction(0), Fraction(1))

    def halved(self, panels: tuple[int, ...]) -> Plan:
        """Return the plan with some panels halved."""
        breaks = list(self.breaks)
        for k in sorted(set(panels), reverse=True):
            breaks.insert(k + 1, (breaks[k] + breaks[k + 1]) / 2)
        if len(breaks) > MOST_PANELS + 1:
            raise EvaluationError(f"--certify: found coefficients that need more than {MOST_PANELS} panels; run without it: the error is then estimated from two computations")
        return Plan(route=self.route, breaks=tuple(breaks))


def terms_of(bits: int) -> int:
    """Return how many terms bring e hL/N to the power N below 2^-bits, for the largest hL of a panel."""
    import math

    terms = 12
    while terms * math.log2(terms / (math.e * 4.0 * max(1.0, terms / 60))) < bits:
        terms += max(1, terms // 24)
    return terms


def algebra_of(module: Module, plan: Plan, control: acb, frequency: acb) -> Algebra:
    """Return the certified algebra at (control, frequency), at the working precision."""
    probe = CertifiedConstants(control=acb(0), frequency=acb(0), values={})
    common: dict[str, Any] = {"control": control, "frequency": frequency, "values": {name: acb(value) for name, value in module.parameters(probe).items()}}
    if not module.SPATIAL:
        return CertifiedConstants(**common)
    ends = tuple(acb(end) for end in module.interval(probe))
    if plan.route == "closed":
        return CertifiedClosed(ends=ends, **common)
    return PowerSeries(ends=ends, breaks=plan.breaks, terms=terms_of(flint.ctx.prec), real=module.KIND == "steady", **common)  # type: ignore[arg-type]


def evaluate_certified(module: Module, digits: int, route: str, count: bool) -> Result:
    """Return threshold and coefficients with proved bounds.

    Raises
    ------
    EvaluationError
        Something cannot be proved; the message says what and why.
    """
    if route == "quadrature":
        raise EvaluationError("--certify: found the route quadrature, which has no proof of its error; expected auto, closed or chebyshev (power series with bounded remainders)")
    start = Start(plan=Plan(route="series" if module.SPATIAL and route == "chebyshev" else "closed"), guard=GUARD)
    if digits > DEAR:
        _, start = searched(module, 30, route, start, count=False)
    return searched(module, digits, route, start, count)[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where the search for a precision begins: the plan, and the bits beyond those of the digits, which cancellation takes."""

    plan: Plan
    guard: int


def searched(module: Module, digits: int, route: str, start: Start, count: bool) -> tuple[Result, Start]:
    """Return the result at the first precision whose enclosures are narrow enough, with the plan and the guard that it needed."""
    plan, bits = start.plan, bits_of(digits) + start.guard
    seconds = [0.0, 0.0]
    reason, failures = "", 0
    for _ in range(40):
        try:
            answer, missing = attempt(module, plan, digits, bits, seconds, count)
        except TooCoarse as coarse:
            plan = plan.halved(coarse.panels)
            continue
        except NotClosed as problem:
            if route == "closed":
                raise EvaluationError(f"--certify: found no closed form: {problem}; use --route auto") from problem
            plan = Plan(route="series")
            continue
        except Undecided as problem:
            reason = str(problem)
            break
        except Unproved as problem:
            reason = str(problem)
            missing = bits // 2
            failures += 1
            if module.SPATIAL and plan.route == "closed" and route == "auto" and failures > 1:
                plan, missing = Plan(route="series"), -8  # exponents that are exactly equal, say: series have no trouble with them
                bits = bits_of(digits) + GUARD
        else:
            if answer is not None:
                return answer, Start(plan=plan, guard=bits - bits_of(digits))
            reason = f"the enclosures are {missing} bits too wide"
        bits += missing + 8
        if bits > 8 * (bits_of(digits) + 128):
            break
    raise EvaluationError(f"--certify: {module.NAME} at {digits} digits: {reason}; run without --certify: the error is then estimated from two computations")


def attempt(module: Module, plan: Plan, digits: int, bits: int, seconds: list[float], count: bool) -> tuple[Result | None, int]:
    """Return the result at one precision, or the bits that are missing."""
    begun = time.perf_counter()
    with working_precision(bits):
        root = find_root(module, plan, bits)
        seconds[0] += time.perf_counter() - begun
        begun = time.perf_counter()
        a = algebra_of(module, plan, acb(root.control), acb(root.frequency))
        values = enclosures(module, a)
        seconds[1] += time.perf_counter() - begun
        result, missing = written_result(module, plan, digits, root, values, seconds)
    if result is None or not count:
        return result, missing
    return replace(result, first_instability=first_instability(module, root.control, root.frequency, float(module.names.get("NEIGHBOUR", "0")))), 0


def find_root(module: Module, plan: Plan, bits: int) -> ProvedRoot:
    """Return the proved threshold."""
    hopf = module.KIND == "hopf"

    def build(control: acb, frequency: acb) -> Any:
        return algebra_of(module, plan, control, frequency)

    scale = (abs(arb(module.ONSET[0])) + abs(arb(module.CONTROL_RANGE[1]) - arb(module.CONTROL_RANGE[0])) * arb(2) ** -8).mid()
    control, frequency = arb(module.ONSET[0]).mid(), arb(module.ONSET[1]).mid() if hopf else None
    with working_precision(128):
        a = build(acb(control), acb(frequency if frequency is not None else 0))
        corner = a.corner(module.critical(a))

    def determinant(control: acb, frequency: acb) -> acb:
        a = build(control, frequency)
        return a.defect(module.critical(a), corner)  # type: ignore[no-any-return]

    control, frequency = approach(determinant, control, frequency, scale, bits)
    return prove_root(determinant, slopes_at(determinant, control, frequency, scale), control, frequency)


class Undecided(EvaluationError):
    """An enclosure that holds zero at any precision: whether the number is zero balls cannot tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Enclosed:
    """What the emitted text gives: enclosures by identifier, and whether the coefficient of A**2 is proved to vanish."""

    values: dict[str, acb]
    quadratic_zero: bool


def enclosures(module: Module, a: Algebra) -> Enclosed:
    """Return an enclosure of every coefficient."""
    values: dict[str, acb] = {}

    def run(name: str) -> acb:
        value = acb(module.names[name](a))
        if not value.is_finite():
            raise Unproved(f"{name.removeprefix('coefficient_')} is not bounded: the product of direct and adjoint mode is not proved to differ from zero")
        return value

    module.critical(a)  # the adjoint takes its exponents from it
    if run("xi").contains(0):
        raise Unproved("the product of direct and adjoint mode is not proved to differ from zero: the critical eigenvalue may be defective")
    quadratic_zero = True
    if module.QUADRATIC is not None and not module.names.get("ODD", False):
        value = run("coefficient_A2")
        if not value.contains(0):
            quadratic_zero = False
            values["coefficient_A2"] = value
        elif not value.is_zero():
            message = "whether the coefficient of A**2 vanishes is not proved: no symmetry of the equations is known that makes it vanish, and its enclosure holds zero"
            raise Undecided(message) if upper(value) < arb(2) ** (-flint.ctx.prec // 2) else Unproved(message)
    for _, monomial, identifier in module.COEFFICIENTS:
        if quadratic_zero or monomial != "A**3":
            values[identifier] = run(identifier)
    for name, _, _ in module.WEAK:
        values[name] = run(name)
    for identifier, mirror in module.MIRROR:
        if identifier in values and not run(mirror).overlaps(values[identifier]):
            raise EvaluationError("rotation_axis: found different coefficients for the two senses of rotation: the problem is not unchanged by reflections, and its amplitude "
                                  "equation is not of this class; drop rotation_axis")
    for labels, condition in [*module.consistency(a), *(module.consistency_cubic(a) if quadratic_zero else ())]:
        if excludes_zero(a, condition):
            raise EvaluationError(f"equations: {labels} contradict each other beyond the linear terms; expected redundant equations to follow from the others")
    return Enclosed(values=values, quadratic_zero=quadratic_zero)


def excludes_zero(a: Algebra, condition: Any) -> bool:
    """Tell whether a demand is proved not to be met, at one of a few places."""
    if isinstance(condition, (int, acb)):
        return not acb(condition).contains(0)
    return any(not value.contains(0) for value in a.probes(condition))  # type: ignore[attr-defined]


def written_result(module: Module, plan: Plan, digits: int, root: ProvedRoot, enclosed: Enclosed, seconds: list[float]) -> tuple[Result | None, int]:
    """Return the result as decimal text with proved bounds, or how many bits are missing."""
    from numerics.coefficients import Coefficient, Number, Result, Threshold

    hopf = module.KIND == "hopf"
    width = abs(arb(module.CONTROL_RANGE[1]) - arb(module.CONTROL_RANGE[0]))
    missing = max(lacking(acb(root.control), digits, arb(10) ** -digits * (1 if not root.control.contains(0) else width)), lacking(acb(root.frequency), digits, arb(0)) if hopf else 0)
    coefficients: list[Coefficient] = []
    warnings: list[str] = []
    listed = [*module.COEFFICIENTS]
    if not enclosed.quadratic_zero:
        listed = [entry for entry in listed if entry[1] != "A**3"] + [module.QUADRATIC]
        listed.sort(key=lambda entry: (entry[1].startswith("epsilon"), entry[1] == "mu*A"))
    weak, left_out = weak_terms(module, enclosed)
    pairs = [(name, monomial, enclosed.values[identifier]) for name, monomial, identifier in listed] + weak
    reference = max((upper(value) for _, _, value in pairs), default=arb(1)).max(arb(1))
    floor = arb(10) ** -(digits + 3) * reference
    missing = max([missing, *(bits_above(upper(value), floor) for value in left_out)])
    for name, monomial, value in pairs:
        value = value if hopf or monomial.startswith("epsilon*dot") else acb(value.real)
        if value.contains(0):
            if value.is_zero() and monomial.startswith("epsilon"):
                continue
            missing = max(missing, bits_above(upper(value), floor))
            if monomial == "mu*A":
                raise Unproved("the coefficient of mu*A is not proved to differ from zero: the critical eigenvalue may not cross the axis with the control")
            proved = "vanishes" if value.is_zero() else "is zero within its error (that it vanishes exactly is not proved)"
            warnings.append(f"the coefficient of {monomial} {proved}: the next order decides" if not monomial.startswith("epsilon") else f"the coefficient of {monomial} {proved}")
            coefficients.append(Coefficient(name=name, monomial=monomial, value=Number(re="0", im="0", error=rounded_up(upper(value)))))
            continue
        missing = max(missing, lacking(value, digits, arb(0)))
        coefficients.append(Coefficient(name=name, monomial=monomial, value=printed(value, digits)))
    if missing > 0:
        return None, missing
    control, error = printed_real(root.control, digits)
    frequency, error_frequency = printed_real(root.frequency, digits) if hopf else (None, arb(0))
    threshold = Threshold(kind=module.KIND, multiplicity=module.MULTIPLICITY, control=control, frequency=frequency, error=rounded_up(error.max(error_frequency)))
    return Result(
        problem=module.NAME, digits=digits, route=plan.route, certified=True, threshold=threshold, coefficients=tuple(coefficients),
        seconds=MappingProxyType({"derive": 0.0, "threshold": seconds[0], "coefficients": seconds[1]}), warnings=tuple(warnings),
    ), 0


def weak_terms(module: Module, enclosed: Enclosed) -> tuple[list[tuple[str, str, acb]], list[acb]]:
    """Return the weak effects on a vector amplitude in the directions e1, e2 across the axis, and what is left out as zero: it has to be small."""
    if not module.WEAK:
        return [], []
    table = {(r, c): enclosed.values[name] for name, r, c in module.WEAK}
    entries = across(table, acb(0), acb(0, 1))
    unequal = [entries["12"], entries["21"], entries["11"] - entries["22"]]
    if all(value.contains(0) for value in unequal):
        text = "epsilon*A"
        return [(module.WEAK_NAMES.get(text, text), text, entries["11"])], unequal
    texts = {key: f"epsilon*dot(A,e{key[1]})*e{key[0]}" for key in entries}
    result = [(module.WEAK_NAMES.get(texts[key], texts[key]), texts[key], value) for key, value in entries.items() if not value.contains(0)]
    return result, [value for value in entries.values() if value.contains(0)]


def lacking(value: acb, digits: int, floor: arb) -> int:
    """Return how many bits the radius of an enclosure has to lose."""
    size = value.abs_lower().max(floor)
    return bits_above(upper(value - value.mid()), size * arb(10) ** -(digits + 2))


def bits_above(radius: arb, allowed: arb) -> int:
    """Return log2(radius/allowed), rounded up; at most 0 when the radius is allowed."""
    if radius <= allowed:
        return 0
    if not (allowed > 0):
        return 64
    return max(1, int(float((radius / allowed).log().upper()) / 0.6931) + 1)


def printed(value: acb, digits: int) -> Any:
    """Return a complex number with three digits more than asked for, and the proved distance of what is printed from the true value."""
    from numerics.coefficients import Number, decimal

    size = abs(value).mid()
    re, im = decimal(value.real, digits + 3, size), decimal(value.imag, digits + 3, size)
    return Number(re=re, im=im, error=rounded_up(upper(value - acb(arb(re), arb(im)))))


def printed_real(value: arb, digits: int) -> tuple[str, arb]:
    """Return a real number and the proved distance of what is printed."""
    from numerics.coefficients import decimal

    if value.contains(0):
        return "0", upper(value)
    text = decimal(value, digits + 3, abs(value).mid())
    return text, upper(value - arb(text))


def rounded_up(value: arb) -> str:
    """Return a text of two digits that is not below the number."""
    if value.is_zero():
        return "0"
    for factor in ("1.05", "1.11", "1.3"):
        text = (value * arb(factor)).mid().str(2, radius=False).replace("e+", "e")
        if arb(text) >= value:
            return text
    raise Unproved("an error is not finite")

