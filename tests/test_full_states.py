"""The full nonlinear problem: known solutions, another formulation, another method, and the coefficients measured on it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS, derivation_of, result_of
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from derive import derive_amplitude_equation, hard_cases, load_problem
from derive.cli import main
from derive.residual import emit_residual
from numerics import evaluate
from numerics.full import Secondary, follow_branch, solve_state
from numerics.full_rows import Rows, space_basis
from numerics.full_validate import validate
from numerics.precision import EvaluationError
from numerics.scout import refuse_narrow


def text_of(target):
    return emit_residual(load_problem(target))


def solved(target, state, mu, tolerance=1e-9):
    return solve_state(text_of(target), result_of(target), state, mu, tolerance)


def local(name):
    return str(PROBLEMS / f"{name}.py")


def test_every_emitted_derivative_is_that_of_its_row():
    """Complex steps on the emitted rows of the filament share nothing with SymPy's derivatives."""
    rows = Rows(text_of("follower_force"))
    jets = np.random.default_rng(3).standard_normal((4, len(rows.jets), 1))
    for site in ("interior", "right"):
        s = np.linspace(0.1, 0.9, 4)
        _, in_control, slopes = rows.evaluate(site, s, 2.0, jets)
        for j in range(len(rows.jets)):
            moved = [complex(0, 1e-30) * (k == j) + jets[:, k] for k in range(len(rows.jets))]
            step = np.array([np.broadcast_to(np.imag(row[0]), (4, 1)) for row in rows.names[site](s[:, None], 2.0, moved)]) / 1e-30
            assert np.allclose(step, np.moveaxis(slopes[..., j], 1, 0), atol=1e-12)
        step = np.array([np.broadcast_to(np.imag(row[0]), (4, 1)) for row in rows.names[site](s[:, None], 2.0 + 1e-30j, np.moveaxis(jets, 1, 0))]) / 1e-30
        assert np.allclose(step, np.moveaxis(in_control, 1, 0), atol=1e-12)


def test_the_basis_is_its_own_derivative():
    x = np.linspace(-1, 1, 7)
    step = 1e-5
    for order in (0, 1, 2):
        difference = (space_basis(3, 9, 2.5, x + step, order) - space_basis(3, 9, 2.5, x - step, order)) / (2 * step) * (2 / 2.5)
        assert np.allclose(difference, space_basis(3, 9, 2.5, x, order + 1), atol=1e-6)


def test_buckling_is_the_elastica_in_elliptic_functions():
    """theta'' + P sin(theta) = 0, theta'(0) = theta(1) = 0: sqrt(P) = K(k), theta(0) = 2 asin k."""
    found = solved(local("elastica"), "branch", 1.0)
    k = np.sin(found.peak / 2)
    assert abs(ellipk(k**2) ** 2 - found.control) < 1e-8 * found.control
    assert found.stable


def test_a_rotating_vector_oscillator_has_its_exact_radius():
    """r'' - (m - r.r) r' + r = 0: circular motion has radius sqrt(m) and frequency 1."""
    found = solved(local("isotropic_vdp"), "whirling", 0.1)
    assert abs(found.peak - np.sqrt(0.1)) < 1e-12 and abs(found.frequency - 1) < 1e-12


def test_a_limit_cycle_is_that_of_time_stepping():
    def slope(t, u):
        return [u[1], (1 - u[0] ** 2) * u[1] - u[0]]

    found = solved("van_der_pol", "cycle", 1.0)
    run = solve_ivp(slope, (0, 60), [2.0, 0.0], rtol=1e-11, atol=1e-12, events=lambda t, u: u[1])
    peaks, times = run.y_events[0][-5:, 0], run.t_events[0]
    assert abs(found.peak - np.abs(peaks).max()) < 1e-8
    assert abs(found.frequency - np.pi / (times[-1] - times[-2])) < 1e-7
    # the product of the multipliers is exp of the mean divergence: one exponent is 0, the other the mean of m - x^2
    cycle = solve_ivp(lambda t, u: [*slope(t, u[:2]), 1 - u[0] ** 2], (0, 2 * np.pi / found.frequency), [found.peak, 0.0, 0.0], rtol=1e-11, atol=1e-12)
    exponent = next(one.value.real for one in found.exponents if not one.neutral)
    assert abs(exponent - cycle.y[2, -1] * found.frequency / (2 * np.pi)) < 1e-7


