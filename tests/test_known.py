"""Normal forms known exactly, each by hand or from a textbook; the source stands beside it."""

from decimal import Decimal

import pytest
from conftest import PROBLEMS, result_of
from sympy import Rational, Symbol, cos, expand, integrate, pi, sin, symbols

from derive import Problem, derive_amplitude_equation, field
from derive.statement import ProblemError
from numerics import EvaluationError, evaluate

PI = Decimal("3.14159265358979323846264338327950288")
ZETA, OMEGA = Decimal("0.001"), Decimal(1000003).sqrt()

KNOWN = {
    # Kuznetsov's formula for the Brusselator with A = 1: -(2 + A^2)/(2 A^2), -(4 - 7 A^2 + 4 A^4)/(6 A^3)
    "brusselator_ode": ("2", {"A**2*conj(A)": ("-1.5", -Decimal(1) / 6), "mu*A": ("0.5", "0")}),
    "brus_neumann": ("2", {"A**2*conj(A)": ("-1.5", -Decimal(1) / 6), "mu*A": ("0.5", "0")}),
    # Lorenz: dA/dt = sigma/(sigma + 1) (mu A - A^3/b)
    "lorenz_pitch": ("1", {"A**3": (-Decimal(15) / 44, "0"), "mu*A": (Decimal(10) / 11, "0")}),
    # u_t = u_ss + c u - u^2 on (0, pi): int sin^3 / int sin^2 = 8/(3 pi)
    "fisher": ("1", {"A**2": (-8 / (3 * PI), "0"), "mu*A": ("1", "0")}),
    "chafee": ("1", {"A**3": ("-0.125", "0"), "mu*A": ("1", "0")}),
    "elastica": (PI**2 / 4, {"A**3": (-(PI**2) / 32, "0"), "mu*A": ("1", "0")}),
    # u = A sin s, u_2 = -A^2 sin(2s)/24
    "ks": ("1", {"A**3": (-Decimal(1) / 48, "0"), "mu*A": ("1", "0")}),
    "fhn_nodiff": ("2", {"A**2*conj(A)": ("-1.125", "1.125"), "mu*A": ("0.5", "-0.5")}),
    # x'' - (m - r.r) x' + x = 0: 2i A' = i m A - i (2 (A.A*) A - (A.A) A*)
    "isotropic_vdp": ("0", {"dot(A,A)*conj(A)": ("0.5", "0"), "dot(A,conj(A))*A": ("-1", "0"), "mu*A": ("0.5", "0")}),
    "weak_iso": ("0", {"dot(A,A)*conj(A)": ("0.5", "0"), "dot(A,conj(A))*A": ("-1", "0"), "mu*A": ("0.5", "0"), "epsilon*dot(A,e1)*e1": ("0", "0.5")}),
    # x'' + x + epsilon K x: 2 i A' = -epsilon K A, with no two entries of K alike
    "weak_full": ("0", {"dot(A,A)*conj(A)": ("0.5", "0"), "dot(A,conj(A))*A": ("-1", "0"), "mu*A": ("0.5", "0"), "epsilon*dot(A,e1)*e1": ("0", "0.5"), "epsilon*dot(A,e2)*e1": ("0", "1"),
                        "epsilon*dot(A,e1)*e2": ("0", "1.5"), "epsilon*dot(A,e2)*e2": ("0", "2.5")}),
    "weak_scalar": ("0", {"A**2*conj(A)": ("-0.5", "0"), "mu*A": ("0.5", "0"), "epsilon*A": ("0", Decimal(1) / 6)}),
    "vec_pitch": ("0", {"dot(A,A)*A": ("-1", "0"), "mu*A": ("1", "0")}),
    "zero_cubic": ("0", {"A**3": ("0", "0"), "mu*A": ("1", "0")}),
    # D = m S/(K + S) at S = S_in; S_1 = -A/Y, and dA/dt = mu A - m K/(K + S_in)^2 A^2/Y: all eigenvalues are small beside those at the lower end
    "slow_washout": ("-5e-7", {"A**2": (-Decimal(7) / 12, "0"), "mu*A": ("1", "0")}),
    # z_0 = 2 |A|^2/zeta, z_2 = A^2/(zeta + 2 i omega): another eigenvalue is a millionth of the frequency from the axis
    "slow_neighbour": ("0", {"A**2*conj(A)": (-Decimal(7) / 600 + 1 / (ZETA**2 + 4 * OMEGA**2), (3 * Decimal("1e-6") + 2 / ZETA + ZETA / (ZETA**2 + 4 * OMEGA**2)) / (2 * OMEGA)), "mu*A": ("0.5", "0")}),
    "auxiliary": ("1", {"A**3": ("-0.75", "0"), "mu*A": ("1", "0")}),
}


