"""What vanishes identically and what is only small."""

import pytest
from sympy import Rational, cos, exp, sin, sqrt, symbols

from derive.expand import cancel, coefficients_in, expand
from derive.zero import Probe

a, b, s, c = symbols("a b s c", real=True)
probe = Probe(fixed={a: Rational(1, 3), b: Rational(0)}, ranges={s: (Rational(0), Rational(1)), c: (Rational(0), Rational(5))})
bump = exp(-((1000 * (s - Rational(1, 3))) ** 2))


@pytest.mark.parametrize("expression", [
    sin(s) ** 2 + cos(s) ** 2 - 1, (sin(s) ** 2 + cos(s) ** 2 - 1) * bump, bump * s - s * bump, b * s, b**2, (sqrt(2) + 1) * (sqrt(2) - 1) - 1,
    bump * (exp(s) - exp(s / 2) ** 2) + 0 * s, exp(-(10**6)) * (sin(2 * s) - 2 * sin(s) * cos(s))])
def test_what_vanishes(expression):
    assert probe.is_zero(expression)


@pytest.mark.parametrize("expression", [bump, c * bump, bump - bump**2, bump * (s - a), exp(-(10**6)), bump + exp(-((900 * s) ** 2)), exp(-(10**5)) * sin(s), a * s + b])
def test_what_is_only_small(expression):
    assert not probe.is_zero(expression)


def test_arguments_of_functions_stay_as_they_are_written():
    assert expand(c * (1 + bump)) == c + c * bump
    assert cancel((s**2 - 1) * bump / (s - 1)) == s * bump + bump
    assert coefficients_in(c**2 * bump + 3 * c, c) == [0, 3, bump]
    assert not probe.may_vanish(bump * (1 + s)) and probe.may_vanish(bump * (s - Rational(1, 2)))
