"""Displays of sections V and appendix B, typed once from the paper, against what the program derives.

Here phi is the paper's varphi (critical mode), psi its phi (adjoint eigenfunction); a bar is a conjugate.
"""

import pytest
from conftest import derivation_of
from flint import acb, arb

from numerics.algebra import Operator
from numerics.closed import Closed
from numerics.coefficients import Module, Resolution, builder
from numerics.precision import working_precision
from numerics.threshold import Level, newton

BITS = 256
TINY = 1e-50


@pytest.fixture(scope="module")
def filament():
    """The emitted module on the closed algebra at the threshold, with 256 bits."""
    module = Module(derivation_of("follower_force").emit())
    build = builder(module, "closed", Resolution(nodes=0, breaks=()), BITS)
    with working_precision(BITS):
        levels = [Level(goal=bits, bits=bits + 32, build=build) for bits in (60, 110, BITS)]
        root = newton(levels, module.critical, (arb(module.ONSET[0]), arb(module.ONSET[1])), module.width, 40)
        yield module, build(acb(root.control), acb(root.frequency))


class Paper:
    """The functions of the paper."""

    def __init__(self, module, a):
        self.a, self.F, self.iw, self.omega = a, a.control, a.i * a.frequency, a.frequency
        self.phi, self.bar = module.mode(a), module.mode_bar(a)
        # (adjoint eq) and (adjoint bcs): psi'''' + F psi'' - i omega psi = 0; psi' = psi'' = 0 at 0; psi = psi''' + F psi' = 0 at 1
        operator = Operator(
            matrix=((0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (self.iw, 0, -self.F, 0)),
            left=((0, 1, 0, 0), (0, 0, 1, 0)), right=((1, 0, 0, 0), (0, self.F, 0, 1)))
        self.psi = a.kernel(operator, (1, 0, 0, 0), 0)
        self.psi_bar = tuple(a.reflect(one) for one in self.psi)
        self.from_left, self.to_right, self.integral, self.right = a.integral_from_left, a.integral_to_right, a.integral, a.right

    def xi(self):
        return -self.integral(self.psi_bar[1] * self.phi[0])

    def alpha(self):
        """(coefficients integrals a)."""
        p, b, q, F, iw = self.phi, self.bar, self.psi_bar, self.F, self.iw
        one = self.integral(q[1] * b[1] * self.from_left(p[1] * p[1])) - self.integral(q[1] * p[0] * p[1] * b[1])
        braces = (-(p[1] * p[1] * (b[3] + b[1] * F)) + b[1] * (self.right(p[1]) ** 2 * F) + b[1] * (iw / 2 * self.right(p[0]) ** 2)
                  - b[1] * p[0] * p[0] * (iw / 2) + b[1] * self.to_right(self.from_left(p[1] * p[1])) * iw)
        last = self.integral(q[3] * (p[2] * p[1] * b[1] - p[1] * p[1] * b[2] / 2))
        return (iw / 2 * one + self.integral(q[2] * braces) / 2 + last) / self.xi()

    def beta(self):
        """(coefficients integrals b)."""
        p, b, q, F, iw = self.phi, self.bar, self.psi_bar, self.F, self.iw
        one = -iw / 2 * self.integral(q[1] * p[1] * (b[1] * p[0] - p[1] * b[0]))
        square = self.right(p[0]) * self.right(b[0]) - p[0] * b[0] - self.to_right(p[1] * b[0]) * 2
        braces = -(p[1] * b[1] * (p[3] + p[1] * F)) + p[1] * (F * self.right(p[1]) * self.right(b[1])) + p[1] * square * (iw / 2)
        return (one + self.integral(q[2] * braces) + self.integral(q[3] * p[1] * p[1] * b[2])) / self.xi()

    def gamma(self):
        """(coefficients integrals c)."""
        return self.integral(self.psi_bar[1] * self.phi[2]) / self.xi()


def same(one, other):
    return float(abs(one - other).mid()) < TINY * max(1.0, float(abs(other).mid()))


def same_function(a, one, other):
    return all(same(a.function(one).at(a.length * k / 5), a.function(other).at(a.length * k / 5)) for k in range(6))


@pytest.mark.parametrize("name", ["alpha", "beta", "gamma"])
def test_the_quadratures_of_appendix_b(filament, name):
    module, a = filament
    assert isinstance(a, Closed)
    assert same(getattr(Paper(module, a), name)(), module.names[f"coefficient_{name}"](a))


def test_sol_1(filament):
    """(sol 1): the O(epsilon) position, tangent and force along the axis; A.A is A_+ A_-, |A|^2 is (A_+ A*_- + A_- A*_+)/2."""
    module, a = filament
    paper = Paper(module, a)
    p, b, F, iw = paper.phi, paper.bar, paper.F, paper.iw
    r2, F2 = module.response_Ap_Am(a)
    assert same_function(a, r2, paper.from_left(p[1] * p[1]) * (-a.one / 2))
    displayed = (paper.right(p[1]) ** 2 * F + iw / 2 * paper.right(p[0]) ** 2 - p[0] * p[0] * (iw / 2) + paper.to_right(paper.from_left(p[1] * p[1])) * iw) / 2
    assert same_function(a, F2, displayed)
    # A mean term of the display and its conjugate are twice its real part; A_+ A*_- + A_- A*_+ = 2 |A|^2.
    r0, F0 = module.response_Ap_Cm(a)
    assert same_function(a, r0, paper.from_left(p[1] * b[1]) * (-a.one / 2))
    mean = paper.to_right(p[1] * b[0]) * (-iw / 2) + paper.to_right(b[1] * p[0]) * (iw / 2) + F * paper.right(p[1]) * paper.right(b[1])
    assert same_function(a, F0, mean / 2)


def test_secular_forcing_terms(filament):
    """(secular forcing terms): f_(2) and f_(4) of both nonlinear monomials; in circular components n x A is i A_+."""
    module, a = filament
    paper = Paper(module, a)
    p, b, iw = paper.phi, paper.bar, paper.iw
    f2_alpha = b[1] * paper.from_left(p[1] * p[1]) * (iw / 2) - p[0] * p[1] * b[1] * (iw / 2)
    f2_beta = p[1] * (b[1] * p[0] - p[1] * b[0]) * (-iw / 2)
    assert same_function(a, -module.f_alpha_3(a), f2_alpha)
    assert same_function(a, -module.f_beta_3(a), f2_beta)
    f4_alpha = p[2] * p[1] * b[1] - p[1] * p[1] * b[2] / 2
    f4_beta = p[1] * p[1] * b[2]
    assert same_function(a, -module.f_alpha_9(a), f4_alpha * a.i)
    assert same_function(a, -module.f_beta_9(a), f4_beta * a.i)


def test_the_adjoint_eigenfunction_is_that_of_the_paper(filament):
    """(adjoint solutions): the multiplier of the force balance is psi'/(i omega), conjugated: zeta = c psi_bar'."""
    module, a = filament
    paper = Paper(module, a)
    zeta = module.adjoint_mode(a)[3]
    ratio = a.right(zeta) / a.right(paper.psi_bar[1])
    assert same_function(a, zeta, paper.psi_bar[1] * ratio)


def test_specific_solvability_as_printed_is_wrong(filament):
    """The misprint: with the critical mode in the second term gamma is not the printed number, with the adjoint one it is."""
    module, a = filament
    paper = Paper(module, a)
    p, q, b = paper.phi, paper.psi_bar, paper.bar

    def gamma(second):
        # int (f2 q' - n x f3 second'' ) = h1 q'(1), f3 = -n x A phi' chi, h1 = -chi A phi'(1)
        return (-paper.right(p[1]) * paper.right(q[1]) + paper.integral(p[1] * second)) / paper.integral(p[0] * q[1])

    right = module.coefficient_gamma(a)
    assert same(gamma(q[2]), right)
    assert not same(gamma(b[2]), right)
    assert abs(complex(right) - (7.34480 + 5.34285j)) < 1e-5
