"""Double precision: each entry against another derivation with those values and 25 digits by another route; what is refused, and the counts."""

import re
from dataclasses import replace
from functools import cache
from random import Random

import numpy as np
import pytest
from conftest import PROBLEMS, derivation_of
from sympy import Rational

from derive import derive_amplitude_equation, load_problem
from numerics import EvaluationError, evaluate, evaluate_batch
from numerics.batch import ROOTS_CHUNK, VALUES_CHUNK, Evaluator, computed, evaluator_of
from numerics.doubles import rules_of
from numerics.tape import NotRecorded, Recorded, Tape


def path_of(name):
    return str(PROBLEMS / f"{name}.py")


def emitted(name):
    return derivation_of(path_of(name) if (PROBLEMS / f"{name}.py").exists() else name).emit()


@cache
def at_values(name, **values):
    """Return the result of the problem stated with other values, derived anew."""
    problem = load_problem(path_of(name))
    symbols = {symbol.name: symbol for symbol in problem.parameters}
    return evaluate(derive_amplitude_equation(replace(problem, parameters={**problem.parameters, **{symbols[key]: value for key, value in values.items()}})).emit(), digits=25)


def assert_entry_holds(batch, place, result, loosest=1e-12):
    """Compare one entry: the claimed error bounds the true one, and neither is large."""
    assert batch.reason[place] == ""
    control = float(result.threshold.control)
    assert abs(batch.control[place] - control) <= batch.control_error[place] + 2e-16 * abs(control)
    assert batch.control_error[place] <= loosest * (1 + abs(control))
    if batch.frequency is not None:
        frequency = float(result.threshold.frequency)
        assert abs(batch.frequency[place] - frequency) <= batch.frequency_error[place] + 2e-16 * frequency
    for one in result.coefficients:
        true, found, error = complex(one.value), batch[one.monomial][place], batch.errors[one.name][place]
        assert abs(found - true) <= error + 2e-16 * abs(true), one.name
        assert abs(found - true) <= loosest * max(abs(true), 1e-3), one.name
        assert error <= 20 * loosest * max(abs(true), 1), one.name


@pytest.mark.parametrize("name", ["follower_force", "van_der_pol", "beck", "lorenz_hopf", "weak_iso", "robin", "vec_quadratic", *(pytest.param(name, marks=pytest.mark.slow) for name in (
    "varcoef", "sixth", "weak_scalar", "follower_force_planar", "swift_hohenberg", "tipmass", "brus_pde", "pipe", "ff_weak", "fisher", "layer", "ff_gravity"))])
def test_nominal_values_agree_with_25_digits(name):
    text = emitted(name)
    assert_entry_holds(evaluate_batch(text), (), evaluate(text, digits=25))


@pytest.mark.parametrize(("name", "boxes"), [
    pytest.param("ff_drag", {"delta": (0, 60), "kappa": (44, 72)}, marks=pytest.mark.slow),
    pytest.param("brus_pde", {"D_x": (2, 6)}, marks=pytest.mark.slow),
    ("lorenz_hopf", {"sigma": (560, 720), "beta": (100, 200)}),
])
def test_entries_agree_with_problems_stated_with_those_values(name, boxes):
    chooser = Random(11)
    values = [{key: Rational(chooser.randint(*box), 64) for key, box in boxes.items()} for _ in range(3)]
    batch = evaluate_batch(emitted(name), {key: np.array([float(one[key]) for one in values]) for key in boxes})
    for place, one in enumerate(values):
        assert_entry_holds(batch, place, at_values(name, **one))


def test_the_shape_of_the_result_is_that_of_the_broadcast_parameters():
    batch = evaluate_batch(emitted("lorenz_hopf"), {"sigma": np.linspace(9, 11, 3)[:, None], "beta": np.linspace(2.5, 2.9, 4)})
    assert batch.control.shape == batch["mu*A"].shape == batch.reason.shape == batch.errors["mu*A"].shape == (3, 4)
    assert (batch.reason == "").all()
    # Hopf of the Lorenz equations at r = sigma (sigma + b + 3)/(sigma - b - 1), omega^2 = b (r + sigma)
    sg, b = batch.parameters["sigma"], batch.parameters["beta"]
    exact = sg * (sg + b + 3) / (sg - b - 1)
    assert np.allclose(batch.control, exact, rtol=1e-13)
    assert np.allclose(batch.frequency**2, b * (exact + sg), rtol=1e-12)


def test_many_entries_are_those_computed_one_by_one():
    text = emitted("ff_drag")
    kappa = np.linspace(0.7, 1.1, 300)
    batch = evaluate_batch(text, {"kappa": kappa})
    assert (batch.reason == "").all()
    for place in (0, 137, 299):
        alone = evaluate_batch(text, {"kappa": kappa[place]})
        for name in batch.coefficients:
            assert abs(batch[name][place] - alone[name]) <= batch.errors[name][place] + alone.errors[name]


