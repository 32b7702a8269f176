"""Amplitude equation of swift_hohenberg. Emitted by `fredholm derive`; do not edit."""

from numerics.algebra import Operator, stage

NAME = "swift_hohenberg"
KIND = "steady"
MULTIPLICITY = 1
SPATIAL = True
CONTROL = "r"
CONTROL_RANGE = ("-1.0", "1.0")
ONSET = ("0", None)
NEIGHBOUR = "-9.0e+00"  # the growth rate of the next mode there, roughly
COEFFICIENTS = (
    ("A**3", "A**3", "coefficient_A3"),
    ("mu*A", "mu*A", "coefficient_mu_A"),
)
QUADRATIC = ("A**2", "A**2", "coefficient_A2")
ODD = True  # a symmetry of the equations changes the sign of A
MIRROR = (
)
PENCILS = ((0, "pencil_0"),)
WEAK = ()


def interval(a):
    """Return the ends of the interval."""
    return (0, a.pi)


def parameters(a):
    """Return the values of the parameters."""
    return {
    }


@stage
def critical(a):
    """The linear problem at the threshold: y' = P y with its boundary rows."""
    r = a.control
    return Operator(
        matrix=(
            (0, 1, 0, 0),
            (0, 0, 1, 0),
            (0, 0, 0, 1),
            (r - 1, 0, -2, 0),
        ),
        left=(
            (1, 0, 0, 0),
            (0, 0, 1, 0),
        ),
        right=(
            (1, 0, 0, 0),
            (0, 0, 1, 0),
        ),
    )


@stage
def mode(a):
    """The critical mode: phi, phi_1, phi_2, phi_3."""
    return a.kernel(critical(a), (1, 0, 0, 0), a.pi/2)


@stage
def mode_bar(a):
    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""
    return tuple(a.reflect(one) for one in mode(a))


@stage
def adjoint(a):
    """The adjoint problem: z' = -P^T z with the adjoint boundary rows."""
    r = a.control
    return Operator(
        matrix=(
            (0, 0, 0, 1 - r),
            (-1, 0, 0, 0),
            (0, -1, 0, 2),
            (0, 0, -1, 0),
        ),
        left=(
            (0, 1, 0, 0),
            (0, 0, 0, 1),
        ),
        right=(
            (0, 1, 0, 0),
            (0, 0, 0, 1),
        ),
    )


@stage
def adjoint_mode(a):
    """The adjoint mode: zeta_3, zeta_2, zeta_1, zeta."""
    return a.kernel(adjoint(a))


def pencil_0(a, lam):
    """The linear problem of weight 0 at the growth rate lam."""
    r = a.control
    return Operator(
        matrix=(
            (0, 1, 0, 0),
            (0, 0, 1, 0),
            (0, 0, 0, 1),
            (-lam + r - 1, 0, -2, 0),
        ),
        left=(
            (1, 0, 0, 0),
            (0, 0, 1, 0),
        ),
        right=(
            (1, 0, 0, 0),
            (0, 0, 1, 0),
        ),
    )


def divisors_0(a, lam):
    """What was divided by: eigenvalues where one of these vanishes may be missing from `pencil_0`."""
    return ()


@stage
def f_cubic_0(a):
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
    return phi**3


@stage
def xi(a):
    """Solvability integral of dA/dt."""
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(phi*zeta)
    return total


@stage
def coefficient_A3(a):
    """Solvability integral of A**3, over -xi."""
    _zeta_3, _zeta_2, _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(f_cubic_0(a)*zeta)
    return -total/xi(a)


@stage
def coefficient_mu_A(a):
    """Solvability integral of mu*A, over -xi."""
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(-phi*zeta)
    return -total/xi(a)


@stage
def coefficient_A2(a):
    """Solvability integral of A**2, over -xi."""
    total = a.zero
    return -total/xi(a)


AMPLITUDES = ("A",)
UNKNOWNS = (
    ("u", ""),
)
NORMALISED = "u"


@stage
def base(a):
    """The base state, unknown by unknown."""
    return (
        0,
    )


@stage
def fields_mode(a):
    """The mode: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
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
