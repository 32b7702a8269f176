"""Orbits of the full problem far from onset: started from the amplitude equation, followed in the control, refined in space and time, with multipliers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from numerics.full_newton import NotConverged
from numerics.full_orbit import Found, Orbit, Space, orbit_from, solve_orbit
from numerics.full_rows import Array, State
from numerics.full_stability import Class, Exponent, labelled, ordered
from numerics.full_states import Branch, field_tails, peak_of
from numerics.precision import EvaluationError

MAX_NODES, MAX_ELEMENTS = 120, 240
FAINTEST = 1e-6  # smallest multiplier that rounding leaves legible


class Cycles:
    """The orbits of one state."""

    def __init__(self, branch: Branch) -> None:
        self.branch = branch
        self.made: dict[int, tuple[Space, Space | None]] = {}
        self.sufficed = (0, 0)  # nodes and elements from which the last state was confirmed: the next one on the branch starts there

    def spaces(self, nodes: int) -> tuple[Space, Space | None]:
        """Return the coefficients in the plane of the motion, and out of it if the motion has one."""
        if nodes not in self.made:
            form, rows = self.branch.form, self.branch.full.rows
            others = Space(rows, form.motion, form.others, nodes) if any(group.members for group in form.others) else None
            self.made[nodes] = Space(rows, form.motion, form.groups, nodes), others
        return self.made[nodes]

    def mu(self, orbit: Orbit) -> float:
        """Return the distance from the threshold."""
        return orbit.control - self.branch.full.threshold

    def solve(self, orbit: Orbit) -> Found:
        """Return the orbit at the control of a start; it must not have collapsed onto the base state."""
        found = solve_orbit(orbit, self.branch.width(self.mu(orbit)))
        if np.abs(found.orbit.start).max() < 0.2 * np.abs(orbit.start).max():
            raise NotConverged(f"at control {orbit.control:.8g}: Newton's method left the branch")
        return found

    def at(self, state: State, nodes: int, elements: int) -> Found:
        """Return a state solved at a resolution."""
        return self.solve(orbit_from(self.spaces(nodes)[0], state, elements))

    def start(self, mu: float) -> Found:
        """Return the orbit at mu: from the prediction, or followed from nearer the threshold."""
        near = self.branch.near(mu)[0]
        state = near.grid.unpack(near.y, near.control, near.omega)
        found = self.at(state, 16, 8 if self.branch.form.motion.symmetric else 16)
        *_, found = self.follow(found, self.branch.full.threshold + mu)
        return found

    def follow(self, start: Found, target: float, longest: float = 0.4) -> Iterator[Found]:
        """Yield the orbits from a start, itself first, to a control, the last one there: steps in log |mu|, predicted by the secant."""
        threshold = self.branch.full.threshold
        goal, current, before, step = target - threshold, self.resolved(start, 1e-4), None, longest / 4
        if self.mu(start.orbit) * goal <= 0:
            raise NotConverged(f"{self.branch.state}: found the threshold between controls {start.orbit.control:.8g} and {target:.8g}; expected both on one side")
        yield current
        while abs(self.mu(current.orbit) - goal) > 1e-13 * abs(target):
            mu = self.mu(current.orbit)
            gap = float(np.log(goal / mu))
            while True:
                last = abs(gap) <= 1.2 * step
                control = target if last else threshold + mu * float(np.exp(np.sign(gap) * step))
                try:
                    found = self.solve(self.predicted(before, current.orbit, control))
                    break
                except NotConverged as failure:
                    step /= 2
                    if step < 2e-3:
                        raise NotConverged(f"{self.branch.state}: the branch cannot be followed beyond control {current.orbit.control:.8g} towards {target:.8g}: {failure}") from failure
            before = current.orbit
            current = self.resolved(found, 1e-4)
            if found.steps <= 5:
                step = min(1.5 * step, longest)
            yield current

    def predicted(self, before: Orbit | None, orbit: Orbit, control: float) -> Orbit:
        """Return the orbit continued along the secant in log |mu|."""
        if before is None:
            return replace(orbit, control=control)
        if before.stages.shape != orbit.stages.shape:
            before = orbit_from(orbit.space, before.state, orbit.elements)
        threshold = self.branch.full.threshold
        mus = [one - threshold for one in (before.control, orbit.control, control)]
        share = float(np.log(mus[2] / mus[1]) / np.log(mus[1] / mus[0]))
        return replace(orbit, control=control, stages=orbit.stages + share * (orbit.stages - before.stages), start=orbit.start + share * (orbit.start - before.start),
                       omega=orbit.omega + share * (orbit.omega - before.omega))

    def resolved(self, found: Found, tolerance: float) -> Found:
        """Return the same orbit with tails of both series below the tolerance."""
        while True:
            state = found.orbit.state
            space, time = field_tails(self.branch.full.rows, state)
            if space < tolerance and time < tolerance:
                return found
            nodes, elements = state.nodes, found.orbit.elements
            nodes += max(3, nodes // 6) if space >= tolerance else 0
            elements += max(2, elements // 4) if time >= tolerance else 0
            self.check(nodes, elements, found.orbit.control, f"tails of {space:.1e} in space and {time:.1e} in time")
            found = self.at(state, nodes, elements)

    def check(self, nodes: int, elements: int, control: float, reason: str) -> None:
        """Refuse a resolution beyond the largest."""
        if nodes > MAX_NODES or elements > MAX_ELEMENTS:
            raise NotConverged(f"{self.branch.state} at control {control:.8g}: found {reason} at the largest resolution; ask for a larger tolerance")

    def refined(self, found: Found, tolerance: float) -> tuple[Found, float, tuple[Exponent, ...], float]:
        """Return the orbit with the relative error of peak and frequency, its exponents and their error, all from two resolutions."""
        mu = self.mu(found.orbit)
        floor = 4 * np.finfo(float).eps * (1 + abs(found.orbit.control / mu))
        if floor > tolerance:
            raise EvaluationError(f"tolerance: found {tolerance:.0e}; expected at least {floor:.0e} at this distance from the threshold, by the rounding of the control")
        found = self.resolved(found, max(1e-8, min(1e-4, 1e3 * tolerance)))
        nodes, elements = max(found.orbit.space.grid.nodes, self.sufficed[0]), max(found.orbit.elements, self.sufficed[1])
        if (nodes, elements) != (found.orbit.space.grid.nodes, found.orbit.elements):
            found = self.at(found.orbit.state, nodes, elements)
        exponents = self.exponents(found)
        while True:
            orbit = found.orbit
            space, _ = field_tails(self.branch.full.rows, orbit.state)
            nodes = orbit.space.grid.nodes + (max(3, orbit.space.grid.nodes // 8) if space > 1e-12 else 2)
            elements = orbit.elements + max(2, orbit.elements // 4)
            self.check(nodes, elements, orbit.control, f"two resolutions that differ by more than {tolerance:.0e}")
            finer = self.at(orbit.state, nodes, elements)
            error = self.distance(orbit, finer.orbit)
            now = self.exponents(finer)
            change = exponent_change(exponents, now) / max(abs(orbit.omega), 1e-300)
            found, exponents = finer, with_errors(exponents, now)
            if error < tolerance / 2 and change < max(1e-6, tolerance):
                self.sufficed = (orbit.space.grid.nodes, orbit.elements)
                return found, max(error, floor), exponents, change * abs(orbit.omega)

    def distance(self, one: Orbit, other: Orbit) -> float:
        """Return the relative difference of peak and frequency."""
        rows = self.branch.full.rows
        peaks = [peak_of(rows, orbit.state) for orbit in (one, other)]
        return max(abs(peaks[0] - peaks[1]) / peaks[1], abs(one.omega - other.omega) / abs(other.omega))

    def exponents(self, found: Found) -> tuple[Exponent, ...]:
        """Return the leading Floquet exponents, in plane and out of plane, neutral ones recognised.

        Raises
        ------
        EvaluationError
            An exponent that must be zero by a symmetry is not.
        """
        orbit = found.orbit
        inside, outside = self.spaces(orbit.space.grid.nodes)
        planar = outside is not None
        classes = [("in plane" if planar else "", self.rates(found, inside))]
        if outside is not None:
            classes.append(("out of plane", self.rates(found, outside)))
        return labelled(self.branch, [Class(kind=kind, values=values, errors=np.zeros(len(values))) for kind, values in classes], orbit.omega)

    def rates(self, found: Found, space: Space) -> Array:
        """Return the exponents of a class of disturbances that are legible, sorted from the most dangerous."""
        orbit = found.orbit
        multipliers = found.multipliers(orbit.space if space.size == orbit.space.size and space is self.spaces(space.grid.nodes)[0] else space).astype(complex)
        values = np.log(multipliers[np.abs(multipliers) > FAINTEST]) * orbit.omega / orbit.span
        return values[ordered(values)]


def with_errors(before: tuple[Exponent, ...], after: tuple[Exponent, ...]) -> tuple[Exponent, ...]:
    """Return the exponents with their changes."""
    return tuple(replace(one, error=float(min((abs(one.value - other.value) for other in before if other.kind == one.kind), default=np.inf))) for one in after)


def exponent_change(before: tuple[Exponent, ...], after: tuple[Exponent, ...]) -> float:
    """Return the largest change of the exponents that grow or decay least: as many as grow, and two more, of each kind."""
    worst = 0.0
    for kind in sorted({one.kind for one in after if not one.neutral}):
        pair = [[one.value for one in group if one.kind == kind] for group in (before, after)]
        leading = [value for k, value in enumerate(pair[1]) if value.real > 0 or k < 2]
        worst = max([worst, *(min((abs(value - other) for other in pair[0]), default=np.inf) for value in leading)])
        worst = max([worst, *(min((abs(value - other) for other in pair[1]), default=np.inf) for value in pair[0] if value.real > 0)])
    return worst
