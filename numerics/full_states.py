r"""States of the full problem: started from the amplitude equation, refined in space and time, followed in the control.

Names: `undeformed`, `beating`, `whirling` for a complex vector amplitude; `base`, `cycle`, `branch` for the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from numerics.coefficients import Result
from numerics.full_newton import Condition, LeastSquares, NotConverged, Solution, newton, system
from numerics.full_rows import Array, Discretisation, Group, Motion, Rows, State, space_basis
from numerics.precision import EvaluationError

CUBIC = ("A**2*conj(A)", "A**3", "dot(A,A)*A")
MAX_NODES, MAX_HARMONICS = 160, 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What the amplitude equation says at a distance mu from the threshold; `slope` is d|A|/dmu when it is linear in mu."""

    peak: float
    frequency: float | None
    amplitude: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Full:
    """The full problem and its amplitude equation."""

    rows: Rows
    result: Result

    @property
    def threshold(self) -> float:
        """Return the threshold."""
        return float(self.result.threshold.control)

    @property
    def frequency(self) -> float:
        """Return the frequency at the threshold, 0 when steady."""
        return float(self.result.threshold.frequency or 0)

    @property
    def hopf(self) -> bool:
        """Tell whether the bifurcation is to oscillations."""
        return self.result.threshold.kind == "hopf"

    @property
    def vector(self) -> bool:
        """Tell whether the amplitude is a vector."""
        return self.result.threshold.multiplicity == 2

    @property
    def states(self) -> tuple[str, ...]:
        """Return the names of the states."""
        if self.hopf and self.vector:
            return ("undeformed", "beating", "whirling")
        return ("base", "cycle") if self.hopf else ("base", "branch")

    def coefficient(self, *monomials: str) -> complex:
        """Return the sum of coefficients of the monomials that occur."""
        return sum((complex(one.value) for one in self.result.coefficients if one.monomial in monomials), 0j)

    def predict(self, state: str, mu: float) -> Prediction:
        """Return the state of the amplitude equation.

        Raises
        ------
        EvaluationError
            It has no such state at this mu.
        """
        gamma = self.coefficient("mu*A")
        if state in ("undeformed", "base"):
            return Prediction(peak=0.0, frequency=None, amplitude=0.0)
        quadratic = self.coefficient("A**2").real
        if quadratic:
            amplitude = -gamma.real * mu / quadratic
            return Prediction(peak=abs(amplitude), frequency=None, amplitude=amplitude)
        if state in ("beating", "whirling"):
            alpha, beta = self.coefficient("dot(A,A)*conj(A)"), self.coefficient("dot(A,conj(A))*A")
            cubic = alpha + beta if state == "beating" else beta
        else:
            cubic = self.coefficient(*CUBIC)
        # gamma mu + cubic |A|^2 = i nu
        if not cubic.real or not -gamma.real * mu / cubic.real > 0:
            found = "a cubic coefficient that vanishes" if not cubic.real else f"|A|^2 = {-gamma.real * mu / cubic.real:.3g}"
            raise EvaluationError(f"mu: found {mu:g}, where the amplitude equation gives {found} for {state}; expected |A|^2 > 0: ask for {'another state' if not cubic.real or not mu else 'mu of the other sign'}")
        square = -gamma.real * mu / cubic.real
        frequency = self.frequency + gamma.imag * mu + cubic.imag * square if self.hopf else None
        amplitude = sqrt(square)
        peak = {"beating": 2.0, "cycle": 2.0, "whirling": sqrt(2.0)}.get(state, 1.0) * amplitude
        return Prediction(peak=peak, frequency=frequency, amplitude=amplitude)


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """How a state is looked for: its motion, its unknowns, and the unknowns that it leaves at rest."""

    state: str
    motion: Motion
    groups: tuple[Group, ...]
    others: tuple[Group, ...]

    def grid(self, rows: Rows, nodes: int, harmonics: int) -> Discretisation:
        """Return the discretisation of the state."""
        return Discretisation(rows, self.motion, self.groups, nodes, harmonics)


