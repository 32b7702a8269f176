"""States of the full nonlinear problem with their stability: what `fredholm full` prints."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np
from scipy.optimize import brentq

from numerics.coefficients import Result
from numerics.full_cycles import Cycles
from numerics.full_newton import Condition, NotConverged, Solution, newton
from numerics.full_orbit import Found
from numerics.full_rows import Rows, State
from numerics.full_stability import Exponent, exponents_of, resting_exponents, settled_exponents
from numerics.full_states import Branch, Full, Prediction, peak_of
from numerics.precision import EvaluationError

SHOWN = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class FullState:
    """One state of the full problem.

    Attributes
    ----------
    peak
        Largest deviation of the normalised field from the base state at its place.
    error
        Estimate of the relative error of peak and frequency: two resolutions, and the rounding of the control.
    exponents
        Leading growth rates (steady and rotating states) or Floquet exponents (modulo i times the frequency).
    exponent_error
        Estimate of the error of those that grow or decay least, from two resolutions.
    """

    state: str
    mu: float
    control: float
    peak: float
    frequency: float | None
    predicted: Prediction | None
    exponents: tuple[Exponent, ...]
    exponent_error: float
    error: float
    nodes: int
    harmonics: int
    residual: float
    seconds: float
    shape: State

    @property
    def stable(self) -> bool:
        """Tell whether every exponent that is not neutral decays."""
        return all(one.value.real < 0 for one in self.exponents if not one.neutral)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of the contract."""
        frequency = None if self.frequency is None else decimal(self.frequency, self.error)
        predicted = self.predicted
        return {
            "state": self.state, "mu": decimal(self.mu, 0.0), "control": decimal(self.control, 0.0), "peak": decimal(self.peak, self.error), "frequency": frequency,
            "predicted": {"peak": decimal(predicted.peak, 0.0), "frequency": None if predicted.frequency is None else decimal(predicted.frequency, 0.0)} if predicted else None,
            "exponents": [{"re": placed(one.value.real, one.error), "im": placed(one.value.imag, one.error), "kind": one.kind} for one in self.exponents[:SHOWN]],
            "exponent_error": f"{self.exponent_error:.1e}", "stable": self.stable, "error": f"{self.error:.1e}", "resolution": {"nodes": self.nodes, "harmonics": self.harmonics, "residual": f"{self.residual:.1e}"},
            "seconds": round(self.seconds, 4),
        }

    def line(self) -> str:
        """Return the state as a row of a table: mu, peak, frequency, peak of the amplitude equation, leading exponent, stability."""
        leading = next((one for one in self.exponents if not one.neutral), None)
        rate = f"{leading.value.real:+14.7g} {leading.value.imag:+14.7g}i" if leading else ""
        frequency = "" if self.frequency is None else f"{self.frequency:16.10g}"
        predicted = f"{self.predicted.peak:14.8g}" if self.predicted else f"{'-':>14}"
        return f"{self.mu:14.8g} {self.peak:16.10g} {frequency} {predicted} {rate} {'stable' if self.stable else 'unstable'}"

    def text(self) -> str:
        """Return the state as lines of text."""
        lines = [f"{self.state} at mu = {self.mu:.10g}, control {self.control:.15g}: {'stable' if self.stable else 'unstable'}"]
        predicted = self.predicted
        lines.append(f"  peak       {decimal(self.peak, self.error)}" + (f"   amplitude equation {predicted.peak:.8g}" if predicted else ""))
        if self.frequency is not None:
            lines.append(f"  frequency  {decimal(self.frequency, self.error)}" + (f"   amplitude equation {predicted.frequency:.8g}" if predicted and predicted.frequency else ""))
        for one in self.exponents[:SHOWN]:
            lines.append(f"  exponent   {placed(one.value.real, one.error)} {'-' if one.value.imag < 0 else '+'} {placed(abs(one.value.imag), one.error)}i" + (f"   {one.kind}" if one.kind else ""))
        harmonics = f", {self.harmonics} harmonics" if self.harmonics else ""
        lines.append(f"  relative error {self.error:.1e}, of the exponents {self.exponent_error:.1e} (absolute), {self.nodes} nodes" + harmonics + f", {self.seconds:.2f} s")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.text()


def decimal(value: float, error: float) -> str:
    """Return a number with the digits that its relative error allows."""
    digits = 16 if error <= 0 else min(16, max(1, floor(-log10(error)) + 1))
    return f"{value:.{digits}g}"


def placed(value: float, error: float) -> str:
    """Return a number with the places that its absolute error allows, and at most thirteen digits."""
    places = floor(-log10(max(error, 1e-13 * abs(value), 1e-16)))
    written = f"{value:.{min(16, max(0, places))}f}"
    return written if float(written) else written.lstrip("-")


