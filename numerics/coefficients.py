"""Coefficients from emitted text: right to the digits asked for, or a clear failure.

Every result is computed twice, with more bits and (on nodes) with other nodes; the difference is the estimate of the error.
The precision is raised until that estimate is below what was asked for.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from flint import acb, arb

from numerics.algebra import Algebra, Constants
from numerics.certified_count import FirstInstability
from numerics.closed import Closed
from numerics.precision import EvaluationError, NotClosed, bits_of, working_precision
from numerics.sampled import Chebyshev, Gauss, Samples
from numerics.threshold import Root, newton

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
        exec(compile(text, "<emitted>", "exec"), self.names)  # noqa: S102  (the emitted module is our own text)

    def __getattr__(self, name: str) -> Any:
        return self.names[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """Nodes on each panel and number of panels; not used without sampling."""

    nodes: int
    panels: int


def builder(module: Module, route: str, resolution: Resolution):  # type: ignore[no-untyped-def]
    """Return the function that makes the algebra of a route at (control, frequency)."""
    kind = {"closed": Closed, "chebyshev": Chebyshev, "quadrature": Gauss}[route]
    probe = Constants(control=acb(0), frequency=acb(0), values={})

    def build(control: acb, frequency: acb) -> Algebra:
        values = {name: acb(value) for name, value in module.parameters(probe).items()}
        common: dict[str, Any] = {"control": control, "frequency": frequency, "values": values}
        if not module.SPATIAL:
            return Constants(**common)
        ends = tuple(acb(end) for end in module.interval(probe))
        if kind is Closed:
            return Closed(ends=ends, **common)  # type: ignore[arg-type]
        return kind(ends=ends, nodes=resolution.nodes, panels=resolution.panels, **common)

    return build


@dataclass(frozen=True, slots=True, kw_only=True)
class Computed:
    """One computation: the root and the raw values by name."""

    root: Root
    values: dict[str, acb]
    scales: dict[str, arb]
    quadratic_zero: bool
    seconds: tuple[float, float]


def compute(module: Module, route: str, bits: int, resolution: Resolution, names: tuple[str, ...], start: Root | None, tolerance_bits: int) -> Computed:
    """Return threshold and raw coefficients at one precision and resolution."""
    hopf = module.KIND == "hopf"
    begun = time.perf_counter()

    def build(control: acb, frequency: acb) -> Algebra:
        return builder(module, route, resolution)(control, frequency)

    with working_precision(max(bits, 96)):
        control = start.control if start else arb(module.ONSET[0])
        frequency = (start.frequency if start else arb(module.ONSET[1])) if hopf else None
    root = newton(build, module.critical, control, frequency, bits, tolerance_bits, start is not None, abs(arb(module.CONTROL_RANGE[1]) - arb(module.CONTROL_RANGE[0])).mid())
    middle = time.perf_counter()
    with working_precision(bits):
        a = build(acb(root.control), acb(root.frequency))
        values: dict[str, acb] = {}
        scales: dict[str, arb] = {}
        quadratic_zero = True
        total = module.xi(a)
        check_simple(module, a, total)
        if module.QUADRATIC is not None:
            value = module.coefficient_A2(a)
            scale = 1 + abs(value)
            quadratic_zero = bool(abs(value).mid() < arb(2) ** (-(tolerance_bits * 3) // 4) * scale)
            if not quadratic_zero:
                values["coefficient_A2"] = value
        wanted = [identifier for _, monomial, identifier in module.COEFFICIENTS if quadratic_zero or monomial != "A**3"]
        for identifier in wanted:
            values[identifier] = module.names[identifier](a)
        for name, _, _ in module.WEAK:
            values[name] = module.names[name](a)
        for identifier, mirror in module.MIRROR:
            if identifier in values:
                other = module.names[mirror](a)
                if abs(other - values[identifier]).mid() > arb(2) ** (-(tolerance_bits // 2)) * (1 + abs(other)):
                    raise EvaluationError("rotation_axis: found different coefficients for the two senses of rotation: the problem is not unchanged by reflections, and its amplitude "
                                          "equation is not of this class; drop rotation_axis")
        demands = [*module.consistency(a), *(module.consistency_cubic(a) if quadratic_zero else ())]
        for labels, condition in demands:
            size = largest(condition)
            reference = max((largest(one) for one in module.mode(a)), default=1.0)
            if size > 2.0 ** (-min(tolerance_bits // 2, 300)) * max(1.0, reference) ** 2:
                raise EvaluationError(f"equations: {labels} contradict each other beyond the linear terms (residual {size:.3g}); expected redundant equations to follow from the others")
        del names
    return Computed(root=root, values=values, scales=scales, quadratic_zero=quadratic_zero, seconds=(middle - begun, time.perf_counter() - middle))


def largest(value: Any) -> float:
    """Return the size of a function or number."""
    if isinstance(value, int):
        return float(abs(value))
    if isinstance(value, acb):
        return float(abs(value.mid()))
    if isinstance(value, Samples):
        return value.largest()
    return max((float(abs(value.at(value.algebra.length * k / 7).mid())) for k in range(8)), default=0.0)


def check_simple(module: Module, a: Algebra, total: acb) -> None:
    """Refuse a defective critical eigenvalue: the adjoint product of direct and adjoint mode vanishes."""
    mode, adjoint = module.mode(a), module.adjoint_mode(a)
    size = max(largest(one) for one in mode) * max(largest(one) for one in adjoint)
    if not float(abs(total.mid())) > 1e-14 * size:
        raise EvaluationError("threshold: found a vanishing product of direct and adjoint mode: the critical eigenvalue is defective; expected a simple one")


def start_resolution(digits: int) -> Resolution:
    """Return nodes and panels for a problem with moderate exponents."""
    return Resolution(nodes=14 + digits // 4, panels=3 + digits // 10) if digits <= 100 else Resolution(nodes=24 + digits // 7, panels=8 + digits // 16)


def evaluate(emitted: str | Path | Mapping[str, Any], digits: int = 15, route: str = "auto", certify: bool = False, count: bool = True) -> Result:
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
    if certify:
        from numerics.certified import evaluate_certified

        return evaluate_certified(module, digits, route, count)
    if route != "auto":
        return evaluate_route(module, digits, route)
    try:
        return evaluate_route(module, digits, "closed")
    except NotClosed:
        return evaluate_route(module, digits, "chebyshev")


def evaluate_route(module: Module, digits: int, route: str) -> Result:
    """Return the result of one route, raising precision and resolution until the digits are there."""
    guard = 48
    goal = bits_of(digits + 3)
    bits = goal + guard
    resolution = start_resolution(digits)
    sampled = module.SPATIAL and route != "closed"
    previous: Computed | None = None
    seconds = [0.0, 0.0]
    reason = ""
    for _attempt in range(9):
        try:
            current = compute(module, route, bits, resolution, (), previous.root if previous else None, goal)
        except NotClosed:
            raise
        except ZeroDivisionError as problem:
            raise EvaluationError("a division by zero: a coefficient of the equations is singular on the interval") from problem
        seconds = [seconds[0] + current.seconds[0], seconds[1] + current.seconds[1]]
        if previous is not None and set(previous.values) == set(current.values):
            with working_precision(bits + 64):
                result, reason = finished(module, digits, route, previous, current, seconds, goal)
            if result is not None:
                return result
        previous = current
        bits += 40 if _attempt == 0 else bits // 4
        if sampled:
            resolution = Resolution(nodes=resolution.nodes + 6, panels=resolution.panels + 1) if _attempt == 0 else \
                Resolution(nodes=resolution.nodes * 5 // 4, panels=resolution.panels * 3 // 2)
    raise EvaluationError(f"{module.NAME}: {digits} digits by {route} are not reached: {reason}; ask for fewer digits or another route")


def finished(module: Module, digits: int, route: str, first: Computed, second: Computed, seconds: list[float], goal: int) -> tuple[Result | None, str]:
    """Return the result when both computations agree to the digits asked for, else the reason why not."""
    allowed = arb(10) ** -(digits + 1)
    root_a, root_b = first.root, second.root
    drift = abs(root_a.control - root_b.control)
    scale_control = abs(root_b.control)
    zero_control = bool(scale_control < arb(10) ** -(digits + 2) or scale_control < drift * 4)
    if drift > allowed * max_of(scale_control, arb(10) ** -(digits)):
        if not (zero_control and drift < arb(10) ** -(digits + 2)):
            return None, f"two computations of the threshold differ by {drift.str(3, radius=False)}"
    drift_frequency = abs(root_a.frequency - root_b.frequency)
    if drift_frequency > allowed * max_of(abs(root_b.frequency), arb(10) ** -digits):
        return None, f"two computations of the frequency differ by {drift_frequency.str(3, radius=False)}"
    hopf = module.KIND == "hopf"
    coefficients: list[Coefficient] = []
    warnings: list[str] = []
    listed = list(module.COEFFICIENTS)
    if module.QUADRATIC is not None and not second.quadratic_zero:
        listed = [entry for entry in listed if entry[1] != "A**3"] + [module.QUADRATIC]
        listed.sort(key=lambda entry: (entry[1].startswith("epsilon"), entry[1] == "mu*A"))
    pairs = [(name, monomial, first.values[identifier], second.values[identifier]) for name, monomial, identifier in listed]
    pairs += weak_pairs(module, first, second)
    for _, monomial, one, other in pairs:
        if not (one.is_finite() and other.is_finite()):
            reason = "the base state or the equations are not smooth in the control there: a fold, which is not of this class" if monomial == "mu*A" else \
                "the problem is singular at the threshold"
            raise EvaluationError(f"threshold: found no finite coefficient of {monomial}: {reason}")
    reference = max((abs(value) for _, _, _, value in pairs), default=arb(1))
    for name, monomial, one, other in pairs:
        if not hopf:
            one, other = acb(one.real), acb(other.real)
        elif monomial.startswith("epsilon*dot"):
            pass
        drift = abs(one - other).mid()
        size = abs(other).mid()
        floor = arb(10) ** -(digits + 2)
        if size < floor * max_of(arb(1), reference) and drift < floor * max_of(arb(1), reference) and size <= 8 * drift:
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
    if not module.WEAK:
        return []
    names = module.WEAK_NAMES

    def entries(values: dict[str, acb]) -> dict[str, acb]:
        table = {(r, c): values[name] for name, r, c in module.WEAK}
        a, b, c, d = (table.get(key, acb(0)) for key in ((0, 0), (0, 1), (1, 0), (1, 1)))
        i = acb(0, 1)
        # A_1 = (A_+ + A_-)/2, A_2 = (A_+ - A_-)/(2i)
        return {"11": (a + b + c + d) / 2, "12": i * (a + c - b - d) / 2, "21": (a - c + b - d) / (2 * i), "22": (a - c - b + d) / 2}

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