def form_of(full: Full, state: str) -> Form:
    """Return how to look for a state."""
    if state not in full.states:
        raise EvaluationError(f"state: found {state!r}; expected one of {', '.join(full.states)}")
    rows = full.rows
    everything = tuple(range(rows.count))
    if state in ("base", "undeformed"):
        return Form(state=state, motion=Motion(kind="steady"), groups=(Group(members=everything),), others=())
    if state == "whirling":
        return Form(state=state, motion=Motion(kind="rotating"), groups=(Group(members=everything),), others=())
    if not full.vector:
        motion = Motion(kind="periodic" if full.hopf else "steady")
        return Form(state=state, motion=motion, groups=(Group(members=everything),), others=())
    absent = components_at_rest(full)
    across = [k for k in everything if rows.weight[k]]
    along = [k for k in everything if not rows.weight[k]]
    odd, even = (1, 0) if full.hopf else (None, None)
    motion = Motion(kind="periodic", symmetric=True) if full.hopf else Motion(kind="steady")

    def groups(inside: bool) -> tuple[Group, ...]:
        parts = (tuple(k for k in across if (k in absent) != inside), tuple(k for k in along if (k in absent) != inside))
        if full.hopf:
            return tuple(Group(members=part, parity=parity) for part, parity in zip(parts, (odd, even), strict=True) if part)
        return (Group(members=tuple(sorted((*parts[0], *parts[1])))),)

    return Form(state=state, motion=motion, groups=groups(True), others=groups(False))


def components_at_rest(full: Full) -> frozenset[int]:
    """Return the components that vanish in a motion within a plane, read off the linear mode of the full rows.

    A vector that moves in the plane keeps its components 1 and n; an axial one (a moment) keeps 2 only.
    """
    rows = full.rows
    across = tuple(k for k in range(rows.count) if rows.weight[k])
    if full.hopf:
        grid = Discretisation(rows, Motion(kind="periodic", symmetric=True), (Group(members=across, parity=1),), 16, 1)
        wanted: tuple[tuple[int, int, float], ...] = ((0, 1, 1.0), (0, 2, 0.0), (1, 1, 0.0), (1, 2, 0.0))
    else:
        grid = Discretisation(rows, Motion(kind="steady"), (Group(members=across),), 16)
        wanted = ((0, 0, 1.0), (1, 0, 0.0))
    mode = grid.unpack(linear_mode(full, grid, wanted), full.threshold, full.frequency)
    absent = set()
    for field in sorted({rows.field[k] for k in across}):
        first, second = (k for k in across if rows.field[k] == field)
        sizes = [float(np.abs(mode.coefficients[k]).max()) for k in (first, second)]
        if max(sizes) == 0:
            continue
        if sizes[1] < 1e-5 * sizes[0]:
            absent.add(second)
        elif sizes[0] < 1e-5 * sizes[1]:
            absent |= {first, second + 1}
    return frozenset(absent)


def linear_mode(full: Full, grid: Discretisation, wanted: Sequence[tuple[int, int, float]]) -> Array:
    """Return the critical mode from the linearisation of the full rows: (normalised component, wave, value) are given."""
    at = grid.linearise(np.zeros(grid.size), full.threshold, full.frequency)
    matrix = at.matrix()
    matrix = matrix * at.scales(matrix)[:, None]
    extra = np.array([grid.reading(full.rows.normalised[component], wave) for component, wave, _ in wanted])
    right = np.concatenate([np.zeros(len(matrix)), [value for _, _, value in wanted]])
    return LeastSquares(np.vstack([matrix, extra])).solve(right)


