r"""Does the theory hold? Threshold, frequency and coefficients measured on the full problem, beside the derived ones.

The control `c` and the frequency of a state of leading harmonic `a` are smooth functions of :math:`q = a^2` (of `a` for a transcritical
bifurcation; a steady scalar state need not have a symmetry that makes it so, but the mean over :math:`\pm a` is). A polynomial through a few of
them, at Chebyshev points, gives their values and slopes at q = 0: Richardson extrapolation in the amplitude. With :math:`\gamma` from the spectrum of the base state,

* :math:`\gamma c'(0) + \kappa = i \Omega'(0)` gives the cubic coefficient of that state: :math:`\beta/2` from whirling (q its squared radius),
  :math:`\alpha + \beta` from beating, the only one for a scalar amplitude;
* the exponent of whirling near :math:`2 i \Omega` is :math:`2 i \Omega + \alpha q + O(q^2)`.

Nothing of the derivation enters but the start of Newton's method.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log, log10
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from numerics.coefficients import Result
from numerics.full_newton import NotConverged, Solution
from numerics.full_orders import NODES, ResidualOrder, residual_orders
from numerics.full_rows import Array, Discretisation, Rows
from numerics.full_stability import exponents_of, resting_exponents
from numerics.full_states import CUBIC, Branch, Full
from numerics.precision import EvaluationError

POINTS = 7
NEEDED = 6
ROUNDING = 1e-9
SHARES = (0.01, 0.05, 0.10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One derived number beside the measured one; `difference` and `error`, the measurement's own estimate, are relative (a threshold at zero: to a size of the control)."""

    name: str
    source: str
    derived: complex
    measured: complex
    difference: float
    error: float

    @property
    def digits(self) -> int:
        """Return how many digits agree."""
        return 16 if self.difference == 0 else max(0, min(16, int(-log10(self.difference))))

    @property
    def agrees(self) -> bool:
        """Tell whether enough digits agree, and as many as the measurement has (nine of them at most)."""
        return self.digits >= NEEDED and self.difference < max(10 * self.error, ROUNDING)

    def line(self) -> str:
        """Return a line of text."""
        verdict = "agrees" if self.agrees else "DISAGREES" if self.difference > 10 * self.error else f"UNDECIDED, measured to {self.error:.0e} only"
        return f"  {self.name:12} derived {shown(self.derived)}  full {shown(self.measured)}  {verdict}, {self.digits} digits  [{self.source}]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """How far the theory of one state can be used."""

    state: str
    order_peak: float
    order_frequency: float | None
    within: tuple[tuple[float, float | None], ...]  # (share, largest mu; None: beyond what was followed)

    @property
    def agrees(self) -> bool:
        """Tell whether the errors vanish with the order they should have."""
        return self.order_peak > LEAST_ORDERS[0] and (self.order_frequency is None or self.order_frequency > LEAST_ORDERS[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """The comparison of the theory with the full problem."""

    problem: str
    checks: tuple[Check, ...]
    validity: tuple[Validity, ...]
    orders: tuple[ResidualOrder, ...]
    seconds: float

    @property
    def agrees(self) -> bool:
        """Tell whether everything does."""
        return all(check.agrees for check in self.checks) and all(one.agrees for one in self.validity) and all(one.agrees for one in self.orders)

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain data."""
        return {
            "problem": self.problem, "agrees": self.agrees, "seconds": round(self.seconds, 3),
            "checks": [{"name": one.name, "source": one.source, "derived": {"re": repr(one.derived.real), "im": repr(one.derived.imag)},
                        "measured": {"re": repr(one.measured.real), "im": repr(one.measured.imag)}, "error": f"{one.error:.1e}", "digits": one.digits, "agrees": one.agrees} for one in self.checks],
            "validity": [{"state": one.state, "order_peak": written(one.order_peak), "order_frequency": None if one.order_frequency is None else written(one.order_frequency),
                          "within": {f"{share:g}": None if mu is None else f"{mu:.6g}" for share, mu in one.within}, "agrees": one.agrees} for one in self.validity],
            "residual_orders": [one.as_dict() for one in self.orders],
        }

    def text(self) -> str:
        """Return the comparison as lines of text."""
        lines = [f"{self.problem}: {sum(check.agrees for check in self.checks)} of {len(self.checks)} numbers agree with the full problem"]
        for one in self.checks:
            lines.append(one.line())
        for state in self.validity:
            orders = f"error of the peak {power(state.order_peak)} (relative)" + (f", of the frequency {power(state.order_frequency)}" if state.order_frequency is not None else "")
            limits = ", ".join(f"{100 * share:g} %: mu = {'beyond ' if mu is None else ''}{'what was followed' if mu is None else f'{mu:.4g}'}" for share, mu in state.within)
            lines.append(f"  {state.state:12} {orders}; peak within {limits}{'' if state.agrees else '  DISAGREES'}")
        return "\n".join([*lines, *(one.line() for one in self.orders)])


