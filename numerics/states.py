"""States of the amplitude equation as numbers: right to the digits asked for, or a clear failure.

The coefficients enter as balls whose radius is their error, so that whatever is computed from them carries its own bound. A number
that is wrong by less than asked for is printed; a ball that cannot be told from zero with 30 more digits is a zero, and said so.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from flint import arb, fmpq

from numerics.coefficients import Result, Threshold, decimal, evaluate
from numerics.precision import EvaluationError, bits_of, working_precision

GUARDS = (8, 30, 90)  # the first is enough for numbers that are not zero
MOST_DIGITS = 10000
TRIVIAL = ("undeformed", "base")


@dataclass(frozen=True, slots=True, kw_only=True)
class Eigenvalue:
    """A growth rate of perturbations about a state, in original time; exactly zero where a symmetry makes it so."""

    re: str
    im: str
    direction: str
    neutral: str | None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        return {"re": self.re, "im": self.im, "direction": self.direction, "neutral": self.neutral}


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state at one control; without it (`exists` false) its numbers are None."""

    name: str
    exists: bool
    criticality: str | None
    amplitude_squared: str | None
    peak: str | None
    frequency_correction: str | None
    eigenvalues: tuple[Eigenvalue, ...]
    stable: bool | None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        numbers = {key: getattr(self, key) for key in ("name", "exists", "criticality", "amplitude_squared", "peak", "frequency_correction")}
        return {**numbers, "eigenvalues": [one.as_dict() for one in self.eigenvalues], "stable": self.stable}


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """What becomes of |A| at the threshold: `prefactor` t^exponent if it decays, `prefactor` (t* - t)^exponent if it grows."""

    perturbation: str
    decays: bool | None
    prefactor: str | None
    exponent: str

    def text(self) -> str | None:
        """Return the law as text, None where the next order decides."""
        if self.decays is None:
            return None
        return f"|A| ~ {self.prefactor} t^({self.exponent})" if self.decays else f"|A| ~ {self.prefactor} (t* - t)^({self.exponent}), infinite at a finite t*"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"perturbation": self.perturbation, "decays": self.decays, "prefactor": self.prefactor, "exponent": self.exponent}


@dataclass(frozen=True, slots=True, kw_only=True)
class StatesResult:
    """All states of a problem at one distance `mu` from the threshold."""

    problem: str
    mu: str
    digits: int
    kind: str
    threshold: Threshold
    criticality: str | None
    states: tuple[State, ...]
    at_threshold: tuple[Law, ...]
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> State:
        for one in self.states:
            if one.name == name:
                return one
        raise KeyError(f"{name}: expected one of {', '.join(one.name for one in self.states)}")

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        return {
            "problem": self.problem, "mu": self.mu, "digits": self.digits, "kind": self.kind, "criticality": self.criticality, "threshold": self.threshold.as_dict(),
            "states": [one.as_dict() for one in self.states], "at_threshold": [one.as_dict() for one in self.at_threshold], "warnings": list(self.warnings),
        }

    def text(self) -> str:
        """Return the states as lines of text."""
        lines = [f"{self.problem}: {self.kind}, {self.criticality or 'undecided'}, at mu = {self.mu}"]
        for state in self.states:
            if not state.exists:
                lines.append(f"  {state.name}: does not exist here" + (f" ({state.criticality})" if state.criticality else ""))
                continue
            verdict = {True: "stable", False: "unstable", None: "stability undecided"}[state.stable]
            lines.append(f"  {state.name}: {verdict}")
            if state.amplitude_squared != "0":
                lines += [f"    |A|^2                 {state.amplitude_squared}", f"    peak                  {state.peak}", f"    frequency correction  {state.frequency_correction}"]
            for one in state.eigenvalues:
                value = one.re if one.im == "0" else f"{one.re} {'-' if one.im.startswith('-') else '+'} {one.im.lstrip('-')}i"
                lines.append(f"    {one.direction:21} {value}" + (f"  ({one.neutral})" if one.neutral else ""))
        lines += [f"  at the threshold, {law.perturbation} perturbation: {law.text() or 'undecided'}" for law in self.at_threshold]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.text()

    def _repr_latex_(self) -> str:
        rows = r" \\ ".join(rf"\text{{{one.name}}} & {one.amplitude_squared or '-'} & {one.frequency_correction or '-'} & \text{{{'stable' if one.stable else 'unstable' if one.exists else ''}}}"
                            for one in self.states)
        return rf"$$\begin{{array}}{{llll}} & |A|^2 & \nu & \\ {rows} \end{{array}}$$"


def exact_number(text: str) -> Fraction:
    """Return an exact decimal or rational number, such as 1, 0.5, -3e-4 or 2/7."""
    fault = EvaluationError(f"mu: found {text!r}; expected an exact number such as 1, 0.5, -3e-4 or 2/7")
    if not re.fullmatch(r"[+-]?(\d+/\d+|(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?)", text, re.ASCII) or len(text) > 4000:
        raise fault
    try:
        return Fraction(text)
    except ZeroDivisionError:
        raise fault from None