@pytest.mark.parametrize("name", sorted(KNOWN))
def test_exact_normal_form(name):
    control, coefficients = KNOWN[name]
    result = result_of(str(PROBLEMS / f"{name}.py"), 20)
    assert abs(Decimal(result.threshold.control) - Decimal(control)) < Decimal("1e-20")
    assert {one.monomial for one in result.coefficients} == set(coefficients)
    for one in result.coefficients:
        re, im = coefficients[one.monomial]
        assert abs(Decimal(one.value.re) - Decimal(re)) < Decimal("1e-20")
        assert abs(Decimal(one.value.im) - Decimal(im)) < Decimal("1e-20")


# one of every kind; the others on demand (-m slow)
QUICK = frozenset("basedep brus_pde buckle3d clash ff_components ff_weakbc lorenz_hopf noninteger pipe tipmass varcoef vec_pitch".split())


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in sorted(path.stem for path in PROBLEMS.glob("*.py"))])
def test_routes_agree_on_every_problem(name):
    """Every route that does not refuse gives the same digits."""
    target = str(PROBLEMS / f"{name}.py")
    chebyshev = result_of(target, 16, "chebyshev")
    for route in ("closed", "quadrature"):
        try:
            other = result_of(target, 16, route)
        except EvaluationError as refusal:
            assert "chebyshev" in str(refusal)
            continue
        for one in chebyshev.coefficients:
            size = max(abs(complex(one.value)), 1e-12)
            assert abs(complex(one.value) - complex(other[one.monomial].value)) <= 1e-14 * size


def test_no_warning_for_others_that_decay_much_faster():
    """u_t = -u_8 + u_4/2 + r u - u^3 with modes sin((n + 1/2) s): the growth rates are 0, -23, -1506, ..., and none is near the first."""
    s, t, r = *symbols("s t", real=True), Symbol("r", real=True)
    u = field("u", s, t)
    odd, even = (u.diff(s, k) for k in (1, 3, 5, 7)), (u, *(u.diff(s, k) for k in (2, 4, 6)))
    result = evaluate(derive_amplitude_equation(Problem(
        name="eighth", space=s, interval=(0, pi), time=t, control=r, control_range=(-1, 4), fields=(u,), equations=(u.diff(t) + u.diff(s, 8) - u.diff(s, 4) / 2 - r * u + u**3,),
        boundary={0: even, pi: tuple(odd)}, base_state={u: 0}, normalisation=(u, pi))).emit(), digits=15)
    assert not result.warnings
    assert abs(Decimal(result.threshold.control) - (Decimal(1) / 256 - Decimal(1) / 32)) < Decimal("1e-15")
    assert abs(Decimal(result["A**3"].value.re) + Decimal("0.75")) < Decimal("1e-14")


