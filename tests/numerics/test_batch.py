"""Double precision: each entry against another derivation with those values and 25 digits by another route; what is refused, and the counts."""

from dataclasses import replace
from functools import cache
from random import Random

import numpy as np
import pytest
from conftest import PROBLEMS, derivation_of
from sympy import Rational

from derive import derive_amplitude_equation, load_problem
from numerics import EvaluationError, evaluate, evaluate_batch
from numerics.batch import evaluator_of
from numerics.doubles import Doubles, rules_of


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


@pytest.mark.parametrize("name", ["follower_force", "follower_force_planar", "swift_hohenberg", "van_der_pol", "varcoef", "ff_gravity", "beck", "tipmass", "brus_pde", "lorenz_hopf", "sixth", "pipe",
                                  "weak_iso", "weak_scalar", "ff_weak", "fisher", "robin", "layer"])
def test_nominal_values_agree_with_25_digits(name):
    text = emitted(name)
    assert_entry_holds(evaluate_batch(text), (), evaluate(text, digits=25))


@pytest.mark.parametrize(("name", "boxes"), [
    ("ff_drag", {"delta": (0, 60), "kappa": (44, 72)}),
    ("brus_pde", {"Dx": (2, 6)}),
    ("lorenz_hopf", {"sg": (500, 900), "b": (100, 200)}),
])
def test_entries_agree_with_problems_stated_with_those_values(name, boxes):
    chooser = Random(11)
    values = [{key: Rational(chooser.randint(*box), 64) for key, box in boxes.items()} for _ in range(4)]
    batch = evaluate_batch(emitted(name), {key: np.array([float(one[key]) for one in values]) for key in boxes})
    for place, one in enumerate(values):
        assert_entry_holds(batch, place, at_values(name, **one))