def evaluate_states(emitted: str | Path | Mapping[str, Any], states: str, mu: str | int = "1", digits: int = 15) -> StatesResult:
    """Return all states at `mu` = control - threshold, each number right to `digits` significant digits.

    Parameters
    ----------
    emitted, states
        The texts that `Derivation.emit` and `States.emit` return.
    mu
        An integer, or text of an exact decimal or rational number.
    digits
        Significant digits; of the modulus for eigenvalues.

    Raises
    ------
    EvaluationError
        The digits cannot be given; the message says why.
    """
    if isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= MOST_DIGITS:
        raise EvaluationError(f"digits: found {digits!r}; expected an integer from 1 to {MOST_DIGITS}")
    distance = exact_number(mu if isinstance(mu, str) else str(mu) if type(mu) is int else repr((mu,)))  # a float is no exact number
    module = module_of(states)
    for guard in GUARDS:
        result = evaluate(emitted, digits=digits + guard)
        with working_precision(bits_of(digits + guard) + 64):
            reckoning = Reckoning(digits=digits, last=guard != GUARDS[0])
            try:
                return numbers_of(module, result, str(mu), distance, reckoning)
            except Undecided as reason:
                said = str(reason)
    raise EvaluationError(f"{result.problem}: {digits} digits of the states are not reached: {said}; ask for fewer digits")


def module_of(states: str) -> dict[str, Any]:
    """Return the names of the text that `States.emit` returns."""
    if "Emitted by `fredholm states`" not in states.split("\n", 1)[0]:
        raise EvaluationError("found a text that `States.emit` did not return; expected its text")
    module: dict[str, Any] = {"__name__": "emitted_states"}
    exec(compile(states, "<emitted states>", "exec"), module)
    return module


def analysis_of(module: Mapping[str, Any], monomials: Collection[str]) -> tuple[Sequence[tuple[str, Callable[..., Any]]], Callable[..., Any]]:
    """Return ((state, its function), ...) and the function of the laws at the threshold, of the amplitude equation with these monomials."""
    functions, laws = next((functions, laws) for listed, functions, laws in module["ANALYSES"] if set(listed) == set(monomials))
    return functions, laws


class Undecided(Exception):
    """A ball is too wide; more digits are needed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reckoning:
    """Decides about balls: what is printed, what is zero (on the last count only), what needs more digits."""

    digits: int
    last: bool

    def is_zero(self, value: arb, scale: arb) -> bool:
        """Tell whether a ball is zero; one that holds zero must be small against `scale`."""
        if not value.is_finite():
            raise Undecided("a quotient is not bounded")
        if not value.contains(0):
            return False
        if self.last and value.abs_upper() < arb(10) ** -(self.digits + 20) * scale.abs_upper():
            return True
        raise Undecided(f"{value.str(5)} cannot be told from zero")

    def sign(self, value: arb, scale: arb) -> int:
        """Return the sign of a ball."""
        return 0 if self.is_zero(value, scale) else 1 if value > 0 else -1

    def printed(self, real: arb | int, imaginary: arb | int, scale: arb) -> tuple[str, str]:
        """Return a complex number, right to the digits of its modulus."""
        parts = arb(real), arb(imaginary)
        if all(part == 0 or part.contains(0) and self.is_zero(part, scale) for part in parts):
            return "0", "0"
        size = max(abs(part).mid() for part in parts)
        for part in parts:
            if not part.is_finite() or part.rad() > arb(10) ** -(self.digits + 4) * size:
                raise Undecided(f"{part.str(self.digits)} is not known to {self.digits} digits")
        return decimal(parts[0], self.digits + 3, size), decimal(parts[1], self.digits + 3, size)


def ball(text: str, error: str) -> arb:
    """Return a decimal number as a ball with its error."""
    return arb(text) + arb(0, error)


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The coefficients as balls, by monomial, and the distance from the threshold."""

    coefficients: Mapping[str, tuple[arb, arb]]
    mu: arb
    reckoning: Reckoning

    @property
    def growth(self) -> arb:
        """Return the scale of growth rates."""
        return sum((abs(part) for part in self.coefficients["mu*A"]), arb(0)) * abs(self.mu)

    @property
    def transcritical(self) -> bool:
        """Tell whether the equation ends at A**2."""
        return "A**2" in self.coefficients

    def sign_of_coefficient(self, value: arb) -> int:
        """Return the sign of a sum of coefficients."""
        return self.reckoning.sign(value, sum((abs(part).mid() for pair in self.coefficients.values() for part in pair), arb(0)))

    def positive(self, value: arb) -> str:
        """Return a positive number as text."""
        return self.reckoning.printed(value, arb(0), arb(1))[0]

    def rate(self, real: arb, imaginary: arb | int = 0) -> tuple[str, str]:
        """Return a growth rate or a frequency as text."""
        return self.reckoning.printed(real, imaginary, self.growth)


