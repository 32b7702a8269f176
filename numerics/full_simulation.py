"""Direct simulation of the full problem from the shape that an amplitude has, as the file that `fredholm simulate` writes, with an error by finer steps and more nodes."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from numerics.coefficients import Module, Result
from numerics.full_motion import CONSTRAINT, Coarse, Plan, Record, simulate_full
from numerics.full_newton import NotConverged
from numerics.full_orders import components
from numerics.full_radau import System
from numerics.full_rows import Array, Rows, State, space_basis
from numerics.full_states import Full, readings
from numerics.motion import Scene, Shapes, check_scene, fast_phase, motion_of, shapes_of
from numerics.precision import EvaluationError
from numerics.simulation import Dataset, Sampling, Variable, field_variables, times_of

NODES, LEAST_NODES, MOST_NODES = 32, 28, 120  # of the shape that an amplitude has, and of a run
LEVELS = 4
LEAST_ERROR = 1e-13  # of a step, above rounding
SHORT = 1e-4  # of a period: a start is brought onto the constraints within it
MOST_PERIODS = 100_000
FINER = 64.0  # change of the step error from one level to the next: half the step


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Fewest steps in a period of the threshold (in the whole time when steady), and the error that is allowed, of the largest displacement."""

    steps: int = 6
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        if not 1e-12 <= self.tolerance < 1:
            raise EvaluationError(f"tolerance: found {self.tolerance:g}; expected a number from 1e-12 to 1")


def simulate_fields(text: str, emitted: str, result: Result, scene: Scene, sampling: Sampling, accuracy: Accuracy) -> Dataset:
    """Return the fields of the full problem from the shape of an initial amplitude.

    Parameters
    ----------
    text
        What `derive.residual.emit_residual` returns.
    emitted
        The emitted derivation: it gives the initial shape, reconstructed to `sampling.order`.

    Raises
    ------
    EvaluationError
        The scene does not fit the problem, or the tolerance cannot be met.
    """
    check_scene(Module(emitted), scene)
    full = Full(rows=Rows(text), result=result)
    shapes = shapes_of(emitted, result, scene.mu, sampling.order, sampling.places)
    start = start_of(full, emitted, scene, sampling.order, NODES if full.rows.spatial else 1)
    record, error, before = converged(full, scene.mu, start, times_of(scene.until, sampling), accuracy)
    return dataset(full, shapes, record, before, scene, (error, change_of_start(full, start, record)))


def period_of(full: Full, until: float) -> float:
    """Return the period at the threshold, the whole time when steady."""
    return 2 * np.pi / full.frequency if full.hopf else until


