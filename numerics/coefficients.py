"""Coefficients from emitted text: right to the digits asked for, or a clear failure.

Every result is computed twice, with more bits and (on nodes) with other nodes; the difference is the estimate of the error.
The precision is raised until that estimate is below what was asked for.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from types import CodeType, MappingProxyType
from typing import Any

from flint import acb, arb

from numerics.algebra import Algebra, Constants, across, midpoint
from numerics.certified_count import FirstInstability
from numerics.closed import Closed
from numerics.precision import EvaluationError, NotClosed, bits_of, working_precision
from numerics.sampled import Chebyshev, Gauss, Sampled, Samples
from numerics.scout import scouted
from numerics.threshold import Build, Level, Root, newton

ROUTES = ("auto", "closed", "chebyshev", "quadrature")
MAX_DIGITS = 20000


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A complex number as decimal text, with a bound on its error."""

    re: str
    im: str
    error: str

    def __complex__(self) -> complex:
        return complex(float(self.re), float(self.im))

    def __repr__(self) -> str:
        if self.im == "0":
            return self.re
        return f"{self.re} {'-' if self.im.startswith('-') else '+'} {self.im.lstrip('-')}i"

    def _repr_latex_(self) -> str:
        return f"${self!r}$".replace("i$", "\\,i$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """A coefficient of the amplitude equation."""

    name: str
    monomial: str
    value: Number

    @property
    def error(self) -> str:
        """Bound on |computed - true|."""
        return self.value.error

    def as_dict(self) -> dict[str, str]:
        """Return the JSON object of the contract."""
        return {"name": self.name, "monomial": self.monomial, "re": self.value.re, "im": self.value.im, "error": self.value.error}


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """Where stability is lost: control and, for a Hopf bifurcation, frequency, as decimal text."""

    kind: str
    multiplicity: int
    control: str
    frequency: str | None
    error: str

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        return {"kind": self.kind, "multiplicity": self.multiplicity, "control": self.control, "frequency": self.frequency}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Threshold and coefficients with their errors."""

    problem: str
    digits: int
    route: str
    certified: bool
    threshold: Threshold
    coefficients: tuple[Coefficient, ...]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...] = ()
    first_instability: FirstInstability | None = None

    def __getitem__(self, name: str) -> Coefficient:
        for one in self.coefficients:
            if name in (one.name, one.monomial):
                return one
        raise KeyError(f"{name}: expected one of {', '.join(one.name for one in self.coefficients)}")

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        return {
            "problem": self.problem, "digits": self.digits, "route": self.route, "certified": self.certified,
            "threshold": self.threshold.as_dict(), "coefficients": [one.as_dict() for one in self.coefficients],
            "seconds": dict(self.seconds),
            **({"first_instability": self.first_instability.as_dict()} if self.first_instability is not None else {}),
        }

    def __repr__(self) -> str:
        lines = [f"{self.problem}: {self.threshold.kind} at control {self.threshold.control}"
                 + (f", frequency {self.threshold.frequency}" if self.threshold.frequency else "")]
        lines += [f"  {one.name} = {one.value!r}  (error {one.error})" for one in self.coefficients]
        lines += [f"  first instability {self.first_instability}"] if self.first_instability is not None else []
        return "\n".join(lines)

    def _repr_latex_(self) -> str:
        rows = r" \\ ".join(rf"\text{{{one.name}}} &= {one.value!r}" for one in self.coefficients)
        return rf"$$\begin{{aligned}} {rows} \end{{aligned}}$$"


@lru_cache(maxsize=8)
def compiled(text: str) -> CodeType:
    """Return the code of an emitted module; the last few are kept, as compiling takes a good part of 50 digits."""
    return compile(text, "<emitted>", "exec")


