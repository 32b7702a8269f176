"""Amplitude equation of heavy_column. Emitted by `fredholm derive`; do not edit."""

from numerics.algebra import Operator, stage

NAME = "heavy_column"
KIND = "steady"
MULTIPLICITY = 1
SPATIAL = True
CONTROL = "W"
CONTROL_RANGE = ("0.0", "20.0")
ONSET = ("7.8373474", None)
NEIGHBOUR = "-1.9e+01"  # the growth rate of the next mode there, roughly
COEFFICIENTS = (
    ("A**3", "A**3", "coefficient_A3"),
    ("mu*A", "mu*A", "coefficient_mu_A"),
)
QUADRATIC = ("A**2", "A**2", "coefficient_A2")
ODD = True  # a symmetry of the equations changes the sign of A
MIRROR = (
)
PENCILS = ()
WEAK = ()


def interval(a):
    """Return the ends of the interval."""
    return (0, 1)


def parameters(a):
    """Return the values of the parameters."""
    return {
    }


@stage
def critical(a):
    """The linear problem at the threshold: y' = P y with its boundary rows."""
    W = a.control
    s = a.s
    return Operator(
        matrix=(
            (0, 1),
            (W*s - W, 0),
        ),
        left=(
            (1, 0),
        ),
        right=(
            (0, 1),
        ),
    )


@stage
def mode(a):
    """The critical mode: phi, phi_1."""
    return a.kernel(critical(a), (1, 0), 1)


@stage
def mode_bar(a):
    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""
    return tuple(a.reflect(one) for one in mode(a))


@stage
def adjoint(a):
    """The adjoint problem: z' = -P^T z with the adjoint boundary rows."""
    W = a.control
    s = a.s
    return Operator(
        matrix=(
            (0, -W*s + W),
            (-1, 0),
        ),
        left=(
            (0, 1),
        ),
        right=(
            (1, 0),
        ),
    )


@stage
def adjoint_mode(a):
    """The adjoint mode: zeta_1, zeta."""
    return a.kernel(adjoint(a))


@stage
def f_mu_0(a):
    s = a.s
    phi, _phi_1 = mode(a)
    return phi*s - phi


@stage
def f_cubic_0(a):
    W = a.control
    s = a.s
    phi, _phi_1 = mode(a)
    return -W*phi**3*s/6 + W*phi**3/6


@stage
def xi(a):
    """Solvability integral of dA/dt."""
    phi, _phi_1 = mode(a)
    _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(-phi*zeta)
    return total


@stage
def coefficient_A3(a):
    """Solvability integral of A**3, over -xi."""
    _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(-f_cubic_0(a)*zeta)
    return -total/xi(a)


@stage
def coefficient_mu_A(a):
    """Solvability integral of mu*A, over -xi."""
    _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(-f_mu_0(a)*zeta)
    return -total/xi(a)


@stage
def coefficient_A2(a):
    """Solvability integral of A**2, over -xi."""
    total = a.zero
    return -total/xi(a)


AMPLITUDES = ("A",)
UNKNOWNS = (
    ("theta", ""),
)
NORMALISED = "theta"


@stage
def base(a):
    """The base state, unknown by unknown."""
    return (
        0,
    )


@stage
def fields_mode(a):
    """The mode: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    phi, _phi_1 = mode(a)
    return (
        ((1,), 0, {
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
