"""Certified results: enclosures hold what other routes give with twice the digits; what cannot be proved is refused."""

import json
import threading
from fractions import Fraction

import pytest
from conftest import PROBLEMS, ROOT, derivation_of
from flint import acb, acb_poly, arb

from derive.cli import main
from numerics import evaluate
from numerics.algebra import Operator
from numerics.certified import Plan, algebra_of, enclosures, find_root
from numerics.certified_closed import isolated_roots
from numerics.certified_count import Pencil, Ratio, first_instability, zeros_right_of
from numerics.certified_linear import Unproved, elementary
from numerics.certified_root import Slopes, approach, prove_root, slopes_at
from numerics.certified_series import PowerSeries, TooCoarse
from numerics.coefficients import Module
from numerics.precision import EvaluationError, NotClosed, working_precision

DIGITS = 20
QUICK = ("chafee", "robin", "elastica", "tipmass", "pipe", "fisher", "brusselator_ode", "lorenz_hopf", "scaled_large", "scaled_small", "weak_scalar", "auxiliary")
SLOW = ("cont_ctrl", "ff_weak", "ff_inertia", "snap", "varcoef", "heat_delay", "brus_neumann", "ff_gravity", "sixth", "buckle3d", "basedep", "ks")


def text_of(name):
    """The emitted text of a bundled model or of a problem of the tests."""
    path = ROOT / "generated" / f"{name}.py"
    return path.read_text(encoding="utf-8") if path.is_file() else derivation_of(str(PROBLEMS / f"{name}.py")).emit()


def number(text_re, text_im="0"):
    return acb(arb(text_re), arb(text_im))


def assert_bounds_hold(certified, reference):
    """Each certified number is as near to the reference as its own bound and the reference's estimate say."""
    with working_precision(1200):
        for one in certified.coefficients:
            other = reference[one.monomial]
            distance = abs(number(one.value.re, one.value.im) - number(other.value.re, other.value.im))
            assert distance <= arb(one.error) + arb(other.error), (one, other)
            assert arb(one.error) <= abs(number(other.value.re, other.value.im)) * arb(10) ** -certified.digits
        assert abs(arb(certified.threshold.control) - arb(reference.threshold.control)) <= arb(certified.threshold.error) + arb(reference.threshold.error)


@pytest.mark.parametrize("name", ["follower_force", "swift_hohenberg", "van_der_pol", *QUICK])
def test_certified_bounds_hold_against_twice_the_digits(name):
    text = text_of(name)
    result = evaluate(text, digits=DIGITS, certify=True, count=False)
    assert result.certified
    assert_bounds_hold(result, evaluate(text, digits=2 * DIGITS))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["follower_force_planar", *SLOW])
def test_certified_bounds_hold_against_twice_the_digits_for_heavier_problems(name):
    text = text_of(name)
    assert_bounds_hold(evaluate(text, digits=DIGITS, certify=True, count=False), evaluate(text, digits=2 * DIGITS))


@pytest.mark.parametrize("name", ["follower_force", "tipmass"])
def test_power_series_and_exponentials_overlap_with_the_threshold_as_a_ball(name):
    module = Module(text_of(name))
    found = []
    for plan in (Plan(route="closed"), Plan(route="series")):
        with working_precision(220):
            root = find_root(module, plan, 220)
            found.append((root, enclosures(module, algebra_of(module, plan, acb(root.control), acb(root.frequency))).values))
    (one, values), (other, others) = found
    assert one.control.overlaps(other.control)
    assert one.frequency.overlaps(other.frequency)
    for key, value in values.items():
        assert value.overlaps(others[key]), key
        assert 0 < float(value.rad()) < 1e-35
        assert 0 < float(others[key].rad()) < 1e-35


def test_a_remainder_left_out_is_noticed(monkeypatch):
    text = text_of("chafee")
    reference = evaluate(text, digits=40)
    assert_bounds_hold(evaluate(text, digits=DIGITS, route="chebyshev", certify=True, count=False), reference)
    monkeypatch.setattr(PowerSeries, "within", lambda self, size: acb(0))
    monkeypatch.setattr("numerics.certified.terms_of", lambda bits: 16)
    with pytest.raises(AssertionError):
        assert_bounds_hold(evaluate(text, digits=DIGITS, route="chebyshev", certify=True, count=False), reference)