class Module:
    """An emitted module: its names, found by attribute."""

    def __init__(self, emitted: str | Path | Mapping[str, Any]) -> None:
        self.names: dict[str, Any] = {"__name__": "emitted"}
        if isinstance(emitted, Mapping):
            self.names.update(emitted)
            return
        text = str(emitted)
        if "\n" not in text:
            path = Path(text)
            if not path.is_file():
                raise EvaluationError(f"{text}: found no such file; expected an emitted module or its text")
            text = path.read_text(encoding="utf-8")
        if 'Emitted by `fredholm derive`' not in text.split("\n", 1)[0]:
            raise EvaluationError("found a text that `fredholm derive` did not emit; expected an emitted module")
        exec(compiled(text), self.names)  # noqa: S102  (the emitted module is our own text)

    def __getattr__(self, name: str) -> Any:
        return self.names[name]

    @property
    def width(self) -> arb:
        """Return the length of the control range."""
        low, high = (arb(end) for end in self.CONTROL_RANGE)
        return (high - low).mid()


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """Nodes on each panel and the breaks between panels, as shares of the interval; not used without sampling."""

    nodes: int
    breaks: tuple[Fraction, ...]

    def refined(self, unresolved: frozenset[int]) -> Resolution:
        """Return the resolution with the panels named cut in halves."""
        middles = [(self.breaks[k] + self.breaks[k + 1]) / 2 for k in unresolved]
        return Resolution(nodes=self.nodes, breaks=tuple(sorted((*self.breaks, *middles))))


def uniform(panels: int) -> tuple[Fraction, ...]:
    """Return the breaks of panels of equal length."""
    return tuple(Fraction(k, panels) for k in range(panels + 1))


UNIFORM = uniform(4)
MAX_PANELS = 1200
GUARD = 48
SMALL_GUARD = 160
CLOSE = 1e-3
DEFECT = 1e-15
TELLS_ZERO = 80  # bits that tell a small coefficient of A**2 from zero
DEFECTIVE = "threshold: found a vanishing product of direct and adjoint mode: the critical eigenvalue is defective; expected a simple one"
SINGULAR = "a division by zero: a coefficient of the equations is singular on the interval"


def builder(module: Module, route: str, resolution: Resolution, goal: int) -> Build:
    """Return the function that makes the algebra of a route at (control, frequency)."""
    kind = {"closed": Closed, "chebyshev": Chebyshev, "quadrature": Gauss}[route]

    def build(control: acb, frequency: acb) -> Algebra:
        probe = Constants(control=acb(0), frequency=acb(0), values={})
        values = {name: acb(value) for name, value in module.parameters(probe).items()}
        common: dict[str, Any] = {"control": control, "frequency": frequency, "values": values}
        if not module.SPATIAL:
            return Constants(**common)
        ends = tuple(acb(end) for end in module.interval(probe))
        if kind is Closed:
            return Closed(ends=ends, **common)  # type: ignore[arg-type]
        return kind(ends=ends, nodes=resolution.nodes, breaks=resolution.breaks, goal=goal, **common)

    return build


