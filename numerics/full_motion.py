r"""Direct simulation of the full problem, a stiff differential-algebraic system, from any initial shape.

Radau IIA with three stages (order 5, stiffly accurate: algebraic rows are met at the end of every step, not only in the limit). With stage values
Y, their derivatives :math:`V = (hA)^{-1}(Y - y_n)` and :math:`(hA)^{-1}(V - v_n)` enter the rows; simplified Newton steps decouple in the
eigenvectors of :math:`A^{-1}` and are least-squares solutions, as everywhere here, so that redundant rows need no care.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np

from numerics.coefficients import Result
from numerics.full_newton import LeastSquares, NotConverged
from numerics.full_rows import Array, Discretisation, Group, Linearisation, Motion, Rows, State
from numerics.full_states import Full, components_at_rest, linear_mode, readings
from numerics.precision import EvaluationError

ROOT = sqrt(6.0)
RADAU = np.array([  # Radau IIA, order 5
    [(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
    [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
    [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9],
])
CONSTRAINT = 1e-10
PROJECTION = 1e-5  # of a period, whatever the steps: no halving of them may shift the start


class Coarse(NotConverged):
    """The nodes in space do not meet the constraints; the message gives time and residual."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A simulated motion.

    Attributes
    ----------
    displacement
        Deviation of the normalised field from the base state at its place: (times, components).
    residual
        Largest scaled residual of all rows at the end of any step: constraints and balances alike.
    kept
        The deviation from the base state at equally spaced times, the first and the last among them, if samples were asked for.
    """

    times: Array
    displacement: Array
    residual: float
    factors: int
    last: State
    kept: tuple[State, ...]
    nodes: int


class ComplexLeastSquares:
    """The least-squares solution with a complex matrix, by one real factor of twice the size."""

    def __init__(self, matrix: Array) -> None:
        self.half = matrix.shape[1]
        self.solver = LeastSquares(np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]]))

    def solve(self, right: Array) -> Array:
        """Return the solution."""
        found = self.solver.solve(np.concatenate([right.real, right.imag]))
        return found[:self.half] + 1j * found[self.half:]


class Integrator:
    """Radau steps of a fixed size for the rows on one grid."""

    def __init__(self, grid: Discretisation, control: float, step: float) -> None:
        self.grid, self.control, self.step = grid, control, step
        self.inverse = np.linalg.inv(RADAU) / step
        values, vectors = np.linalg.eig(self.inverse)
        order = np.argsort(np.abs(values.imag))
        self.values, self.vectors = values[order], vectors[:, order]
        self.back = np.linalg.inv(self.vectors)
        self.solvers: tuple[LeastSquares, ComplexLeastSquares] | None = None
        self.factors = 0

    def jets(self, site: str, Y: Array, V: Array, L: Array) -> Array:
        """Return the jets of the deviation at the stages, shape (points, jets, stages)."""
        grid = self.grid
        total = np.zeros((len(grid.x[site]), len(grid.rows.jets), Y.shape[1]))
        for j, (k, ds, dt) in enumerate(grid.rows.jets):
            total[:, j] = grid.reduced[0, site, k, ds] @ (Y, V, L)[dt]
        return total

    def rows_at(self, Y: Array, V: Array, L: Array) -> tuple[Array, Linearisation]:
        """Return the residual at the stages, one column each, and the linearisation at the last."""
        grid, values, slopes = self.grid, [], {}
        for site in grid.sites:
            keep, s = grid.kept(site), grid.points(site)
            base, _ = grid.rows.base(s, self.control)
            value, _, slope = grid.rows.evaluate(site, s, self.control, base[:, :, None] + self.jets(site, Y, V, L))
            values.append(value[:, keep].reshape(-1, Y.shape[1]))
            slopes[site] = slope[:, keep][:, :, -1:]
        none = np.zeros(0)
        return np.concatenate(values), Linearisation(grid=grid, omega=0.0, residual=none, in_control=none, in_omega=none, slopes=slopes)

    def factor(self, at: Linearisation) -> None:
        """Factor the decoupled systems J0 + z J1 + z^2 J2 at the eigenvalues z of (hA)^-1."""
        parts = [at.matrix(part) for part in ("value", "growth", "growth2")]
        z = float(self.values[0].real)
        self.scale = at.scales(np.hstack([part * z**power for power, part in enumerate(parts)]))
        parts = [part[self.scale > 0] * self.scale[self.scale > 0, None] for part in parts]
        w = self.values[1]
        self.solvers = (LeastSquares(parts[0] + z * parts[1] + z**2 * parts[2]), ComplexLeastSquares(parts[0] + w * parts[1] + w**2 * parts[2]))
        self.factors += 1

    def advance(self, y: Array, v: Array, guess: Array) -> tuple[Array, Array, Array, float]:
        """Return state, velocity and stage values after one step, and the scaled residual there."""
        Y = guess
        before = np.inf
        fresh = False
        for _ in range(40):
            V = (Y - y[:, None]) @ self.inverse.T
            L = (V - v[:, None]) @ self.inverse.T
            residual, at = self.rows_at(Y, V, L)
            if self.solvers is None:
                self.factor(at)
                fresh = True
            assert self.solvers is not None
            scaled = residual[self.scale > 0] * self.scale[self.scale > 0, None]
            modes = scaled @ self.back.T
            one, two = self.solvers[0].solve(-modes[:, 0].real), self.solvers[1].solve(-modes[:, 1])
            step = np.real(np.column_stack([one, two, two.conj()]) @ self.vectors.T)
            Y = Y + step
            size = float(np.abs(step).max() / max(np.abs(Y).max(), 1e-300))
            if not np.isfinite(size):
                break
            if size < 1e-12 or (size < 1e-8 and size > 0.5 * before):
                V = (Y - y[:, None]) @ self.inverse.T
                return Y[:, 2], V[:, 2], Y, float(np.abs(scaled[:, 2]).max())
            if size > 0.3 * before and size > 1e-9 and not fresh:
                self.solvers = None
            elif size > 20 * before:
                break
            else:
                fresh = False
            before = size
        raise NotConverged(f"the step of {self.step:.3g} in time did not converge (last relative change {size:.1e}); expected a smaller step: ask for more steps a period")


def initial_shape(full: Full, grid: Discretisation, amplitude: tuple[complex, ...]) -> tuple[Array, Array]:
    """Return the deviation, and its rate, of the critical mode with a complex amplitude (two components about the axis for a vector)."""
    rows, omega = full.rows, full.frequency
    everything = tuple(range(rows.count))
    if full.vector and full.hopf:
        space = Discretisation(rows, Motion(kind="rotating"), (Group(members=everything),), grid.nodes)
        mode = space.unpack(linear_mode(full, space, ((0, 0, 1.0), (1, 0, 0.0))), full.threshold, omega)
        absent = components_at_rest(full)
        plus, minus = amplitude[0] + 1j * amplitude[1], amplitude[0] - 1j * amplitude[1]
        shape, rate = ([np.zeros_like(one) for one in mode.coefficients] for _ in range(2))
        for k in everything:
            if rows.weight[k] != 1:
                continue
            # v_+ = phi A_+ + conj(phi A_-), each turning at +-omega
            phi = mode.coefficients[k] + 1j * mode.coefficients[k + 1]
            sign = -1.0 if k in absent else 1.0
            for part, speed in ((phi * plus, omega), (sign * np.conj(phi * minus), -omega)):
                shape[k] += part.real
                shape[k + 1] += part.imag
                rate[k] += (1j * speed * part).real
                rate[k + 1] += (1j * speed * part).imag
    elif full.hopf:
        space = Discretisation(rows, Motion(kind="periodic"), (Group(members=everything),), grid.nodes, 1)
        mode = space.unpack(linear_mode(full, space, ((0, 1, 1.0), (0, 2, 0.0))), full.threshold, omega)
        parts = [2 * amplitude[0] * (one[:, 1] - 1j * one[:, 2]) for one in mode.coefficients]  # u = 2 Re(A phi exp(i omega t))
        shape, rate = [one.real[:, None] for one in parts], [(1j * omega * one).real[:, None] for one in parts]
    else:
        mode = grid.unpack(linear_mode(full, grid, ((0, 0, 1.0),) if not full.vector else ((0, 0, 1.0), (1, 0, 0.0))), full.threshold, 0.0)
        shape = [amplitude[0].real * one for one in mode.coefficients]
        rate = [np.zeros_like(one) for one in shape]
    made = [State(coefficients=tuple(one), nodes=grid.nodes, harmonics=0, control=full.threshold, omega=0.0) for one in (shape, rate)]
    return grid.pack(made[0]), grid.pack(made[1])


def simulate_full(text: str, result: Result, mu: float, amplitude: tuple[complex, ...], time: float, steps: int = 24, nodes: int = 24, start: tuple[State, State] | None = None, samples: int = 0) -> Record:
    """Return the motion of the full problem from an initial shape.

    Parameters
    ----------
    amplitude
        Complex amplitude of the critical mode at the start, one number, or two for a vector; not used with `start`.
    time
        How long, in the units of the problem.
    steps
        Steps in the period of the threshold (in the unit of time when steady).
    start
        Deviation from the base state and its rate, any shape: what violates the constraints is projected by the first step.
    samples
        How many equal intervals of time end with a state that is kept; the steps are made to fit.

    Raises
    ------
    NotConverged
        A step fails, or (`Coarse`) a constraint is not kept to 1e-10; the message gives the time.
    """
    full = Full(rows=Rows(text), result=result)
    if not time > 0 or steps < 1:
        raise EvaluationError(f"time and steps: found {time:g} and {steps}; expected positive numbers")
    grid = Discretisation(full.rows, Motion(kind="steady"), (Group(members=tuple(range(full.rows.count))),), nodes)
    h = (2 * pi / full.frequency if full.hopf else 1.0) / steps
    count = ceil(time / h - 1e-9)
    count = samples * ceil(count / samples) if samples else count
    integrator = Integrator(grid, full.threshold + mu, time / count)
    y, v = (grid.pack(one) for one in start) if start else initial_shape(full, grid, amplitude)
    worst = 0.0
    try:  # onto the constraints by a step too short for any motion; once more for the multipliers, which the jump has spoilt
        short = Integrator(grid, full.threshold + mu, PROJECTION * steps * h)
        y = short.advance(y, v, np.repeat(y[:, None], 3, axis=1))[0]
        y, v, _, _ = Integrator(grid, full.threshold + mu, PROJECTION * steps * h).advance(y, v, np.repeat(y[:, None], 3, axis=1))
    except NotConverged as failure:
        raise NotConverged(f"at time 0: the initial shape cannot be brought to meet the constraints: {failure}") from failure
    Y = np.repeat(y[:, None], 3, axis=1)
    displacement = [readings(full.rows, grid.unpack(y, 0.0, 0.0))[:, 0]]
    kept = [grid.unpack(y, full.threshold + mu, 0.0)] if samples else []
    c = RADAU.sum(axis=1)
    for step in range(count):
        try:
            y_next, v, Y, residual = integrator.advance(y, v, Y)
        except NotConverged as failure:
            raise NotConverged(f"at time {step * integrator.step:.6g}: {failure}") from failure
        worst = max(worst, residual)
        if residual > CONSTRAINT:
            raise Coarse(f"at time {(step + 1) * integrator.step:.6g}: found a residual of {residual:.1e} in the rows; expected {CONSTRAINT:.0e}: ask for more nodes")
        # The collocation polynomial through the stages, continued, starts the next step.
        Y = continued(c, Y, 1 + c) if step else np.repeat(y_next[:, None], 3, axis=1)
        y = y_next
        displacement.append(readings(full.rows, grid.unpack(y, 0.0, 0.0))[:, 0])
        if samples and (step + 1) % (count // samples) == 0:
            kept.append(grid.unpack(y, full.threshold + mu, 0.0))
    times = np.arange(count + 1) * integrator.step
    return Record(times=times, displacement=np.array(displacement), residual=worst, factors=integrator.factors, last=grid.unpack(y, full.threshold + mu, 0.0), kept=tuple(kept), nodes=nodes)


def continued(nodes: Array, values: Array, at: Array) -> Array:
    """Return the polynomial through the columns of `values` at other points."""
    weights = np.array([[np.prod([(x - other) / (one - other) for j, other in enumerate(nodes) if j != i]) for i, one in enumerate(nodes)] for x in at])
    return values @ weights.T
