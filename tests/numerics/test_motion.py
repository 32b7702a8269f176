"""The motion against direct integration in Cartesian components, closed-form states, and exact invariants."""

import numpy as np
import pytest
from conftest import PROBLEMS, ROOT, derivation_of
from scipy.integrate import solve_ivp

import numerics.motion
from numerics import EvaluationError, coefficients, evaluate
from numerics.motion import Scene, VectorMotion, fast_phase, integrate_vector, motion_of

FILAMENT = ROOT / "generated" / "follower_force.py"
ALPHA, BETA, GAMMA = (complex(evaluate(FILAMENT)[name].value) for name in ("alpha", "beta", "gamma"))



def moved(initial, mu, until, target=None):
    emitted = FILAMENT if target is None else derivation_of(target).emit()
    return motion_of(emitted, Scene(initial=tuple(complex(one) for one in initial), mu=mu, until=until))


def direct(initial, mu, until):
    """Integrate the vector equation in Cartesian components, as the paper writes it."""

    def slope(t, y):
        a = y[:2] + 1j * y[2:]
        rate = ALPHA * np.conj(a) * (a @ a) + BETA * a * (np.conj(a) @ a) + mu * GAMMA * a
        return np.concatenate([rate.real, rate.imag])

    start = np.concatenate([np.real(initial), np.imag(initial)])
    final = solve_ivp(slope, (0, until), start, method="DOP853", rtol=1e-13, atol=1e-18).y[:, -1]
    return final[:2] + 1j * final[2:]


@pytest.mark.parametrize(("initial", "mu", "until"), [
    ((0.03, 0.005j), 0.5, 2.0), ((0.03, 0.01 + 0.02j), -0.5, 1.0), ((0.2, 0.1 - 0.3j), 0.0, 0.5), ((0.02, 0.01), 0.5, 0.5), ((0.02, -0.02j), 0.5, 1.0), ((1e-3 + 1e-3j, 2e-3j), 2.0, 0.4),
])
def test_the_motion_is_that_of_a_direct_integration(initial, mu, until):
    motion, _ = moved(initial, mu, until)
    expected = direct(initial, mu, until)
    assert np.abs(motion.amplitude(until) - expected).max() < 1e-11 * np.abs(expected).max()


def test_whirling_is_reached_with_the_radius_and_the_frequency_of_the_closed_form():
    """Label cw sol: |A|^2 = -mu gamma_r/beta_r, nu = mu (gamma_i - gamma_r beta_i/beta_r); printed 0.16840 and 10.362 at mu = 1."""
    mu = 0.5
    motion, _ = moved((0.03, 0.005j), mu, 1e6)
    for t in (30.0, 1e3, 1e6 - 1):
        here, later = motion.amplitude(t), motion.amplitude(t + 0.01)
        assert np.sum(np.abs(here) ** 2) == pytest.approx(-mu * GAMMA.real / BETA.real, rel=1e-11)
        assert abs(here @ here) < 1e-11 * np.sum(np.abs(here) ** 2)
        nu = mu * (GAMMA.imag - GAMMA.real * BETA.imag / BETA.real)
        assert np.angle(later[0] / here[0]) == pytest.approx(0.01 * nu, rel=1e-6 if t > 1e5 else 1e-9)
    assert np.sqrt(2) * np.sqrt(np.sum(np.abs(here) ** 2)) / np.sqrt(mu) == pytest.approx(0.16840, abs=5e-6)


def test_a_start_far_below_the_state_reaches_it():
    motion, _ = moved((1e-40, 1e-41j), 0.5, 1e3)
    assert np.sum(np.abs(motion.amplitude(1e3)) ** 2) == pytest.approx(-0.5 * GAMMA.real / BETA.real, rel=1e-12)


def test_beating_is_reached_with_the_closed_form():
    """Label beating sol, printed 2|A| = 0.17412 and nu = 5.5426 at mu = 1."""
    motion, _ = moved((0.03, 0.01), 1.0, 50.0)
    here, later = motion.amplitude(50.0), motion.amplitude(50.01)
    assert 2 * np.sqrt(np.sum(np.abs(here) ** 2)) == pytest.approx(0.17412, abs=5e-6)
    assert np.angle(later[0] / here[0]) / 0.01 == pytest.approx(5.5426, abs=1e-4)


