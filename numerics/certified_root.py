r"""The threshold as a proved root: existence and uniqueness in a small box, by Krawczyk's operator.

The determinant D is an analytic function of control and frequency. On a polydisc of radii R about the midpoint it stays within V of
its centre; Cauchy's estimates on the half polydisc then bound all its second and third derivatives, so that first derivatives over a
small box are enclosed by central differences. With Y near the inverse of the Jacobian J of (Re D, Im D),

.. math:: x_0 - Y F(x_0) + (I - Y J(X))(X - x_0) \subset \mathrm{int}\,X

proves one and only one root in the box X, and that it lies in the left side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import flint
from flint import acb, arb

from numerics.certified_linear import Unproved, upper
from numerics.precision import working_precision

Determinant = Callable[[acb, acb], acb]
"""D at (control, frequency), an enclosure at the working precision."""

SPREADS = (14, 24, 40, 60, 90)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvedRoot:
    """Enclosures of control and frequency that hold exactly one root each of the determinant; frequency is 0 when steady."""

    control: arb
    frequency: arb


@dataclass(frozen=True, slots=True, kw_only=True)
class Slopes:
    """Derivatives of D at the centre, and the bounds that carry them over to a box: radii R of the polydisc, V the variation of D."""

    first: tuple[acb, ...]
    radii: tuple[arb, ...]
    variation: arb

    def over(self, box: tuple[arb, ...]) -> tuple[acb, ...]:
        """Return the derivatives over a box of the half-widths `box`, well inside the half polydisc."""
        result = []
        for k, slope in enumerate(self.first):
            # |D_kj| <= V (2/R_k)(2/R_j), twice that for k = j
            spread = sum((r * self.variation * (8 if j == k else 4) / (self.radii[k] * self.radii[j]) for j, r in enumerate(box)), arb(0)).upper()
            result.append(slope + acb(arb(0, spread), arb(0, spread)))
        return tuple(result)


def slopes_at(determinant: Determinant, control: arb, frequency: arb | None, scale: arb) -> Slopes:
    """Return the derivatives at a point, by central differences with Cauchy's bound on their error."""
    point = [acb(control), acb(frequency if frequency is not None else 0)]
    count = 1 if frequency is None else 2
    sizes = (scale, abs(frequency) if frequency is not None else arb(1))
    reason = ""
    for spread in SPREADS:
        with working_precision(160 + 3 * spread):
            radii = tuple((sizes[k] * arb(2) ** -spread).mid() for k in range(count))
            wide = [acb(z.real + arb(0, radii[k]), z.imag + arb(0, radii[k])) if k < count else z for k, z in enumerate(point)]
            try:
                variation = upper(determinant(wide[0], wide[1]) - determinant(point[0], point[1]))
            except Unproved as wider:
                reason = str(wider)
                continue
            if not variation.is_finite():
                continue
            first = []
            for k in range(count):
                h = radii[k] * arb(2) ** -40
                values = []
                for sign in (1, -1):
                    moved = list(point)
                    moved[k] = moved[k] + sign * h
                    values.append(determinant(moved[0], moved[1]))
                error = (8 * variation * h**2 / radii[k] ** 3).upper()  # |D_kkk| h^2 / 6, |D_kkk| <= 6 V (2/R)^3
                first.append((values[0] - values[1]) / (2 * h) + acb(arb(0, error), arb(0, error)))
            if all(_accurate(slope) for slope in first):
                return Slopes(first=tuple(first), radii=radii, variation=variation)
            reason = "its derivatives are not known well enough"
    raise Unproved(f"the threshold is not proved to be a simple root: {reason or 'the determinant is not bounded near it'}")


