"""Where the problem is nasty: right digits against an independent value, or a clear refusal."""

import json
from decimal import Decimal
from fractions import Fraction
from functools import cache

import pytest
from click.testing import CliRunner
from conftest import derivation_of
from mpmath import mp
from sympy import Rational, pi

from derive import derive_amplitude_equation, hard_cases
from derive.cli import main
from derive.hard_cases import c, s, t, u, x
from derive.statement import DerivationError, ProblemError
from numerics import EvaluationError, evaluate, evaluate_batch
from tests.normal_form import Flow, normal_form


def emitted(problem):
    return derive_amplitude_equation(problem).emit()


def close(number, true, digits):
    """Tell whether a printed number is right to so many digits of its modulus, and its error bound holds."""
    with mp.workdps(digits + 30):
        difference = abs(mp.mpc(number.re, number.im) - true)
        return difference <= mp.mpf(10) ** -digits * abs(true) and difference <= mp.mpf(number.error)


def agree(first, second, digits):
    """Compare a result with one of more digits by another route: digits and claimed errors."""
    with mp.workdps(second.digits + 10):
        assert abs(mp.mpf(first.threshold.control) - mp.mpf(second.threshold.control)) <= min(mp.mpf(10) ** -digits * abs(mp.mpf(second.threshold.control)), mp.mpf(first.threshold.error))
        for one in first.coefficients:
            other = second[one.monomial].value
            assert close(one.value, mp.mpc(other.re, other.im), digits), one.name


# Characteristic exponents that meet: u_t = r u - (1 + d_ss)^2 u - u^3 on (0, L), r = c + 1. At the threshold sigma^2 = -1 +- sqrt(r) with sqrt(r) = |1 - k^2|, k = pi/L.


@pytest.mark.parametrize("distance", ["1e-1", pytest.param("1e-5", marks=pytest.mark.slow), "1e-15", pytest.param("1e-30", marks=pytest.mark.slow), "0"])
def test_characteristic_exponents_that_meet(distance):
    text = emitted(hard_cases.meeting_exponents(distance))
    for route in ("auto", "chebyshev"):
        result = evaluate(text, digits=20, route=route)
        with mp.workdps(90):
            k = 1 / (1 + mp.mpf(distance) / 2)
            assert abs(mp.mpf(result.threshold.control) - ((1 - k * k) ** 2 - 1)) < mp.mpf("1e-20")
        assert close(result["A**3"].value, -0.75, 20)
        assert close(result["mu*A"].value, 1, 20)
    if distance in ("1e-15", "1e-30", "0"):
        with pytest.raises(EvaluationError, match="0/0.*chebyshev"):
            evaluate(text, digits=20, route="closed")


# Higher instabilities of the filament, and large exponents


@pytest.mark.parametrize("near", [("174.6", "1508"), pytest.param(("402", "4430"), marks=pytest.mark.slow)])
def test_higher_instabilities_of_the_filament(near):
    text = derivation_of("follower_force").emit()
    agree(evaluate(text, digits=16, near=near), evaluate(text, digits=32, route="chebyshev", near=near), 16)


def test_a_start_that_is_no_critical_point_is_refused():
    with pytest.raises(EvaluationError, match="Newton"):
        evaluate(derivation_of("follower_force").emit(), near=("120", "1000"))


@pytest.mark.parametrize("stiffness", ["1/40", pytest.param("1/1000", marks=pytest.mark.slow)])
def test_large_exponents_and_boundary_layers(stiffness):
    text = emitted(hard_cases.boundary_layers(stiffness))
    first, second = evaluate(text, digits=12, route="closed"), evaluate(text, digits=24, route="quadrature")
    agree(first, second, 12)
    agree(evaluate(text, digits=12, route="chebyshev"), second, 12)


# omega -> 0, where the eigenvalue becomes defective: x'' + k x = (c - x^2) x' - x^3, A' = c A/2 - (1/2 - 3 i/(2 omega)) |A|^2 A


@pytest.mark.parametrize("k", ["1", "1e-2", "1e-8", "1e-12"])
def test_slow_oscillation(k):
    text = emitted(hard_cases.slow_oscillation(k))
    result = evaluate(text, digits=20)
    with mp.workdps(50):
        omega = mp.sqrt(mp.mpf(k))
        assert abs(mp.mpf(result.threshold.frequency) - omega) < mp.mpf("1e-20") * omega
        assert close(result["A**2*conj(A)"].value, mp.mpc(-0.5, 3 / (2 * omega)), 20)