def nodes_for(goal: int) -> int:
    """Return the nodes on a panel: three bits of the goal each, up to where the tables of a rule cost more than panels."""
    return min(goal // 3 + 12, 320)


def level_of(module: Module, route: str, goal: int, resolution: Resolution, guard: int) -> Level:
    """Return the level of a goal; on nodes 1.3 bits a node are lost between values and powers."""
    sampled = module.SPATIAL and route != "closed"
    return Level(goal=goal, bits=goal + guard + (int(1.3 * resolution.nodes) + 8 if sampled else 0), build=builder(module, route, resolution, goal + 16))


@dataclass(frozen=True, slots=True, kw_only=True)
class Computed:
    """One computation: the root and the raw values by name."""

    root: Root
    values: dict[str, acb]
    quadratic_zero: bool
    unresolved: frozenset[int]
    seconds: tuple[float, float]


def compute(module: Module, route: str, goal: int, guard: int, resolution: Resolution, onset: tuple[arb, arb | None], before: Root | None, width: arb | None = None,
            only: tuple[str, ...] = ()) -> Computed:
    """Return threshold and raw coefficients at one precision and resolution."""
    begun = time.perf_counter()
    goals = [goal]
    while before is None and goals[0] > 100:
        goals.insert(0, goals[0] // 2 + 16)
    top = level_of(module, route, goal, resolution, guard)
    levels = [level_of(module, route, one, Resolution(nodes=nodes_for(one), breaks=resolution.breaks), one + guard) for one in goals[:-1]] + [top]
    root = newton(levels, module.critical, onset, module.width if width is None else width, guard - 8, before)
    middle = time.perf_counter()
    with working_precision(top.bits):
        a = top.build(acb(root.control), acb(root.frequency))
        values: dict[str, acb] = {}
        quadratic_zero = True
        check_simple(module.xi(a))
        if module.QUADRATIC is not None:
            value = module.coefficient_A2(a)
            quadratic_zero = module.names.get("ODD", False) or vanishes(module, top.build, root, value, goal)
            if not quadratic_zero:
                values["coefficient_A2"] = value
        wanted = [identifier for name, monomial, identifier in module.COEFFICIENTS if (quadratic_zero or monomial != "A**3") and (not only or {name, monomial} & set(only))]
        for identifier in wanted:
            values[identifier] = module.names[identifier](a)
        for name, _, _ in module.WEAK if not only else ():
            values[name] = module.names[name](a)
        unresolved = frozenset(a.unresolved) if isinstance(a, Sampled) else frozenset()
        if not unresolved:
            check_consistent(module, a, values, quadratic_zero, goal)
    return Computed(root=root, values=values, quadratic_zero=quadratic_zero, unresolved=unresolved, seconds=(middle - begun, time.perf_counter() - middle))


def check_consistent(module: Module, a: Algebra, values: dict[str, acb], quadratic_zero: bool, tolerance_bits: int) -> None:
    """Refuse two senses of rotation that differ, and redundant equations that contradict each other."""
    for identifier, mirror in module.MIRROR:
        if identifier in values:
            other = module.names[mirror](a)
            if abs(other - values[identifier]).mid() > arb(2) ** (-(tolerance_bits // 2)) * (1 + abs(other)):
                raise EvaluationError("rotation_axis: found different coefficients for the two senses of rotation: the problem is not unchanged by reflections, and its amplitude "
                                      "equation is not of this class; drop rotation_axis")
    demands = [*module.consistency(a), *(module.consistency_cubic(a) if quadratic_zero else ())]
    reference = max((largest(one) for one in module.mode(a)), default=1.0) if demands else 1.0
    for labels, condition in demands:
        size = largest(condition)
        if size > 2.0 ** (-min(tolerance_bits // 2, 300)) * max(1.0, reference) ** 2:
            raise EvaluationError(f"equations: {labels} contradict each other beyond the linear terms (residual {size:.3g}); expected redundant equations to follow from the others")


def vanishes(module: Module, build: Build, root: Root, value: acb, goal: int) -> bool:
    """Tell whether the coefficient of A**2 is zero: what rounding and the error of the threshold leave of zero has no digit in common with the value beside it."""
    size = abs(value).mid()
    if size == 0 or size > arb(2) ** (-goal // 8):
        return bool(size == 0)
    a = build(acb((root.control + (abs(root.control) + module.width) * arb(2) ** -goal).mid()), acb(root.frequency))
    return bool(abs(module.coefficient_A2(a) - value).mid() > size * arb(2) ** (-goal // 4))


def largest(value: Any) -> float:
    """Return the size of a function or number."""
    if isinstance(value, int):
        return float(abs(value))
    if isinstance(value, acb):
        return float(abs(value.mid()))
    if isinstance(value, Samples):
        return value.largest()
    return max((float(abs(value.at(value.algebra.length * k / 7).mid())) for k in range(8)), default=0.0)


def check_simple(total: acb) -> None:
    """Refuse a defective critical eigenvalue: the adjoint product of direct and adjoint mode vanishes. How near it is to that `close_calls` tells."""
    if total.mid() == 0 or not total.is_finite():
        raise EvaluationError(DEFECTIVE)


def evaluate(emitted: str | Path | Mapping[str, Any], digits: int = 15, route: str = "auto", certify: bool = False, count: bool = True,
             near: tuple[str, str | None] | None = None, only: tuple[str, ...] = ()) -> Result:
    """Return threshold and coefficients, each right to `digits` significant digits of its modulus.

    Parameters
    ----------
    emitted
        The text that `Derivation.emit` returns, or the path of an emitted module.
    digits
        Significant digits of the modulus.
    route
        `closed`, `chebyshev`, `quadrature`, or `auto`: closed where it exists, else chebyshev.
    certify
        Prove the errors: every number is an enclosure. With `chebyshev` by power series on panels with bounded remainders.
    count
        With `certify`, count the unstable eigenvalues at the threshold too (`first_instability` of the result).
    near
        (control, frequency) as text, frequency None when steady: the coefficients at the critical point there. It need not be the first
        loss of stability, and nothing is said of the stability of the base state.
    only
        Names or monomials of the coefficients to evaluate; all when empty.

    Raises
    ------
    EvaluationError
        The digits cannot be given; the message says why.
    """
    if route not in ROUTES:
        raise EvaluationError(f"route: found {route!r}; expected one of {', '.join(ROUTES)}")
    if isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= MAX_DIGITS:
        raise EvaluationError(f"digits: found {digits!r}; expected an integer from 1 to {MAX_DIGITS}")
    module = Module(emitted)
    known = {text for name, monomial, _ in module.COEFFICIENTS for text in (name, monomial)}
    for name in only:
        if name not in known:
            raise EvaluationError(f"only: found {name!r}; expected coefficients of {module.NAME}: {', '.join(one[0] for one in module.COEFFICIENTS)}")
    if certify:
        if near is not None or only:
            raise EvaluationError("certify: found it with near or only; expected all coefficients at the first loss of stability")
        from numerics.certified import evaluate_certified

        result = evaluate_certified(module, digits, route, count)
        return with_close_calls(module, result) if count else result
    if route != "auto":
        return evaluate_route(module, digits, route, near, only)
    try:
        return evaluate_route(module, digits, "closed", near, only)
    except NotClosed:
        return evaluate_route(module, digits, "chebyshev", near, only)


def evaluate_route(module: Module, digits: int, route: str, near: tuple[str, str | None] | None = None, only: tuple[str, ...] = ()) -> Result:
    """Return the result of one route, raising precision and resolution until two computations agree to the digits."""
    goal = max(bits_of(digits + 3), TELLS_ZERO if module.QUADRATIC is not None and not module.names.get("ODD", False) else 0)
    guard = GUARD
    onset, width, breaks = beginning(module, route, goal, near)
    resolution = Resolution(nodes=nodes_for(goal), breaks=breaks)
    previous: Computed | None = None
    root: Root | None = None
    seconds = [0.0, 0.0]
    reason = ""
    for _attempt in range(24):
        try:
            current = compute(module, route, goal, guard, resolution, onset, root, width, only)
        except ZeroDivisionError as problem:
            raise EvaluationError(SINGULAR) from problem
        seconds = [seconds[0] + current.seconds[0], seconds[1] + current.seconds[1]]
        if current.unresolved:
            resolution = cut(resolution, current.unresolved)
            previous, root, reason = None, None, f"{len(current.unresolved)} panels are not resolved"
            continue
        if guard < SMALL_GUARD and abs(current.root.control) < module.width * arb(2) ** -30:  # zero, or tiny: tell which
            previous, root, guard = None, None, SMALL_GUARD
            continue
        if previous is not None and set(previous.values) == set(current.values):
            with working_precision(goal + guard + 64):
                result, reason = finished(module, digits, route, previous, current, seconds, goal, guard)
            if result is not None:
                return replace(result, warnings=(*result.warnings, *close_calls(module, route, resolution, current.root, near is None)))
            guard += guard // 2 + goal // 4
            goal += 16
        previous, root = current, current.root
        guard += 40
        resolution = Resolution(nodes=resolution.nodes + 6 + resolution.nodes // 16, breaks=resolution.breaks)
    raise EvaluationError(f"{module.NAME}: {digits} digits by {route} are not reached: {reason}; ask for fewer digits or another route")


def beginning(module: Module, route: str, goal: int, near: tuple[str, str | None] | None) -> tuple[tuple[arb, arb | None], arb | None, tuple[Fraction, ...]]:
    """Return where Newton's method starts, the width of its neighbourhood (None: of the control range), and the panels."""
    with working_precision(max(goal, 96)):
        control, frequency = near if near is not None else module.ONSET
        onset = (arb(control), arb(frequency) if module.KIND == "hopf" else None)
        width = None if near is None else (20 * max_of(abs(onset[0]), module.width * arb(2) ** -8)).mid()  # a root within two per cent of what was said
    return onset, width, adapted(module, route, onset, width) if module.SPATIAL and route != "closed" else UNIFORM


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbourhood:
    """The threshold and what distances from it are measured by: in control, the way from the lower end of the range."""

    module: Module
    level: Level
    control: arb
    frequency: arb

    @property
    def reach(self) -> arb:
        """Return the distance from the lower end of the control range, within which the base state is stable."""
        return max_of(abs(self.control - arb(self.module.CONTROL_RANGE[0])), self.module.width * arb(2) ** -20)

    def determinant(self, problem: str, control: arb, frequency: arb) -> acb:
        """Return the determinant of one of the emitted linear problems."""
        a = self.level.build(acb(control.mid()), acb(frequency.mid()))
        return midpoint(a.determinant(self.module.names[problem](a)))  # type: ignore[attr-defined]

    def growing(self, rate: arb) -> acb:
        """Return the critical determinant at the eigenvalue i omega + rate, a real rate when steady, i times one in a Hopf bifurcation."""
        if self.module.KIND == "hopf":
            return self.determinant("critical", self.control, self.frequency + rate)
        a = self.level.build(acb(self.control), acb(0))
        return midpoint(a.determinant(self.module.names[f"pencil_{self.module.MULTIPLICITY - 1}"](a, acb(rate))))  # type: ignore[attr-defined]

    def resonance(self, problem: str) -> float:
        """Return the relative distance in control or frequency at which D_h = 0, by one step of Newton's method."""
        here = self.determinant(problem, self.control, self.frequency)
        if here == 0:
            return 0.0
        steps = [(self.reach * arb(2) ** -24, arb(0)), (arb(0), self.frequency * arb(2) ** -24)]
        changes = [abs(self.determinant(problem, self.control + dc, self.frequency + dw) - here) for dc, dw in steps if dc != 0 or dw != 0]
        fastest = max(float((change / abs(here)).mid()) for change in changes) * 2.0**24
        return 1 / fastest if fastest else float("inf")

    def defect(self) -> tuple[float, float]:
        """Return the relative distances to a double eigenvalue: in control, |D_l^2 / (2 D_ll D_c)|, and of the other eigenvalue, |2 D_l / D_ll|, in frequencies.

        To leading order D = D_l l + D_ll l^2 / 2 + D_c dc about the threshold; where that is no description of D there is none nearby.
        """
        hopf = self.module.KIND == "hopf"
        scale = self.frequency if hopf else abs(arb(self.module.names.get("NEIGHBOUR", "0")))
        nowhere = float("inf"), float("inf")
        if scale == 0 or not (hopf or self.module.PENCILS):
            return nowhere
        h, dc = scale * arb(2) ** -12, self.reach * arb(2) ** -24
        low, here, high = self.growing(-h), self.growing(arb(0)), self.growing(h)
        first, second = (high - low) / (2 * h), (high - 2 * here + low) / (h * h)
        slope = (self.determinant("critical", self.control + dc, self.frequency) - self.determinant("critical", self.control, self.frequency)) / dc
        if second.mid() == 0 or slope.mid() == 0:
            return nowhere
        other = 2 * first / second
        if hopf and abs(self.growing((-other.real).mid()) - here).mid() > arb("0.3") * abs(first * other):
            return nowhere
        return float((abs(first * first / (2 * second * slope)) / self.reach).mid()), float((abs(other) / scale).mid())


def close_calls(module: Module, route: str, resolution: Resolution, root: Root, first: bool) -> tuple[str, ...]:
    """Return a warning with the distance for each degenerate point that is close: resonances, a defective eigenvalue, other modes.

    Raises
    ------
    EvaluationError
        The critical eigenvalue is defective as far as can be told.
    """
    warnings = []
    level = level_of(module, route, 60, Resolution(nodes=nodes_for(60), breaks=resolution.breaks), GUARD)
    with working_precision(level.bits):
        around = Neighbourhood(module=module, level=level, control=root.control, frequency=root.frequency)
        for name in sorted(one for one in module.names if one.startswith("operator_")):
            distance = around.resonance(name)
            if distance < CLOSE:
                warnings.append(f"the linear problem of harmonic {name.removeprefix('operator_').strip('_')} is singular at a relative distance of about {distance:.2g} in control or frequency: "
                                "a resonance; the amplitude equation holds in a range smaller than that")
        distance, other = around.defect()
    if distance < DEFECT:
        raise EvaluationError(f"{DEFECTIVE} (relative distance {distance:.2g} in control)")
    if distance < CLOSE:
        what = "the frequency goes to zero: a steady instability is close" if module.KIND == "hopf" and 1.5 < other < 2.5 else "two eigenvalues meet: the critical one is nearly defective"
        warnings.append(f"at a relative distance of about {distance:.2g} in control {what} (Takens-Bogdanov or 1:1 resonance); the amplitude equation holds in a range smaller than that")
    if first:
        for value, distance in module.names.get("NEAR_CRITICAL", ()):
            warnings.append(f"another eigenvalue, {value}, is within a relative distance of {distance} of the imaginary axis at the threshold: two modes are nearly critical together; "
                            "the amplitude equation of one holds in a range smaller than that")
    return tuple(warnings)


def with_close_calls(module: Module, result: Result) -> Result:
    """Return a certified result with the warnings of `close_calls`; the distances are not proved."""
    route = "closed" if result.route == "closed" else "chebyshev"
    with working_precision(160):
        control, frequency = arb(result.threshold.control).mid(), arb(result.threshold.frequency or 0).mid()
        breaks = adapted(module, route, (control, frequency if result.threshold.frequency else None), None) if module.SPATIAL and route != "closed" else UNIFORM
    root = Root(control=control, frequency=frequency, error=arb(0), steps=0, slopes=(acb(0), acb(0)), slopes_bits=0)
    try:
        return replace(result, warnings=(*result.warnings, *close_calls(module, route, Resolution(nodes=nodes_for(60), breaks=breaks), root, True)))
    except NotClosed:
        return result


def cut(resolution: Resolution, unresolved: frozenset[int]) -> Resolution:
    """Return the refined resolution, or refuse what stays unresolved on a thousand panels."""
    finer = resolution.refined(unresolved)
    narrowest = min(b - a for a, b in zip(finer.breaks, finer.breaks[1:], strict=False))
    if len(finer.breaks) > MAX_PANELS or narrowest < Fraction(1, 2**40):
        raise EvaluationError("a coefficient of the equations or a mode is not resolved on the finest panels; expected functions that are smooth on the interval, its ends included")
    return finer


def adapted(module: Module, route: str, onset: tuple[arb, arb | None], width: arb | None) -> tuple[Fraction, ...]:
    """Return the breaks that resolve every function of the problem to the digits of a double, where panels are cheap."""
    goal = 60
    with working_precision(goal + GUARD):
        resolution = Resolution(nodes=nodes_for(goal), breaks=scouted(module, acb(onset[0]), acb(onset[1] or 0), UNIFORM))
    while True:  # first the critical problem alone, without which Newton's method has nothing to start from
        level = level_of(module, route, goal, resolution, GUARD)
        with working_precision(level.bits):
            a = level.build(acb(onset[0]), acb(onset[1] or 0))
            assert isinstance(a, Sampled)
            try:
                a.determinant(module.critical(a))
            except ZeroDivisionError as problem:
                raise EvaluationError(SINGULAR) from problem
        if not a.unresolved:
            break
        resolution = cut(resolution, frozenset(a.unresolved))
    for _ in range(24):
        unresolved = compute(module, route, goal, GUARD, resolution, onset, None, width).unresolved
        if not unresolved:
            break
        resolution = cut(resolution, unresolved)
    return resolution.breaks


def finished(module: Module, digits: int, route: str, first: Computed, second: Computed, seconds: list[float], goal: int, guard: int) -> tuple[Result | None, str]:
    """Return the result when both computations agree to the digits asked for, else the reason why not."""
    allowed = arb(10) ** -(digits + 1)
    root_a, root_b = first.root, second.root
    drift = abs(root_a.control - root_b.control)
    scale_control = abs(root_b.control)
    # zero is what cannot be told from it, on the scale of the control range as well as on the absolute one
    unresolved = max_of(drift * 4, module.width * arb(2) ** (24 - goal - guard))
    zero_control = bool(scale_control <= unresolved and unresolved < arb(10) ** -(digits + 2) * min_of(arb(1), module.width))
    if drift > allowed * scale_control and not zero_control:
        return None, f"two computations of the threshold differ by {drift.str(3, radius=False)}"
    drift_frequency = abs(root_a.frequency - root_b.frequency)
    if drift_frequency > allowed * abs(root_b.frequency):
        return None, f"two computations of the frequency differ by {drift_frequency.str(3, radius=False)}"
    hopf = module.KIND == "hopf"
    coefficients: list[Coefficient] = []
    warnings: list[str] = []
    listed = list(module.COEFFICIENTS)
    if module.QUADRATIC is not None and not second.quadratic_zero:
        listed = [entry for entry in listed if entry[1] != "A**3"] + [module.QUADRATIC]
        listed.sort(key=lambda entry: (entry[1].startswith("epsilon"), entry[1] == "mu*A"))
    pairs = [(name, monomial, first.values[identifier], second.values[identifier]) for name, monomial, identifier in listed if identifier in second.values]
    pairs += weak_pairs(module, first, second)
    for _, monomial, one, other in pairs:
        if not (one.is_finite() and other.is_finite()):
            reason = "the base state or the equations are not smooth in the control there: a fold, which is not of this class" if monomial == "mu*A" else \
                "the problem is singular at the threshold"
            raise EvaluationError(f"threshold: found no finite coefficient of {monomial}: {reason}")
    for name, monomial, one, other in pairs:
        if not hopf:
            one, other = acb(one.real), acb(other.real)
        elif monomial.startswith("epsilon*dot"):
            pass
        drift = abs(one - other).mid()
        size = abs(other).mid()
        floor = arb(10) ** -(digits + 2)
        if size < floor and drift < floor and size <= 8 * drift:
            if monomial.startswith("epsilon"):
                continue  # zero weak terms are left out
            if monomial != "mu*A":
                warnings.append(f"the coefficient of {monomial} vanishes: the next order decides")
            else:
                raise EvaluationError("threshold: the critical eigenvalue does not cross the axis with the control (the coefficient of mu*A vanishes)")
            coefficients.append(Coefficient(name=name, monomial=monomial, value=Number(re="0", im="0", error=short(max_of(drift * 4, floor)))))
            continue
        if drift > allowed * size:
            return None, f"two computations of {name} differ by {drift.str(3, radius=False)}"
        coefficients.append(Coefficient(name=name, monomial=monomial, value=written(other, drift * 4, digits)))
    control = "0" if zero_control else decimal(root_b.control, digits + 3, abs(root_b.control))
    threshold = Threshold(
        kind=module.KIND, multiplicity=module.MULTIPLICITY, control=control,
        frequency=decimal(root_b.frequency, digits + 3, abs(root_b.frequency)) if hopf else None, error=short(max_of(drift * 4, arb(10) ** -(digits + 2) * scale_control)),
    )
    return Result(
        problem=module.NAME, digits=digits, route=route, certified=False, threshold=threshold, coefficients=tuple(coefficients),
        seconds=MappingProxyType({"derive": 0.0, "threshold": seconds[0], "coefficients": seconds[1]}), warnings=tuple(warnings),
    ), ""


def weak_pairs(module: Module, first: Computed, second: Computed) -> list[tuple[str, str, acb, acb]]:
    """Return the weak effects on a vector amplitude, in the directions e1, e2 across the axis."""
    if not any(name in second.values for name, _, _ in module.WEAK):
        return []
    names = module.WEAK_NAMES

    def entries(values: dict[str, acb]) -> dict[str, acb]:
        return across({(r, c): values[name] for name, r, c in module.WEAK}, acb(0), acb(0, 1))

    one, two = entries(first.values), entries(second.values)
    scale = max((abs(value) for value in two.values()), default=arb(1))
    tiny = scale * arb(2) ** -60
    if abs(two["12"]) < tiny and abs(two["21"]) < tiny and abs(two["11"] - two["22"]) < tiny:
        return [(names.get("epsilon*A", "epsilon*A"), "epsilon*A", one["11"], two["11"])]
    result = []
    for key in ("11", "12", "21", "22"):
        text = f"epsilon*dot(A,e{key[1]})*e{key[0]}"
        if abs(two[key]) >= tiny:
            result.append((names.get(text, text), text, one[key], two[key]))
    return result


def min_of(a: arb, b: arb) -> arb:
    """Return the smaller midpoint."""
    return (a if a.mid() < b.mid() else b).mid()


def max_of(a: arb, b: arb) -> arb:
    """Return the larger midpoint."""
    return (a if a.mid() > b.mid() else b).mid()


def short(value: arb) -> str:
    """Return a positive number rounded up to two digits."""
    if value.mid() == 0:
        return "0"
    text = (value.mid() * arb("1.06")).str(2, radius=False)
    return scientific(text)


def scientific(text: str) -> str:
    """Return flint's decimal text in Python's form."""
    return text.replace("e+", "e")


def written(value: acb, error: arb, digits: int) -> Number:
    """Return a value with three digits more than asked for, and the error with that of the rounding."""
    size = abs(value).mid()
    rounding = size * arb(10) ** -(digits + 2)
    return Number(re=decimal(value.real, digits + 3, size), im=decimal(value.imag, digits + 3, size), error=short(max_of(error, rounding) + rounding))


def decimal(value: arb, digits: int, size: arb) -> str:
    """Return a real number to `digits` digits of `size`; what is below is 0."""
    value = value.mid()
    if value == 0 or abs(value) < size * arb(10) ** -(digits + 1):
        return "0"
    missing = int(float((size / abs(value)).log().mid()) / 2.302585092994046) if abs(value) < size else 0
    text = scientific(value.str(max(digits - missing, 1), radius=False))
    return text
