"""Direct simulation of the full problem: against states found without time stepping, another integrator, and what the statement says."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS, derivation_of, result_of
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from derive import load_problem
from derive.cli import main
from derive.residual import emit_residual
from numerics import full_motion, full_radau
from numerics.full import solve_state
from numerics.full_motion import consistent, simulate_full
from numerics.full_radau import STAGES, Instant, Stepper, System
from numerics.full_rows import Rows, State
from numerics.full_simulation import Accuracy, Plan, converged, ellipses, simulate_fields, start_of
from numerics.full_states import Full
from numerics.motion import Scene
from numerics.precision import EvaluationError
from numerics.simulation import Sampling


def local(name):
    return str(PROBLEMS / f"{name}.py")


def full_of(target):
    return Full(rows=Rows(emit_residual(load_problem(target))), result=result_of(target))


def simulated(target, initial, mu, until, tolerance=1e-6, sampling=None):
    scene = Scene(initial=initial, mu=mu, until=until)
    return simulate_fields(emit_residual(load_problem(target)), derivation_of(target).emit(), result_of(target), scene, sampling or Sampling(times=11, places=9), Accuracy(tolerance=tolerance))


def start_on(full, found):
    """Return shape and rate at time 0 of a state that turns about the axis, or that is periodic."""
    shape, rows = found.shape, full.rows
    if shape.harmonics == 0:  # v' = Omega e_n x v
        values = [one[:, :1] for one in shape.coefficients]
        rates = [-weight * shape.omega * values[k + weight] for k, weight in enumerate(rows.weight)]
    else:
        waves = np.arange(1, shape.harmonics + 1)
        values = [one[:, :1] + one[:, 1::2].sum(axis=1, keepdims=True) for one in shape.coefficients]
        rates = [shape.omega * (one[:, 2::2] * waves).sum(axis=1, keepdims=True) for one in shape.coefficients]
    return tuple(State(coefficients=tuple(one), nodes=shape.nodes, harmonics=0, control=shape.control, omega=0.0) for one in (values, rates))


def on_state(target, name, mu, periods, accuracy, tolerance=1e-10):
    full = full_of(target)
    found = solve_state(emit_residual(load_problem(target)), result_of(target), name, mu, tolerance)
    times = np.linspace(0, periods * 2 * np.pi / found.frequency, 8 * periods + 1)
    record, error, _ = converged(full, mu, start_on(full, found), times, Accuracy(tolerance=accuracy))
    assert error < accuracy and record.violation < 1e-10
    return found, record, error


def test_whirling_is_kept_by_the_simulation():
    """The relative equilibrium is found in a turning frame, without time stepping: radius and angle stay within the stated error."""
    found, record, error = on_state("follower_force", "whirling", 0.5, 1, 1e-5)
    place = record.displacement @ [1, 1j]
    exact = found.peak * np.exp(1j * found.frequency * record.times)
    assert np.abs(place - exact).max() < max(error, 1e-11) * found.peak
    ellipse = ellipses(record, 2 * np.pi / found.frequency)
    assert np.allclose(ellipse["semi_major"], found.peak, rtol=1e-6) and np.allclose(ellipse["semi_minor"], found.peak, rtol=1e-6) and np.all(ellipse["sense"] == 1)


@pytest.mark.slow
def test_beating_returns_after_its_period():
    """The periodic orbit is found by collocation over a period; its peak is the largest displacement of the simulation."""
    found, record, error = on_state("follower_force", "beating", 0.5, 3, 1e-7)
    for k in (8, 16, 24):
        assert np.abs(record.displacement[k] - record.displacement[0]).max() < 2e-8 * found.peak
    ellipse = ellipses(record, 2 * np.pi / found.frequency)
    assert np.allclose(ellipse["semi_major"], found.peak, rtol=1e-6) and not ellipse["semi_minor"].any() and not ellipse["sense"].any()


def factor_of(series, length):
    """Return by what factor what does not repeat in a series changes from one of the last three periods to the next."""
    first, second, third = series[-3 * length:].reshape(3, length)
    a, b = second - first, third - second
    factor = (b @ a) / (a @ a)
    assert np.linalg.norm(b - factor * a) < 2e-3 * np.linalg.norm(b)
    return factor


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "exponent"), [(144.0, 21.50625), (150.0, -23.41716)])
def test_beating_gains_stability_by_time_stepping_too(monkeypatch, mu, exponent):
    """Far from onset, either side of the change at mu = 147.0019: a copy across the plane, a quarter of a period late, grows or decays at the rate of the Floquet exponent."""
    monkeypatch.setattr(full_motion, "CONSTRAINT", 1e-4)  # the start is a truncated Fourier series
    full = full_of("follower_force")
    found = solve_state(emit_residual(load_problem("follower_force")), full.result, "beating", mu, 1e-9)
    assert min(abs(one.value - exponent) for one in found.exponents) < 1e-3
    shape, waves = found.shape, np.arange(1, found.shape.harmonics + 1)

    def series(one, angle, order):
        cosines, sines = np.cos(waves * angle), np.sin(waves * angle)
        return ((one[:, :1].ravel() if order == 0 else 0) + (one[:, 1::2] @ (cosines if order == 0 else -waves * shape.omega * sines))
                + one[:, 2::2] @ (sines if order == 0 else waves * shape.omega * cosines))[:, None]

    start = []
    for order in (0, 1):
        now, late = ([series(one, angle, order) for one in shape.coefficients] for angle in (0.0, np.pi / 2))
        turned = [-weight * late[k + weight] for k, weight in enumerate(full.rows.weight)]
        start.append(State(coefficients=tuple(a + 1e-6 * b for a, b in zip(now, turned, strict=True)), nodes=shape.nodes, harmonics=0, control=shape.control, omega=0.0))
    period = 2 * np.pi / found.frequency
    times = np.linspace(0, 5 * period, 161)
    plan = Plan(tolerance=1e-11, pieces=1, longest=times[1], first=times[1] / 50, short=1e-6 * times[1])
    moved = simulate_full(System(full.rows, full.threshold + mu, found.nodes + 8), tuple(start), times, plan).displacement
    across = moved @ np.linalg.svd(moved, full_matrices=False)[2][1]
    assert np.log(factor_of(across[:-1], 32)) / period == pytest.approx(exponent, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "exponent"), [(145.0, -20.67890 + 3012.40240j), (160.0, 26.50134 + 3349.74983j)])
def test_whirling_loses_stability_by_time_stepping_too(mu, exponent):
    """Either side of the change at mu = 152.1076: the radius of a start that belongs to another control oscillates, decaying or growing, as the exponent says."""
    full = full_of("follower_force")
    found, other = (solve_state(emit_residual(load_problem("follower_force")), full.result, "whirling", one, 1e-11) for one in (mu, mu + 0.004))
    assert min(abs(one.value - exponent) for one in found.exponents) < 1e-4
    start = tuple(replace(one, control=found.control) for one in start_on(full, other))
    times = np.linspace(0, 6 * 2 * np.pi / found.frequency, 97)
    plan = Plan(tolerance=1e-10, pieces=1, longest=times[1], first=times[1] / 50, short=1e-6 * times[1])
    moved = simulate_full(System(full.rows, full.threshold + mu, found.nodes + 20), start, times, plan).displacement
    late, radius = times[32:], np.linalg.norm(moved, axis=1)[32:] - found.peak
    size = np.abs(radius).max()

    def apart(p):
        return radius / size - np.exp(p[0] * (late - late[0])) * (p[2] * np.cos(p[1] * late) + p[3] * np.sin(p[1] * late)) - p[4]

    fits = [least_squares(apart, [0.0, 1.01 * exponent.imag, a, b, 0.0], x_scale=[10, 10, 1, 1, 1]) for a in (1, -1) for b in (1, -1)]
    rate, frequency = min(fits, key=lambda one: one.cost).x[:2]
    assert rate == pytest.approx(exponent.real, rel=1e-2) and frequency == pytest.approx(exponent.imag, rel=1e-4)


def test_a_limit_cycle_is_kept_by_the_simulation():
    found, record, error = on_state("van_der_pol", "cycle", 0.3, 2, 1e-9)
    assert np.abs(record.displacement[8::8] - record.displacement[0]).max() < max(2 * error, 1e-10) * found.peak


@pytest.mark.parametrize("spacing", ["linear", "log"])
def test_an_oscillator_is_that_of_an_explicit_integrator_within_the_stated_error(tmp_path, spacing):
    path = tmp_path / "motion.npz"
    arguments = ["simulate", "van_der_pol", "--full", "--initial", "0.3", "--mu", "0.2", "--until", "10", "--points", "31", "--tolerance", "1e-8", "--spacing", spacing, "--out", str(path)]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.output
    with np.load(path) as data:
        x, times, attributes = data["field_x"], data["time"], json.loads(str(data["attributes"]))
        amplitude = data["amplitude_re"] + 1j * data["amplitude_im"]
    state, rate = start_of(full_of("van_der_pol"), derivation_of("van_der_pol").emit(), Scene(initial=(0.3 + 0j,), mu=0.2, until=10.0), "1", 1)
    start = [state.coefficients[0][0, 0], rate.coefficients[0][0, 0]]
    exact = solve_ivp(lambda t, u: [u[1], (0.2 - u[0] ** 2) * u[1] - u[0]], (0, 10), start, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times).y
    assert times[0] == 0 and attributes["error"] < 1e-8
    assert np.abs(x - exact[0]).max() < attributes["error"] * np.abs(exact[0]).max()
    assert np.abs(x - exact[0]).max() < json.loads(attributes["field_errors"])["x"]
    assert np.allclose(2 * (amplitude * np.exp(1j * times)).real, exact[0], atol=1e-8) and np.allclose(-2 * (amplitude * np.exp(1j * times)).imag, exact[1], atol=1e-8)


def test_a_smaller_tolerance_gives_a_smaller_error():
    errors = [simulated("van_der_pol", (0.3 + 0j,), 0.2, 10.0, tolerance).attributes["error"] for tolerance in (1e-4, 1e-7, 1e-10)]
    assert all(error < tolerance for error, tolerance in zip(errors, (1e-4, 1e-7, 1e-10), strict=True))


def test_steps_converge_with_order_nine():
    full = full_of("van_der_pol")
    start = start_of(full, derivation_of("van_der_pol").emit(), Scene(initial=(0.3 + 0j,), mu=0.5, until=6.0), "1", 1)
    system = System(full.rows, full.threshold + 0.5, 1)
    ends = []
    for count in (4, 8, 16):
        now, stepper = Instant(y=system.pack(start[0]), rate=system.pack(start[1]), second=np.zeros(1)), Stepper(system=system)
        for _ in range(count):
            now = stepper.solve(now, 6.0 / count, np.repeat(now.y[:, None], STAGES, axis=1)).end()
        ends.append(now.y[0])
    assert np.log2(abs(ends[1] - ends[0]) / abs(ends[2] - ends[1])) > 8.0


def test_the_filament_keeps_its_constraints_from_time_zero_on():
    """From the shape of an amplitude, which violates them: the tangent is a unit vector, the moment its product with the curvature, at places that are no nodes."""
    data = simulated("follower_force", (0.03 + 0j, 0.005j), 0.5, 0.01, 1e-5, Sampling(times=5, places=23))
    t, r, force = data["field_t"], data["field_r"], data["field_F"]
    assert data["time"][0] == 0 and np.abs((t**2).sum(-1) - 1).max() < 1e-10 and data.attributes["constraint"] < 1e-10
    assert np.abs(r[:, 0]).max() < 1e-14 and np.abs(force[:, -1] + data.attributes["control"] * t[:, -1]).max() < 1e-10
    assert r[0, -1, :2] == pytest.approx([0.06, 0], abs=2e-6) and data.attributes["start_moved"] < 2e-5
    assert data.attributes["error"] < 1e-5


def test_a_pendulum_on_a_circle_is_simulated_onto_its_cycle():
    """A second-order differential-algebraic system: the constraint is kept, and the motion ends on the state found by harmonic balance."""
    target = local("pendulum_cart")
    cycle = solve_state(emit_residual(load_problem(target)), result_of(target), "cycle", 0.2, 1e-9)
    data = simulated(target, (0.4 + 0j,), 0.2, 40.0, 1e-6, Sampling(times=321))
    assert np.abs(data["field_x"] ** 2 + data["field_z"] ** 2 - 1).max() < 1e-10
    assert np.abs(data["field_x"][-60:]).max() == pytest.approx(cycle.peak, rel=2e-3)


def test_a_pendulum_on_a_circle_moves_as_its_angle_does():
    """x = sin a, z = -cos a turns the system of index 3 into an ordinary equation that knows of no constraint."""
    target = local("pendulum_cart")
    data = simulated(target, (0.2 + 0j,), 0.2, 10.0, 1e-8, Sampling(times=21))
    start = start_of(full_of(target), derivation_of(target).emit(), Scene(initial=(0.2 + 0j,), mu=0.2, until=10.0), "1", 1)
    x, z, given = data["field_x"], data["field_z"], [one[0, 0] for one in start[1].coefficients]
    angle = np.arctan2(x[0], -z[0])
    turning = -2 * data["amplitude_im"][0] / np.cos(angle)  # x' = -2 omega Im A at time 0, omega = 1
    assert turning == pytest.approx(np.cos(angle) * given[0] + np.sin(angle) * given[1], abs=1e-7)  # the constraint takes nothing along the circle
    exact = solve_ivp(lambda t, u: [u[1], (0.2 - np.sin(u[0]) ** 2) * u[1] - np.sin(u[0])], (0, 10), [angle, turning], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=data["time"]).y[0]
    assert np.abs(x - np.sin(exact)).max() < data.attributes["error"] * np.abs(x).max()


def test_cost_is_counted():
    """A period of the filament takes few steps, and few factors and iterations in each."""
    full = full_of("follower_force")
    period = 2 * np.pi / full.frequency
    start = start_of(full, derivation_of("follower_force").emit(), Scene(initial=(0.03 + 0j, 0.005j), mu=0.5, until=1.0), "1", 24)
    plan = Plan(tolerance=1e-5, pieces=1, longest=period / 6, first=period / 400, short=1e-4 * period)
    costs = simulate_full(System(full.rows, full.threshold + 0.5, 28), start, np.linspace(0, period, 3), plan).costs
    assert costs.steps <= 20 and costs.factors <= 1.5 * costs.steps and costs.iterations <= 12 * costs.steps


def test_a_wrong_weight_is_found_out(monkeypatch):
    """One weight of the method, wrong by a millionth, shows against the state that is found without time stepping."""
    full = full_of("van_der_pol")
    found = solve_state(emit_residual(load_problem("van_der_pol")), result_of("van_der_pol"), "cycle", 0.3, 1e-10)
    period = 2 * np.pi / found.frequency
    plan = Plan(tolerance=1e-9, pieces=1, longest=period / 6, first=period / 400, short=1e-4 * period)
    system = System(full.rows, full.threshold + 0.3, 1)

    def misses():
        record = simulate_full(system, start_on(full, found), np.array([0.0, 2 * period]), plan)
        return np.abs(record.displacement[1] - record.displacement[0]).max() / found.peak

    right = misses()
    wrong = full_radau.INVERSE.copy()
    wrong[-1, 0] *= 1 + 1e-6
    monkeypatch.setattr(full_radau, "INVERSE", wrong)
    assert right < 1e-10 < 1e-9 < misses()


@pytest.mark.slow
def test_a_nearly_planar_start_becomes_circular_whirling():
    """At mu = 0.5, as the paper's figure shows for the theory; the circle is that of the relative equilibrium, found without time stepping."""
    data = simulated("follower_force", (0.03 + 0j, 0.005j), 0.5, 2.5, 1e-5, Sampling(times=101, places=5))
    found = solve_state(emit_residual(load_problem("follower_force")), result_of("follower_force"), "whirling", 0.5, 1e-10)
    ratio = data["ellipse_semi_minor"] / data["ellipse_semi_major"]
    assert ratio[0] < 0.2 and np.all(np.diff(ratio[::5]) > 0) and ratio[-1] > 0.999
    assert data["ellipse_semi_major"][-1] == pytest.approx(found.peak, rel=2e-4) and np.all(data["ellipse_sense"] == data["ellipse_sense"][0])
    assert data.attributes["constraint"] < 1e-10 and data.attributes["error"] < 1e-5


def test_a_start_that_is_not_the_given_one_is_refused():
    """Growth by many orders within the time in which a start is brought onto the constraints."""
    full = full_of("van_der_pol")
    system = System(full.rows, full.threshold + 0.5, 1)
    given = Instant(y=np.array([1e-3]), rate=np.zeros(1), second=np.zeros(1))
    assert abs(consistent(system, given, 1e-4).y[0] - 1e-3) < 1e-15
    with pytest.raises(EvaluationError, match="at time 0"):
        consistent(system, given, 40.0)


@pytest.mark.parametrize(("changes", "says"), [
    ({"tolerance": 1e-13}, "tolerance: found 1e-13"),
    ({"until": 1e7}, "until: found 1.59e.06 periods"),
    ({"initial": (5.0 + 0j, 0j), "target": "follower_force", "until": 0.01}, "at time 0"),
])
def test_what_cannot_be_simulated_is_said(changes, says):
    values = {"target": "van_der_pol", "initial": (0.3 + 0j,), "mu": 0.5, "until": 6.0, "tolerance": 1e-6, **changes}
    with pytest.raises(EvaluationError, match=says):
        simulated(values["target"], values["initial"], values["mu"], values["until"], values["tolerance"])