def test_growth_rates_of_the_base_state_are_known_in_closed_form():
    """Swift-Hohenberg on (0, pi): modes sin(n s) grow with r - (1 - n^2)^2."""
    found = solved("swift_hohenberg", "base", 0.25)
    assert not found.stable
    assert np.allclose([one.value for one in found.exponents[:4]], [0.25 - (1 - n**2) ** 2 for n in (1, 2, 3, 4)], atol=1e-7)


@pytest.mark.parametrize("mu", [-2.0, 1e-7, 0.0, 0.5])
def test_growth_rates_of_a_damped_column_are_known_in_closed_form(write_problem, mu):
    """Modes sin(n pi s) of a pinned column: infinitely many decay alike, and only some of them are resolved."""
    target = write_problem(COLUMN)
    found = solved(target, "base", mu)
    stiffness = [(n * np.pi) ** 4 - found.control * (n * np.pi) ** 2 + 10 for n in (1, 2, 3, 4)]
    exact = [value for k in stiffness for value in np.roots([1, 2, k])]
    shown = [one for one in found.exponents if abs(one.value) < 100]
    assert len(shown) >= 6 and any(abs(one.value) < 5 for one in shown)
    assert all(min(abs(one.value - value) for value in exact) < max(10 * one.error, 1e-9) < 1e-5 for one in shown)
    assert mu == 0 or found.stable == (mu < 0)


COLUMN = """
from sympy import Rational, symbols
from derive import Problem, field

s, t, P = symbols("s t P", real=True)
u = field("u", s, t)
problem = Problem(
    name="column", space=s, interval=(0, 1), time=t, control=P, control_range=(0, 30), fields=(u,),
    equations=(u.diff(t, 2) + 2 * u.diff(t) + u.diff(s, 4) + P * u.diff(s, 2) + 10 * u + 500 * u**3,),
    boundary={0: (u, u.diff(s, 2)), 1: (u, u.diff(s, 2))}, base_state={u: 0}, normalisation=(u, Rational(1, 2)),
)
"""


@pytest.mark.parametrize("mu", [-0.1, 0.1])
def test_rounding_in_a_multiplier_does_not_hide_a_double_growth_rate(mu):
    """d' = d_ss - L d - P k with |d| = 1: the modes sin((n + 1/2) pi s) across the axis grow with P - ((n + 1/2) pi)^2, each twice."""
    found = solved(local("buckle_pinned_tw"), "base", mu)
    exact = [found.control - ((n + 0.5) * np.pi) ** 2 for n in (0, 0, 1, 1, 2, 2)]
    assert np.allclose([one.value for one in found.exponents[:6]], exact, atol=1e-8) and found.stable == (mu < 0)


def test_a_branch_with_an_inner_layer_starts_where_a_coarse_grid_has_no_state():
    """The threshold of twelve nodes is farther from the true one than the state that is asked for."""
    found = solved(local("layer"), "branch", 1e-2)
    assert found.peak == pytest.approx(found.predicted.peak, rel=1e-4) and found.stable
    base = solved(local("layer"), "base", 1e-2)
    assert abs(base.exponents[0].value - 0.00843522812) < 1e-7


def test_whirling_of_the_filament_has_the_exponents_of_the_amplitude_equation():
    """Near onset: -2 gamma_r mu along the radius, alpha R^2 + 2 i Omega for the other sense, and 0 for the rotation."""
    result, found = result_of("follower_force"), solved("follower_force", "whirling", 1e-3)
    alpha, gamma = complex(result["alpha"].value), complex(result["gamma"].value)
    values = [one.value for one in found.exponents if not one.neutral]
    assert found.stable and sum(one.neutral for one in found.exponents) == 1
    assert min(abs(value + 2 * gamma.real * 1e-3) for value in values) < 1e-6
    assert min(abs(value - 2j * found.frequency - alpha * found.peak**2) for value in values) < 2e-5