@pytest.mark.parametrize("time", [1e6, 1e12])
def test_algebraic_decay_has_the_prefactors_of_the_paper(time):
    """Labels nonlinear stability planar sol and nonplanar powerlaws."""
    planar, _ = moved((1, 0), 0.0, time)
    size = np.sqrt(np.sum(np.abs(planar.amplitude(time)) ** 2))
    assert size * np.sqrt(-2 * (ALPHA + BETA).real * time) == pytest.approx(1, rel=1 / time + 1e-12)
    general, _ = moved((0.5, 0.5j * np.sqrt(3)), 0.0, time)
    a = general.amplitude(time)
    size, cross = np.sqrt(np.sum(np.abs(a) ** 2)), 2 * abs((np.conj(a[0]) * a[1]).imag)
    assert size * np.sqrt(-2 * BETA.real * time) == pytest.approx(1, rel=1e-5)
    assert cross * -2 * BETA.real * time == pytest.approx(1, rel=1e-5)
    assert isinstance(general, VectorMotion) and general.steps < 1000  # the steps grow with time


def test_planar_stays_planar_and_circular_stays_circular():
    times = np.linspace(0, 50, 201)
    line, _ = moved((0.03 * np.exp(0.4j), 0.01 * np.exp(0.4j)), 0.5, 50.0)
    a = line.amplitude(times)
    assert np.abs((np.conj(a[:, 0]) * a[:, 1]).imag).max() < 1e-12 * np.abs(a).max() ** 2
    assert np.abs(a[:, 1] - a[:, 0] / 3).max() < 1e-12 * np.abs(a).max()
    circle, _ = moved((0.03, -0.03j), 0.5, 50.0)
    a = circle.amplitude(times)
    assert np.abs(a[:, 0] ** 2 + a[:, 1] ** 2).max() < 1e-12 * np.abs(a).max() ** 2


def test_a_rotated_and_delayed_start_gives_the_rotated_and_delayed_motion():
    times = np.linspace(0, 20, 41)
    start, turn = np.array([0.03, 0.005j]), np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    plain, _ = moved(start, 0.5, 20.0)
    other, _ = moved(np.exp(0.3j) * turn @ start, 0.5, 20.0)
    expected = np.exp(0.3j) * plain.amplitude(times) @ turn.T
    assert np.abs(other.amplitude(times) - expected).max() < 1e-10 * np.abs(expected).max()


def test_a_nearly_planar_start_keeps_its_digits():
    """The growth across the plane, sigma = 2 alpha_r gamma_r mu/(alpha_r + beta_r), over many decades (label beating perpendicular eigenvalues)."""
    mu, until = 0.5, 8.0
    size = np.sqrt(-mu * GAMMA.real / (ALPHA + BETA).real)
    motion, _ = moved((size, 1e-30j * size), mu, until)
    sigma = 2 * ALPHA.real * GAMMA.real * mu / (ALPHA + BETA).real
    a = motion.amplitude(np.array([0.0, until]))
    assert isinstance(motion, VectorMotion)
    assert motion.variables(until)[1] / motion.variables(0.0)[1] == pytest.approx(np.exp(sigma * until), rel=1e-10)
    assert np.isfinite(a).all()


@pytest.mark.parametrize(("initial", "mu", "kind", "evaluated"), [
    ((0.03, 0.01), 0.5, "ScalarMotion", {"alpha", "beta", "gamma"}), ((0.03, 0.03j), 0.5, "ScalarMotion", {"beta", "gamma"}),
    ((0.03, 0.01), 0.0, "ScalarMotion", {"alpha", "beta"}), ((0.03, 0.02j), 0.0, "VectorMotion", {"alpha", "beta"}), ((0.03, -0.03j), 0.0, "ScalarMotion", {"beta"}),
])
def test_only_what_the_scene_needs_is_evaluated(monkeypatch, initial, mu, kind, evaluated):
    """Counts the stages that ran: a circular motion never evaluates alpha nor the response of harmonic 2 that alpha alone needs."""
    made = []
    build = coefficients.builder

    def recording(*arguments):
        make = build(*arguments)

        def inner(*point):
            made.append(make(*point))
            return made[-1]
        return inner

    monkeypatch.setattr(coefficients, "builder", recording)
    motion, result = moved(initial, mu, 1.0)
    ran = {name for algebra in made for name in algebra.store}
    assert type(motion).__name__ == kind
    assert {name.removeprefix("coefficient_") for name in ran if name.startswith("coefficient_")} == evaluated == {one.name for one in result.coefficients}
    assert ("response_Ap_Am" in ran) == ("alpha" in evaluated)