def test_the_series_of_an_exponential_holds_it_and_is_no_wider_than_its_remainder():
    with working_precision(160):
        a = PowerSeries(ends=(acb(0), acb(1)), breaks=(Fraction(0), Fraction(1, 3), Fraction(1)), terms=40, real=True, control=acb(0), frequency=acb(0), values={})
        growth = 1 + a.s * a.s  # y' = (1 + s^2) y, y(0) = 1
        y, = a.solve(Operator(matrix=((growth,),), left=((1,),), right=()), forcing=(0,), left=(1,), right=())
        true = (acb(4) / 3).exp()
        assert a.right(y).contains(true)
        assert float(a.right(y).rad()) < 1e-25
        assert a.integral(growth * y).contains(true - 1)


def test_the_series_of_a_coefficient_holds_it_between_its_ends():
    """exp(3 s) on (0, 1): from the first number of terms that is taken, the terms left out are in the radius of the constant."""
    taken = 0
    with working_precision(160):
        for terms in range(30, 50):
            a = PowerSeries(ends=(acb(0), acb(1)), breaks=(Fraction(0), Fraction(1)), terms=terms, real=True, control=acb(0), frequency=acb(0), values={})
            try:
                (piece,) = a.exp(3 * a.s).series().pieces
            except TooCoarse:
                continue
            taken += 1
            for x in (-1, -0.7, 0.3, 1):
                assert piece(acb(x)).contains((acb(arb(3) / 2 + arb(x) * 3 / 2)).exp())
    assert 5 < taken < 20


@pytest.mark.parametrize("name", ["tanh", "atan", "asin", "acos", "asinh", "atanh", "sinh", "cosh", "sqrt", "log", "erf", "tan"])
def test_elementary_functions_agree_with_the_principal_values(name):
    z = acb("0.3", "0.1")
    assert elementary(name, z).overlaps(getattr(z, name)())


def test_a_branch_cut_within_a_disc_is_not_taken_for_analytic():
    assert not elementary("sqrt", acb(arb(-1, 0.5), arb(0, 0.5))).is_finite()
    assert not elementary("asin", acb(arb(2, 0.5), arb(0, 0.5))).is_finite()


def test_krawczyk_proves_a_simple_root_and_refuses_a_double_one():
    def simple(control, frequency):
        return (control * control - 2) + acb(0, 1) * (frequency - control)

    with working_precision(300):
        control, frequency = approach(simple, arb("1.4142"), arb("1.4142"), arb(1), 300)
        root = prove_root(simple, slopes_at(simple, control, frequency, arb(1)), control, frequency)
        assert root.control.contains(arb(2).sqrt())
        assert float(root.frequency.rad()) < 1e-80

    def double(control, frequency):
        return (control - 1) ** 2

    with working_precision(200), pytest.raises(Unproved):
        prove_root(double, slopes_at(double, arb(1), None, arb(1)), arb(1), None)


@pytest.mark.parametrize("gap", ["1e-40", "0", "-1e-60"])
def test_krawczyk_does_not_prove_what_its_box_does_not_show(gap):
    """(c - 1)^2 + gap has no root, a double one, or two nearer to each other than Newton's step: none is proved from c = 1 + 1e-25."""
    with working_precision(300):
        def parabola(control, frequency):
            return (control - 1) ** 2 + arb(gap)

        near = arb("1.0000000000000000000000001").mid()
        slopes = Slopes(first=(2 * acb(near - 1),), radii=(arb("1e-10"),), variation=arb("1.0000001e-20"))
        with pytest.raises(Unproved):
            prove_root(parabola, slopes, near, None)


def test_slopes_hold_over_a_box():
    """Derivatives over a box hold those at its corners: exp(3 c) sin(2 w) about (0.4, 0.7)."""
    def surface(control, frequency):
        return (3 * control).exp() * (2 * frequency).sin()

    with working_precision(200):
        slopes = slopes_at(surface, arb("0.4"), arb("0.7"), arb(1))
        box = tuple(radius / 5 for radius in slopes.radii)
        over = slopes.over(box)
        for a in (-1, 1):
            for b in (-1, 1):
                c, w = acb("0.4") + a * box[0], acb("0.7") + b * box[1]
                assert over[0].contains(3 * (3 * c).exp() * (2 * w).sin()) and over[1].contains(2 * (3 * c).exp() * (2 * w).cos())