LEAST_ORDERS = (0.4, 1.4)
"""Observed orders in mu, of the relative peak and of the frequency, at or above which the error vanishes as it should."""


def written(order: float) -> str | None:
    """Return an observed order for JSON."""
    return f"{order:.3f}" if np.isfinite(order) else None


def power(order: float) -> str:
    """Return an observed order as text."""
    if np.isnan(order):
        return "not measured: no state found where it is predicted"
    return f"~ mu^{order:.2f}" if np.isfinite(order) else "too small to measure"


def shown(value: complex) -> str:
    """Return a number to 12 digits."""
    return f"{value.real:.12g}" if value.imag == 0 else f"{value.real:.12g} {'-' if value.imag < 0 else '+'} {abs(value.imag):.12g}i"


def validate(text: str, emitted: str, result: Result, say: Callable[[str], None] = lambda message: None) -> Validation:
    """Return the comparison of threshold, frequency and coefficients with the full problem.

    Parameters
    ----------
    text
        What `derive.residual.emit_residual` returns.
    emitted
        The emitted derivation: it gives the truncated expansion.
    result
        The derived threshold and coefficients.

    Raises
    ------
    EvaluationError
        The full problem cannot be solved near the threshold.
    """
    started = time.perf_counter()
    full = Full(rows=Rows(text), result=result)
    checks: list[Check] = []
    validity: list[Validity] = []
    say("gamma from the spectrum of the base state")
    slope = measured_gamma(full)
    checks.append(check("gamma" if full.hopf else "mu*A", "spectrum of the base state", full.coefficient("mu*A"), slope.gamma, slope.error))
    shrunk, nodes = 1.0, NODES  # how much nearer than usual the expansion converges, and on what grid
    for state in full.states[:0:-1]:
        say(f"{state}: Richardson extrapolation")
        branch = Branch(full, state)
        try:
            fit = extrapolated(branch, slope.width)
        except NotConverged:
            validity.append(Validity(state=state, order_peak=np.nan, order_frequency=np.nan if full.hopf else None, within=tuple((share, None) for share in SHARES)))
            continue
        checks += compared(branch, fit, slope)
        say(f"{state}: range of validity")
        shrunk, nodes = min(shrunk, abs(fit.mu) / usual_range(full)), max(nodes, fit.nodes)
        validity.append(validity_of(branch, shrunk * NEAR * size_of(full)))
    say("orders of the residual of the truncated expansion")
    orders = residual_orders(full, emitted, side_of(branch) * shrunk * NEAR * size_of(full), nodes)
    return Validation(problem=result.problem, checks=tuple(checks), validity=tuple(validity), orders=orders, seconds=time.perf_counter() - started)