def solve_state(text: str, result: Result, state: str, mu: float, tolerance: float = 1e-10) -> FullState:
    """Return one state of the full problem at a distance mu from the threshold.

    Parameters
    ----------
    text
        What `derive.residual.emit_residual` returns.
    result
        Threshold and coefficients of the amplitude equation: they give the start and the prediction.
    tolerance
        Relative error of peak and frequency.

    Raises
    ------
    EvaluationError
        There is no such state, Newton's method failed, or the tolerance cannot be met; the message says which.
    """
    started = time.perf_counter()
    check_tolerance(tolerance)
    branch = Branch(Full(rows=Rows(text), result=result), state)
    if not np.isfinite(mu):
        raise EvaluationError(f"mu: found {mu}; expected a finite number")
    if state in ("base", "undeformed"):
        return at_rest(branch, mu, started)
    if mu == 0:
        raise EvaluationError(f"mu: found 0, where {state} has no amplitude; expected mu on the side on which it exists")
    if not turning(branch):
        return completed(branch, branch.start(mu), tolerance, started)
    cycles = Cycles(branch)
    try:
        found = cycles.start(mu)
    except NotConverged:  # a fold on the way: by pseudo-arclength
        start = branch.start(mu)
        found = cycles.at(start.grid.unpack(start.y, start.control, start.omega), start.grid.nodes, 2 * start.grid.harmonics)
    return completed_orbit(cycles, found, tolerance, started)


def turning(branch: Branch) -> bool:
    """Tell whether a state is periodic in time and extended in space: collocation in time then costs less than harmonics."""
    return branch.form.motion.kind == "periodic" and branch.full.rows.spatial


def predicted_at(branch: Branch, mu: float) -> Prediction | None:
    """Return the prediction of the amplitude equation, if it has the state at mu."""
    try:
        return branch.full.predict(branch.state, mu)
    except EvaluationError:
        return None


def completed_orbit(cycles: Cycles, start: Found, tolerance: float, started: float) -> FullState:
    """Return an orbit refined to the tolerance, with its stability."""
    found, error, exponents, exponent_error = cycles.refined(start, tolerance)
    branch, orbit, state = cycles.branch, found.orbit, found.orbit.state
    mu = cycles.mu(orbit)
    return FullState(
        state=branch.state, mu=mu, control=orbit.control, peak=peak_of(branch.full.rows, state), frequency=orbit.omega, predicted=predicted_at(branch, mu), exponents=exponents,
        exponent_error=exponent_error, error=error, nodes=state.nodes, harmonics=state.harmonics, residual=found.residual, seconds=time.perf_counter() - started, shape=state,
    )


