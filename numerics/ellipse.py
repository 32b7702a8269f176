r"""The ellipse that :math:`A e^{i\omega t} + c.c.` traces in a plane, for a complex vector :math:`A = (A_1, A_2)`.

In circular components :math:`A_\pm = A_1 \pm i A_2` the motion is the sum of a circle of radius :math:`|A_+|` run counterclockwise
and one of radius :math:`|A_-|` run clockwise, so every property of the ellipse is read off without a division or a square root
that loses digits near a line or a circle. The invariants of the paper (label axes) are the same numbers:
:math:`A\cdot A = A_+A_-`, :math:`|A|^2 = (|A_+|^2 + |A_-|^2)/2`, :math:`|A \times A^*| = ||A_+|^2 - |A_-|^2|/2`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

RESOLVED = 8 * np.finfo(float).eps
"""Relative size below which a deviation from a line or a circle is the rounding of what was given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse:
    """The ellipses of one or many complex vectors; lengths are those of the normalised field.

    Attributes
    ----------
    semi_major, semi_minor
        Semi-axes, >= 0.
    orientation
        Angle in [0, pi) from e1 to the major axis; 0 for a circle and for no motion, where there is none.
    sense
        +1 counterclockwise seen against the axis (from e1 to e2), -1 clockwise, 0 for a line or no motion.
    phase
        :math:`\\omega t` modulo pi at which the point stands at an end of the major axis, in (-pi, 0].
    """

    semi_major: NDArray[np.float64]
    semi_minor: NDArray[np.float64]
    orientation: NDArray[np.float64]
    sense: NDArray[np.int64]
    phase: NDArray[np.float64]

    @property
    def area(self) -> NDArray[np.float64]:
        r"""The enclosed area, :math:`2\pi|A\times A^*|`."""
        return np.pi * self.semi_major * self.semi_minor


def circular_components(amplitude: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return A_+ and A_-, with exact zeros where only rounding is left of one of them."""
    first, second = np.moveaxis(np.asarray(amplitude, dtype=complex), -1, 0)
    plus, minus = first + 1j * second, first - 1j * second
    size = RESOLVED * np.hypot(np.abs(first), np.abs(second))
    return np.where(np.abs(plus) <= size, 0, plus), np.where(np.abs(minus) <= size, 0, minus)


def cross_product(amplitude: ArrayLike) -> NDArray[np.float64]:
    r"""Return :math:`\mathrm{Im}(A_1^*A_2)`, half of :math:`|A\times A^*|` with a sign; exactly 0 where only rounding is left of it."""
    first, second = np.moveaxis(np.asarray(amplitude, dtype=complex), -1, 0)
    one, other = first.real * second.imag, first.imag * second.real
    return np.where(np.abs(one - other) <= RESOLVED * (np.abs(one) + np.abs(other)), 0.0, one - other)


def cartesian_components(plus: ArrayLike, minus: ArrayLike) -> NDArray[np.complex128]:
    """Return A = (A_1, A_2), shape (..., 2), from circular components."""
    plus, minus = np.asarray(plus, dtype=complex), np.asarray(minus, dtype=complex)
    return np.stack([(plus + minus) / 2, (plus - minus) / 2j], axis=-1)


def ellipse_of(amplitude: ArrayLike) -> Ellipse:
    r"""Return the ellipse traced by :math:`A e^{i\omega t} + c.c.`

    Parameters
    ----------
    amplitude
        Complex, shape (2,) or (..., 2): components along e1 and e2.

    Notes
    -----
    Semi-axes :math:`|A_+| \pm |A_-|`; the major axis lies at half the angle of :math:`A_+ A_-^*`, which is the real part of
    :math:`A/(A\cdot A)^{1/2}`. Source: label axes of the paper.
    """
    plus, minus = circular_components(amplitude)
    p, q = np.abs(plus), np.abs(minus)
    # |A_+|^2 - |A_-|^2 = -4 Im(A_1^* A_2), without cancellation near a line
    minor = np.where((p == 0) | (q == 0), p - q, -4 * cross_product(amplitude) / np.where(p + q > 0, p + q, 1))
    oval = (p > 0) & (q > 0)
    twice = np.where(oval, np.angle(np.where(oval, plus * np.conj(minus), 1)), 0.0)
    sum_phase = np.where(oval, np.angle(np.where(oval, plus, 1)) + np.angle(np.where(oval, minus, 1)), np.angle(np.where(p > 0, plus, np.where(q > 0, np.conj(minus), 1))))
    # x_+ = A_+ e^{i wt} + conj(A_-) e^{-i wt} is largest where both terms are in phase: wt = -(arg A_+ + arg A_-)/2.
    phase = -np.where(oval, sum_phase / 2, np.where(p > 0, sum_phase, -sum_phase))
    orientation = np.mod(twice / 2, np.pi)
    orientation = np.where(orientation >= np.pi, 0.0, orientation)
    return Ellipse(semi_major=p + q, semi_minor=np.abs(minor), orientation=orientation, sense=np.sign(minor).astype(int), phase=-np.mod(-phase, np.pi))