def converged(full: Full, mu: float, start: tuple[State, State], times: Array, accuracy: Accuracy) -> tuple[Record, float, Record]:
    """Return the motion at two levels of steps and nodes that agree to the tolerance: the finer, their difference, and the coarser.

    Parameters
    ----------
    start
        Deviation from the base state and its rate.

    Raises
    ------
    NotConverged
        The levels do not agree, or a step fails.
    """
    until = float(times[-1])
    period = period_of(full, until)
    if until > MOST_PERIODS * period:
        raise EvaluationError(f"until: found {until / period:.3g} periods of the threshold; expected at most {MOST_PERIODS} to follow step by step")
    short = min(SHORT * (period if full.hopf else min(1.0, period) / 10), until / 10)
    nodes, error, before = (LEAST_NODES if full.rows.spatial else 1), np.inf, None
    skip = 2 if len(times) > 2 and len(times) % 2 else 1  # the first level stops at every other time
    for level in range(LEVELS):
        plan = Plan(tolerance=max(10 * accuracy.tolerance / FINER**level, LEAST_ERROR), pieces=max(2**level // skip, 1), longest=period / accuracy.steps / 2**level, first=period / 400, short=short)
        while True:
            try:
                record = simulate_full(System(full.rows, full.threshold + mu, nodes), start, times if level else times[::skip], plan)
                break
            except Coarse as failure:
                if not full.rows.spatial or nodes >= MOST_NODES:
                    raise Coarse(f"{failure}: expected a smoother initial shape, such as a smaller amplitude, or --order 1") from failure
                nodes += nodes // 4
        if before is not None:
            error = difference(before, record)
            if error < accuracy.tolerance:
                return record, error, before
        before, nodes = record, nodes + nodes // (2 if level else 8)  # what is not smooth needs many
    raise NotConverged(f"found a displacement that changes by {error:.1e} of its largest value when steps are halved; expected less than {accuracy.tolerance:.0e}: ask for a shorter time or a larger tolerance")


def difference(one: Record, other: Record) -> float:
    """Return the largest change of the normalised field at the times of the first record, as a share of its largest value."""
    return float(np.abs(one.displacement - other.displacement[shared(one, other)]).max() / max(np.abs(other.displacement).max(), 1e-300))


def shared(one: Record, other: Record) -> slice:
    """Return which times of the second record are those of the first."""
    return slice(None, None, (len(other.times) - 1) // (len(one.times) - 1))


def change_of_start(full: Full, start: tuple[State, State], record: Record) -> float:
    """Return how far the start was moved onto the constraints, as a share of the largest displacement."""
    given = readings(full.rows, start[0])[:, 0]
    return float(np.abs(given - record.displacement[0]).max() / max(np.abs(record.displacement).max(), 1e-300))


def start_of(full: Full, emitted: str, scene: Scene, order: str, nodes: int) -> tuple[State, State]:
    """Return deviation from the base state and its rate of the reconstruction at time 0, by least squares on twice as many places."""
    rows = full.rows
    left, right = rows.INTERVAL if rows.spatial else (-1.0, 1.0)
    x = -np.cos(np.pi * np.arange(2 * nodes + 1) / (2 * nodes)) if rows.spatial else np.zeros(1)
    places = np.clip(left + (x + 1) * (right - left) / 2, left, right)
    shapes = shapes_of(emitted, full.result, scene.mu, order, places)
    step = 2 * np.pi / full.frequency / 400 if full.hopf else 1e-2
    motion, _ = motion_of(emitted, Scene(initial=scene.initial, mu=scene.mu, until=8 * step))
    initial = np.array(scene.initial if shapes.vector else scene.initial[0])
    still = components(full, shapes, shapes.at(np.zeros_like(initial), 0.0))
    deviation = components(full, shapes, shapes.at(initial, 0.0))
    times = step * np.arange(9)
    moving = components(full, shapes, shapes.at(motion.amplitude(times), fast_phase(full.result.threshold.frequency, times)))
    forward = np.linalg.solve(np.vander(np.arange(9.0), increasing=True).T, np.eye(9)[1]) / step  # first derivative at the first of nine instants
    made = []
    for values in ([a - b for a, b in zip(deviation, still, strict=True)], [np.tensordot(forward, one, axes=1) for one in moving]):
        coefficients = []
        for k, value in enumerate(values):
            basis = space_basis(rows.degree[k], nodes, right - left if rows.spatial else 2.0, x, 0)
            coefficients.append(np.linalg.lstsq(basis, value, rcond=1e-13)[0][:, None])
        made.append(State(coefficients=tuple(coefficients), nodes=nodes, harmonics=0, control=full.threshold + scene.mu, omega=0.0))
    return made[0], made[1]


def fields_of(full: Full, shapes: Shapes, record: Record) -> dict[str, Array]:
    """Return the fields of the statement in Cartesian components at the wanted times."""
    rows = full.rows
    left, right = rows.INTERVAL if rows.spatial else (-1.0, 1.0)
    x = 2 * (shapes.places - left) / (right - left) - 1 if rows.spatial else np.zeros(1)
    still = shapes.at(np.zeros(2 if shapes.vector else ()), 0.0)
    fields = {name: np.repeat(value[None], len(record.kept), axis=0) for name, value in still.items()}
    for k, (name, _) in enumerate(shapes.unknowns):
        basis = space_basis(rows.degree[k], record.nodes, right - left if rows.spatial else 2.0, x, 0)
        values = np.array([basis @ state.coefficients[k][:, 0] for state in record.kept])
        component = rows.component[k]
        if component in ("1", "2", "n"):
            fields[name] += values[..., None] * shapes.frame["12n".index(component)]
        elif component:
            fields[name][..., "xyz".index(component)] += values
        else:
            fields[name] += values
    return fields


def amplitude_of(full: Full, record: Record) -> Array:
    r"""Return :math:`e^{-i\omega t}(d - i\dot{d}/\omega)/2` of the displacement d with the frequency of the threshold; d itself when steady."""
    found = record.displacement.astype(complex)
    if full.hopf:
        turn = np.exp(-1j * fast_phase(full.result.threshold.frequency, record.times))
        found = turn[:, None] * (record.displacement - 1j * record.velocity / full.frequency) / 2
    return found if full.vector else found[:, 0]


def ellipses(record: Record, period: float) -> dict[str, Array]:
    """Return the ellipse about each time: largest and smallest displacement, direction of the largest, and sense.

    Between two turning points of the displacement no further apart than a period the semi-axes are interpolated; elsewhere (a circle has none) they are the
    largest and the smallest displacement within a period. Between the stages of a step the square of the displacement is that of cubic Hermite interpolation.
    """
    count = record.displacement.shape[1]
    track = np.vstack([np.concatenate([record.times[:1], record.displacement[0], record.velocity[0]]), record.track])
    times, d, v = track[:, 0], track[:, 1:1 + count], track[:, 1 + count:]
    square, slope, gap = np.sum(d**2, axis=1), 2 * np.sum(d * v, axis=1), np.diff(track[:, 0])
    turns = np.flatnonzero(slope[:-1] * slope[1:] < 0)
    share = slope[turns] / (slope[turns] - slope[turns + 1])
    a, b, h = square[turns], square[turns + 1], gap[turns]
    cubic = a + share**2 * (3 - 2 * share) * (b - a) + h * share * (1 - share) * ((1 - share) * slope[turns] - share * slope[turns + 1])
    turning, extreme, top = times[turns] + share * h, np.sqrt(np.maximum(cubic, 0.0)), slope[turns] > 0
    swept = np.concatenate([[0.0], np.cumsum(gap * (cross(d, v)[1:] + cross(d, v)[:-1]) / 2)])
    found: dict[str, list[float]] = {"semi_major": [], "semi_minor": [], "orientation": [], "sense": []}
    for time in record.times:
        begin = max(min(time - period / 2, times[-1] - period), times[0])
        end = begin + period * (1 + 1e-12)
        first, last = np.searchsorted(times, [begin, end])
        largest = min(first, len(times) - 1) + int(np.argmax(square[first:last])) if last > first else min(first, len(times) - 1)
        sizes = np.concatenate([np.sqrt(square[first:max(last, largest + 1)]), extreme[slice(*np.searchsorted(turning, [begin, end]))]])
        area = np.interp(end, times, swept) - np.interp(begin, times, swept)
        line = abs(area) <= 1e-12 * 2 * np.pi * square[largest]
        major, minor = between(turning[top], extreme[top], time, period, sizes.max()), between(turning[~top], extreme[~top], time, period, sizes.min())
        for name, value in (("semi_major", major), ("semi_minor", 0.0 if line else min(major, minor)),
                            ("orientation", np.mod(np.arctan2(d[largest, 1], d[largest, 0]), np.pi)), ("sense", 0.0 if line else np.sign(area))):
            found[name].append(float(value))
    return {name: np.array(values) for name, values in found.items()}


def between(times: Array, values: Array, time: float, longest: float, otherwise: float) -> float:
    """Return a value by linear interpolation between two times no further apart than the longest, else the other one."""
    k = int(np.searchsorted(times, time))
    if not 0 < k < len(times) or times[k] - times[k - 1] > longest:
        return otherwise
    return float(np.interp(time, times[k - 1:k + 1], values[k - 1:k + 1]))


def cross(one: Array, other: Array) -> Array:
    """Return the component along the axis of the cross product."""
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]


def dataset(full: Full, shapes: Shapes, record: Record, before: Record, scene: Scene, errors: tuple[float, float]) -> Dataset:
    """Return the simulated fields with what made them."""
    threshold = full.result.threshold
    amplitude, across = amplitude_of(full, record), ("across",) if full.vector else ()
    ellipse = ellipses(record, period_of(full, scene.until)) if full.vector and full.hopf else {}
    fields, coarser = (fields_of(full, shapes, one) for one in (record, before))
    variables = {
        "time": Variable(axes=("time",), values=record.times),
        **({"place": Variable(axes=("place",), values=shapes.places)} if shapes.spatial else {}),
        "amplitude_re": Variable(axes=("time", *across), values=amplitude.real),
        "amplitude_im": Variable(axes=("time", *across), values=amplitude.imag),
        **{f"ellipse_{name}": Variable(axes=("time",), values=values) for name, values in ellipse.items()},
        **({"frame": Variable(axes=("frame_vector", "component"), values=shapes.frame)} if shapes.vector else {}),
        **field_variables(shapes, fields),
    }
    error, moved = errors
    attributes = {
        "problem": full.result.problem, "model": "full nonlinear problem", "kind": threshold.kind, "multiplicity": threshold.multiplicity, "threshold": threshold.control, "mu": scene.mu,
        "control": full.threshold + scene.mu, "frequency": threshold.frequency or "0", "order": shapes.order, "initial": ", ".join(str(one) for one in scene.initial),
        "amplitude": "exp(-i omega t) (d - i d'/omega)/2 of the deviation d of the normalised field, omega of the threshold" if full.hopf else "deviation of the normalised field",
        "method": "Radau IIA, order 9", "steps": record.costs.steps, "rejected": record.costs.rejected, "nodes": record.nodes,
        "error": error,  # of the normalised field, of its largest value: change by finer steps and more nodes
        "field_errors": json.dumps({name: float(f"{np.abs(fields[name][shared(before, record)] - coarser[name]).max():.2e}") for name in fields}),  # absolute
        "start_moved": moved,  # by the constraints, of the largest displacement
        "constraint": record.violation, "constraint_bound": CONSTRAINT,
    }
    return Dataset(variables=variables, attributes=attributes)