def approach(determinant: Determinant, control: arb, frequency: arb | None, scale: arb, bits: int) -> tuple[arb, arb | None]:
    """Return a root to nearly `bits` bits, without a proof: Newton's method from a double with Broyden's update of the slopes, the precision doubled on the way."""
    levels = [bits]
    while levels[-1] > 160:
        levels.append(levels[-1] // 2 + 16)
    start, level = control, levels.pop()
    slopes: list[acb] = []
    steps: list[arb] = []
    sizes = [scale] if frequency is None else [scale, abs(frequency).mid()]
    before = arb(1)
    for _ in range(60):
        with working_precision(level):
            value = determinant(acb(control), acb(frequency if frequency is not None else 0)).mid()
            length = sum((step * step / (size * size) for step, size in zip(steps, sizes, strict=False)), arb(0)).mid()
            if not slopes:
                slopes = differences(determinant, control, frequency, sizes, value)
            elif length > 0:  # a full step leaves D = J' dx - J dx: J' is the nearest to J that does
                slopes = [(slope - value * step / (size * size * length)).mid() for slope, step, size in zip(slopes, steps, sizes, strict=True)]
            steps = newton_step(slopes, value)
            control = (control - steps[0]).mid()
            frequency = (frequency - steps[1]).mid() if frequency is not None else None
            size = sum((abs(step) / size for step, size in zip(steps, sizes, strict=True)), arb(0)).mid()
            if not size < arb("0.1") or abs(control - start) > scale / 100:
                raise Unproved("Newton's method leaves the neighbourhood of the derivation's threshold")
            left = size * (size / before).min(arb(1)) if before > 0 else size  # of the root: steps shrink faster and faster
            if level < bits:
                if size < arb(2) ** (24 - level // 2):
                    level = levels.pop()
            elif left < arb(2) ** (20 - level) or before < arb(2) ** (-level // 3) and size > before / 4:
                return control, frequency
            if size > before / 8:
                slopes = []
            before = size
    raise Unproved("Newton's method does not converge to the threshold")


def differences(determinant: Determinant, control: arb, frequency: arb | None, sizes: Sequence[arb], value: acb) -> list[acb]:
    """Return the derivatives of D as difference quotients over half the bits."""
    point = [acb(control), acb(frequency if frequency is not None else 0)]
    result = []
    for k, size in enumerate(sizes):
        h = (size * arb(2) ** (-(flint.ctx.prec // 2))).mid()
        moved = [z + h if j == k else z for j, z in enumerate(point)]
        result.append(((determinant(moved[0], moved[1]) - value) / h).mid())
    return result


def newton_step(slopes: Sequence[acb], value: acb) -> list[arb]:
    """Return the real step that makes D + J dx vanish, with the opposite sign."""
    if len(slopes) == 1:
        if slopes[0] == 0:
            raise Unproved("the critical eigenvalue does not cross the axis with the control")
        return [(value / slopes[0]).real.mid()]
    a, b = slopes
    det = (a.real * b.imag - a.imag * b.real).mid()
    if det == 0:
        raise Unproved("the critical eigenvalue does not cross the axis with the control")
    return [((b.imag * value.real - b.real * value.imag) / det).mid(), ((a.real * value.imag - a.imag * value.real) / det).mid()]


def _accurate(slope: acb) -> bool:
    return bool(slope.rad() < abs(slope.mid()) * arb(2) ** -8)


def prove_root(determinant: Determinant, slopes: Slopes, control: arb, frequency: arb | None) -> ProvedRoot:
    """Return the box about (control, frequency) that holds exactly one root, evaluated at the working precision."""
    value = determinant(acb(control), acb(frequency if frequency is not None else 0))
    if not value.is_finite():
        raise Unproved("the determinant is not finite at the threshold")
    if frequency is None:
        # D is real, or i times a real function, for a real problem
        part = _real if abs(slopes.first[0].real.mid()) >= abs(slopes.first[0].imag.mid()) else _imaginary
        inverse = [[(1 / part(slopes.first[0]).mid()).mid()]]
        parts = [part(value)]
    else:
        a, b = slopes.first
        determinant_of = (a.real * b.imag - a.imag * b.real).mid()
        if determinant_of == 0:
            raise Unproved("the threshold is not proved to be a simple root: its Jacobian vanishes")
        inverse = [[(b.imag / determinant_of).mid(), (-b.real / determinant_of).mid()], [(-a.imag / determinant_of).mid(), (a.real / determinant_of).mid()]]
        parts = [value.real, value.imag]
        part = _real
    count = len(parts)
    step = [sum((inverse[i][j] * parts[j] for j in range(count)), arb(0)) for i in range(count)]
    sizes = [upper(one) for one in step]
    tiny = [radius * arb(2) ** (-2 * flint.ctx.prec) for radius in slopes.radii]
    ratio = [sum((sizes[j] * slopes.radii[i] / slopes.radii[j] for j in range(count)), arb(0)).upper() for i in range(count)]
    box = tuple((2 * sizes[i] + ratio[i] / 64 + tiny[i]).upper() for i in range(count))
    if not all(b < r / 4 for b, r in zip(box, slopes.radii, strict=True)):
        raise Unproved("the threshold is not proved: Newton's step is larger than the box")
    for _ in range(2):
        over = slopes.over(box)
        jacobian = [[part(over[0])]] if frequency is None else [[over[0].real, over[1].real], [over[0].imag, over[1].imag]]
        image = []
        for i in range(count):
            rest = [(1 if i == j else 0) - sum((inverse[i][m] * jacobian[m][j] for m in range(count)), arb(0)) for j in range(count)]
            image.append((sizes[i] + sum((upper(rest[j]) * box[j] for j in range(count)), arb(0))).upper())
        if not all(k < b for k, b in zip(image, box, strict=True)):
            raise Unproved("the threshold is not proved: Krawczyk's operator does not map the box into itself")
        box = tuple((k + t).upper() for k, t in zip(image, tiny, strict=True))
    return ProvedRoot(control=control + arb(0, box[0]), frequency=frequency + arb(0, box[1]) if frequency is not None else arb(0))


def _real(value: acb) -> arb:
    return value.real


def _imaginary(value: acb) -> arb:
    return value.imag
