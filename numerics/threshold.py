r"""The threshold to any number of digits: :math:`D(i\omega; c) = 0` by Newton's method from the onset of the derivation.

The digits double from level to level. The slopes are differences taken at the level before, so that the last and dearest level costs
one determinant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from flint import acb, arb

from numerics.algebra import Algebra, midpoint
from numerics.precision import EvaluationError, working_precision

Build = Callable[[acb, acb], Algebra]


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """The bits that the root shall have, the bits to work with, and the algebra there."""

    goal: int
    bits: int
    build: Build


@dataclass(frozen=True, slots=True, kw_only=True)
class Root:
    """Control and frequency (0 when steady), with the last Newton step as the error, and the slopes found on the way."""

    control: arb
    frequency: arb
    error: arb
    steps: int
    slopes: tuple[acb, acb]
    slopes_bits: int


def newton(levels: Sequence[Level], critical: Callable, start: tuple[arb, arb | None], width: arb, floor: int, before: Root | None = None) -> Root:  # type: ignore[type-arg]
    """Return the root of the critical determinant near a start; `before` is the root of a computation with fewer bits.

    A control below `width` 2^-`floor` has fewer digits than the goal: it may be zero.

    Raises
    ------
    EvaluationError
        Newton's method leaves the neighbourhood of its start or does not converge.
    """
    control, frequency = start
    if before is not None:
        control, frequency = before.control, before.frequency if frequency is not None else None
    slopes, known = (before.slopes, before.slopes_bits) if before else ((acb(0), acb(0)), 0)
    steps, size = 0, arb(1)
    for place, level in enumerate(levels):
        with working_precision(level.bits):
            def value(c: arb, w: arb | None, build: Build = level.build) -> acb:
                a = build(acb(c), acb(w if w is not None else 0))
                return midpoint(a.determinant(critical(a)))  # type: ignore[attr-defined]

            for attempt in range(24):
                centre = value(control, frequency)
                if not centre.is_finite():
                    raise EvaluationError("threshold: found no finite determinant there; expected coefficients that are finite at the threshold")
                if not known or attempt % 3 == 2:
                    slopes, known = differences(value, centre, control, frequency, width, level.bits), 0
                step_control, step_frequency = solve_real(slopes, centre, frequency is None)
                control = (control - step_control).mid()
                size = abs(step_control) / (abs(control) + width * arb(2) ** -floor)
                moved = abs(step_control) / width
                if frequency is not None:
                    frequency = (frequency - step_frequency).mid()
                    size, moved = size + abs(step_frequency) / abs(frequency), moved + abs(step_frequency) / abs(frequency)
                steps += 1
                size = size.mid()
                if not moved.mid() < 0.5:
                    raise EvaluationError("threshold: Newton's method leaves the neighbourhood of its start; the threshold is too ill-conditioned")
                if abs(control - start[0]) > arb("1e-3") * width:
                    raise EvaluationError("threshold: Newton's method went to another root")
                # what is left after a step is of the size of the step times the error of the slopes
                exponent = exponent_of(size)
                known = max(known, min(-exponent, level.bits // 2) - 6) if known == 0 else known
                if -exponent >= level.goal or -exponent + max(known, 0) - 8 >= level.goal:
                    break
            else:
                raise EvaluationError(f"threshold: Newton's method did not converge (last step {size.str(3, radius=False)})")
            if place + 1 < len(levels):
                slopes = differences(value, value(control, frequency), control, frequency, width, level.bits)
                known = min(level.goal, level.bits // 2) - 6
    return Root(control=control, frequency=frequency if frequency is not None else arb(0), error=size, steps=steps, slopes=slopes, slopes_bits=known)


def exponent_of(size: arb) -> int:
    """Return the binary exponent of a positive number, -10^9 for zero."""
    if size == 0:
        return -(10**9)
    mantissa, exponent = size.man_exp()
    return int(exponent) + int(mantissa).bit_length()


def differences(value: Callable[[arb, arb | None], acb], centre: acb, control: arb, frequency: arb | None, width: arb, bits: int) -> tuple[acb, acb]:
    """Return D_c and D_omega as difference quotients over half the bits."""
    h = (arb(2) ** (-bits // 2) * (abs(control) + width * arb(2) ** -8)).mid()
    d_control = ((value((control + h).mid(), frequency) - centre) / h).mid()
    if frequency is None:
        return d_control, acb(0)
    k = (arb(2) ** (-bits // 2) * abs(frequency)).mid()
    return d_control, ((value(control, (frequency + k).mid()) - centre) / k).mid()


def solve_real(slopes: tuple[acb, acb], value: acb, steady: bool) -> tuple[arb, arb]:
    """Return the real steps (dc, domega) with D_c dc + D_omega domega = D."""
    d_control, d_frequency = slopes
    if steady:
        if d_control == 0:
            raise EvaluationError("threshold: the eigenvalue does not cross the axis with the control")
        return (value / d_control).real.mid(), arb(0)
    determinant = d_control.real * d_frequency.imag - d_control.imag * d_frequency.real
    if determinant.mid() == 0:
        raise EvaluationError("threshold: the eigenvalue does not cross the axis with the control, or is defective")
    dc = (value.real * d_frequency.imag - value.imag * d_frequency.real) / determinant
    dw = (d_control.real * value.imag - d_control.imag * value.real) / determinant
    return dc.mid(), dw.mid()


__all__ = ["Build", "Level", "Root", "newton"]