@pytest.mark.parametrize(("name", "initial", "mu", "until", "rate"), [
    ("fisher", 0.01, 0.3, 60.0, lambda a: 0.3 * a - 8 / (3 * np.pi) * a**2), ("fisher", -0.2, -0.3, 9.0, lambda a: -0.3 * a - 8 / (3 * np.pi) * a**2),
    ("lorenz_pitch", 0.01, 0.5, 12.0, lambda a: 10 / 11 * 0.5 * a - 15 / 44 * a**3), ("lorenz_pitch", -0.7, 0.0, 50.0, lambda a: -15 / 44 * a**3),
    ("chafee", -0.7, -0.5, 5.0, lambda a: -0.5 * a - 0.125 * a**3),
])
def test_real_amplitudes_follow_the_textbook_equation(name, initial, mu, until, rate):
    motion, _ = moved((initial,), mu, until, str(PROBLEMS / f"{name}.py"))
    expected = solve_ivp(lambda t, y: rate(y), (0, until), [initial], method="DOP853", rtol=1e-12, atol=1e-15).y[0, -1]
    assert motion.amplitude(until) == pytest.approx(expected, rel=1e-10)


def test_a_complex_scalar_and_a_real_vector():
    motion, _ = moved((0.01,), 0.2, 1e9, "van_der_pol")
    assert abs(motion.amplitude(1e9)) == pytest.approx(np.sqrt(0.2), rel=1e-12)
    motion, _ = moved((0.03, 0.04), 0.25, 1e3, str(PROBLEMS / "vec_pitch.py"))
    assert motion.amplitude(1e3) == pytest.approx(np.array([0.3, 0.4]), rel=1e-12)


def test_a_general_motion_comes_to_rest_on_a_line_or_leaves_every_bound(monkeypatch):
    line = integrate_vector(0.5 + 1j, 0.5 + 0.2j, -1 + 0.3j, (0.1, 0.03j), 1e6)
    a = line.amplitude(1e6)
    assert np.sum(np.abs(a) ** 2) == pytest.approx(1, rel=1e-12) and abs((np.conj(a[0]) * a[1]).imag) < 1e-12
    with pytest.raises(EvaluationError, match="grows"):
        integrate_vector(0.5 + 1j, -0.5 + 0j, 1 + 0j, (0.1, 0.03j), 1e6)
    monkeypatch.setattr(numerics.motion, "MOST_CALLS", 3000)
    with pytest.raises(EvaluationError, match="two very different rates"):
        integrate_vector(1e3 + 0j, -1e-9 + 0j, -1 + 0j, (0.1, 0.03j), 1e12)


def test_the_rest_of_the_way_is_the_end_of_a_longer_integration():
    """After the integration has come to rest, |A| and the phases go on as they would have: whirling, ten times as long as until rest."""
    motion, _ = moved((0.08, 0.05j), 0.5, 400.0)
    assert isinstance(motion, VectorMotion) and motion.rest < 40
    whole = integrate_vector(motion.growth, motion.alpha, motion.beta, motion.amplitude(motion.rest / 2), 400.0)
    late = motion.rest * np.array([1.01, 2, 9])
    assert whole.amplitude(late - motion.rest / 2) == pytest.approx(motion.amplitude(late), rel=1e-9)


def test_a_motion_without_bound_is_refused():
    for target, initial, mu in ((str(PROBLEMS / "fisher.py"), (-0.1,), 0.5), (str(PROBLEMS / "zero_cubic.py"), (0.1,), 0.5), (str(PROBLEMS / "lorenz_hopf.py"), (3,), 1.0)):
        with pytest.raises(EvaluationError, match="grows"):
            moved(initial, mu, 1e4, target)


def test_the_fast_phase_keeps_its_digits():
    assert fast_phase("1.5", [0.0, 1.0, 2e12])[:2] == pytest.approx([0.0, 1.5])
    assert fast_phase("1.5", [2e12])[0] == pytest.approx(float(np.mod(np.longdouble("3e12"), 2 * np.pi * np.longdouble(1))), abs=1e-2)
    assert fast_phase(None, [3.0])[0] == 0
