"""States of the full nonlinear problem with their stability: what `fredholm full` prints."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np

from numerics.coefficients import Result
from numerics.full_newton import Condition, Solution, newton
from numerics.full_rows import Rows, State
from numerics.full_stability import Exponent, exponents_of
from numerics.full_states import MAX_NODES, Branch, Full, Prediction
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
    """

    state: str
    mu: float
    control: float
    peak: float
    frequency: float | None
    predicted: Prediction | None
    exponents: tuple[Exponent, ...]
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
            "exponents": [{"re": decimal(one.value.real, 1e-9), "im": decimal(one.value.imag, 1e-9), "kind": one.kind} for one in self.exponents[:SHOWN]],
            "stable": self.stable, "error": f"{self.error:.1e}", "resolution": {"nodes": self.nodes, "harmonics": self.harmonics, "residual": f"{self.residual:.1e}"},
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
            lines.append(f"  exponent   {one.value.real:+.9g} {one.value.imag:+.9g}i" + (f"   {one.kind}" if one.kind else ""))
        lines.append(f"  relative error {self.error:.1e}, {self.nodes} nodes" + (f", {self.harmonics} harmonics" if self.harmonics else "") + f", {self.seconds:.2f} s")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.text()


def decimal(value: float, error: float) -> str:
    """Return a number with the digits that its relative error allows."""
    digits = 16 if error <= 0 else min(16, max(1, floor(-log10(error)) + 1))
    return f"{value:.{digits}g}"


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
    return completed(branch, branch.start(mu), tolerance, started)


def check_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that double precision cannot meet."""
    if not 1e-14 <= tolerance < 0.1:
        raise EvaluationError(f"tolerance: found {tolerance:g}; expected a number from 1e-14 to 0.1")


def at_rest(branch: Branch, mu: float, started: float) -> FullState:
    """Return the base state with its growth rates, at a resolution that changes them no more."""
    full = branch.full
    control, nodes = full.threshold + mu, 20
    found: tuple[Exponent, ...] = ()
    while True:
        grid = branch.grid(nodes, 0)
        before, found = found, exponents_of(branch, grid, np.zeros(grid.size), control, 0.0)
        error = drift(before, found)
        if error < 1e-8 or grid.nodes == 1:
            break
        nodes += nodes // 4
        if nodes > MAX_NODES:
            raise EvaluationError(f"{branch.state} at control {control:.8g}: found leading growth rates that still change by {error:.1e} at {grid.nodes} nodes; expected them to settle")
    return FullState(
        state=branch.state, mu=mu, control=control, peak=0.0, frequency=None, predicted=full.predict(branch.state, mu), exponents=found, error=0.0 if grid.nodes == 1 else error, nodes=grid.nodes,
        harmonics=0, residual=0.0, seconds=time.perf_counter() - started, shape=grid.unpack(np.zeros(grid.size), control, 0.0),
    )


def drift(before: tuple[Exponent, ...], after: tuple[Exponent, ...]) -> float:
    """Return the relative change of the leading exponents."""
    if not before or not after:
        return float("inf")
    pairs = list(zip(before[:2], after[:2], strict=False))
    scale = max(abs(one.value) for one in after[:2])
    return max(abs(one.value - other.value) for one, other in pairs) / max(scale, 1e-300)


def completed(branch: Branch, start: Solution, tolerance: float, started: float) -> FullState:
    """Return a state refined to the tolerance, with its stability."""
    solution, error = branch.refined(start, tolerance)
    full = branch.full
    mu = solution.control - full.threshold
    try:
        predicted = full.predict(branch.state, mu)
    except EvaluationError:
        predicted = None
    return FullState(
        state=branch.state, mu=mu, control=solution.control, peak=branch.peak(solution), frequency=solution.omega if full.hopf else None, predicted=predicted,
        exponents=exponents_of(branch, solution.grid, solution.y, solution.control, solution.omega), error=error, nodes=solution.grid.nodes,
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
    branch = Branch(Full(rows=Rows(text), result=result), state)
    if state in ("base", "undeformed"):
        for mu in np.linspace(low, high, 30):
            yield at_rest(branch, float(mu), time.perf_counter())
        return
    current = branch.start(low)
    started = time.perf_counter()
    before = completed(branch, current, tolerance, started)
    yield before
    for solution in branch.follow(current, branch.full.threshold + high, step=0.15, longest=0.15):
        started = time.perf_counter()
        after = completed(branch, solution, tolerance, started)
        if unstable(before) != unstable(after):
            yield secondary_between(branch, before, after)
        yield after
        before = after


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
