"""The first loss of stability, to the accuracy of a double: kind, weight, control and frequency.

What is found here fixes the *form* of the derivation; the digits come from `numerics.threshold`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from sympy import Symbol
from threadpoolctl import threadpool_limits

from derive.expansion import Expansion
from derive.formulation import Formulation
from derive.operator import FirstOrderOperator
from derive.ordinary import AlgebraicOperator
from derive.pencil import Mesh, Pencil, compiled
from derive.statement import DerivationError, ProblemError

SCAN = 61
MOST_PLACES = 300
DEPTH = 8
BENT = 1e-2
AXIS = 1e-6
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Onset:
    """The first loss of stability.

    `kind` is "hopf" or "steady"; `weight` that of the critical mode under rotations; `control` and `frequency` are doubles.
    """

    kind: str
    weight: int
    control: float
    frequency: float | None
    other_eigenvalues: tuple[complex, ...]  # of those that stay stable the rightmost and the smallest


class Spectrum:
    """The rightmost eigenvalues of all weights, resolved."""

    def __init__(self, operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> None:
        self.pencils = {weight: Pencil(operator, formulation) for weight, operator in operators.items()}
        self.formulation = formulation
        self.ladders: dict[Pencil, tuple[Mesh, ...]] = {}  # the meshes that are still of use: the first two are compared
        self.scales: dict[Pencil, float] = {}
        self.known: dict[Pencil, list[complex]] = {}
        self.bases = compiled(formulation, formulation.base)

    def rightmost(self, control: float) -> list[tuple[complex, int]]:
        """Return the converged eigenvalues (value, weight), rightmost first.

        Raises
        ------
        FloatingPointError
            The base state or a coefficient is not finite and real there.
        """
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            place = np.linspace(float(self.formulation.interval[0]), float(self.formulation.interval[1]), 7) if self.formulation.interval else 0.0
            try:
                values = self.bases(place, control + 0j)
            except ZeroDivisionError as singular:
                raise FloatingPointError from singular
            for value in values:
                value = np.asarray(value, dtype=complex)
                if not np.all(np.isfinite(value)) or np.any(np.abs(value.imag) > 1e-9 * (1 + np.abs(value))):
                    raise FloatingPointError
        found: list[tuple[complex, int]] = []
        for weight, pencil in self.pencils.items():
            if weight < 0 and -weight in self.pencils:
                continue
            found.extend((value, weight) for value in self.resolved(pencil, control))
        return sorted(found, key=lambda pair: (-pair[0].real, -pair[0].imag))

    def resolved(self, pencil: Pencil, control: float) -> list[complex]:
        """Return the eigenvalues that two resolutions agree on; refine until no other could be the rightmost."""
        if not pencil.spatial:
            return [complex(value) for value in pencil.eigenvalues(control, None)]
        if pencil.constant and pencil in self.known:
            return self.known[pencil]
        self.known[pencil] = self.converged(pencil, control)
        return self.known[pencil]

    def converged(self, pencil: Pencil, control: float) -> list[complex]:
        """Return the eigenvalues that two resolutions agree on, raising the resolution where they do not."""
        meshes = self.ladders.get(pencil) or pencil.ladder(control)
        while True:
            self.ladders[pencil] = meshes
            coarse, fine = (pencil.eigenvalues(control, mesh) for mesh in meshes[:2])
            if not len(fine):
                return []
            distance = np.abs(fine[:, None] - coarse[None, :]).min(axis=1) if len(coarse) else np.full(len(fine), np.inf)
            # what counts as equal, and as zero, is measured by the second smallest eigenvalue met on the way
            scale = self.scales[pencil] = max(self.scales.get(pencil, 0.0), float(np.sort(np.abs(fine))[:2][-1]))
            agreed = distance <= 1e-5 * (scale + np.abs(fine))
            good = fine[agreed]
            if len(good):
                # Discretisation spoils large eigenvalues first: an unresolved one counts only among the smallest.
                reach = 2 * np.sort(np.abs(good))[min(len(good), 6) - 1]
                doubtful = fine[~agreed & (np.abs(fine) <= reach)]
                if not np.any(doubtful.real > good.real.max() + AXIS * scale):
                    return sorted((complex(value) for value in good), key=lambda z: -z.real)[:40]
            elif np.abs(fine).min() > 1e6:
                return []
            if len(meshes) == 2 and not len(good):
                if 0 in pencil.counts:
                    raise ProblemError(f"boundary: found all {sum(pencil.counts)} rows at one end, and no eigenvalues: a problem of initial values; expected rows at both ends")
                raise DerivationError(f"threshold: found eigenvalues at {self.formulation.problem.control} = {control:.10g} that {meshes[1].size} nodes do not resolve; "
                                      "expected a mode that is smooth on that scale")
            if len(meshes) == 2:
                return sorted((complex(value) for value in good), key=lambda z: -z.real)[:40]
            meshes = meshes[1:]

    def check_pointwise(self, control: float, name: Symbol) -> None:
        """Refuse a state that loses stability at single points of the interval: no boundary-value problem, no mode."""
        found = np.concatenate([pencil.pointwise(control) for pencil in self.pencils.values()])
        unstable = found[found.real > 1e-9 * np.abs(found)]
        if len(unstable):
            worst = complex(unstable[np.argmax(unstable.real)])
            raise DerivationError(f"equations: found a continuous spectrum that reaches {shown(worst)} at {name} = {control:.10g}: single points of the interval grow by themselves; "
                                  "expected a loss of stability by one mode; correct the sign, or add the missing space derivative")

    def growth(self, control: float) -> float:
        """Return the largest real part."""
        values = self.rightmost(control)
        return values[0][0].real if values else -1e30


def holds_mode(operator: FirstOrderOperator, expansion: Expansion, onset: Onset) -> bool:
    """Tell whether the critical eigenvalue is one of this operator, which is a block of the whole linear problem."""
    with threadpool_limits(limits=1, user_api="blas"):
        found = Spectrum({0: operator}, expansion.formulation).rightmost(onset.control)
    wanted = onset.frequency or 0.0
    return any(abs(value.real + 1j * (abs(value.imag) - wanted)) < 1e-4 * wanted for value, _ in found)


def find_onset(operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> Onset:
    """Return the first loss of stability from the lower end of the control range; see `first_loss`."""
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads only cost
        return first_loss(operators, formulation)


def first_loss(operators: Mapping[int, FirstOrderOperator | AlgebraicOperator], formulation: Formulation) -> Onset:
    """Return the first loss of stability from the lower end of the control range.

    Raises
    ------
    ProblemError
        The base state is not strictly stable at the lower end, or stays stable in the whole range.
    DerivationError
        The critical eigenvalue is not simple (or, with a rotation axis, not double), or others lie on the axis too.
    """
    spectrum = Spectrum(operators, formulation)
    name = formulation.problem.control
    low, high = (float(end) for end in formulation.control_range)
    try:
        start = spectrum.rightmost(low)
    except FloatingPointError:
        raise ProblemError(f"base_state: found no finite real state, or coefficients of the equations that are not finite on the interval, "
                           f"at {name} = {formulation.control_range[0]}; expected both at the lower end of control_range") from None
    if not start:
        raise ProblemError("equations: found no eigenvalue at all; expected equations with time derivatives that can lose stability")
    spectrum.check_pointwise(low, name)
    if start[0][0].real >= -1e-13 * abs(start[0][0]) - 1e-18:
        raise ProblemError(f"control_range: found the eigenvalue {shown(start[0][0])} at {name} = {formulation.control_range[0]}; expected a base state that is "
                           "strictly stable at the lower end; lower it, or remove the neutral or unstable mode")
    bracket = bracket_of(spectrum, low, high, start[0][0].real)
    threshold = crossing(spectrum.growth, *bracket) if bracket[1] > bracket[0] else bracket[0]
    spectrum.check_pointwise(threshold, name)
    return classify(spectrum, threshold, abs(start[0][0].real), formulation)


def bracket_of(spectrum: Spectrum, low: float, high: float, growth_at_low: float) -> tuple[float, float]:
    """Return two controls between which stability is lost for the first time, by a scan that looks closer at peaks near zero."""
    formulation = spectrum.formulation
    history = [(low, growth_at_low)]
    for control in places(spectrum, low, high)[1:]:
        previous = history[-1][0]
        try:
            growth = spectrum.growth(control)
        except FloatingPointError:
            return singular_end(spectrum, previous, control, formulation.problem.control, abs(growth_at_low))
        if growth > 0:
            return previous, control
        history.append((control, growth))
        if len(history) >= 3 and near_zero_peak(history[-3:]):
            top = peak_of(spectrum.growth, history[-3][0], control, 1e-6 * (high - low))
            if spectrum.growth(top) > 0:
                return history[-3][0], top
    raise ProblemError(f"control_range: found no loss of stability between {formulation.control_range[0]} and {formulation.control_range[1]} (largest growth rate "
                       f"{max(value for _, value in history):.6g}, at the upper end {history[-1][1]:.6g}); expected one; widen control_range")


def places(spectrum: Spectrum, low: float, high: float) -> list[float]:
    """Return where to look for a loss of stability: equidistant controls, and more where the equations change fast with the control."""
    found = list(np.linspace(low, high, SCAN))
    left, right = np.array(found[:-1]), np.array(found[1:])
    for _ in range(DEPTH):
        bent = np.max([pencil.bends(left, right) for pencil in spectrum.pencils.values() if pencil.size], axis=0, initial=0) > BENT
        if not np.any(bent) or len(found) > MOST_PLACES:
            break
        edges = left[bent][:, None] + (right - left)[bent][:, None] * np.linspace(0, 1, 5)
        left, right = edges[:, :-1].ravel(), edges[:, 1:].ravel()
        found += list(edges[:, 1:-1].ravel())
    return sorted(map(float, found))


def crossing(growth: Callable[[float], float], low: float, high: float) -> float:
    """Return where `growth` changes sign between two controls: secant steps (Illinois), halving the bracket every third time."""
    below, above = growth(low), growth(high)
    tolerance = 1e-11 * max(abs(low), abs(high), 1e-300)
    ends = {low: abs(below), high: abs(above)}  # the true values: the weights of the secant are halved
    moved, small = 0, 1e-13 * min(abs(below), abs(above))
    for step in range(400):
        if high - low <= tolerance or 0 in (below, above):
            break
        middle = (low + high) / 2 if step % 3 == 2 else low + min(max(below / (below - above), 1e-3), 1 - 1e-3) * (high - low)
        value = growth(middle)
        if value > 0:
            high, above, below, moved = middle, value, below / 2 if moved > 0 else below, 1
        else:
            low, below, above, moved = middle, value, above / 2 if moved < 0 else above, -1
        ends[middle] = abs(value)
        if ends[middle] <= small:
            return middle
    return low if ends[low] <= ends[high] else high


def peak_of(growth: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Return where `growth` is largest between two controls, by golden sections."""
    share = (5**0.5 - 1) / 2
    left, right = high - share * (high - low), low + share * (high - low)
    at_left, at_right = growth(left), growth(right)
    while high - low > tolerance:
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - share * (high - low)
            at_left = growth(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + share * (high - low)
            at_right = growth(right)
    return left if at_left > at_right else right


def near_zero_peak(points: Sequence[tuple[float, float]]) -> bool:
    """Tell whether a parabola through three points has a maximum between them that could reach zero."""
    (left, a), (middle, b), (right, c) = points
    if b <= max(a, c):
        return False
    before, after = (b - a) / (middle - left), (c - b) / (right - middle)
    bend = (after - before) / (right - left)
    top = b - (before + bend * (middle - left)) ** 2 / (4 * bend)
    return top + 2 * (top - min(a, c)) > 0


def singular_end(spectrum: Spectrum, inside: float, outside: float, name: Symbol, rate: float) -> tuple[float, float]:
    """Return the last control with a real base state, if stability is lost before it; refuse a fold."""
    for _ in range(200):
        middle = (inside + outside) / 2
        if middle in (inside, outside):
            break
        try:
            growth = spectrum.growth(middle)
        except FloatingPointError:
            outside = middle
            continue
        if growth > AXIS * rate:
            return (inside, middle)
        inside = middle
    raise DerivationError(f"base_state: found a state that ends (is no longer finite and real) at {name} = {inside:.12g}, before any loss of stability; "
                          f"the rightmost eigenvalue there is {shown(spectrum.rightmost(inside)[0][0])}; a fold, or another singular point of the base state, is not of this class")


def shown(value: complex, rounding: float = 0.0) -> str:
    """Return an eigenvalue for a message; what is below `rounding` is 0."""
    value = complex(value.real if abs(value.real) > rounding else 0, value.imag if abs(value.imag) > rounding else 0)
    if abs(value.real) <= 1e-9 * abs(value):
        value = complex(0, value.imag)
    real = f"{value.real:.6g}"
    return real if abs(value.imag) <= 1e-9 * (1 + abs(value)) else f"{real} {'+' if value.imag > 0 else '-'} {abs(value.imag):.6g}i"


def classify(spectrum: Spectrum, threshold: float, rate: float, formulation: Formulation) -> Onset:
    """Tell what kind of bifurcation it is, or refuse it by name."""
    values = spectrum.rightmost(threshold)
    # An eigenvalue is on the axis within rounding of the growth rates met on the way; a defective one moves as a square root.
    tolerance = AXIS * max(rate, abs(values[0][0]))
    noise = ROUNDING * (max(rate, abs(values[0][0])) if formulation.interval else max(abs(value) for value, _ in values))
    critical, stable = on_the_axis(values, tolerance, noise)
    rest = tuple(dict.fromkeys([*stable[:4], *sorted(stable, key=abs)[:4]]))
    oscillating = [value for value, _ in critical if abs(value.imag) > 30 * tolerance]
    still = [value for value, _ in critical if abs(value.imag) <= 30 * tolerance]
    listing = ", ".join(shown(value, tolerance) for value, _ in critical)
    where = f"at {formulation.problem.control} = {threshold:.10g}"
    rotating = formulation.frame is not None
    if not critical:
        raise DerivationError(f"threshold: found the eigenvalue {shown(values[0][0])} {where}, where stability is lost; expected one on the imaginary axis; "
                              "one that jumps over it, or is torn by rounding because it is defective, is not of this class")
    if oscillating and still:
        raise DerivationError(f"threshold: found a zero eigenvalue together with a pair {where}: {listing}; expected no other eigenvalue on the imaginary axis")
    if rotating and {abs(weight) for _, weight in critical} != {1}:
        raise DerivationError(f"threshold: found critical eigenvalues {listing} {where} of a mode along the rotation axis; expected a mode across it; drop rotation_axis")
    if len(still) > 1 and rotating:
        raise DerivationError(f"threshold: found the eigenvalues {listing} in each of the two directions {where}; expected one: a defective or multiple eigenvalue is not of this class")
    if len(still) > 1:
        raise DerivationError(f"threshold: found a double eigenvalue {listing} {where}; expected a simple one; if the problem is unchanged by rotations declare rotation_axis; "
                              "a defective (Takens-Bogdanov) eigenvalue is not of this class")
    frequency = None if still else frequency_of(oscillating, rotating, listing, where)
    return Onset(kind="steady" if still else "hopf", weight=critical[0][1], control=threshold, frequency=frequency, other_eigenvalues=rest)


def on_the_axis(values: Sequence[tuple[complex, int]], tolerance: float, noise: float) -> tuple[list[tuple[complex, int]], list[complex]]:
    """Return the eigenvalues on the axis, and the others.

    One within `tolerance` of the axis is off it if its distance is far above `noise` and above that of the nearest: the parts into which
    rounding tears a defective eigenvalue are all as far away.
    """
    limit = min(tolerance, max(noise, 1e3 * min(abs(value.real) for value, _ in values)))
    return [pair for pair in values if abs(pair[0].real) <= limit], [value for value, _ in values if abs(value.real) > limit]


def frequency_of(oscillating: Sequence[complex], rotating: bool, listing: str, where: str) -> float:
    """Return the frequency of a simple pair, or refuse what is none; `listing` and `where` are the words for it."""
    upper = sorted((value for value in oscillating if value.imag > 0), key=lambda z: z.imag)
    lower = [value for value in oscillating if value.imag < 0]
    if len(upper) != 1 or len(lower) != 1:
        if rotating and len(upper) + len(lower) == 1:
            raise DerivationError(f"threshold: found the eigenvalue {listing} {where} in one sense of rotation only: it is simple; expected the double eigenvalue of a problem that is "
                                  "also unchanged by reflections; drop rotation_axis")
        close = len(upper) == 2 and abs(upper[0] - upper[1]) <= 1e-3 * abs(upper[0])
        hint = "a double eigenvalue: if the problem is unchanged by rotations declare rotation_axis; a defective one is not of this class" if close else \
            "several modes are critical together (a resonance or a double Hopf point), which is not of this class"
        raise DerivationError(f"threshold: found the eigenvalues {listing} {where}; expected a simple pair; {hint}")
    if rotating and abs(upper[0] + lower[0]) > 1e-5 * abs(upper[0]):
        raise DerivationError(f"threshold: found the eigenvalues {listing} {where} in one sense of rotation; expected a conjugate pair: the problem is not unchanged by reflections; drop rotation_axis")
    return float(upper[0].imag)