@pytest.mark.parametrize("spatial", [False, True])
def test_a_window_of_instability_between_the_places_of_the_scan_is_found(spatial):
    """Growth 3/(1 + X^2) - 1 with X = 3000 (m - 0.2871) is positive in a thousandth of the range, another mode grows at 0.9 only: X = -sqrt(2) is first."""
    s, t, m = *symbols("s t", real=True), Symbol("m", real=True)
    x, y = (field(name, *((s, t) if spatial else (t,))) for name in "xy")
    diffusion = (lambda u: u.diff(s, 2) / pi**2 + u) if spatial else (lambda u: 0)
    rows = (x.diff(t) - diffusion(x) - (m - Rational(9, 10)) * x + x**3, y.diff(t) - diffusion(y) - (3 / (1 + (3000 * (m - Rational(2871, 10000))) ** 2) - 1) * y + y**3)
    inside = {"space": s, "interval": (0, 1), "boundary": {0: (x, y), 1: (x, y)}} if spatial else {}
    result = evaluate(derive_amplitude_equation(Problem(name="window", time=t, control=m, control_range=(0, 1), fields=(x, y), equations=rows, base_state={x: 0, y: 0},
                                                        normalisation=(y, Rational(1, 2) if spatial else None), **inside)).emit(), digits=15)
    root = Decimal(2).sqrt()
    assert abs(Decimal(result.threshold.control) - (Decimal("0.2871") - root / 3000)) < Decimal("1e-15")
    assert abs(Decimal(result["mu*A"].value.re) - 2000 * root) < Decimal("1e-11")
    assert abs(Decimal(result["A**3"].value.re) + (Decimal("0.75") if spatial else 1)) < Decimal("1e-14")


def test_a_redundant_row_with_time_derivatives_is_taken_and_one_that_contradicts_is_not():
    """The sum of two oscillators' rows follows from them; with another cubic term it contradicts the amplitude equation's dA/dt only."""
    t, c = symbols("t", real=True), Symbol("c", real=True)
    x, y = field("x", t), field("y", t)
    rows = (x.diff(t) - c * x + y + x**3 + x**2, y.diff(t) - x - c * y + x * y)

    def result(*more):
        return evaluate(derive_amplitude_equation(Problem(name="sum", time=t, control=c, control_range=(-1, 1), fields=(x, y), equations=(*rows, *more),
                                                          base_state={x: 0, y: 0}, normalisation=(x, None))).emit(), digits=15)

    alone, both = result(), result(rows[0] + 2 * rows[1])
    assert [(one.monomial, one.value) for one in alone.coefficients] == [(one.monomial, one.value) for one in both.coefficients]
    for wrong in (x**3 / 7, c * x, x**2 / 3):
        with pytest.raises((EvaluationError, ProblemError), match="contradict"):
            result(rows[0] + 2 * rows[1] + wrong)


def test_responses_by_direct_integration_meet_coupled_rows():
    """p' = u^2, q' = p, p(0) = 0, q(1) + 3 p(1) = 0: with u = A sin(pi s) e^{i pi t} + c.c. and Q from sin^2, dA/dt = mu A/2 - A |A|^2 int Q sin^2."""
    s, t, c = *symbols("s t", real=True), Symbol("c", real=True)
    u, p, q = (field(name, s, t) for name in "upq")
    derivation = derive_amplitude_equation(Problem(
        name="nested", space=s, interval=(0, 1), time=t, control=c, control_range=(0, 5), fields=(u, p, q),
        equations=(u.diff(t, 2) - c * u.diff(t) - u.diff(s, 2) - u.diff(s, 2, t) / 5 + q * u.diff(t), p.diff(s) - u**2, q.diff(s) - p),
        boundary={0: (u, p), 1: (u, q + 3 * p)}, base_state={u: 0, p: 0, q: 0}, normalisation=(u, Rational(1, 2))))
    Q = s**2 / 4 + (cos(2 * pi * s) - 1) / (8 * pi**2) - Rational(7, 4)
    result = evaluate(derivation.emit(), digits=20)
    for monomial, exact in (("A**2*conj(A)", -integrate(expand(Q * sin(pi * s) ** 2), (s, 0, 1))), ("mu*A", Rational(1, 2))):
        assert abs(Decimal(result[monomial].value.re) - Decimal(str(exact.evalf(30)))) < Decimal("1e-20")
        assert abs(Decimal(result[monomial].value.im)) < Decimal("1e-20")
    assert any(response.explicit is not None for response in derivation.reduction.responses)
