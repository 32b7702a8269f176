r"""What figures are drawn of: a problem with its coefficients, the states that bifurcate, and the scenes that show them.

Amplitudes are scaled by :math:`|\mu|^{1/2}` (by :math:`|\mu|` for a transcritical bifurcation), with which the amplitude equation is free of
:math:`\mu`. Scenes are chosen from the coefficients alone: initial amplitudes are shares of the amplitude of the states, and :math:`\mu`
is such that a growing disturbance needs about eight periods for a factor e.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from numerics.coefficients import Module, Result, evaluate
from numerics.drawing import bold, symbol
from numerics.ellipse import ellipse_of
from numerics.motion import Motion, Scene, motion_from, shape_of
from numerics.precision import EvaluationError
from numerics.states import TRIVIAL, analysis_of, module_of

PERIODS = 8


def nice(value: float) -> float:
    """Return a positive number rounded to one digit."""
    return float(f"{value:.0e}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    r"""A state that bifurcates: |A|^2 (A for a transcritical one) is `share` times mu, for one sign of mu.

    `stability` is "stable", "unstable", or "partly": stable in its plane, unstable across.
    """

    name: str
    share: float
    peak: float  # largest displacement over |A|
    stability: str

    def exists(self, mu: float) -> bool:
        """Tell whether the state exists at mu."""
        return self.share * mu > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A problem with its coefficients, and the scales of the scenes that are drawn of it."""

    emitted: str | Path | Mapping[str, Any]
    states: str
    module: Module
    result: Result
    values: Mapping[str, complex]

    @property
    def omega(self) -> float:
        """The frequency; 0 when steady."""
        return float(self.result.threshold.frequency or 0)

    @property
    def threshold(self) -> float:
        """The control at the threshold."""
        return float(self.result.threshold.control)

    @property
    def control(self) -> str:
        """The symbol of the control as mathtext."""
        return symbol(self.module.CONTROL)

    @property
    def control_c(self) -> str:
        """The symbol of its value at the threshold."""
        return symbol(self.module.CONTROL, "c")

    @property
    def gamma(self) -> complex:
        """Coefficient of mu A."""
        return self.values["mu*A"]

    @property
    def vector(self) -> bool:
        """Tell whether the amplitude is a vector."""
        return bool(self.module.MULTIPLICITY == 2)

    @property
    def steady(self) -> bool:
        """Tell whether the amplitude is real."""
        return bool(self.module.KIND == "steady")

    @property
    def transcritical(self) -> bool:
        """Tell whether the equation ends at A**2."""
        return "A**2" in self.values

    @property
    def planar(self) -> complex:
        """Coefficient of |A|^2 A (or A^2) for motion along a line."""
        return sum((value for monomial, value in self.values.items() if monomial != "mu*A" and not monomial.startswith("epsilon")), 0j)

    @property
    def circular(self) -> complex:
        """Coefficient of |A|^2 A for motion on a circle."""
        return self.values["dot(A,conj(A))*A"]

    @property
    def mu(self) -> float:
        """The distance from the threshold that scenes are drawn at."""
        low, high = map(float, self.module.CONTROL_RANGE)
        return nice((high - low) / 100) if self.steady else nice(self.omega / (2 * pi * self.gamma.real * PERIODS))

    @property
    def size(self) -> float:
        """|A| of the state along a line, at |mu| = 1."""
        share = abs(self.gamma.real / self.planar.real)
        return share if self.transcritical else float(np.sqrt(share))

    def scale(self, mu: float) -> float:
        """Return what amplitudes are divided by."""
        return abs(mu) if self.transcritical else float(np.sqrt(abs(mu)))

    def scaled_by(self, text: str, norm: bool = True) -> str:
        """Return the mathtext of a length over the scale."""
        control = rf"{self.control}-{self.control_c}"
        control = f"|{control}|" if norm else f"({control})"
        return rf"${text}\,/\,{control}$" if self.transcritical else rf"${text}\,/\,{control}^{{1/2}}$"

    def move(self, initial: Sequence[complex], mu: float, until: float) -> Motion:
        """Return the motion from an initial amplitude."""
        scene = Scene(initial=tuple(complex(one) for one in initial), mu=mu, until=until)
        return motion_from(self.result, scene, shape_of(scene.initial, self.steady))


