"""The eigenvalues of the base state against the control, as plain arrays for a figure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from derive.derivation import Derivation
from derive.onset import Spectrum
from derive.operator import LAMBDA
from derive.response import reduced

SHOWN = 6
REAL = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrumCurves:
    """Eigenvalues at some controls, shape (controls, SHOWN), those nearest to the critical ones, NaN where there are fewer.

    `oscillation` is the control from which on, up to the threshold, the rightmost eigenvalues are a complex pair; None if they
    never are, or always.
    """

    controls: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    oscillation: float | None


def spectrum_curves(derivation: Derivation, count: int = 61) -> SpectrumCurves:
    """Return the leading eigenvalues over the control range, to the accuracy of a double."""
    expansion, onset = derivation.expansion, derivation.onset
    spectrum = Spectrum({weight: reduced(expansion, weight, LAMBDA) for weight in expansion.weights}, expansion.formulation)
    low, high = (float(end) for end in expansion.formulation.control_range)
    high = min(high, onset.control + (onset.control - low))
    with threadpool_limits(limits=1, user_api="blas"):
        start = onset_of_oscillation(spectrum, low, onset.control) if onset.kind == "hopf" else None
        # square roots where eigenvalues meet: many points near
        near = np.zeros(0) if onset.kind == "steady" else (onset.control if start is None else start) + (high - low) * np.linspace(-0.4, 0.4, 21) ** 3
        controls = np.unique(np.concatenate([np.linspace(low, high, count), [onset.control], near]))
        controls = controls[(controls >= low) & (controls <= high)]
        rows = [nearest(spectrum, float(control), onset.frequency or 0.0) for control in controls]
    return SpectrumCurves(controls=controls, eigenvalues=np.array(rows), oscillation=start)


def nearest(spectrum: Spectrum, control: float, frequency: float) -> NDArray[np.complex128]:
    """Return the eigenvalues nearest to +-i omega: a damped system may have any number of others of the same growth rate."""
    result = np.full(SHOWN, np.nan + 1j * np.nan)
    try:
        values = [value for value, _ in spectrum.rightmost(control)]
    except FloatingPointError:  # the base state is not finite there
        values = []
    values.sort(key=lambda value: (abs(complex(value.real, abs(value.imag) - frequency)), -value.imag))
    result[:len(values)] = values[:SHOWN]
    return result


def onset_of_oscillation(spectrum: Spectrum, low: float, threshold: float) -> float | None:
    """Return where the two rightmost eigenvalues turn from real to a pair, the last time before the threshold, by bisection."""

    def oscillates(control: float) -> bool:
        first = spectrum.rightmost(control)[0][0]
        return bool(abs(first.imag) > REAL * abs(first))

    grid = np.linspace(low, threshold, 25)
    real = [k for k, control in enumerate(grid[:-1]) if not oscillates(float(control))]
    if not real:
        return None
    below, above = float(grid[real[-1]]), float(grid[real[-1] + 1])
    while above - below > 1e-9 * (abs(above) + threshold - low):
        middle = (below + above) / 2
        below, above = (below, middle) if oscillates(middle) else (middle, above)
    return (below + above) / 2
