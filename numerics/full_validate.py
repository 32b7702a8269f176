r"""Does the theory hold? Threshold, frequency and coefficients measured on the full problem, beside the derived ones.

The control `c` and the frequency of a state of leading harmonic `a` are smooth functions of :math:`q = a^2` (of `a` for a transcritical
bifurcation). A polynomial through a few of them, at Chebyshev points, gives their values and slopes at q = 0: Richardson extrapolation in the
amplitude. With :math:`\gamma` from the spectrum of the base state,

* :math:`\gamma c'(0) + \kappa = i \Omega'(0)` gives the cubic coefficient of that state: :math:`\beta/2` from whirling (q its squared radius),
  :math:`\alpha + \beta` from beating, the only one for a scalar amplitude;
* the exponent of whirling near :math:`2 i \Omega` is :math:`2 i \Omega + \alpha q + O(q^2)`.

Nothing of the derivation enters but the start of Newton's method.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import log, log10, sqrt
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from numerics.coefficients import Result
from numerics.full_newton import NotConverged, Solution
from numerics.full_orders import ResidualOrder, residual_orders
from numerics.full_rows import Array, Rows
from numerics.full_stability import exponents_of
from numerics.full_states import CUBIC, Branch, Full
from numerics.precision import EvaluationError

POINTS = 7
NEEDED = 6
ROUNDING = 1e-9
SHARES = (0.01, 0.05, 0.10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One derived number beside the measured one; `digits` agree, `error` is the measurement's own estimate."""

    name: str
    source: str
    derived: complex
    measured: complex
    error: float
    digits: int

    @property
    def agrees(self) -> bool:
        """Tell whether enough digits agree, and as many as the measurement has (nine of them at most)."""
        difference = abs(self.derived - self.measured) / max(abs(self.derived), 1e-300)
        return self.digits >= NEEDED and difference < max(10 * self.error, ROUNDING)


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
            lines.append(f"  {one.name:12} derived {shown(one.derived)}  full {shown(one.measured)}  {'agrees' if one.agrees else 'DISAGREES'}, {one.digits} digits  [{one.source}]")
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
    gamma, gamma_error = measured_gamma(full)
    checks.append(check("gamma" if full.hopf else "mu*A", "spectrum of the base state", full.coefficient("mu*A"), gamma, gamma_error))
    for state in full.states[:0:-1]:
        say(f"{state}: Richardson extrapolation")
        branch = Branch(full, state)
        fit = extrapolated(branch)
        checks += compared(branch, fit, gamma, gamma_error)
        say(f"{state}: range of validity")
        validity.append(validity_of(branch))
    say("orders of the residual of the truncated expansion")
    orders = residual_orders(full, emitted, side_of(branch) * 1e-3 * max(abs(full.threshold), 0.5 * scale_of(full)))
    return Validation(problem=result.problem, checks=tuple(checks), validity=tuple(validity), orders=orders, seconds=time.perf_counter() - started)


def check(name: str, source: str, derived: complex, measured: complex, error: float) -> Check:
    """Return the comparison of one number."""
    difference = abs(derived - measured)
    size = max(abs(derived), 1e-300)
    digits = 16 if difference == 0 else max(0, min(16, int(-log10(difference / size))))
    return Check(name=name, source=source, derived=derived, measured=measured, error=error, digits=digits)