def test_exponents_are_isolated_or_refused():
    with working_precision(200):
        exact = [acb(k) for k in (1, 2, 5, -3)]
        discs = isolated_roots(acb_poly.from_roots(exact).coeffs())
        assert all(sum(disc.contains(root) for disc in discs) == 1 for root in exact)
        with pytest.raises(NotClosed):
            isolated_roots(acb_poly.from_roots([acb(1), acb(1), acb(2)]).coeffs())


def polynomial_pencil(roots):
    return Pencil(matrix=[[Ratio(acb_poly.from_roots(roots), acb_poly([1]))]], left=[], right=[], length=None, divisors=())


def test_the_winding_number_counts_zeros_right_of_the_line():
    pencil = polynomial_pencil([acb(1, 2), acb(1, -2), acb(-3), acb(0, 1), acb(0, -1)])
    with working_precision(80):
        assert zeros_right_of(pencil, -0.5, 10.0)[0] == 4
        assert zeros_right_of(pencil, 0.5, 10.0)[0] == 2
        assert zeros_right_of(pencil, -4.0, 10.0)[0] == 5


def test_the_filament_loses_stability_first_at_its_threshold():
    result = evaluate(text_of("follower_force"), digits=10, certify=True)
    assert result.first_instability.proved
    assert "first instability proved" in repr(result)
    assert result.as_dict()["first_instability"]["others"] == 0


@pytest.mark.parametrize("name", ["van_der_pol", "brusselator_ode", "chafee", "robin", "elastica"])
def test_the_first_instability_is_proved(name):
    assert evaluate(text_of(name), digits=10, certify=True).first_instability.proved


def test_a_later_crossing_is_not_certified_as_the_first():
    # u_t = u_ss + c sin u on (0, pi) loses stability at c = 1; c = 9 is the third crossing
    text = text_of("chafee").replace('ONSET = ("1", None)', 'ONSET = ("9", None)').replace('CONTROL_RANGE = ("0.0", "3.0")', 'CONTROL_RANGE = ("8.0", "10.0")')
    assert evaluate(text, digits=10).threshold.control.startswith("9.0")
    with pytest.raises(EvaluationError, match="2 other eigenvalues have a real part above .* stability is lost before"):
        evaluate(text, digits=10, certify=True)


def test_what_cannot_be_counted_says_why():
    module = Module(text_of("tipmass"))
    found = first_instability(module, arb(17), arb(5), None)
    assert not found.proved
    assert "do not separate" in str(found)
    assert found.as_dict()["reason"]


def test_a_vanishing_quadratic_coefficient_needs_a_symmetry():
    text = text_of("cont_ctrl")
    assert "ODD = True" in text
    with pytest.raises(EvaluationError, match="A\\*\\*2 vanishes is not proved"):
        evaluate(text.replace("ODD = True", "ODD = False"), digits=10, certify=True, count=False)


@pytest.mark.parametrize(("name", "odd"), [("chafee", True), ("cont_ctrl", True), ("fisher", False), ("robin", False)])
def test_the_symmetry_flag_follows_from_the_rows(name, odd):
    assert f"ODD = {odd}" in text_of(name)


def test_quadrature_has_no_proof():
    with pytest.raises(EvaluationError, match="quadrature, which has no proof"):
        evaluate(text_of("van_der_pol"), digits=10, route="quadrature", certify=True)


def test_a_certified_zero_is_printed_as_zero():
    result = evaluate(text_of("zero_cubic"), digits=15, certify=True, count=False)
    assert result["A**3"].value.re == "0"
    assert result.warnings


def test_two_threads_at_different_precisions_do_not_disturb_each_other():
    text = text_of("follower_force")
    alone = {digits: evaluate(text, digits=digits, certify=True, count=False) for digits in (12, 60)}
    found = {}

    def work(digits):
        found[digits] = evaluate(text, digits=digits, certify=True, count=False)

    threads = [threading.Thread(target=work, args=(digits,)) for digits in (12, 60)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for digits, result in alone.items():
        assert found[digits].coefficients == result.coefficients


def test_the_command_certifies(capsys):
    with pytest.raises(SystemExit) as left:
        main(["coefficients", "van_der_pol", "--certify", "--json"])
    assert left.value.code == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["certified"] is True
    assert printed["first_instability"]["proved"] is True