@pytest.mark.slow
def test_beating_of_the_filament_is_that_of_the_planar_formulation():
    three, two = solved("follower_force", "beating", 1e-2, 1e-7), solved("follower_force_planar", "cycle", 1e-2, 1e-7)
    assert abs(three.peak - two.peak) < 2e-7 * two.peak and abs(three.frequency - two.frequency) < 2e-7 * two.frequency
    assert not three.stable and two.stable
    inside = next(one.value.real for one in three.exponents if one.kind == "in plane")
    assert abs(inside - next(one.value.real for one in two.exponents if not one.neutral)) < 1e-5


@pytest.mark.slow
def test_rows_by_component_about_an_oblique_axis_give_the_same_whirling():
    one, other = solved("follower_force", "whirling", 0.5), solved(local("ff_components"), "whirling", 0.5)
    assert abs(one.peak - other.peak) < 1e-9 and abs(one.frequency - other.frequency) < 1e-7


@pytest.mark.parametrize("target", ["swift_hohenberg", "van_der_pol", local("fisher"), local("vec_pitch"), local("pendulum_cart"), local("robin"), local("weak_iso"), local("exchange"),
                                    pytest.param(local("turing_brus"), marks=pytest.mark.slow), pytest.param(local("mass_matrix"), marks=pytest.mark.slow)])
def test_the_coefficients_are_measured_on_the_full_problem(target):
    found = validate(text_of(target), derivation_of(target).emit(), result_of(target))
    assert found.agrees
    assert min(check.digits for check in found.checks) >= 7


def test_a_wrong_coefficient_is_found_out():
    text, result = text_of("swift_hohenberg"), result_of("swift_hohenberg")
    wrong = tuple(replace(one, value=replace(one.value, re="-0.75000001")) if one.monomial == "A**3" else one for one in result.coefficients)
    assert not validate(text, derivation_of("swift_hohenberg").emit(), replace(result, coefficients=wrong)).agrees


def scaled(result, name, factor):
    """Return the result with one coefficient times a factor, or control or frequency of the threshold."""
    def times(number):
        return replace(number, re=repr(float(number.re) * factor), im=repr(float(number.im) * factor))

    if name in ("control", "frequency"):
        return replace(result, threshold=replace(result.threshold, **{name: repr(float(getattr(result.threshold, name)) * factor)}))
    return replace(result, coefficients=tuple(replace(one, value=times(one.value)) if one.monomial == name else one for one in result.coefficients))


@pytest.mark.parametrize("factor", [1.001, 2.0, -1.0])
@pytest.mark.parametrize("name", ["mu*A", "A**2*conj(A)"])
def test_a_coefficient_wrong_by_a_factor_disagrees_and_what_is_measured_does_not_depend_on_it(name, factor):
    result = result_of("van_der_pol")
    found = validate(text_of("van_der_pol"), derivation_of("van_der_pol").emit(), scaled(result, name, factor))
    assert not found.agrees
    wrong = {"mu*A": "gamma"}.get(name, name)
    assert [check.name for check in found.checks if not check.agrees] == [wrong]
    assert abs(next(check for check in found.checks if check.name == wrong).measured - complex(result[name].value)) < 1e-8


@pytest.mark.parametrize("name", ["control", "frequency"])
def test_a_wrong_threshold_disagrees(name):
    target = local("near_defect")
    assert not validate(text_of(target), derivation_of(target).emit(), scaled(result_of(target), name, 1.001)).agrees


@pytest.mark.parametrize("target", [local("near_defect"), pytest.param(local("beck"), marks=pytest.mark.slow)])
def test_near_a_defective_eigenvalue_the_measurement_goes_where_the_expansion_converges(target):
    """The radius of convergence in mu is 3e-4 of the control here, 2e-5 for the column: what usually suits is far outside."""
    found = validate(text_of(target), derivation_of(target).emit(), result_of(target))
    assert found.agrees and min(check.digits for check in found.checks) >= 8
    assert all(check.difference < max(10 * check.error, 1e-9) for check in found.checks)


