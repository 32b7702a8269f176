"""Normal forms known exactly, each by hand or from a textbook; the source stands beside it."""

from decimal import Decimal

import pytest
from conftest import PROBLEMS, result_of

PI = Decimal("3.14159265358979323846264338327950288")

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
    "weak_scalar": ("0", {"A**2*conj(A)": ("-0.5", "0"), "mu*A": ("0.5", "0"), "epsilon*A": ("0", Decimal(1) / 6)}),
    "vec_pitch": ("0", {"dot(A,A)*A": ("-1", "0"), "mu*A": ("1", "0")}),
    "zero_cubic": ("0", {"A**3": ("0", "0"), "mu*A": ("1", "0")}),
    "aux": ("1", {"A**3": ("-0.75", "0"), "mu*A": ("1", "0")}),
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
    from numerics import EvaluationError

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
