"""Published values, second formulations, unrelated routes."""

from decimal import Decimal, getcontext

import pytest
from conftest import result_of

from derive.problem import bundled_names
from numerics.comparison import compare, reference_of

getcontext().prec = 200


@pytest.mark.parametrize("name", bundled_names())
def test_computed_values_agree_with_every_published_digit(name):
    comparison = compare(result_of(name), reference_of(name))
    assert comparison.lines
    assert [line.name for line in comparison.lines if not line.agrees] == []


def test_a_changed_digit_is_a_disagreement():
    reference = reference_of("follower_force")
    reference["value"][2]["printed_re"] = "-451.039"
    assert not compare(result_of("follower_force"), reference).agrees


def close(a, b, digits):
    return abs(Decimal(a) - Decimal(b)) <= abs(Decimal(a)) * Decimal(10) ** -digits


def test_the_planar_formulation_gives_alpha_plus_beta_to_50_digits():
    vector, planar = result_of("follower_force", 50), result_of("follower_force_planar", 50)
    assert close(vector.threshold.control, planar.threshold.control, 50)
    assert close(vector.threshold.frequency, planar.threshold.frequency, 50)
    for part in ("re", "im"):
        total = Decimal(getattr(vector["alpha"].value, part)) + Decimal(getattr(vector["beta"].value, part))
        assert abs(total - Decimal(getattr(planar["alpha_plus_beta"].value, part))) < Decimal("1e-46")
        assert close(getattr(vector["gamma"].value, part), getattr(planar["gamma"].value, part), 49)


@pytest.mark.parametrize("route", ["chebyshev", "quadrature"])
def test_unrelated_routes_agree(route):
    closed, other = result_of("follower_force", 30, "closed"), result_of("follower_force", 30, route)
    assert close(closed.threshold.control, other.threshold.control, 30)
    for one in closed.coefficients:
        for part in ("re", "im"):
            assert close(getattr(one.value, part), getattr(other[one.name].value, part), 29)


def test_claimed_errors_hold_against_more_digits():
    reference = result_of("follower_force", 120, "closed")
    for digits in (5, 16, 17, 60):
        result = result_of("follower_force", digits, "closed")
        for one in result.coefficients:
            for part in ("re", "im"):
                difference = abs(Decimal(getattr(one.value, part)) - Decimal(getattr(reference[one.name].value, part)))
                assert difference <= Decimal(one.error)