@pytest.mark.slow
def test_the_coefficients_of_the_filament_are_measured_to_eight_digits():
    found = validate(text_of("follower_force"), derivation_of("follower_force").emit(), result_of("follower_force"))
    assert found.agrees and min(check.digits for check in found.checks) >= 8


@pytest.mark.parametrize(("state", "mu", "tolerance", "message"), [
    ("whirling", 1.0, 1e-9, "state: found 'whirling'; expected one of base, cycle"),
    ("cycle", -0.1, 1e-9, "expected .A.\\^2 > 0: ask for mu of the other sign"),
    ("cycle", 0.0, 1e-9, "mu: found 0"),
    ("cycle", 0.1, 1.0, "tolerance: found 1"),
    ("cycle", float("nan"), 1e-9, "mu: found nan"),
])
def test_what_cannot_be_solved_is_said(state, mu, tolerance, message):
    with pytest.raises(EvaluationError, match=message):
        solved("van_der_pol", state, mu, tolerance)


def test_the_json_object_is_that_of_the_contract():
    derivation_of("van_der_pol")
    data = solved("van_der_pol", "cycle", 0.1).as_dict()
    assert set(data) == {"state", "mu", "control", "peak", "frequency", "predicted", "exponents", "exponent_error", "stable", "error", "resolution", "seconds"}
    assert isinstance(data["peak"], str) and set(data["predicted"]) == {"peak", "frequency"} and {"re", "im"} <= set(data["exponents"][0])


def test_the_hopf_bifurcation_of_lorenz_on_the_branch_of_the_pitchfork_is_located():
    """Known: r = sigma (sigma + b + 3) / (sigma - b - 1) = 470/19, frequency sqrt(b (sigma + r))."""
    target = local("lorenz_pitch")
    found = [one for one in follow_branch(text_of(target), result_of(target), "branch", 5.0, 30.0, 1e-8) if isinstance(one, Secondary)]
    assert len(found) == 1 and found[0].kind == "complex"
    assert abs(found[0].control - 470 / 19) < 1e-8 * 470 / 19
    assert abs(found[0].frequency - np.sqrt(8 / 3 * (10 + 470 / 19))) < 1e-6


@pytest.mark.parametrize(("name", "state", "low", "high", "tolerance", "control", "kind", "frequency", "where"), [
    ("exchange", "beating", 0.9, 1.05, 1e-8, 1.0, "real", 0.0, "out of plane"), ("exchange", "whirling", 0.9, 1.05, 1e-8, 1.0, "complex", 6.0, ""),
    pytest.param("torus", "cycle", 0.49, 0.51, 1e-4, 0.5, "complex", 0.5, "", marks=pytest.mark.slow),  # extended in space: by collocation in time
])
def test_a_periodic_state_changes_stability_where_it_is_known_to(name, state, low, high, tolerance, control, kind, frequency, where):
    target = local(name)
    found = list(follow_branch(text_of(target), result_of(target), state, low, high, tolerance))
    change = [one for one in found if isinstance(one, Secondary)]
    assert [(one.kind, one.where) for one in change] == [(kind, where)]
    assert abs(change[0].control - control) < 1e-8 and abs(change[0].frequency - frequency) < 1e-7
    assert all(one.stable == ((one.control > control) == (state == "beating")) for one in found if not isinstance(one, Secondary))


def test_a_branch_is_followed_around_its_fold(write_problem):
    """u' = mu u + u^3 - u^5: from the threshold backwards to the fold at mu = -1/4 and on to mu = 1/2."""
    target = write_problem(FOLD)
    states = list(follow_branch(text_of(target), result_of(target), "branch", -0.05, 0.5, 1e-8))
    for one in (one for one in states if not isinstance(one, Secondary)):
        assert abs(one.mu + one.peak**2 - one.peak**4) < 1e-10
        assert one.stable == (one.peak > np.sqrt(0.5))
    fold = [one for one in states if isinstance(one, Secondary)]
    assert len(fold) == 1 and fold[0].kind == "real"