def check_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that double precision cannot meet."""
    if not 1e-14 <= tolerance < 0.1:
        raise EvaluationError(f"tolerance: found {tolerance:g}; expected a number from 1e-14 to 0.1")


def at_rest(branch: Branch, mu: float, started: float) -> FullState:
    """Return the base state with its growth rates, at a resolution that changes them no more."""
    full = branch.full
    control = full.threshold + mu
    exponents, error, grid = resting_exponents(branch, control)
    return FullState(
        state=branch.state, mu=mu, control=control, peak=0.0, frequency=None, predicted=full.predict(branch.state, mu), exponents=exponents, exponent_error=error, error=0.0, nodes=grid.nodes,
        harmonics=0, residual=0.0, seconds=time.perf_counter() - started, shape=grid.unpack(np.zeros(grid.size), control, 0.0),
    )


def completed(branch: Branch, start: Solution, tolerance: float, started: float) -> FullState:
    """Return a state refined to the tolerance, with its stability."""
    solution, error = branch.refined(start, tolerance)
    full = branch.full
    mu = solution.control - full.threshold
    exponents, exponent_error = settled_exponents(branch, solution)
    return FullState(
        state=branch.state, mu=mu, control=solution.control, peak=branch.peak(solution), frequency=solution.omega if full.hopf else None, predicted=predicted_at(branch, mu),
        exponents=exponents, exponent_error=exponent_error, error=error, nodes=solution.grid.nodes,
        harmonics=solution.grid.harmonics, residual=solution.residual, seconds=time.perf_counter() - started,
        shape=solution.grid.unpack(solution.y, solution.control, solution.omega),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Secondary:
    """Where a state gains or loses stability: `kind` is `real` (an exponent crosses at 0) or `complex` (a pair, at +- i frequency)."""

    state: str
    kind: str
    mu: float
    control: float
    frequency: float
    error: float
    where: str

    def as_dict(self) -> dict[str, Any]:
        """Return the bifurcation as plain data."""
        return {"state": self.state, "kind": self.kind, "mu": decimal(self.mu, self.error), "control": decimal(self.control, self.error), "frequency": decimal(self.frequency, self.error),
                "error": f"{self.error:.1e}", "where": self.where}

    def line(self) -> str:
        """Return the bifurcation as a row of a table."""
        return f"{self.mu:14.8g} secondary bifurcation of {self.state}: {self.kind} exponent, control {self.control:.10g}, frequency {self.frequency:.8g}" + (f", {self.where}" if self.where else "")


def follow_branch(text: str, result: Result, state: str, low: float, high: float, tolerance: float = 1e-6) -> Iterator[FullState | Secondary]:
    """Yield the states of a branch from mu = low to mu = high, with their stability, by pseudo-arclength, and the secondary bifurcations between them."""
    check_tolerance(tolerance)
    full = Full(rows=Rows(text), result=result)
    branch = Branch(full, state)
    if state in ("base", "undeformed"):
        for mu in np.linspace(low, high, 30):
            yield at_rest(branch, float(mu), time.perf_counter())
        return
    if full.coefficient("A**2") and low * high < 0:  # through the threshold, where its amplitude vanishes
        for one, other in ((low, low / 100), (high / 100, high)):
            branch = Branch(full, state)
            yield from follow_states(branch, branch.start(one), other, tolerance)
        return
    if not turning(branch) or low * high < 0:
        yield from follow_states(branch, branch.start(low), high, tolerance)
        return
    last: FullState | Secondary | None = None
    try:
        for last in follow_orbits(Cycles(branch), low, high, tolerance):
            yield last
    except NotConverged:
        if not isinstance(last, FullState):
            raise
        grid = branch.grid(last.nodes, last.harmonics)  # a fold: by pseudo-arclength
        start = branch.at_control(grid, np.concatenate([grid.pack(last.shape), [last.shape.omega, last.control]]), last.control)
        yield from follow_states(branch, start, high, tolerance)


def follow_states(branch: Branch, current: Solution, high: float, tolerance: float) -> Iterator[FullState | Secondary]:
    """Yield the states of a branch by pseudo-arclength, and its secondary bifurcations."""
    before = completed(branch, current, tolerance, time.perf_counter())
    yield before
    for solution in branch.follow(current, branch.full.threshold + high, step=0.15, longest=0.15):
        started = time.perf_counter()
        after = completed(branch, solution, tolerance, started)
        if unstable(before) != unstable(after):
            yield secondary_between(branch, before, after)
        yield after
        before = after


def follow_orbits(cycles: Cycles, low: float, high: float, tolerance: float) -> Iterator[FullState | Secondary]:
    """Yield the orbits of a branch and its secondary bifurcations."""
    before: tuple[FullState, Found] | None = None
    for found in cycles.follow(cycles.start(low), cycles.branch.full.threshold + high, longest=0.15):
        after = completed_orbit(cycles, found, tolerance, time.perf_counter())
        if before is not None and unstable(before[0]) != unstable(after):
            yield secondary_orbit(cycles, before[0], after)
        yield after
        before = after, found


def secondary_orbit(cycles: Cycles, before: FullState, after: FullState) -> Secondary:
    """Return where the last growing exponent of an orbit crosses the axis, at two resolutions."""
    rank = max(unstable(before), unstable(after)) - 1
    nodes, harmonics = max(before.nodes, after.nodes), max(before.harmonics, after.harmonics) + 1
    elements = harmonics if cycles.branch.form.motion.symmetric else 2 * harmonics
    found: list[tuple[float, Exponent]] = []
    for factor in (1.0, 1.25):
        solved = {one.control: cycles.at(one.shape, int(nodes * factor), int(elements * factor)) for one in (before, after)}
        kept: list[Exponent] = []

        def crossing(control: float) -> float:
            if control not in solved:
                near = sorted(solved, key=lambda one: abs(one - control))
                solved[control] = cycles.solve(cycles.predicted(solved[near[1]].orbit, solved[near[0]].orbit, control))
            every = cycles.exponents(solved[control])
            kept[:] = [one for one in every if not one.neutral][rank:rank + 1]
            if not kept:
                raise EvaluationError(f"{before.state} near control {control:.8g}: found too few exponents to locate the secondary bifurcation; ask for a smaller tolerance")
            # A real exponent meets the neutral one of its class at the crossing: their sum does not feel that they repel each other by rounding.
            return kept[0].value.real + sum(one.value.real for one in every if one.neutral and one.kind.startswith(kept[0].kind))

        ends = (before.control, after.control)
        if found:  # a narrow bracket around what the first resolution found
            ends = (found[0][0] - 1e-3 * (ends[1] - ends[0]), found[0][0] + 1e-3 * (ends[1] - ends[0]))
        values = [crossing(control) for control in ends]
        if values[0] * values[1] > 0:
            raise EvaluationError(f"{before.state} between controls {before.control:.8g} and {after.control:.8g}: found exponents that cross twice, or two resolutions that differ; follow a shorter range")
        control = float(brentq(crossing, *ends, xtol=1e-9 * abs(ends[1]), rtol=1e-9))
        crossing(control)
        found.append((control, kept[0]))
    (first, _), (control, critical) = found
    real = abs(critical.value.imag) < 1e-3 * abs(after.frequency or 1.0)
    return Secondary(state=before.state, kind="real" if real else "complex", mu=control - cycles.branch.full.threshold, control=control, frequency=0.0 if real else abs(critical.value.imag),
                     error=max(2 * abs(control - first) / max(abs(control), 1e-300), 1e-9), where=critical.kind)


def unstable(one: FullState) -> int:
    """Return how many exponents grow."""
    return sum(exponent.value.real > 0 for exponent in one.exponents if not exponent.neutral)


def secondary_between(branch: Branch, before: FullState, after: FullState) -> Secondary:
    """Return where the last growing exponent crosses the axis, by the secant method within a bracket (Illinois)."""
    rank = max(unstable(before), unstable(after)) - 1
    finest = max((before, after), key=lambda one: (one.harmonics, one.nodes))
    estimates: list[tuple[float, Exponent]] = []
    width = branch.width(before.mu)
    for extra in (0, 2):
        grid = branch.grid(finest.nodes + extra, finest.harmonics + (extra if finest.harmonics else 0))
        ends = [np.concatenate([grid.pack(one.shape), [one.shape.omega, one.shape.control]]) for one in (before, after)]

        chord = ends[1] - ends[0]
        row = chord / np.concatenate([np.full(grid.size, max(float(np.sum(ends[1][:-2] ** 2)), 1e-300)), [np.inf, width**2]])

        def crossing(share: float) -> tuple[float, Exponent, float]:
            # control free, across the chord: a fold is no exception
            X = ends[0] + share * chord
            found = newton(grid, X, [*branch.phase(grid), Condition(row=row, value=float(row @ X))], width, branch.held)
            exponents = [one for one in exponents_of(branch, grid, found.y, found.control, found.omega) if not one.neutral]
            if len(exponents) <= rank:
                raise EvaluationError(f"{branch.state} near control {found.control:.8g}: found too few exponents to locate the secondary bifurcation; ask for a smaller tolerance")
            return exponents[rank].value.real, exponents[rank], found.control

        a, b = (0.0, crossing(0.0)[0]), (1.0, crossing(1.0)[0])
        if a[1] * b[1] > 0:
            raise EvaluationError(f"{branch.state} between controls {before.control:.8g} and {after.control:.8g}: found exponents that cross twice; follow a shorter range")
        share, critical, control = 0.5, None, before.control
        for _ in range(30):
            share = (a[0] * b[1] - b[0] * a[1]) / (b[1] - a[1])
            value, critical, control = crossing(share)
            if abs(value) < 1e-9 * (abs(a[1]) + abs(b[1])) or abs(b[0] - a[0]) < 1e-10:
                break
            if value * b[1] < 0:
                a, b = b, (share, value)
            else:
                a, b = (a[0], a[1] / 2), (share, value)
        assert critical is not None
        estimates.append((control, critical))
    controls = [control for control, _ in estimates]
    critical = estimates[1][1]
    real = abs(critical.value.imag) < 1e-6 * max(abs(before.frequency or 0.0), abs(critical.value.real), 1e-12)
    error = abs(controls[1] - controls[0]) / abs(controls[1]) if controls[1] else abs(controls[1] - controls[0])
    return Secondary(state=branch.state, kind="real" if real else "complex", mu=controls[1] - branch.full.threshold, control=controls[1], frequency=abs(critical.value.imag) if not real else 0.0,
                     error=max(2 * error, 1e-9), where=critical.kind)


def measured_points(text: str, result: Result, reach: float, points: int = 4) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Return {state: (controls, peaks)} of the full problem within `reach` of the threshold, to about 1e-4 of the peak: symbols for a bifurcation diagram.

    Where the amplitude equation has a state on one side only there are `points` of them. A point that cannot be found is left out.
    """
    full = Full(rows=Rows(text), result=result)
    found: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {}
    for state in full.states[1:]:
        branch = Branch(full, state)
        cycles = Cycles(branch)
        pairs = []
        for share in [k / points for k in range(-points, points + 1) if k]:
            mu = share * reach
            if predicted_at(branch, mu) is None:
                continue
            try:
                if turning(branch):
                    orbit = cycles.resolved(cycles.start(mu), 1e-4).orbit
                    pairs.append((orbit.control, peak_of(full.rows, orbit.state)))
                else:
                    solution = branch.resolved(branch.start(mu), 1e-4)
                    pairs.append((solution.control, branch.peak(solution)))
            except NotConverged:
                continue
        found[state] = (tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs))
    return found