@pytest.mark.parametrize(("name", "parameters", "words"), [
    ("ff_drag", {"kappa": np.array([0.9, np.nan])}, "not finite"),
    ("ff_drag", {"kappa": np.array([0.9, 0.05])}, "threshold"),  # the frequency goes to zero at kappa = 0.38, and with it the bifurcation
    ("lorenz_hopf", {"sigma": np.array([10.0, 1.0])}, "threshold"),  # no Hopf bifurcation where sigma < b + 1
])
def test_where_there_is_none_the_entry_is_nan_with_a_reason(name, parameters, words):
    batch = evaluate_batch(emitted(name), parameters)
    assert batch.reason[0] == "" and words in batch.reason[1]
    assert np.isfinite(batch.control[0])
    assert np.isnan(batch.control[1]) and all(np.isnan(one[1]) for one in batch.coefficients.values()) and all(np.isnan(one[1]) for one in batch.errors.values())


@pytest.mark.parametrize(("parameters", "words"), [
    ({"nu": 1.0}, "found 'nu'; expected delta, kappa"),
    ({"delta": "x"}, "expected real numbers"),
    ({"delta": 1j}, "expected real numbers"),
])
def test_a_wrong_parameter_is_refused_by_name(parameters, words):
    with pytest.raises(EvaluationError, match=words):
        evaluate_batch(emitted("ff_drag"), parameters)


def test_rules_integrate_and_read_polynomials_exactly():
    rules = rules_of(12)
    for power in range(12):
        values = rules.nodes**power
        assert np.allclose((values[:, None, :] @ rules.integrate)[:, 0], (rules.nodes ** (power + 1) - (-1) ** (power + 1)) / (power + 1), atol=2e-15)
    assert np.allclose((rules.nodes**22 * rules.weights).sum(axis=1), 2 / 23, rtol=1e-14)


def spread_values(count):
    """Parameter values that fill a rectangle without a pattern."""
    k = np.arange(1, count + 1)
    return {"kappa": 0.7 + 0.4 * (0.6180339887498949 * k % 1), "delta": 0.9 * (0.7548776662466927 * k % 1)}


def test_costs_of_one_evaluation_of_the_filament():
    """From the root that chose the resolution one residual confirms the threshold; one critical problem gives mode and adjoint mode, one tape all coefficients."""
    text = emitted("follower_force")
    evaluate_batch(text)
    explicit = evaluator_of(text).explicit
    explicit.counts.clear()
    evaluate_batch(text)
    assert explicit.counts == {"residuals": 1, "kernels": 1, "tapes": 1}
    assert explicit.tape.products <= 36 and explicit.tape.buffers <= 12 and len(explicit.tape.used) == 7


def test_costs_of_many_entries():
    """About three residuals a piece of the batch, leaders and continuation included less than twice that."""
    text = emitted("ff_drag")
    evaluate_batch(text, spread_values(8))
    explicit = evaluator_of(text).explicit
    explicit.counts.clear()
    evaluate_batch(text, spread_values(4096))
    pieces = 4096 / ROOTS_CHUNK
    assert explicit.counts["residuals"] <= 4 * pieces + 40
    assert explicit.counts["kernels"] <= 4096 / VALUES_CHUNK + 1


@pytest.mark.parametrize("count", [1, 3, 700])
@pytest.mark.parametrize("name", ["ff_drag", "beck"])
def test_recorded_problems_agree_with_the_general_route(name, count):
    """The general route shares neither the tape nor the adjoint mode: it runs the emitted text, and solves the emitted adjoint problem; claims bound the differences."""
    text = emitted(name)
    fast, general = Evaluator(text), Evaluator(text)
    assert fast.explicit is not None
    general.explicit = None
    points = np.repeat(fast.nominal_point, count, axis=0)
    for name, values in spread_values(count).items():
        if name in fast.names:
            points[:, list(fast.names).index(name)] = values
    with np.errstate(all="ignore"):
        one, other = computed(fast, points, (count,)), computed(general, points, (count,))
    assert (one.reason == "").all() and (other.reason == "").all()
    assert (np.abs(one.control - other.control) <= one.control_error + other.control_error).all()
    for key in one.coefficients:
        apart = np.abs(one[key] - other[key])
        assert (apart <= one.errors[key] + other.errors[key]).all()
        assert (apart <= 1e-12 * np.abs(other[key])).all() and (one.errors[key] <= 2e-11 * np.abs(other[key])).all()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "boxes"), [("ff_drag", {"delta": (0, 0.95), "kappa": (0.7, 1.1)}), ("ff_drag", {"delta": (0, 3), "kappa": (0.45, 1.5)})])
