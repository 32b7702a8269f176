"""Direct simulation of the full problem from the shape that an amplitude has, as the file that `fredholm simulate` writes, with an error by halved steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from numerics.coefficients import Module, Result
from numerics.full_motion import CONSTRAINT, PROJECTION, Coarse, Record, simulate_full
from numerics.full_newton import NotConverged
from numerics.full_orders import components
from numerics.full_rows import Array, Rows, State, space_basis
from numerics.full_states import Full
from numerics.motion import Scene, Shapes, check_scene, fast_phase, motion_of, shapes_of
from numerics.precision import EvaluationError
from numerics.simulation import Dataset, Sampling, Variable, field_variables

LEAST_NODES, MOST_NODES = 24, 96
HALVINGS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Fewest steps in a period of the threshold (in the unit of time when steady), and the change by halved steps that is allowed, of the largest displacement."""

    steps: int = 24
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
        The scene does not fit the problem, or the steps do not converge.
    """
    if sampling.logarithmic:
        raise EvaluationError("spacing: found log; expected linear: the full problem is stepped at equal times")
    check_scene(Module(emitted), scene)
    full = Full(rows=Rows(text), result=result)
    spatial = full.rows.spatial
    shapes = shapes_of(emitted, result, scene.mu, sampling.order, sampling.places)
    nodes, steps, before = (LEAST_NODES if spatial else 1), accuracy.steps, None
    while True:
        try:
            record = simulate_full(text, result, scene.mu, scene.initial, scene.until, steps, nodes, start_of(full, emitted, scene, sampling.order, nodes), sampling.times - 1)
        except Coarse:
            nodes += nodes // 4
            if not spatial or nodes > MOST_NODES:
                raise
            continue
        if before is not None:
            error = difference(full, before, record)
            if error < accuracy.tolerance:
                return dataset(full, shapes, record, scene, (steps, error))
            if steps >= accuracy.steps * 2**HALVINGS:
                raise NotConverged(f"found a displacement that changes by {error:.1e} when {steps // 2} steps a period become {steps}; "
                                   f"expected less than {accuracy.tolerance:.0e}: ask for a shorter time or a larger tolerance")
        before, steps = record, 2 * steps


def difference(full: Full, one: Record, other: Record) -> float:
    """Return the largest change of the normalised field at the kept times, as a share of its largest value."""
    paths = [record.displacement[:: (len(record.times) - 1) // (len(record.kept) - 1)] for record in (one, other)]
    return float(np.abs(paths[0] - paths[1]).max() / max(np.abs(paths[1]).max(), 1e-300))


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


def start_time(full: Full) -> float:
    """Return the time that the two steps take which project the initial shape onto the constraints."""
    return 2 * PROJECTION * (2 * np.pi / full.frequency if full.hopf else 1.0)


def fields_of(full: Full, shapes: Shapes, record: Record) -> dict[str, Array]:
    """Return the fields of the statement in Cartesian components at the kept times."""
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


def dataset(full: Full, shapes: Shapes, record: Record, scene: Scene, accuracy: tuple[int, float]) -> Dataset:
    """Return the simulated fields with what made them."""
    threshold = full.result.threshold
    variables = {
        "time": Variable(axes=("time",), values=start_time(full) + np.linspace(0, scene.until, len(record.kept))),
        **({"place": Variable(axes=("place",), values=shapes.places)} if shapes.spatial else {}),
        **({"frame": Variable(axes=("frame_vector", "component"), values=shapes.frame)} if shapes.vector else {}),
        **field_variables(shapes, fields_of(full, shapes, record)),
    }
    steps, error = accuracy
    attributes = {
        "problem": full.result.problem, "model": "full nonlinear problem", "kind": threshold.kind, "multiplicity": threshold.multiplicity, "threshold": threshold.control, "mu": scene.mu,
        "control": full.threshold + scene.mu, "frequency": threshold.frequency or "0", "order": shapes.order, "initial": ", ".join(str(one) for one in scene.initial),
        "method": "Radau IIA, order 5", "steps_per_period": steps, "steps": len(record.times) - 1, "nodes": record.nodes,
        "error": error + 2 * np.pi * PROJECTION,  # of the normalised field, of its largest value: change by halved steps, and the time of one projection of the start
        "step_error": error,
        "constraint": max(record.residual, 1e-300), "constraint_bound": CONSTRAINT,
    }
    return Dataset(variables=variables, attributes=attributes)