class Branch:
    """The solutions of one state: conditions, Newton's method at a control or an amplitude, refinement."""

    def __init__(self, full: Full, state: str) -> None:
        self.full, self.state, self.form = full, state, form_of(full, state)
        self.wave = 1 if self.form.motion.kind == "periodic" else 0
        self.reach = 0.0  # how far from the threshold the branch is followed

    def grid(self, nodes: int, harmonics: int) -> Discretisation:
        """Return a discretisation."""
        return self.form.grid(self.full.rows, nodes, harmonics)

    def width(self, mu: float) -> float:
        """Return the size of the control against which a step is small."""
        return max(abs(self.full.threshold + mu), abs(mu), 1e-300)

    def phase(self, grid: Discretisation) -> list[Condition]:
        """Return what fixes the phase in time."""
        if self.form.motion.kind == "periodic":
            return [Condition(row=np.append(grid.reading(self.full.rows.normalised[0], 2), (0, 0)), value=0.0)]
        if self.form.motion.kind == "rotating":
            return [Condition(row=np.append(grid.reading(self.full.rows.normalised[1], 0), (0, 0)), value=0.0)]
        return []

    @property
    def held(self) -> tuple[int, ...]:
        """Return what Newton's method leaves alone: the frequency of a steady state."""
        return (-2,) if self.form.motion.kind == "steady" else ()

    def amplitude_row(self, grid: Discretisation) -> Array:
        """Return the row that reads the leading harmonic at the place of the normalisation."""
        return np.append(grid.reading(self.full.rows.normalised[0], self.wave), (0, 0))

    def at_control(self, grid: Discretisation, X: Array, control: float) -> Solution:
        """Return the state at a control."""
        X = X.copy()
        X[-1] = control
        return newton(grid, X, self.phase(grid), self.width(control - self.full.threshold), (*self.held, -1))

    def at_amplitude(self, grid: Discretisation, X: Array, reading: float, mu: float) -> Solution:
        """Return the state of a given leading harmonic; the control is free."""
        conditions = [*self.phase(grid), Condition(row=self.amplitude_row(grid), value=reading)]
        return newton(grid, X, conditions, self.width(mu), self.held)

    def guess(self, grid: Discretisation, mu: float) -> tuple[Array, float]:
        """Return the prediction of the amplitude equation as a start, and its leading harmonic."""
        prediction = self.full.predict(self.state, mu)
        reading = prediction.peak if prediction.amplitude >= 0 else -prediction.peak
        wanted = [(0, self.wave, 1.0)]
        if self.form.motion.kind == "periodic":
            wanted.append((0, 2, 0.0))
        if self.form.motion.kind == "rotating":
            wanted.append((1, 0, 0.0))
        mode = linear_mode(self.full, grid, wanted)
        return np.concatenate([reading * mode, [prediction.frequency or 0.0, self.full.threshold + mu]]), reading

    def on(self, grid: Discretisation, solution: Solution) -> Array:
        """Return a solution as a start on another discretisation."""
        state = solution.grid.unpack(solution.y, solution.control, solution.omega)
        return np.concatenate([grid.pack(state), [solution.omega, solution.control]])

    def near(self, mu: float) -> tuple[Solution, float, float]:
        """Return a state at about a share of mu, coarsely resolved, from the prediction; the share, and its leading harmonic.

        Raises
        ------
        NotConverged
            Newton's method finds none.
        """
        grid = self.grid(*self.coarse())
        share = 1.0
        for _ in range(12):
            X, reading = self.guess(grid, share * mu)
            try:
                near = self.settled(self.at_amplitude(grid, X, reading, share * mu), reading, share * mu)
                if self.misses(near, share * mu) < 0.35:
                    return near, share, reading
            except NotConverged:
                pass
            share *= 0.25
        raise NotConverged(f"{self.state}: found no state near the threshold from the prediction; ask for mu nearer to 0")

    def misses(self, solution: Solution, mu: float) -> float:
        """Return how far from a control a solution is, relative to mu."""
        return abs(solution.control - self.full.threshold - mu) / abs(mu)

    def settled(self, near: Solution, reading: float, mu: float) -> Solution:
        """Return the state of a given leading harmonic, resolved so far that its control is where the prediction has it, or to rounding."""
        near = self.resolved_at_amplitude(near, reading, mu, 1e-3)
        return near if self.misses(near, mu) < 0.35 else self.resolved_at_amplitude(near, reading, mu, 1e-11)

    def resolved_at_amplitude(self, solution: Solution, reading: float, mu: float, tolerance: float) -> Solution:
        """Return the state of the same leading harmonic with tails of both series below the tolerance; its control may change."""
        while True:
            space, time = tails(self.full.rows, solution)
            if max(space, time) < tolerance:
                return solution
            grid = self.finer(solution, space >= tolerance, time >= tolerance)
            solution = self.at_amplitude(grid, self.on(grid, solution), reading, mu)

    def finer(self, solution: Solution, space: bool, time: bool) -> Discretisation:
        """Return a discretisation with more nodes, more harmonics, or both.

        Raises
        ------
        NotConverged
            It would be beyond the largest; the message gives the tails of the series.
        """
        nodes, harmonics = solution.grid.nodes, solution.grid.harmonics
        nodes += max(4, nodes // 4) if space else 0
        harmonics += max(2, harmonics // 6 * 2) if time else 0
        if nodes > MAX_NODES or harmonics > MAX_HARMONICS:
            now = tails(self.full.rows, solution)
            raise NotConverged(f"{self.state} at control {solution.control:.8g}: {nodes} nodes and {harmonics} harmonics would be needed to bring the tails of the series down "
                               f"(now {now[0]:.1e} in space, {now[1]:.1e} in time); ask for a larger tolerance")
        return self.grid(nodes, harmonics)

    def start(self, mu: float) -> Solution:
        """Return the state at mu, coarsely resolved: from the prediction, or followed from nearer the threshold.

        Raises
        ------
        NotConverged
            Neither works; the message says what failed.
        """
        near, share, reading = self.near(mu)
        target = self.full.threshold + mu
        if share == 1.0:
            try:
                found = self.at_control(near.grid, near.X, target)
                if 0.5 < abs(self.amplitude_row(near.grid) @ found.X) / abs(reading) < 2:
                    return found
            except NotConverged:
                pass
        *_, last = self.follow(near, target)
        return last

    def coarse(self) -> tuple[int, int]:
        """Return nodes and harmonics to start with: as many nodes as resolve the coefficients of the rows, within bounds."""
        return max(12, min(self.full.rows.samples, 3 * MAX_NODES // 4)), (5 if self.form.motion.symmetric else 4)

    def tangent(self, solution: Solution, before: Array | None) -> Array:
        """Return the unit tangent of the branch in X, on the side of `before` (of growing amplitude, without)."""
        grid = solution.grid
        weights = self.weights(solution)
        row = weights * before if before is not None else self.amplitude_row(grid)
        matrix = system(grid, solution.X, [*self.phase(grid), Condition(row=row, value=0.0)])
        free = np.delete(np.arange(len(solution.X)), list(self.held))
        tangent = np.zeros(len(solution.X))
        tangent[free] = LeastSquares(matrix[:, free]).solve(np.append(np.zeros(len(matrix) - 1), 1.0))
        if before is None and self.amplitude_row(grid) @ solution.X < 0:
            tangent = -tangent
        return tangent / sqrt(float(np.sum(weights * tangent**2)))

    def weights(self, solution: Solution) -> Array:
        """Return the weights of the arclength: shape and distance to the threshold count alike."""
        y = solution.y
        size = max(float(np.sum(y**2)), 1e-300)
        mu = max(abs(solution.control - self.full.threshold), 0.1 * self.reach, 1e-9 * self.width(0.0))
        return np.concatenate([np.full(len(y), 1 / size), [0.0, 0.25 / mu**2]])

    def follow(self, start: Solution, target: float, step: float = 0.3, longest: float = 0.5, points: int = 400):  # type: ignore[no-untyped-def]
        """Yield the states along the branch by pseudo-arclength, around folds, up to the control `target`, the last one there.

        Near the threshold it is followed to larger amplitudes, unless the target lies between the threshold and the start; elsewhere towards the target.
        """
        current, before, previous = start, None, None  # state, direction, and the state before
        self.reach = abs(target - self.full.threshold)
        for _ in range(points):
            current = self.resolved(current, 1e-5)
            if before is not None and previous is not None and len(before) != len(current.X):
                before = current.X - self.on(current.grid, previous)
            tangent = self.tangent(current, before)
            if before is None and self.backwards(current, tangent, target):
                tangent = -tangent
            while True:
                gap = target - current.control
                ahead = current.X + step * tangent
                try:
                    if (ahead[-1] - current.control) * gap > 0 and abs(ahead[-1] - current.control) >= abs(gap):
                        share = gap / (ahead[-1] - current.control)
                        yield self.at_control(current.grid, current.X + share * step * tangent, target)
                        return
                    row = self.weights(current) * tangent
                    found = newton(current.grid, ahead, [*self.phase(current.grid), Condition(row=row, value=float(row @ ahead))], self.width(current.control - self.full.threshold), self.held)
                    if sqrt(float(np.sum(self.weights(current) * (found.X - ahead) ** 2))) > 0.5 * step:
                        raise NotConverged(f"at control {found.control:.6g}: the corrector left the predictor")
                    break
                except NotConverged as failure:
                    step /= 2
                    if step < 1e-4:
                        raise NotConverged(f"{self.state}: the branch cannot be followed beyond control {current.control:.8g} towards {target:.8g}: {failure}") from failure
            if found.steps <= 4:
                step = min(1.5 * step, longest)
            if (found.control - target) * (current.control - target) < 0:
                yield self.at_control(current.grid, found.X, target)
                return
            before, previous, current = tangent, current, found
            yield current
            mus = [one - self.full.threshold for one in (start.control, current.control, target)]
            if mus[0] * mus[2] > 0 and mus[1] * mus[2] < 0 and abs(mus[1]) > 2 * self.reach:
                raise NotConverged(f"{self.state}: the branch turns and leads away from control {target:.8g}; it is at {current.control:.8g}: ask for a range on the other side")
        raise NotConverged(f"{self.state}: the branch did not reach control {target:.8g} in {points} steps; it is at {current.control:.8g}")

    def backwards(self, start: Solution, tangent: Array, target: float) -> bool:
        """Tell whether a tangent along which the amplitude grows leads away from where the branch is to be followed."""
        mu = start.control - self.full.threshold
        try:
            predicted = self.full.predict(self.state, mu).peak
        except EvaluationError:
            predicted = 0.0
        if abs(self.peak(start) - predicted) < 0.3 * predicted:
            return 0 < (target - self.full.threshold) / mu < 1
        return bool(tangent[-1] * (target - start.control) < 0)

    def resolved(self, solution: Solution, tolerance: float) -> Solution:
        """Return the same state with tails of both series below the tolerance."""
        while True:
            space, time = tails(self.full.rows, solution)
            if space < tolerance and time < tolerance:
                return solution
            grid = self.finer(solution, space >= tolerance, time >= tolerance)
            solution = self.at_control(grid, self.on(grid, solution), solution.control)

    def refined(self, solution: Solution, tolerance: float) -> tuple[Solution, float]:
        """Return the state with an estimate of the relative error of its peak and frequency, from two resolutions."""
        # A control known to eps leaves the peak uncertain by eps |control| / (2 mu).
        floor = 4 * np.finfo(float).eps * (1 + abs(solution.control) / max(abs(solution.control - self.full.threshold), 1e-300))
        if floor > tolerance:
            raise EvaluationError(f"tolerance: found {tolerance:.0e}; expected at least {floor:.0e} at this distance from the threshold, by the rounding of the control")
        solution = self.resolved(solution, max(1e-9, min(1e-4, 1e3 * tolerance)))  # peak and frequency converge faster than the tails
        error = np.inf
        for _ in range(12):
            nodes, harmonics = solution.grid.nodes, solution.grid.harmonics
            space, _ = tails(self.full.rows, solution)
            grid = self.grid(nodes + (max(3, nodes // 8) if space > 1e-13 else 2), harmonics + 2)
            finer = self.at_control(grid, self.on(grid, solution), solution.control)
            error = self.distance(solution, finer)
            if error < max(tolerance / 4, floor):
                return finer, max(2 * error, floor)
            solution = finer
        raise NotConverged(f"{self.state} at control {solution.control:.8g}: two resolutions differ by {error:.1e}; expected less than {tolerance:.0e}: ask for a larger tolerance")

    def distance(self, one: Solution, other: Solution) -> float:
        """Return the relative difference of peak and frequency."""
        peaks = [self.peak(solution) for solution in (one, other)]
        frequency = abs(one.omega - other.omega) / abs(other.omega) if other.omega else 0.0
        return max(abs(peaks[0] - peaks[1]) / max(peaks[1], 1e-300), frequency)

    def peak(self, solution: Solution) -> float:
        """Return the largest deviation of the normalised field at its place."""
        return peak_of(self.full.rows, solution.grid.unpack(solution.y, solution.control, solution.omega))


def readings(rows: Rows, state: State) -> Array:
    """Return the harmonics of the normalised field at its place, one row a component."""
    left, right = rows.INTERVAL
    x = np.array([2 * (rows.PLACE - left) / (right - left) - 1]) if rows.spatial else np.zeros(1)
    return np.array([space_basis(rows.degree[k], state.nodes, right - left if rows.spatial else 2.0, x, 0)[0] @ state.coefficients[k] for k in rows.normalised])


def peak_of(rows: Rows, state: State) -> float:
    """Return the largest deviation of the normalised field at its place, over a period."""
    values = readings(rows, state)
    if values.shape[1] == 1:
        return float(np.linalg.norm(values))
    waves = (np.arange(values.shape[1]) + 1) // 2
    even = np.arange(values.shape[1]) % 2 == 0

    def at(t: Array, order: int) -> Array:
        angle = np.outer(np.atleast_1d(t), waves) + order * np.pi / 2
        return np.where(even & (waves > 0), np.sin(angle), np.cos(angle)) * np.where((waves == 0) & (order > 0), 0.0, waves.astype(float) ** order) @ values.T

    times = 2 * np.pi * np.arange(64 * max(waves.max(), 1)) / (64 * max(waves.max(), 1))
    t = times[np.argmax(np.sum(at(times, 0) ** 2, axis=1))]
    for _ in range(6):  # the maximum of |v|^2: v . v' = 0
        v, d, dd = (at(t, order)[0] for order in range(3))
        curve = d @ d + v @ dd
        t = t - (v @ d) / curve if curve < 0 else t
    return float(np.linalg.norm(at(t, 0)[0]))


def tails(rows: Rows, solution: Solution) -> tuple[float, float]:
    """Return the tails of a solution."""
    return field_tails(rows, solution.grid.unpack(solution.y, solution.control, solution.omega))


def field_tails(rows: Rows, state: State) -> tuple[float, float]:
    """Return the size of the last coefficients in space and in time, against the largest of the field; a field that is rounding beside the others has no say."""
    space = time = 0.0
    largest = max(float(np.abs(values).max()) for values in state.coefficients)
    for field in sorted(set(rows.field)):
        members = [k for k in range(rows.count) if rows.field[k] == field]
        size = max(float(np.abs(state.coefficients[k]).max()) for k in members)
        if size <= max(1e-14, 1e-11 * largest):
            continue
        for k in members:
            values = np.abs(state.coefficients[k])
            if rows.spatial:
                space = max(space, float(values[-2:].max()) / size)
            if state.harmonics:
                time = max(time, float(values[:, -4:].max()) / size)
    return space, time