def check(name: str, source: str, derived: complex, measured: complex, error: float, size: float = 0.0) -> Check:
    """Return the comparison of one number, measured with an absolute error, relative to its size."""
    size = size or max(abs(derived), 1e-300)
    return Check(name=name, source=source, derived=derived, measured=measured, difference=abs(derived - measured) / size, error=error / size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """The derivative of the critical eigenvalue with respect to the control, an estimate of its error, and within what distance of the threshold it was measured."""

    gamma: complex
    error: float
    width: float


def measured_gamma(full: Full) -> Slope:
    """Return the derivative of the critical eigenvalue of the base state with respect to the control."""
    branch = Branch(full, full.states[0])
    width = 5 * usual_range(full)
    nodes = max(28, resting_exponents(branch, full.threshold)[2].nodes)
    found: list[Slope] = []
    for _ in range(8):  # narrower until the eigenvalue is smooth in it: two resolutions and two degrees agree
        (coarse, _), (fine, lower) = (slopes_of(branch, width, count) for count in (nodes, nodes + 6))
        found.append(Slope(gamma=fine, error=max(abs(fine - coarse), abs(fine - lower)), width=width))
        if found[-1].error < 1e-9 * abs(fine):
            break
        width /= 4
    return min(found, key=lambda one: one.error)


def slopes_of(branch: Branch, width: float, nodes: int) -> tuple[complex, complex]:
    """Return d lambda / d control at the threshold, from polynomials of two degrees through the critical eigenvalue at controls within a width."""
    full = branch.full
    grid = branch.grid(nodes, 0)
    controls = full.threshold + width * np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    values = []
    for control in controls:
        found = [one.value for one in exponents_of(branch, grid, np.zeros(grid.size), float(control), 0.0)]
        values.append(min(found, key=lambda value: abs(value - 1j * full.frequency)))

    def slope(degree: int) -> complex:
        return complex(*(Polynomial.fit((controls - full.threshold) / width, part, degree).deriv()(0) for part in (np.real(values), np.imag(values)))) / width

    return slope(POINTS - 1), slope(POINTS - 3)


def scale_of(full: Full) -> float:
    """Return a size of the control, for a threshold at zero: where the growth rate is that of the frequency, or one."""
    rate = abs(full.coefficient("mu*A").real)
    return (full.frequency or 1.0) / rate if rate else 1.0


def size_of(full: Full) -> float:
    """Return a size of the control against which states are near the threshold."""
    return max(abs(full.threshold), 0.5 * scale_of(full))


def usual_range(full: Full) -> float:
    """Return the range of mu that suits the extrapolation to zero amplitude of most problems."""
    return 4e-3 * max(abs(full.threshold), 0.05 * scale_of(full))


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Value and slope of a function at zero amplitude, with estimates of their errors."""

    value: float
    slope: float
    value_error: float
    slope_error: float

    @property
    def relative(self) -> float:
        """Return the relative error of the slope."""
        return self.slope_error / abs(self.slope) if self.slope else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Limits from states up to the amplitude predicted at mu: of control and frequency, and of the exponent of the other sense of whirling over q."""

    mu: float
    control: Limit
    omega: Limit
    exponent: complex
    exponent_error: float
    nodes: int
    harmonics: int

    @property
    def error(self) -> float:
        """Return an estimate of the relative error of the slopes; one that is far below the other counts against that."""
        omega = self.omega.slope_error / max(abs(self.omega.slope), abs(self.control.slope) * 1e-3, 1e-300)
        return max(self.control.relative, omega, self.exponent_error / abs(self.exponent) if self.exponent else 0.0)


NEARER, WIDER = 0.2, 5.0
"""Factors by which the ranges after the first extrapolation are nearer or wider."""
NEAR = 1e-3
ENOUGH = 1e-9


def extrapolated(branch: Branch, smooth: float) -> Fit:
    """Return the extrapolation to zero amplitude with the smallest estimate of its error among some ranges, the first within `smooth`, confirmed by a finer grid.

    Outside the disk where the expansion in the amplitude converges no degree helps: the range shrinks until the error rises again, then by rounding.
    Where the first range is the best one, a wider one is tried, which rounding spoils less.
    """
    first = side_of(branch) * min(usual_range(branch.full), smooth)
    best: Fit | None = None
    reason = ""
    for mu in (first * NEARER**k for k in range(10)):
        try:
            fit = fitted(branch, mu)
        except NotConverged as failure:
            reason = str(failure)
            continue
        rising = best is not None and best.error < 1e-5 and fit.error > best.error
        best = fit if best is None or fit.error < best.error else best
        if rising or best.error < ENOUGH:
            break
    if best is None:
        raise NotConverged(f"{branch.state}: found no states near the threshold: {reason}")
    if best.mu == first and best.error >= ENOUGH:
        try:
            best = min(best, fitted(branch, first * WIDER), key=lambda one: one.error)
        except NotConverged:
            pass
    return confirmed(branch, best)


def confirmed(branch: Branch, fit: Fit) -> Fit:
    """Return a fit at a finer resolution, with the difference counted as error."""
    if not branch.full.rows.spatial and not fit.harmonics:
        return fit
    finer = fitted(branch, fit.mu, branch.grid(fit.nodes + max(3, fit.nodes // 8), fit.harmonics + (2 if fit.harmonics else 0)))
    control, omega = (
        replace(new, value_error=max(new.value_error, abs(new.value - old.value)), slope_error=max(new.slope_error, abs(new.slope - old.slope)))
        for new, old in ((finer.control, fit.control), (finer.omega, fit.omega))
    )
    return replace(finer, control=control, omega=omega, exponent_error=max(finer.exponent_error, abs(finer.exponent - fit.exponent)))


def side_of(branch: Branch) -> float:
    """Return the sign of mu on the side of the threshold where the amplitude equation has the state."""
    try:
        branch.full.predict(branch.state, 1e-9 * (abs(branch.full.threshold) or 1.0))
    except EvaluationError:
        return -1.0
    return 1.0


def fitted(branch: Branch, mu: float, grid: Discretisation | None = None) -> Fit:
    """Return values and slopes at zero amplitude from states up to the amplitude predicted at mu."""
    full = branch.full
    prediction = full.predict(branch.state, mu)
    largest = prediction.peak if prediction.amplitude > 0 else -prediction.peak
    shares = (1 - np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)) / 2  # Chebyshev points of (0, 1)
    grid = grid or resolved_grid(branch, mu)
    if full.coefficient("A**2"):
        q, sides = largest * shares, [states_at(branch, grid, mu, largest * shares)]
    else:
        both = (largest,) if full.hopf or full.vector else (largest, -largest)
        q, sides = largest**2 * shares, [states_at(branch, grid, mu, side * np.sqrt(shares)) for side in both]
    controls, omegas, exponents = np.mean([[(one.control, one.omega, other_sense(branch, one)) for one in side] for side in sides], axis=0).T
    rates = [limit_of(q, part) for part in ((exponents / q).real, (exponents / q).imag)]  # the exponent vanishes with q
    return Fit(mu=mu, control=limit_of(q, controls.real - full.threshold), omega=limit_of(q, omegas.real - full.frequency), exponent=complex(rates[0].value, rates[1].value),
               exponent_error=rates[0].value_error + rates[1].value_error, nodes=grid.nodes, harmonics=grid.harmonics)


def states_at(branch: Branch, grid: Discretisation, mu: float, readings: Array) -> list[Solution]:
    """Return the states of some leading harmonics: the first from the linear mode, each next one from the one before."""
    X, before = branch.guess(grid, mu * float(readings[0] / readings[-1]) ** 2)
    found = []
    for reading in readings:
        found.append(branch.at_amplitude(grid, np.concatenate([X[:-2] * (reading / before), X[-2:]]), float(reading), mu))
        X, before = found[-1].X, reading
    return found


def other_sense(branch: Branch, found: Solution) -> complex:
    """Return the exponent of whirling in the other sense, seen from rest; 0 for other states."""
    if branch.state != "whirling":
        return 0j
    exponents = exponents_of(branch, found.grid, found.y, found.control, found.omega)
    return min((one.value for one in exponents), key=lambda value: abs(value - 2j * found.omega)) - 2j * found.omega


def limit_of(q: Array, values: Array) -> Limit:
    """Return value and slope at q = 0 of the polynomial through the values, and how much they change with one point less."""
    span = float(np.abs(q).max())
    x = q / span
    domain = [0, 1] if x[0] >= 0 else [-1, 0]
    every, less = (Polynomial.fit(x[k:], values[k:], len(x) - 1 - k, domain=domain) for k in (0, 1))
    value, slope = float(every(0)), float(every.deriv()(0)) / span
    return Limit(value=value, slope=slope, value_error=abs(value - float(less(0))), slope_error=abs(slope - float(less.deriv()(0)) / span))


def resolved_grid(branch: Branch, mu: float) -> Discretisation:
    """Return a discretisation that resolves, to rounding, the state of the amplitude predicted at mu; at which control it stands does not matter."""
    grid = branch.grid(*branch.coarse())
    X, reading = branch.guess(grid, mu)
    near = branch.at_amplitude(grid, X, reading, mu)
    if branch.form.motion.kind == "periodic":
        solution = branch.resolved_at_amplitude(near, reading, mu, 1e-7)
    else:
        try:
            solution = branch.resolved_at_amplitude(near, reading, mu, 1e-11)
        except NotConverged:  # a steep layer
            solution = branch.resolved_at_amplitude(near, reading, mu, 1e-9)
    return branch.grid(solution.grid.nodes + 2, solution.grid.harmonics + (2 if solution.grid.harmonics else 0))


def compared(branch: Branch, fit: Fit, slope: Slope) -> list[Check]:
    """Return the comparisons that the extrapolation of one state allows."""
    full, state, gamma = branch.full, branch.state, slope.gamma
    place = complex(full.threshold)
    found = [check("threshold", f"{state}, zero amplitude", place, place + fit.control.value, fit.control.value_error, abs(place) or size_of(full))]
    if full.hopf:
        found.append(check("frequency", f"{state}, zero amplitude", complex(full.frequency), complex(full.frequency + fit.omega.value), fit.omega.value_error))
    # gamma c' + kappa = i Omega', per |A|^2: q = 4 |A|^2 for a planar motion, 2 |A|^2 for whirling
    factor = {"whirling": 2.0, "beating": 4.0, "cycle": 4.0}.get(state, 1.0)
    kappa = factor * (1j * fit.omega.slope - gamma * fit.control.slope)
    error = factor * (fit.omega.slope_error + abs(gamma) * fit.control.slope_error + slope.error * abs(fit.control.slope))
    if not full.hopf:
        kappa = complex(kappa.real)
    if state == "whirling":
        found.append(check("alpha", "exponents of whirling", full.coefficient("dot(A,A)*conj(A)"), fit.exponent, fit.exponent_error))
        found.append(check("beta", "radius and frequency of whirling", full.coefficient("dot(A,conj(A))*A"), kappa, error))
    elif state == "beating":
        found.append(check("alpha + beta", "peak and frequency of beating", full.coefficient("dot(A,A)*conj(A)", "dot(A,conj(A))*A"), kappa, error))
    else:
        monomial = "A**2" if full.coefficient("A**2") else next(one.monomial for one in full.result.coefficients if one.monomial in CUBIC)
        found.append(check(full.result[monomial].name, f"amplitude of the {state}", full.coefficient(monomial), kappa, error))
    return found


def validity_of(branch: Branch, near: float) -> Validity:
    """Return observed orders within a distance `near` of the threshold, and the largest mu at which the theory's peak is within some shares."""
    full, sign = branch.full, side_of(branch)
    orders = [np.nan, np.nan]
    within: dict[float, float | None] = dict.fromkeys(SHARES)
    for distance in (near, 0.1 * near, 0.01 * near):  # nearer where terms of two orders cancel, or the branch turns
        legible = max(1e-9, 8 * np.finfo(float).eps * (1 + abs(full.threshold) / distance))
        try:
            states = [branch.refined(branch.near(sign * one)[0], legible)[0] for one in (distance, 2 * distance)]
        except NotConverged:
            continue
        mus, errors = [abs(one.control - full.threshold) for one in states], [errors_at(branch, one) for one in states]
        if mus[1] < 1.2 * mus[0]:
            continue
        orders = [log(errors[1][k] / errors[0][k]) / log(mus[1] / mus[0]) if errors[0][k] > legible else np.inf for k in (0, 1)]
        within = limits_of(branch, states[0], sign * size_of(full))
        if orders[0] > LEAST_ORDERS[0] and (not full.hopf or orders[1] > LEAST_ORDERS[1]):
            break
    return Validity(state=branch.state, order_peak=orders[0], order_frequency=orders[1] if full.hopf else None, within=tuple(within.items()))


def limits_of(branch: Branch, start: Solution, far: float) -> dict[float, float | None]:
    """Return, for some shares, the mu between a start and far at which the error of the theory's peak first exceeds it."""
    threshold = branch.full.threshold
    within: dict[float, float | None] = dict.fromkeys(SHARES)
    try:
        while errors_at(branch, start)[0] > SHARES[0] and abs(start.control - threshold) > 1e-9 * size_of(branch.full):  # until all shares lie ahead
            start = branch.near(0.1 * (start.control - threshold))[0]
        previous = (start.control - threshold, errors_at(branch, start)[0])
        for solution in branch.follow(start, threshold + far, step=0.25, longest=0.35, points=80):
            now = (solution.control - threshold, errors_at(branch, solution)[0])
            for share in SHARES:
                if within[share] is None and previous[1] < share <= now[1]:
                    slope = log(now[0] / previous[0]) / log(now[1] / previous[1])
                    within[share] = previous[0] * (share / previous[1]) ** slope
            previous = now
            if now[1] > SHARES[-1]:
                break
    except EvaluationError:
        pass
    return within


def errors_at(branch: Branch, solution: Solution) -> tuple[float, float]:
    """Return the error of the theory: of the peak, relative, and of the frequency."""
    prediction = branch.full.predict(branch.state, solution.control - branch.full.threshold)
    peak = branch.peak(solution)
    return abs(prediction.peak - peak) / peak, abs((prediction.frequency or 0.0) - solution.omega)