def numbers_of(module: Mapping[str, Any], result: Result, text: str, distance: Fraction, reckoning: Reckoning) -> StatesResult:
    """Return the numbers of the analysis that belongs to the monomials of a result."""
    hopf = result.threshold.kind == "hopf"
    listed = {one.monomial: (ball(one.value.re, one.value.error), ball(one.value.im, one.value.error) if hopf else arb(0)) for one in result.coefficients}
    weak = [monomial for monomial in listed if monomial.startswith("epsilon")]
    warnings = [*result.warnings, *([f"the weak effects {', '.join(weak)} are left out: these are the states at epsilon = 0"] if weak else [])]
    nominal = {monomial: value for monomial, value in listed.items() if monomial not in weak}
    functions, law_of = analysis_of(module, nominal)
    setting = Setting(coefficients=nominal, mu=arb(fmpq(distance.numerator, distance.denominator)), reckoning=reckoning)
    laws, criticality = threshold_laws(law_of(nominal), setting, warnings)
    states = tuple(state_of(name, function(nominal, setting.mu), setting, laws[-1].decays, warnings) for name, function in functions)
    return StatesResult(problem=result.problem, mu=text, digits=reckoning.digits, kind=module["KIND"], threshold=result.threshold, criticality=criticality, states=states,
                        at_threshold=laws, warnings=tuple(dict.fromkeys(warnings)))


def threshold_laws(given: Any, setting: Setting, warnings: list[str]) -> tuple[tuple[Law, ...], str | None]:
    """Return the laws at the threshold, last that of a general perturbation, and the criticality of all families together."""
    rows, selected = given
    laws = []
    for perturbation, rate, power in rows:
        sign, exponent = setting.sign_of_coefficient(rate), "-1" if power == -1 else "-1/2"
        if sign == 0:
            warnings.append(f"the coefficient that rules {perturbation} perturbations has a vanishing real part: the next order decides")
        prefactor = None if sign == 0 else setting.positive(1 / abs(rate) if power == -1 else (1 / abs(rate)).sqrt())
        laws.append(Law(perturbation=perturbation, decays=None if sign == 0 else sign < 0, prefactor=prefactor, exponent=exponent))
    if setting.transcritical:  # A of one sign decays, of the other grows
        toward, away = ("positive", "negative") if laws[0].decays else ("negative", "positive")
        return tuple(replace(laws[0], perturbation=name, decays=decays) for name, decays in ((toward, True), (away, False))), "transcritical"
    verdicts = {law.decays for law in laws}
    if len(laws) == 2:
        planar, circular = laws
        sign = setting.sign_of_coefficient(selected)
        if sign == 0:
            warnings.append("the real part of the coefficient of dot(A,A)*conj(A) vanishes: neither beating nor whirling is selected at this order, and ellipses that turn are states too")
        laws.append(replace(circular if sign <= 0 else planar, perturbation="general"))  # alpha_r = 0: both have the same law
    return tuple(laws), "subcritical" if False in verdicts else None if None in verdicts else "supercritical"


def state_of(name: str, values: Mapping[str, Any], setting: Setting, decays: bool | None, warnings: list[str]) -> State:
    """Return one state as numbers; `decays` tells what becomes of a general perturbation at the threshold."""
    criticality, exists, at_threshold = None, name in TRIVIAL, setting.mu == 0
    if not exists:
        sign = setting.sign_of_coefficient(values["nonlinear"])
        if sign == 0:
            warnings.append(f"{name}: the real part of its coefficient vanishes; whether it exists is decided by the next order")
        else:
            criticality = "transcritical" if setting.transcritical else "supercritical" if sign < 0 else "subcritical"
            exists = not at_threshold and values["amplitude_squared"] > 0
    if not exists:
        return State(name=name, exists=False, criticality=criticality, amplitude_squared=None, peak=None, frequency_correction=None, eigenvalues=(), stable=None)
    eigenvalues, signs = [], []
    for real, imaginary, direction, neutral in values["eigenvalues"]:
        re_text, im_text = setting.rate(real, imaginary)
        eigenvalues.append(Eigenvalue(re=re_text, im=im_text, direction=direction, neutral=neutral or ("threshold" if at_threshold else None)))
        if not neutral and not at_threshold:
            signs.append(setting.reckoning.sign(real, setting.growth))
    stable = decays if at_threshold else False if 1 in signs else None if 0 in signs else True
    if stable is None:
        warnings.append(f"{name}: its stability is decided by the next order")
    return State(
        name=name, exists=True, criticality=criticality, amplitude_squared=setting.positive(values["amplitude_squared"]), peak=setting.positive(arb(values["peak_squared"]).sqrt()),
        frequency_correction=setting.rate(values["frequency_correction"])[0], eigenvalues=tuple(eigenvalues), stable=stable,
    )