def case_of(emitted: str | Path | Mapping[str, Any], states: str) -> Case:
    """Return the case of an emitted module and of the states of its amplitude equation, as `States.emit` returns them.

    Raises
    ------
    EvaluationError
        Every nonlinear coefficient vanishes, so that no state is known.
    """
    result = evaluate(emitted, digits=15)
    return Case(emitted=emitted, states=states, module=Module(emitted), result=result, values={one.monomial: complex(one.value) for one in result.coefficients})


def branches(case: Case) -> tuple[Branch, ...]:
    """Return the bifurcating states and their stability where they exist, from the emitted states."""
    nominal = {monomial: (value.real, value.imag) for monomial, value in case.values.items() if not monomial.startswith("epsilon")}
    found = []
    for name, function in analysis_of(module_of(case.states), nominal)[0]:
        if name in TRIVIAL:
            continue
        try:
            above, below = function(nominal, 1.0), function(nominal, -1.0)
        except ZeroDivisionError:  # its coefficient vanishes: the next order decides
            continue
        values = above if above["amplitude_squared"] > 0 else below
        growing = {direction for real, _, direction, neutral in values["eigenvalues"] if not neutral and real >= 0}
        stability = "stable" if not growing else "partly" if growing == {"perpendicular"} else "unstable"
        peak = float(np.sqrt(values["peak_squared"] / values["amplitude_squared"]))
        found.append(Branch(name=name, share=-case.gamma.real / values["nonlinear"], peak=peak, stability=stability))
    return tuple(found)


def field_symbol(case: Case) -> str:
    """Return the normalised field as mathtext."""
    return bold(case.module.NORMALISED) if case.vector else symbol(case.module.NORMALISED)


def bounded(case: Case, initial: Sequence[complex], mu: float, until: float, largest: float) -> tuple[Motion, float]:
    """Return the motion and the time to which |A| stays below `largest`; one that becomes infinite is followed until it is larger."""
    end, known = until, 0.0
    for _ in range(60):
        try:
            motion = case.move(initial, mu, end)
        except EvaluationError:  # infinite before `end`: halve the gap to the last time that is reached
            until, end = end, (known + end) / 2
            continue
        times = np.linspace(0, end, 400)
        sizes = modulus(motion.amplitude(times), case.vector)
        if sizes.max() > largest:
            until = end = float(times[max(int(np.argmax(sizes > largest)) - 1, 0)]) or end / 400
        elif until - end <= 1e-9 * until:
            return motion, end
        else:
            known, end = end, (end + until) / 2
    raise EvaluationError("figures: found no time over which the motion stays bounded")


def modulus(amplitude: NDArray[np.complex128], vector: bool) -> NDArray[np.float64]:
    """Return |A|."""
    return np.sqrt((np.abs(amplitude) ** 2).sum(axis=-1)) if vector else np.abs(amplitude)


def along(case: Case, size: complex) -> tuple[complex, ...]:
    """Return an amplitude along e1."""
    return (size, 0j) if case.vector else (size,)


def approach_scene(case: Case) -> tuple[tuple[complex, ...], float, Motion, float]:
    """Return scaled initial amplitude, mu, motion and the time when the orbit has taken its final shape and size.

    Raises
    ------
    EvaluationError
        No state is stable, so that nothing is approached.
    """
    stable = [branch for branch in branches(case) if branch.stability == "stable" and branch.share > 0]
    if not stable:
        raise EvaluationError("figures: found no stable state above the threshold; nothing is approached")
    mu, state = case.mu, stable[0]
    scale = np.sqrt(mu)
    start = (complex(nice(case.size / 3)), 1j * nice(case.size / 18))
    if state.name == "beating":
        start = (complex(nice(case.size / 3)), 0.7j * nice(case.size / 3))
    long = 100 / (case.gamma.real * mu)
    motion = case.move([one * scale for one in start], mu, long)
    times = np.linspace(0, long, 40001)
    orbit = ellipse_of(motion.amplitude(times))
    shape = orbit.semi_minor / orbit.semi_major
    done = np.abs(modulus(motion.amplitude(times), True) / np.sqrt(state.share * mu) - 1) < 0.03
    done &= (shape > 0.97) if state.name == "whirling" else (shape < 0.03)
    end = float(times[int(np.argmax(done))]) if done.any() else 12 / (case.gamma.real * mu)
    return start, mu, motion, end
