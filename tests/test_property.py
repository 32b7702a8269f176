"""The standing property test: the digits claimed for random problems are right. Ten thousand: `python -m tests.random_problems --count 10000`."""

import pytest

from tests.random_problems import verdict

CHEAP = [("ordinary", 0), ("ordinary", 1), ("ordinary", 4), ("second_order", 0), ("second_order", 1), ("second_order", 2), ("vector", 0),
         ("constant", 2), ("constant", 3), ("constant", 4), ("polynomial", 3)]
REGRESSIONS = [("ordinary", 22), ("second_order", 1005), ("ordinary", 1067), ("ordinary", 1094), pytest.param("constant", 101, marks=pytest.mark.slow), ("polynomial", 140)]


@pytest.mark.parametrize(("kind", "seed"), CHEAP + REGRESSIONS)
def test_digits_of_random_problems(kind, seed):
    outcome, reason = verdict(seed, kind)
    assert outcome != "wrong", reason


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ordinary", "second_order", "vector", "constant", "polynomial"])
def test_digits_of_hundreds_of_random_problems(kind):
    verdicts = [(seed, *verdict(seed, kind)) for seed in range(100, 160)]
    assert [one for one in verdicts if one[1] == "wrong"] == []


def test_a_wrong_digit_is_found():
    """The comparison itself: one digit changed, or an error bound below the true error, is told."""
    from dataclasses import replace

    from mpmath import mp

    from derive import derive_amplitude_equation
    from numerics import evaluate
    from tests.random_problems import make_case, mistakes, true_values

    case = make_case(1, "vector")
    text = derive_amplitude_equation(case.problem).emit()
    result = evaluate(text, digits=case.digits)
    with mp.workdps(60):
        truth = true_values(case, text, result)
        assert mistakes(result, case, truth) == []
        one = result.coefficients[-1]
        for value in (replace(one.value, re="0.7500001"), replace(one.value, re=one.value.re + "1" if "." in one.value.re else one.value.re + ".0000000000000000000000001", error="1e-90")):
            spoilt = replace(result, coefficients=(*result.coefficients[:-1], replace(one, value=value)))
            assert mistakes(spoilt, case, truth)
