r"""Orders of the residual: the truncated expansion, inserted into the full rows, leaves what the next order is to remove.

With amplitudes of the size of :math:`|\mu|^{1/2}`, base state and mode leave :math:`O(\mu)`, and with the responses of second order
:math:`O(|\mu|^{3/2})`; where the amplitude is of the size of mu (an `A**2` in its equation) :math:`O(\mu^2)`. The motion is that of the amplitude equation;
its time derivatives are differences of eighth order, space derivatives those of Chebyshev polynomials, and the rows the emitted ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from numerics.full_rows import SITES, Array
from numerics.full_states import Full
from numerics.motion import ORDERS, Scene, Shapes, fast_phase, motion_of, shapes_of

NODES = 33
EPS = 4 * float(np.finfo(float).eps)
FACTOR = 4.0
SLACK = 0.05
WEIGHTS = (  # at the centre of nine instants: value, first and second derivative
    np.eye(9)[4], np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840, np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualOrder:
    """The measured power of mu of the residual of the expansion truncated after `order`, and the derived one, a lower bound."""

    order: str
    derived: float
    measured: float
    largest: float

    @property
    def agrees(self) -> bool:
        """Tell whether the residual falls at least as fast as derived, or is rounding."""
        return self.measured > self.derived - SLACK

    def as_dict(self) -> dict[str, object]:
        """Return plain data."""
        return {"order": self.order, "derived": f"{self.derived:g}", "measured": f"{self.measured:.4f}" if np.isfinite(self.measured) else None, "residual": f"{self.largest:.2e}", "agrees": self.agrees}

    def line(self) -> str:
        """Return a line of text."""
        slope = f"mu^{self.measured:.3f}" if np.isfinite(self.measured) else "rounding"
        return f"  residual of the expansion to order {self.order:3} ~ {slope}, derived mu^{self.derived:g}{'' if self.agrees else '  DISAGREES'}"


def residual_orders(full: Full, emitted: str, mu: float, nodes: int = NODES) -> tuple[ResidualOrder, ...]:
    """Return the orders of the residual, from the distances mu and mu/4 from the threshold, for a motion of no special shape; farther where they show rounding only."""
    quadratic = bool(full.coefficient("A**2"))
    found = []
    for order in ("1",) if quadratic else ORDERS:
        derived = 2.0 if quadratic else {"1/2": 1.0, "1": 1.5}[order]
        slope, largest = np.inf, 0.0
        for factor in (1.0, FACTOR**-2, FACTOR, FACTOR**2):  # nearer where the next orders are in the way, farther where it is rounding
            (size, _), (nearer, noise) = (residual_of(full, emitted, factor * one, order, nodes) for one in (mu, mu / FACTOR))
            if nearer > 10 * noise and not derived - SLACK < slope < np.inf:
                slope, largest = float(np.log(size / nearer) / np.log(FACTOR)), size
            if derived - SLACK < slope < np.inf:
                break
        found.append(ResidualOrder(order=order, derived=derived, measured=slope, largest=largest))
    return tuple(found)


def initial_amplitude(full: Full, mu: float) -> tuple[complex, ...]:
    """Return an amplitude of the size of that of the states at mu, of no special shape."""
    states = [state for state in full.states if state not in ("base", "undeformed")]
    amplitude = full.predict(states[-1], mu).amplitude  # negative where a transcritical branch is: on the other side nothing saturates
    if not full.vector:
        return (amplitude * (0.8 + 0.3j) if full.hopf else complex(0.8 * amplitude),)
    size = abs(amplitude)
    return (0.8 * size + 0j, size * (0.2 + 0.4j) if full.hopf else complex(0.3 * size))


def residual_of(full: Full, emitted: str, mu: float, order: str, nodes: int) -> tuple[float, float]:
    """Return the largest residual of any row at one instant of a motion, and the size of its rounding; each row by its largest coefficient at the base state."""
    rows, omega = full.rows, full.frequency
    left, right = rows.INTERVAL if rows.spatial else (0.0, 1.0)
    places = left + (right - left) * (1 - np.cos(np.pi * np.arange(nodes) / (nodes - 1))) / 2 if rows.spatial else np.zeros(1)
    rate = max(omega, abs(full.coefficient("mu*A") * mu))
    step = 2 * np.pi / rate / 400 if omega else 0.02 / rate
    times = 75 * step + step * np.arange(-4, 5)
    motion, _ = motion_of(emitted, Scene(initial=initial_amplitude(full, mu), mu=mu, until=float(times[-1])))
    shapes = shapes_of(emitted, full.result, mu, order, places)
    values = components(full, shapes, shapes.at(motion.amplitude(times), fast_phase(full.result.threshold.frequency, times)))
    unit = 2 * (places - left) / (right - left) - 1
    jets = np.empty((len(places), len(rows.jets), 1))
    rounding = np.empty((len(rows.jets), 1))
    for j, (k, ds, dt) in enumerate(rows.jets):
        value = np.tensordot(WEIGHTS[dt] / step**dt, values[k], axes=1)
        rounding[j] = EPS * float(np.abs(values[k]).max() * np.abs(WEIGHTS[dt]).sum()) / step**dt
        if ds:
            series = chebyshev.chebfit(unit, value, nodes - 1)
            series = series[:int(np.flatnonzero(np.abs(series) >= rounding[j])[-1]) + 1] if np.any(np.abs(series) >= rounding[j]) else series[:1]
            stretch = (2 / (right - left)) ** ds
            value = chebyshev.chebval(unit, chebyshev.chebder(series, ds)) * stretch
            rounding[j] *= stretch * slope_at_end(len(series), ds)
        jets[:, j, 0] = value
    worst, noise = 0.0, 0.0
    for site in (site for site in SITES if rows.USES.get(site)):
        where = {"interior": slice(None), "left": slice(0, 1), "right": slice(-1, None)}[site]
        found, _, slopes = rows.evaluate(site, places[where], full.threshold + mu, jets[where])
        still = rows.base(places[where], full.threshold)[0][..., None]
        scale = np.abs(rows.evaluate(site, places[where], full.threshold, still)[2]).max(axis=(0, 2, 3))
        scale[scale == 0] = 1.0
        worst = max(worst, float((np.abs(found[..., 0]) / scale).max()))
        noise = max(noise, float(((np.abs(slopes[:, :, 0]) @ rounding)[..., 0] / scale).max()))
    return worst, noise


def slope_at_end(count: int, order: int) -> float:
    """Return the root of the sum of squares of the derivatives, at 1, of the first Chebyshev polynomials: how much independent errors of the coefficients grow."""
    k = np.arange(count, dtype=float)
    return float(np.linalg.norm(np.prod([(k**2 - j**2) / (2 * j + 1) for j in range(order)], axis=0)))


def components(full: Full, shapes: Shapes, fields: dict[str, Array]) -> list[Array]:
    """Return each unknown of the rows against times and places: real components about the axis, Cartesian ones, or scalars."""
    found = []
    for (name, _), component in zip(shapes.unknowns, full.rows.component, strict=True):
        value = fields[name]
        if component in ("1", "2", "n"):
            value = value @ shapes.frame["12n".index(component)]
        elif component:
            value = value[..., "xyz".index(component)]
        found.append(value)
    return found