def test_a_transcritical_branch_is_followed_through_the_threshold(write_problem):
    target = write_problem(FOLD.replace("u**3 + u**5", "u**2").replace('name="fold"', 'name="logistic"'))
    states = list(follow_branch(text_of(target), result_of(target), "branch", -0.1, 0.2, 1e-8))
    assert states[0].mu == pytest.approx(-0.1) and states[-1].mu == pytest.approx(0.2) and not any(isinstance(one, Secondary) for one in states)
    assert all(abs(one.peak - abs(one.mu)) < 1e-12 and one.stable == (one.mu > 0) for one in states)


def test_a_field_that_vanishes_on_the_branch_does_not_hold_it_up():
    """The clamped elastica is four quarters: sqrt(P) / 4 = K(k), and its middle moves by 4 k / sqrt(P)."""
    found = solved(local("strut"), "branch", 21.0)
    k = found.peak * np.sqrt(found.control) / 4
    assert abs((4 * ellipk(k**2)) ** 2 - found.control) < 1e-8 * found.control


@pytest.mark.slow
def test_an_orbit_extended_in_space_is_followed_around_its_fold():
    """Found by collocation up to the fold, by harmonic balance around it; the frequency is 2 throughout."""
    target = local("subhopf")
    fold: list[Secondary] = []
    for one in follow_branch(text_of(target), result_of(target), "cycle", -0.2, -0.3, 1e-6):
        if isinstance(one, Secondary):
            fold.append(one)
            continue
        assert abs(one.frequency - 2) < 1e-8 and one.stable == bool(fold)
        if fold:
            break
    assert len(fold) == 1 and abs(fold[0].mu + 0.22478624) < 1e-6 and fold[0].kind == "real"


def test_a_branch_that_turns_before_the_control_asked_for_is_refused(write_problem):
    target = write_problem(FOLD)
    with pytest.raises(EvaluationError, match="turns and leads away from control -0.3"):
        list(follow_branch(text_of(target), result_of(target), "branch", -0.05, -0.3, 1e-6))


FOLD = """
from sympy import Symbol
from derive import Problem, field

t, mu = Symbol("t", real=True), Symbol("mu", real=True)
u = field("u", t)
problem = Problem(name="fold", time=t, control=mu, control_range=(-1, 1), fields=(u,), equations=(u.diff(t) - mu * u - u**3 + u**5,), base_state={u: 0}, normalisation=(u, None))
"""


def test_the_command_prints_one_json_object_and_says_what_is_wrong():
    runner = CliRunner()
    found = runner.invoke(main, ["full", "van_der_pol", "--state", "cycle", "--mu", "0.1", "--json"])
    assert found.exit_code == 0 and json.loads(found.output)["state"] == "cycle"
    assert runner.invoke(main, ["full", "van_der_pol", "--state", "cycle"]).exit_code == 2
    assert runner.invoke(main, ["full", "van_der_pol", "--state", "cycle", "--mu", "-0.1"]).exit_code == 2
    checked = runner.invoke(main, ["validate", "van_der_pol"])
    assert checked.exit_code == 0 and "numbers agree" in checked.output


def test_a_narrow_bump_of_a_coefficient_is_resolved_or_refused():
    """The rows are collocated where their own coefficients are resolved; what polynomials on the whole interval cannot hold is refused."""
    derivation = derive_amplitude_equation(hard_cases.narrow_bump("1/20"))
    found = validate(emit_residual(derivation.problem), derivation.emit(), evaluate(derivation.emit(), digits=15))
    assert found.agrees
    narrow = emit_residual(hard_cases.narrow_bump("1/500"))
    with pytest.raises(EvaluationError, match="320 polynomials on the whole interval do not resolve"):
        solve_state(narrow, result_of("swift_hohenberg", 15), "branch", 0.1)
    with pytest.raises(EvaluationError, match="varies within 3e-05 of the interval"):
        refuse_narrow(derive_amplitude_equation(hard_cases.narrow_bump("1/100000")).emit())
