r"""The threshold to any number of digits: :math:`D(i\omega; c) = 0` by Newton's method from the onset of the derivation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flint import acb, arb

from numerics.algebra import Algebra, midpoint
from numerics.precision import EvaluationError, working_precision

Build = Callable[[acb, acb], Algebra]


@dataclass(frozen=True, slots=True, kw_only=True)
class Root:
    """Control and frequency (0 when steady), with the size of the last Newton step as the error."""

    control: arb
    frequency: arb
    error: arb
    steps: int


def newton(build: Build, critical: Callable, control: arb, frequency: arb | None, bits: int, goal: int | None = None, near: bool = False, width: arb | None = None) -> Root:  # type: ignore[type-arg]
    """Return the root of the critical determinant near a double.

    Raises
    ------
    EvaluationError
        Newton's method leaves the neighbourhood of its start or does not converge.
    """
    level = bits if near else 96
    steep: tuple[acb, acb] | None = None
    start = (control, frequency)
    steps = 0
    step_size = arb(1)
    width = width if width is not None else abs(control) + 1
    while True:
        level = min(level, bits)
        with working_precision(level):
            for attempt in range(24):
                def value(c: arb, w: arb | None) -> acb:
                    a = build(acb(c), acb(w if w is not None else 0))
                    return midpoint(a.determinant(critical(a)))  # type: ignore[attr-defined]

                centre = value(control, frequency)
                if steep is None or attempt % 3 == 2:
                    h = (arb(2) ** (-level // 2) * (abs(control) + width * arb(2) ** -8)).mid()
                    d_control = (value((control + h).mid(), frequency) - centre) / h
                    if frequency is None:
                        steep = (d_control, acb(0))
                    else:
                        k = (arb(2) ** (-level // 2) * abs(frequency)).mid()
                        steep = (d_control, (value(control, (frequency + k).mid()) - centre) / k)
                step_control, step_frequency = solve_real(steep, centre, frequency is None)
                control = (control - step_control).mid()
                if frequency is not None:
                    frequency = (frequency - step_frequency).mid()
                steps += 1
                size = abs(step_control) / (abs(control) + width * arb(2) ** -20)
                if frequency is not None:
                    size = size + abs(step_frequency) / abs(frequency)
                if not (abs(step_control) / width + (abs(step_frequency) / abs(frequency) if frequency is not None else 0)).mid() < 0.5:
                    raise EvaluationError("threshold: Newton's method leaves the neighbourhood of its start; the threshold is too ill-conditioned")
                step_size = size.mid()
                if step_size < arb(2) ** (-(level // 2) + 4) and level < bits or step_size < arb(2) ** (-(goal or level - 40)):
                    break
            else:
                raise EvaluationError(f"threshold: Newton's method did not converge (last step {step_size.str(3, radius=False)})")
            if start[0] is not None and abs(control - start[0]) > arb("1e-3") * width:
                raise EvaluationError("threshold: Newton's method went to another root")
        if level >= bits:
            break
        level *= 2
    return Root(control=control, frequency=frequency if frequency is not None else arb(0), error=step_size, steps=steps)


def solve_real(steep: tuple[acb, acb], value: acb, steady: bool) -> tuple[arb, arb]:
    """Return the real steps (dc, domega) with D_c dc + D_omega domega = D."""
    d_control, d_frequency = steep
    if steady:
        return (value / d_control).real.mid(), arb(0)
    determinant = d_control.real * d_frequency.imag - d_control.imag * d_frequency.real
    if determinant.mid() == 0:
        raise EvaluationError("threshold: the eigenvalue does not cross the axis with the control")
    dc = (value.real * d_frequency.imag - value.imag * d_frequency.real) / determinant
    dw = (d_control.real * value.imag - d_control.imag * value.real) / determinant
    return dc.mid(), dw.mid()


__all__ = ["Root", "newton"]