def measured_gamma(full: Full) -> tuple[complex, float]:
    """Return the derivative of the critical eigenvalue of the base state with respect to the control, and an estimate of its error."""
    branch = Branch(full, full.states[0])
    width = 0.02 * max(abs(full.threshold), 1e-3 * scale_of(full))
    found: list[tuple[complex, float]] = []
    for _ in range(6):  # narrower until the eigenvalue is smooth in it: two resolutions and two degrees agree
        (coarse, _), (fine, lower) = (slopes_of(branch, width, nodes) for nodes in (28, 34))
        error = max(abs(fine - coarse), abs(fine - lower))
        found.append((fine, error))
        if error < 1e-9 * abs(fine):
            break
        width /= 4
    return min(found, key=lambda one: one[1])


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Values and slopes at the threshold: of control, frequency and the exponent of the other sense of whirling."""

    control: float
    control_slope: float
    omega: float
    omega_slope: float
    exponent_slope: complex
    error: float


def extrapolated(branch: Branch) -> Fit:
    """Return the extrapolation to zero amplitude with the smallest estimate of its error among some ranges."""
    full = branch.full
    best: Fit | None = None
    reason = ""
    sign = side_of(branch)
    for share in (4e-3, 2e-2, 8e-4):
        mu = sign * share * max(abs(full.threshold), 0.05 * scale_of(full))
        try:
            fit = fitted(branch, mu)
        except NotConverged as failure:
            reason = str(failure)
            continue
        if best is not None and fit.error > 0.3 * best.error:
            best = min(best, fit, key=lambda one: one.error)
            break
        best = fit
        if best.error < 1e-9:
            break
    if best is None:
        raise EvaluationError(f"{branch.state}: found no states near the threshold: {reason}")
    return best


def side_of(branch: Branch) -> float:
    """Return the sign of mu on the side of the threshold where the amplitude equation has the state."""
    try:
        branch.full.predict(branch.state, 1e-9 * (abs(branch.full.threshold) or 1.0))
    except EvaluationError:
        return -1.0
    return 1.0


def fitted(branch: Branch, mu: float) -> Fit:
    """Return values and slopes at zero amplitude from states up to the amplitude predicted at mu."""
    full = branch.full
    transcritical = bool(full.coefficient("A**2"))
    largest = full.predict(branch.state, mu).peak
    shares = (1 - np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)) / 2  # Chebyshev points of (0, 1)
    grid = resolved_grid(branch, mu)
    values = []
    X, reading = branch.guess(grid, mu * float(shares[0]))
    for share in shares:
        power = float(share) if transcritical else sqrt(float(share))
        goal = power * (largest if reading > 0 else -largest)
        found = branch.at_amplitude(grid, np.concatenate([X[:-2] * (goal / reading), X[-2:]]), goal, mu)
        X, reading = found.X, goal
        rate = 0j
        if branch.state == "whirling":
            exponents = exponents_of(branch, grid, found.y, found.control, found.omega)
            rate = min((one.value for one in exponents), key=lambda value: abs(value - 2j * found.omega)) - 2j * found.omega
        values.append((goal if transcritical else goal**2, found.control, found.omega, rate))
    table = [np.array(column) for column in zip(*values, strict=True)]
    q, controls, omegas = table[:3]
    span = float(np.abs(q).max())
    control, control_slope, control_error = at_zero(q / span, controls - full.threshold)
    omega, omega_slope, omega_error = at_zero(q / span, omegas - full.frequency)
    rates = table[3] / q  # the exponent vanishes with q
    parts = [at_zero(q / span, part) for part in (rates.real, rates.imag)]
    slope = complex(parts[0][0], parts[1][0])
    exponent_error = (parts[0][2] + parts[1][2]) / abs(slope) if slope else 0.0
    error = max(control_error / max(abs(control_slope), 1e-300), exponent_error, omega_error / max(abs(omega_slope), abs(control_slope) * 1e-3, 1e-300) if full.hopf else 0.0)
    return Fit(control=full.threshold + control, control_slope=control_slope / span, omega=full.frequency + omega, omega_slope=omega_slope / span, exponent_slope=slope, error=error)


def at_zero(x: Array, values: Array) -> tuple[float, float, float]:
    """Return value and slope at 0 of the polynomial through the values, and how much the slope changes with one point less."""
    full = Polynomial.fit(x, values, len(x) - 1, domain=[0, 1] if x[0] >= 0 else [-1, 0])
    less = Polynomial.fit(x[1:], values[1:], len(x) - 2, domain=[0, 1] if x[0] >= 0 else [-1, 0])
    return float(full(0)), float(full.deriv()(0)), float(abs(full.deriv()(0) - less.deriv()(0)))


def resolved_grid(branch: Branch, mu: float):  # type: ignore[no-untyped-def]
    """Return a discretisation that resolves the states up to mu to rounding."""
    solution = branch.resolved(branch.start(mu), 1e-11 if branch.form.motion.kind != "periodic" else 1e-7)
    return branch.grid(solution.grid.nodes + 2, solution.grid.harmonics + (2 if solution.grid.harmonics else 0))


def compared(branch: Branch, fit: Fit, gamma: complex, gamma_error: float) -> list[Check]:
    """Return the comparisons that the extrapolation of one state allows."""
    full, state = branch.full, branch.state
    error = fit.error + gamma_error / max(abs(gamma), 1e-300)
    found = [check("threshold", f"{state}, zero amplitude", complex(full.threshold), complex(fit.control), error)]
    if full.threshold == 0:
        found = [check("threshold + 1", f"{state}, zero amplitude", 1.0 + 0j, complex(1 + fit.control), error)]
    if full.hopf:
        found.append(check("frequency", f"{state}, zero amplitude", complex(full.frequency), complex(fit.omega), error))
    # gamma c' + kappa = i Omega', per |A|^2: q = 4 |A|^2 for a planar motion, 2 |A|^2 for whirling
    factor = {"whirling": 2.0, "beating": 4.0, "cycle": 4.0}.get(state, 1.0)
    kappa = factor * (1j * fit.omega_slope - gamma * fit.control_slope)
    if not full.hopf:
        kappa = complex(kappa.real)
    if state == "whirling":
        found.append(check("alpha", "exponents of whirling", full.coefficient("dot(A,A)*conj(A)"), fit.exponent_slope, error))
        found.append(check("beta", "radius and frequency of whirling", full.coefficient("dot(A,conj(A))*A"), kappa, error))
    elif state == "beating":
        found.append(check("alpha + beta", "peak and frequency of beating", full.coefficient("dot(A,A)*conj(A)", "dot(A,conj(A))*A"), kappa, error))
    else:
        monomial = "A**2" if full.coefficient("A**2") else next(one.monomial for one in full.result.coefficients if one.monomial in CUBIC)
        found.append(check(full.result[monomial].name, f"amplitude of the {state}", full.coefficient(monomial), kappa, error))
    return found


def validity_of(branch: Branch) -> Validity:
    """Return observed orders near the threshold, and the largest mu at which the theory's peak is within some shares."""
    full = branch.full
    scale = max(abs(full.threshold), 0.5 * scale_of(full))
    sign = side_of(branch)
    for near in (1e-3, 1e-4, 1e-5):  # nearer where terms of two orders cancel
        errors = [errors_at(branch, branch.refined(branch.start(sign * share * scale), 1e-9)[0]) for share in (near, 2 * near)]
        orders = [log(errors[1][k] / errors[0][k]) / log(2) if errors[0][k] > 1e-9 else np.inf for k in (0, 1)]
        if not full.hopf:
            orders[1] = 0.0
        if orders[0] > LEAST_ORDERS[0] and (not full.hopf or orders[1] > LEAST_ORDERS[1]):
            break
    within: dict[float, float | None] = dict.fromkeys(SHARES)
    previous: tuple[float, float] | None = None
    start = branch.start(sign * 2e-3 * scale)
    try:
        for solution in branch.follow(start, full.threshold + sign * scale, step=0.25, longest=0.35, points=60):
            now = (abs(solution.control - full.threshold), errors_at(branch, solution)[0])
            if previous is not None:
                for share in SHARES:
                    if within[share] is None and previous[1] < share <= now[1]:
                        slope = log(now[0] / previous[0]) / log(now[1] / previous[1])
                        within[share] = sign * previous[0] * (share / previous[1]) ** slope
            elif now[1] > SHARES[0]:
                within.update({share: sign * now[0] * share / now[1] for share in SHARES if now[1] > share})
            previous = now
            if now[1] > SHARES[-1]:
                break
    except EvaluationError:
        pass
    return Validity(state=branch.state, order_peak=orders[0], order_frequency=orders[1] if full.hopf else None, within=tuple(within.items()))


def errors_at(branch: Branch, solution: Solution) -> tuple[float, float]:
    """Return the error of the theory: of the peak, relative, and of the frequency."""
    prediction = branch.full.predict(branch.state, solution.control - branch.full.threshold)
    peak = branch.peak(solution)
    return abs(prediction.peak - peak) / peak, abs((prediction.frequency or 0.0) - solution.omega)