def test_claims_of_ten_thousand_entries_bound_the_difference_from_twenty_digits(name, boxes):
    """Random values; of these the worst conditioned and some others are computed with 20 digits in closed form from the text with those values."""
    text, rng = emitted(name), np.random.default_rng(3)
    values = {key: rng.uniform(*box, 10_000) for key, box in boxes.items()}
    batch = evaluate_batch(text, values)
    good = np.flatnonzero(batch.reason == "")
    assert good.size > 5_000
    worst = good[np.argsort(max(batch.errors.values(), key=lambda one: np.nanmax(one))[good])[-10:]]
    for place in (*worst, *rng.choice(good, 20)):
        stated = text
        for key, one in values.items():
            numerator, denominator = float(one[place]).as_integer_ratio()
            stated = re.sub(rf'"{key}": a\.[^\n]*,\n', f'"{key}": a.rational({numerator}, {denominator}),\n', stated)
        stated = re.sub(r"ONSET = .*", f'ONSET = ("{batch.control[place]:.9g}", "{batch.frequency[place]:.9g}")', stated)
        assert_entry_holds(batch, place, evaluate(stated, digits=20))


def test_a_tape_keeps_one_product_of_each_kind_and_folds_constants():
    tape = Tape((0.0, 1.0))
    x = Recorded(tape, 1, None, tape.place("mode", "mode", 0))
    y = Recorded(tape, 1, None, tape.place("mode", "mode", 1))
    first, second = (2j * x * y + y * x, tape.control * (x + y) - tape.control * x)
    assert first.factor == 1 + 2j and first.function == (y * x).function and first.number is None
    run = tape.compiled([tape.integral(first), tape.right(x * y), tape.integral(second)], ())
    assert run.products == 1
    u, v = np.full((1, 3, 2), 2 + 0j), np.full((1, 3, 2), 3j)
    tables = {"integral": np.full((1, 1, 3), 1 / 3)}
    found = run.run(np.full((1, 1, 2), 5 + 0j), None, (), {"mode": [u, v]}, {"mode": [[None, 7.0], [None, 11.0]]}, tables, np.empty((run.buffers, 1, 3, 2), dtype=complex))
    assert np.allclose(found[0], (1 + 2j) * 6j) and found[1] == 77.0 and np.allclose(found[2], 5 * 3j)
    for refused in (lambda: tape.solve(None, None), lambda: tape.s, lambda: tape.exp(x), lambda: tape.integral(1)):
        with pytest.raises(NotRecorded):
            refused()


HELD = """
from sympy import *
from derive import Problem, field
t = symbols("t", real=True)
a, b, omega, zero, m, k = symbols("a b omega zero m k")
x = field("x", t)
problem = Problem(name="held", time=t, control=m, control_range=(-1, 1), fields=(x,), equations=(x.diff(t) - m * x + (a - b) * x**2 + k * omega * x**3 + zero * x**4,),
                  base_state={x: 0}, parameters={a: 2, b: 2, omega: 3, k: 1, zero: 0}, normalisation=(x, None))
"""


def test_names_are_the_users_and_what_the_text_does_not_hold_is_refused(write_problem):
    text = derive_amplitude_equation(load_problem(write_problem(HELD))).emit()
    batch = evaluate_batch(text, {"omega": np.array([3.0, 5.0]), "k": 2.0})
    assert np.allclose(batch["A**3"], [-6, -10], rtol=1e-14) and batch["A**3"].dtype == float
    for name in ("a", "b"):  # (a - b) x^2 vanishes at the nominal values and is left out of the emitted text
        with pytest.raises(EvaluationError, match=f"holds at the nominal value of {name} only"):
            evaluate_batch(text, {name: 1.0})
    with pytest.raises(EvaluationError, match="zero is 0 in the problem"):
        evaluate_batch(text, {"zero": 1.0})


OVERTAKEN = """
from sympy import *
from derive import Problem, field
t = symbols("t", real=True)
m, a = symbols("m a")
x, y, u, v = (field(name, t) for name in "xyuv")
problem = Problem(name="overtaken", time=t, control=m, control_range=(-2, 2), fields=(x, y, u, v), parameters={a: Rational(1, 2)}, base_state={x: 0, y: 0, u: 0, v: 0}, normalisation=(x, None),
                  equations=(x.diff(t) - m * x + FREQUENCY * y + x**3 + x * u, y.diff(t) - m * y - FREQUENCY * x + y**3, u.diff(t) - (m - a) * u + 2 * FREQUENCY * v + u**3, v.diff(t) - (m - a) * v - 2 * FREQUENCY * u))
"""


@pytest.mark.parametrize("problem", [OVERTAKEN.replace("FREQUENCY", "1"),
                                     OVERTAKEN.replace("FREQUENCY", "0").replace("- m * y", "+ y").replace("- (m - a) * v", "+ v")])
@pytest.mark.parametrize("count", [2, 200])
def test_a_mode_that_is_overtaken_is_not_the_first_instability(write_problem, problem, count):
    """The other mode is critical at m = a: first where a < 0."""
    text = derive_amplitude_equation(load_problem(write_problem(problem))).emit()
    a = np.linspace(0.5, -0.5, count)
    batch = evaluate_batch(text, {"a": a})
    assert all((why == "") == (value > 0) for why, value in zip(batch.reason, a, strict=True))
    assert "first instability" in batch.reason[-1]
