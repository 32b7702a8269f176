r"""The motion of the full problem from any initial shape: a consistent start, steps that an error estimate chooses, and the constraints at every time kept.

Steps follow the decay of the Legendre coefficients in time of what moves. A start that does not meet the constraints is moved onto them first.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from numerics.full_newton import NotConverged
from numerics.full_radau import CONVERGED, KNOTS, STAGES, TAIL, Costs, Failed, Instant, Step, Stepper, System
from numerics.full_rows import Array, State

CONSTRAINT = 1e-10
LONGEST, SHORTEST = 3.0, 0.1  # change of the step from one to the next
LEAST_STEP, MOST_STEPS = 1e-12, 100  # of the longest step; in each of those
MOST_MOVED = 0.5  # of the size of an initial shape
PATIENCE = 100  # iterations for it


class Coarse(NotConverged):
    """The nodes in space do not meet the constraints; the message gives time and residual."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How steps are chosen: error of each as a share of what moves, fewest between two wanted times, longest and first, and one too short for any motion."""

    tolerance: float
    pieces: int
    longest: float
    first: float
    short: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A simulated motion.

    Attributes
    ----------
    times, kept
        The wanted times, and the deviation from the base state there.
    displacement, velocity
        Deviation of the normalised field from the base state at its place, and its derivative in time, at the wanted times: (times, components).
    track
        Time, displacement and velocity at every stage of every step: (stages, 1 + 2 components).
    violation
        Largest residual of any row without time derivative at the wanted times, at and between the nodes.
    """

    times: Array
    kept: tuple[State, ...]
    displacement: Array
    velocity: Array
    track: Array
    violation: float
    costs: Costs
    nodes: int


def packed(system: System, start: tuple[State, State]) -> Instant:
    """Return a shape and its rate as coefficients."""
    y, rate = (system.pack(one) for one in start)
    return Instant(y=y, rate=rate[:system.moving], second=np.zeros(system.moving))


def consistent(system: System, given: Instant, short: float) -> Instant:
    """Return the start that meets the rows, at the same time: a step forwards, too short for any motion, and one back.

    The first brings the shape onto the constraints, along the forces that keep them; the second starts there and frees all else of that jump. It needs the
    velocity at its own start, where second derivatives occur: the one from which it ends with the given velocity, up to what the constraints take away.

    Raises
    ------
    NotConverged
        The rows cannot be met near the shape.
    """
    stepper = Stepper(system=system, iterations=PATIENCE)
    try:
        there = stepper.solve(given, short, np.repeat(given.y[:, None], STAGES, axis=1)).end()
        rate = given.rate
        for _ in range(1 if system.order == 1 else 4):
            stepper.kept = None
            found = stepper.solve(Instant(y=there.y, rate=rate, second=there.second), -short, np.repeat(there.y[:, None], STAGES, axis=1)).end()
            rate = rate + given.rate - found.rate
    except NotConverged as failure:
        raise NotConverged(f"at time 0: the initial shape cannot be brought to meet the constraints: {failure}; expected a shape nearer to them, such as a smaller amplitude") from failure
    moved, size = (float(np.abs(one[:system.moving]).max(initial=0.0)) for one in (found.y - given.y, given.y))
    if not moved <= MOST_MOVED * size:
        raise NotConverged(f"at time 0: the equations move the initial shape by {moved / max(size, 1e-300):.1g} of its size before it meets them; expected a smaller amplitude")
    return found


class Control:
    """The size of the next step, from the decay in time of the last."""

    def __init__(self, system: System, plan: Plan) -> None:
        self.plan, self.wanted = plan, plan.first
        self.rows, fields = system.readings
        self.members = [fields == one for one in sorted(set(fields))]
        self.sizes = np.zeros(len(self.members))

    def error(self, step: Step) -> float:
        """Return the estimated error of the collocation polynomial of a step, by the largest value so far of each field."""
        values = self.rows @ np.column_stack([step.start, step.Y[:len(step.start)]])
        last, one = values @ TAIL.T[:, 1], values @ TAIL.T[:, 0]
        self.sizes = np.maximum(self.sizes, [np.abs(values[members]).max() for members in self.members])
        worst = 0.0
        for members, size in zip(self.members, np.maximum(self.sizes, max(1e-3 * self.sizes.max(), 1e-300)), strict=True):
            tail, slope = (float(np.abs(part[members]).max()) / size for part in (last, one))
            worst = max(worst, tail * min(1.0, tail / max(slope, 1e-300)))
        return worst

    def adapt(self, size: float, error: float) -> None:
        """Choose the next step; one that is nearly as good is kept."""
        share = 0.8 * (self.plan.tolerance / max(error, 1e-300)) ** (1 / (STAGES + 1))
        self.wanted = min(size * min(max(share, SHORTEST), LONGEST), self.plan.longest)


def simulate_full(system: System, start: tuple[State, State], times: Array, plan: Plan) -> Record:
    """Return the motion of the full problem at some times, of which the first is that of the start.

    Parameters
    ----------
    start
        Deviation from the base state and its rate, any shape: what violates the constraints is projected.

    Raises
    ------
    NotConverged
        A step fails, or (`Coarse`) a constraint is not kept to 1e-10; the message gives the time.
    """
    stepper, control, last = Stepper(system=system, converged=max(CONVERGED, min(1e-10, 1e-4 * plan.tolerance))), Control(system, plan), None
    now = consistent(system, packed(system, start), plan.short)
    most = MOST_STEPS * (5 + len(times) + (times[-1] - times[0]) / plan.longest)
    record, track, worst = [now], [], checked(system, now, times[0])
    for begin, end in zip(times, times[1:], strict=False):
        time = begin
        while end - time > 1e-9 * (end - begin):
            gap = end - time
            step = gap / max(ceil(gap / min(control.wanted, (end - begin) / plan.pieces) - 1e-6), 1)
            try:
                made = stepper.solve(now, step, last.beyond(step / last.size) if last else np.repeat(now.y[:, None], STAGES, axis=1))
                error = control.error(made)
                stepper.costs.steps += 1
                control.adapt(step, error)
                if error > 4 * plan.tolerance or stepper.costs.steps > most:
                    raise Failed(f"a step of {step:.3g} in time has an error of {error:.1e}")
            except Failed as failure:
                stepper.costs.rejected += 1
                control.wanted = min(control.wanted, step / 2)
                if step < LEAST_STEP * plan.longest or stepper.costs.steps > most:
                    raise NotConverged(f"at time {time:.6g}: after {stepper.costs.steps} steps {failure}; expected a motion that stays smooth: "
                                       "ask for a larger tolerance, a shorter time or a smaller initial amplitude") from failure
                last = None if last is None or step < last.size / 1000 else last
                continue
            track.append(readings(system, made, time))
            now, last, time = made.end(), made, time + step
        record.append(now)
        worst = max(worst, checked(system, now, end))
    return Record(
        times=times, kept=tuple(system.unpack(one.y) for one in record), displacement=np.array([system.place @ one.y for one in record]),
        velocity=np.array([system.place[:, :system.moving] @ one.rate for one in record]), track=np.concatenate(track), violation=worst, costs=stepper.costs, nodes=system.grid.nodes,
    )


def checked(system: System, at: Instant, time: float) -> float:
    """Return the largest residual of the constraints, which is small."""
    found = system.violation(at.values(system.order))
    if not found <= CONSTRAINT:
        raise Coarse(f"at time {time:.6g}: found a residual of {found:.1e} in the constraints at {system.grid.nodes} nodes; expected {CONSTRAINT:.0e}")
    return found


def readings(system: System, step: Step, time: float) -> Array:
    """Return time, displacement and velocity at the stages."""
    place = system.place
    return np.column_stack([time + step.size * KNOTS[1:], (place @ step.Y).T, (place[:, :system.moving] @ step.V).T])
