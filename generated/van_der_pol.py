"""Amplitude equation of van_der_pol. Emitted by `fredholm derive`; do not edit."""

from numerics.algebra import Operator, stage

NAME = "van_der_pol"
KIND = "hopf"
MULTIPLICITY = 1
SPATIAL = False
CONTROL = "mu"
CONTROL_RANGE = ("-1.0", "1.0")
ONSET = ("0", "1")
NEIGHBOUR = "0.0e+00"  # the growth rate of the next mode there, roughly
COEFFICIENTS = (
    ("A**2*conj(A)", "A**2*conj(A)", "coefficient_A2_conj_A"),
    ("mu*A", "mu*A", "coefficient_mu_A"),
)
QUADRATIC = None
MIRROR = (
)
PENCILS = ((0, "pencil_0"),)
WEAK = ()


def parameters(a):
    """Return the values of the parameters."""
    return {
    }


@stage
def critical(a):
    """The linear problem at the threshold: M y = 0."""
    omega = a.frequency
    mu = a.control
    return Operator(
        matrix=(
            (-a.i*mu*omega - omega**2 + 1,),
        ),
    )


@stage
def mode(a):
    """The critical mode: phi."""
    return a.kernel(critical(a), (1,))


@stage
def mode_bar(a):
    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""
    return tuple(a.reflect(one) for one in mode(a))


@stage
def adjoint_mode(a):
    """The left null vector: zeta."""
    return a.left_kernel(critical(a))


def pencil_0(a, lam):
    """The linear problem of weight 0 at the growth rate lam."""
    mu = a.control
    return Operator(
        matrix=(
            (lam**2 - lam*mu + 1,),
        ),
    )


def divisors_0(a, lam):
    """What was divided by: eigenvalues where one of these vanishes may be missing from `pencil_0`."""
    return ()


@stage
def operator_2(a):
    """The linear problem of harmonic 2."""
    omega = a.frequency
    mu = a.control
    return Operator(
        matrix=(
            (-2*a.i*mu*omega - 4*omega**2 + 1,),
        ),
    )


@stage
def operator_0(a):
    """The linear problem of harmonic 0."""
    return Operator(
        matrix=(
            (1,),
        ),
    )


@stage
def f_slow_0(a):
    omega = a.frequency
    mu = a.control
    phi, = mode(a)
    return -mu*phi + 2*a.i*omega*phi


@stage
def f_cubic_0(a):
    omega = a.frequency
    phi, = mode(a)
    phi_bar, = mode_bar(a)
    return a.i*omega*phi**2*phi_bar


@stage
def xi(a):
    """Solvability integral of dA/dt."""
    zeta, = adjoint_mode(a)
    total = f_slow_0(a)*zeta
    return total


@stage
def coefficient_A2_conj_A(a):
    """Solvability integral of A**2*conj(A), over -xi."""
    zeta, = adjoint_mode(a)
    total = f_cubic_0(a)*zeta
    return -total/xi(a)


@stage
def coefficient_mu_A(a):
    """Solvability integral of mu*A, over -xi."""
    omega = a.frequency
    phi, = mode(a)
    zeta, = adjoint_mode(a)
    total = -a.i*omega*phi*zeta
    return -total/xi(a)


AMPLITUDES = ("A", "Ac")
UNKNOWNS = (
    ("x", ""),
)
NORMALISED = "x"


@stage
def base(a):
    """The base state, unknown by unknown."""
    return (
        0,
    )


@stage
def fields_mode(a):
    """The mode: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    phi, = mode(a)
    return (
        ((1, 0), 1, {
            0: phi,
        }),
    )


@stage
def fields_responses(a):
    """The responses of second order: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    return ()


def consistency(a):
    """What redundant equations demand at mu A, epsilon A and A**2: each must vanish."""
    return ()


def consistency_cubic(a):
    """What redundant equations demand of the responses and at third order: each must vanish."""
    return ()