@pytest.mark.parametrize("k", ["1e-30", "0", "-1e-12", "-1e-3"])
def test_no_oscillation_is_refused(k):
    with pytest.raises((DerivationError, ProblemError), match="double eigenvalue|stable at the lower end"):
        emitted(hard_cases.slow_oscillation(k))


@pytest.mark.parametrize("unit", [1, 10**6])
def test_a_hopf_bifurcation_near_a_steady_one_is_warned_of(unit):
    """Distances do not depend on units: lambda^2 - c lambda + k = 0 has a double root at c = 2 sqrt(k); |D_l^2 / (2 D_ll D_c)| = sqrt(k), the lower end is at -1."""
    assert not evaluate(emitted(hard_cases.slow_oscillation("1e-2", unit)), digits=12).warnings
    (line,) = (line for line in evaluate(emitted(hard_cases.slow_oscillation("1e-8", unit)), digits=12).warnings if "steady instability" in line)
    assert float(line.split("about ")[1].split()[0]) == pytest.approx(1e-4, rel=0.05)


@pytest.mark.parametrize("command", [["coefficients"], ["coefficients", "--certify"], ["states", "--mu", "1/1000"]])
def test_warnings_go_to_standard_error_and_json_alone_to_standard_output(command, write_problem):
    path = write_problem("""from sympy import Rational, Symbol, symbols
from derive import Problem, field
t, c = symbols("t", real=True), Symbol("c", real=True)
x = field("x", t)
problem = Problem(name="slow", time=t, control=c, control_range=(-1, 1), fields=(x,), base_state={x: 0}, normalisation=(x, None),
                  equations=(x.diff(t, 2) + x / 10**8 - (c - x**2) * x.diff(t) + x**3,))
""")
    name, *options = command
    done = CliRunner().invoke(main, [name, path, *options, "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)
    assert "steady instability is close" in done.stderr and "warning" in done.stderr


def test_a_nearly_defective_steady_eigenvalue_is_right_and_warned_of():
    """lambda^2 + d lambda - c = 0 has a double root at c = -d^2/4; A' = (mu A - A^3)/d."""
    assert not evaluate(emitted(hard_cases.nearly_double("1e-1")), digits=12).warnings
    result = evaluate(emitted(hard_cases.nearly_double("1e-3")), digits=12)
    assert close(result["A**3"].value, -1000, 12)
    (line,) = (line for line in result.warnings if "nearly defective" in line)
    assert float(line.split("about ")[1].split()[0]) == pytest.approx(2.5e-7, rel=0.05)


@pytest.mark.parametrize("d", ["1e-9", "1e-20"])
def test_a_defective_eigenvalue_is_refused(d):
    with pytest.raises((ProblemError, EvaluationError), match="defective|strictly stable"):
        evaluate(emitted(hard_cases.nearly_double(d)), digits=12)


# Resonances


@pytest.mark.parametrize("d", ["1e-1", "1e-4"])
def test_a_nearly_resonant_second_harmonic_is_right_and_warned_of(d):
    result = evaluate(emitted(hard_cases.resonant(d)), digits=20)
    f, one, zero = Fraction(d), Fraction(1), Fraction(0)
    flow = Flow(
        linear=(((zero, one, zero, zero), (-one, zero, zero, zero), (zero, zero, zero, one), (zero, zero, -4 - f * f, -2 * f)),
                ((zero,) * 4, (zero, one, zero, zero), (zero,) * 4, (zero,) * 4), ((zero,) * 4,) * 4),
        quadratic=((1, (0, 2), one), (3, (0, 0), one)), cubic=((1, (0, 0, 0), -one),))
    assert close(result["A**2*conj(A)"].value, normal_form(flow, 0.0, 1.0, 40)[2]["A**2*conj(A)"], 20)
    resonance = [line for line in result.warnings if "harmonic 2" in line]
    assert bool(resonance) == (d == "1e-4")
    if resonance:
        assert 1e-5 < float(resonance[0].split("about ")[1].split()[0]) < 2e-4  # |-d| / |2 i| = 5e-5


def test_a_resonant_second_harmonic_is_refused():
    with pytest.raises(ProblemError, match="2i at c"):
        emitted(hard_cases.resonant(0))


@pytest.mark.parametrize("d", ["1e-1", "1e-5"])
def test_a_nearly_neutral_mean_mode_is_warned_of(d):
    """x'' + x = c x' - x y, y' = (c - d) y + x^2: y_0 = 2 |A|^2/d, y_2 = A^2/(d + 2 i), 2 i A' = -(A y_0 + conj(A) y_2) + ..."""
    result = evaluate(emitted(hard_cases.neutral_mean(d)), digits=20)
    with mp.workdps(50):
        delta = mp.mpf(d)
        assert close(result["A**2*conj(A)"].value, -(2 / delta + 1 / (delta + 2j)) / 2j, 20)
    assert any("harmonic 0" in line for line in result.warnings) == (d == "1e-5")


def test_two_modes_nearly_critical_together():
    near, far = (evaluate(emitted(hard_cases.two_modes(d)), digits=20) for d in ("1e-4", "1e-1"))
    assert close(near["A**2*conj(A)"].value, mp.mpf(-1) / 2, 20)
    assert any("critical together" in line and "-5e-05 + 1.732i" in line for line in near.warnings)
    assert not far.warnings
    with pytest.raises(DerivationError, match="several modes are critical together"):
        emitted(hard_cases.two_modes(0))


def test_a_damped_mode_is_not_nearly_critical_because_it_turns_fast():
    """u_tt + 2 u_t + u_ssss + c u_ss + u^3 = 0, pinned: all modes but the critical one decay at the rate 1, whatever their frequency."""
    fast = emitted(hard_cases.on_interval(u.diff(t, 2) + 2 * u.diff(t) + u.diff(s, 4) + c * u.diff(s, 2) + u**3, pi, (u, u.diff(s, 2)), (0, 3), pi / 2))
    result = evaluate(fast, digits=15)
    assert Decimal(result.threshold.control) == 1 and not result.warnings
    # clamped and pinned on a foundation: the rightmost four of those that decay at the rate 1 are what rounding makes them, here the fastest
    clamped = emitted(hard_cases.on_interval(u.diff(t, 2) + 2 * u.diff(t) + u.diff(s, 4) + c * u.diff(s, 2) + 10 * u + u**3, 1, (u, u.diff(s)), (0, 60), Rational(1, 2), (u, u.diff(s, 2))))
    assert not evaluate(clamped, digits=15).warnings


# Stiff layers and rapid oscillation


@pytest.mark.parametrize(("q", "place", "route"), [(40, Rational(1, 2), "chebyshev"), (200, Rational(9, 10), "closed")])
def test_strong_advection(q, place, route):
    """u_t = u'' - 2 q u' + c u - u^3: exponents q +- i pi, c = q^2 + pi^2, the mode exp(q s) sin(pi s), the adjoint exp(-q s) sin(pi s)."""
    result = evaluate(emitted(hard_cases.strong_advection(q, place)), digits=12, route=route)
    with mp.workdps(60):
        assert abs(mp.mpf(result.threshold.control) - q * q - mp.pi**2) < mp.mpf("1e-12") * q * q
        # -2 int_0^1 exp(2 q (s - place)) sin(pi s)^4 / sin(pi place)^2 ds
        p = mp.mpf(place.p) / place.q
        weight = mp.quad(lambda z: mp.exp(2 * q * (z - p)) * mp.sin(mp.pi * z) ** 4, mp.linspace(0, 1, 33)) / mp.sin(mp.pi * p) ** 2
        assert close(result["A**3"].value, -2 * weight, 12)


@pytest.mark.parametrize("steep", [pytest.param(100, marks=pytest.mark.slow), pytest.param(1000, marks=pytest.mark.slow)])
def test_a_thin_interior_layer_of_a_coefficient(steep):
    """A coefficient that jumps at s = 1/2 within 1/steep: two routes with other nodes agree, and the limit of a jump is near."""
    text = emitted(hard_cases.interior_layer(steep))
    first = evaluate(text, digits=8, route="chebyshev")
    agree(first, evaluate(text, digits=16, route="quadrature"), 8)
    # k_1 cot(k_1/2) + k_2 cot(k_2/2) = 0 with k^2 = c/2 and 3 c/2
    jump = mp.findroot(lambda z: sum(mp.sqrt(z * w) * mp.cot(mp.sqrt(z * w) / 2) for w in (mp.mpf(1) / 2, mp.mpf(3) / 2)), 9.3)
    assert abs(mp.mpf(first.threshold.control) - jump) < 20 / mp.mpf(steep) ** 2


@pytest.mark.parametrize("steep", [pytest.param(30, marks=pytest.mark.slow), pytest.param(1000, marks=pytest.mark.slow)])
def test_a_thin_layer_of_a_coefficient(steep):
    """A coefficient with a layer of width 1/steep at the wall: two routes with other nodes agree."""
    text = emitted(hard_cases.wall_layer(steep))
    agree(evaluate(text, digits=8, route="chebyshev"), evaluate(text, digits=16, route="quadrature"), 8)


@pytest.mark.parametrize("width", ["1/100", pytest.param("1/1000", marks=pytest.mark.slow), pytest.param("1/100000", marks=pytest.mark.slow)])
def test_a_narrow_bump_of_a_coefficient_is_not_stepped_over(width):
    text, width = emitted(hard_cases.narrow_bump(width)), Rational(width)
    result = evaluate(text, digits=12)
    first = float(pi**2) * (1 - 1.5 * float(pi) ** 0.5 * float(width))
    assert abs(float(result.threshold.control) - first) < 60 * float(width) ** 2
    assert abs(complex(result["mu*A"].value) - float(pi**2) / first) < 60 * float(width) ** 2
    if width == Rational(1, 100):
        assert abs(float(evaluate_batch(text).control) - float(result.threshold.control)) < 1e-11
    elif width == Rational(1, 100000):
        with pytest.raises(EvaluationError, match="double precision does not resolve"):
            evaluate_batch(text)


@pytest.mark.slow
def test_a_narrow_bump_is_certified():
    text = emitted(hard_cases.narrow_bump("1/100"))
    agree(evaluate(text, digits=12, certify=True, count=False), evaluate(text, digits=20), 12)


@pytest.mark.slow
@pytest.mark.parametrize("route", ["closed", "chebyshev", "quadrature"])
def test_a_rapidly_oscillating_mode(route):
    """u_t = (c + 1) u - (1 + d_ss/144)^2 u - u^3 on (0, pi): sin(12 s), threshold -1, A^3 coefficient -3/4."""
    text = rapid()
    if route == "closed":
        with pytest.raises(EvaluationError, match="coincide"):  # sigma^2 = -144 twice
            evaluate(text, digits=16, route=route)
        return
    result = evaluate(text, digits=16, route=route)
    assert Decimal(result.threshold.control) == -1
    assert close(result["A**3"].value, mp.mpf(-3) / 4, 16)


@cache
def rapid():
    return emitted(hard_cases.rapid_mode())


# Parameters of any size


@pytest.mark.parametrize("size", ["1e-12", "1e12"])
@pytest.mark.parametrize("route", ["closed", "chebyshev"])
def test_parameters_of_any_size(size, route):
    """u_t = D u'' + c u - u^3/D on (0, 1): threshold D pi^2, A^3 coefficient -3/(4 D)."""
    result = evaluate(emitted(hard_cases.scaled(size)), digits=17, route=route)
    with mp.workdps(40):
        assert abs(mp.mpf(result.threshold.control) - mp.mpf(size) * mp.pi**2) < mp.mpf("1e-16") * mp.mpf(size)
        assert close(result["A**3"].value, -3 / (4 * mp.mpf(size)), 17)


def test_a_tiny_threshold_is_not_zero():
    """x' = (c/h - 1/4) x - x^3 with h = 1e-12: the threshold 2.5e-13 is far below 10^-5 and still has five digits."""
    result = evaluate(emitted(hard_cases.ordinary((x.diff(t) - (c * 10**12 - Rational(1, 4)) * x + x**3,), {x: 0})), digits=5)
    assert abs(Decimal(result.threshold.control) - Decimal("2.5e-13")) < Decimal("1e-18")


@pytest.mark.parametrize("digits", [5, 16, 17, 300])
def test_any_number_of_digits(digits):
    text = derivation_of("follower_force").emit()
    agree(evaluate(text, digits=digits), evaluate(text, digits=min(2 * digits, digits + 60), route="closed" if digits == 300 else "chebyshev"), digits)


@pytest.mark.slow
@pytest.mark.parametrize("digits", [1000, 3000])
def test_thousands_of_digits(digits):
    text = derivation_of("follower_force").emit()
    agree(evaluate(text, digits=digits), evaluate(text, digits=digits + 50), digits)
