"""Amplitude equation of follower_force_planar. Emitted by `fredholm derive`; do not edit."""

from numerics.algebra import Operator, stage

NAME = "follower_force_planar"
KIND = "hopf"
MULTIPLICITY = 1
SPATIAL = True
CONTROL = "F"
CONTROL_RANGE = ("0.0", "60.0")
ONSET = ("37.695431", "191.259")
NEIGHBOUR = "-2.1e+03"  # the growth rate of the next mode there, roughly
COEFFICIENTS = (
    ("alpha_plus_beta", "A**2*conj(A)", "coefficient_alpha_plus_beta"),
    ("gamma", "mu*A", "coefficient_gamma"),
)
QUADRATIC = None
MIRROR = (
)
PENCILS = ((0, "pencil_0"),)
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
    omega = a.frequency
    F = a.control
    return Operator(
        matrix=(
            (0, 1, 0, 0),
            (0, 0, 1, 0),
            (0, 0, 0, 1),
            (-a.i*omega, 0, -F, 0),
        ),
        left=(
            (1, 0, 0, 0),
            (0, 1, 0, 0),
        ),
        right=(
            (0, 0, 1, 0),
            (0, 0, 0, 1),
        ),
    )


@stage
def mode(a):
    """The critical mode: phi, phi_1, phi_2, phi_3."""
    return a.kernel(critical(a), (1, 0, 0, 0), 1)


@stage
def mode_bar(a):
    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""
    return tuple(a.reflect(one) for one in mode(a))


@stage
def adjoint(a):
    """The adjoint problem: z' = -P^T z with the adjoint boundary rows."""
    omega = a.frequency
    F = a.control
    return Operator(
        matrix=(
            (0, 0, 0, a.i*omega),
            (-1, 0, 0, 0),
            (0, -1, 0, F),
            (0, 0, -1, 0),
        ),
        left=(
            (0, 0, 1, 0),
            (0, 0, 0, 1),
        ),
        right=(
            (1, 0, 0, 0),
            (0, 1, 0, 0),
        ),
    )


@stage
def adjoint_mode(a):
    """The adjoint mode: zeta_3, zeta_2, zeta_1, zeta."""
    return a.kernel(adjoint(a))


def pencil_0(a, lam):
    """The linear problem of weight 0 at the growth rate lam."""
    F = a.control
    return Operator(
        matrix=(
            (0, 0, 1, 0, 0, 0),
            (0, 0, 0, 0, 0, 0),
            (0, 0, 0, 1, 0, 0),
            (0, 0, -F, 0, -1, 0),
            (lam, 0, 0, 0, 0, 0),
            (0, lam/2, 0, 0, 0, 0),
        ),
        left=(
            (1, 0, 0, 0, 0, 0),
            (0, 1, 0, 0, 0, 0),
            (0, 0, 1, 0, 0, 0),
        ),
        right=(
            (0, 0, 0, 1, 0, 0),
            (0, 0, F, 0, 1, 0),
            (0, 0, 0, 0, 0, 1),
        ),
    )


def divisors_0(a, lam):
    """What was divided by: eigenvalues where one of these vanishes may be missing from `pencil_0`."""
    return ()


@stage
def operator_2(a):
    """The linear problem of harmonic 2."""
    omega = a.frequency
    return Operator(
        matrix=(
            (0, 0),
            (a.i*omega, 0),
        ),
        left=(
            (1, 0),
        ),
        right=(
            (0, 1),
        ),
    )


@stage
def operator_0(a):
    """The linear problem of harmonic 0."""
    return Operator(
        matrix=(
            (0, 0),
            (0, 0),
        ),
        left=(
            (1, 0),
        ),
        right=(
            (0, 1),
        ),
    )


@stage
def response_A_A(a):
    """Response to A A (harmonic 2): w_A_A_z, w_A_A_Z."""
    omega = a.frequency
    F = a.control
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    w_A_A_z = a.integral_from_left(f_A_A_row_1(a))
    w_A_A_Z = a.right(F*phi_1**2/2) - a.integral_to_right(f_A_A_row_3(a) + a.i*omega*w_A_A_z)
    return w_A_A_z, w_A_A_Z


@stage
def response_A_Ac(a):
    """Response to A Ac (harmonic 0): w_A_Ac_z, w_A_Ac_Z."""
    F = a.control
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    w_A_Ac_z = a.integral_from_left(f_A_Ac_row_1(a))
    w_A_Ac_Z = a.right(F*phi_1*phi_bar_1) - a.integral_to_right(f_A_Ac_row_3(a))
    return w_A_Ac_z, w_A_Ac_Z


@stage
def f_A_A_row_1(a):
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    return -phi_1**2/2


@stage
def f_A_A_row_3(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    return -a.i*omega*phi*phi_1/2


@stage
def f_A_Ac_row_1(a):
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -phi_1*phi_bar_1


@stage
def f_A_Ac_row_3(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -a.i*omega*phi*phi_bar_1/2 + a.i*omega*phi_1*phi_bar/2


@stage
def f_cubic_0(a):
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return phi_1**2*phi_bar_1/2


@stage
def f_cubic_2(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    w_A_A_z, _w_A_A_Z = response_A_A(a)
    return (
        a.i*omega*phi*phi_1*phi_bar_1
        - a.i*omega*phi_1**2*phi_bar/2
        + a.i*omega*phi_bar_1*w_A_A_z
    )


@stage
def f_cubic_4(a):
    F = a.control
    _phi, phi_1, _phi_2, phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, phi_bar_3 = mode_bar(a)
    _w_A_A_z, w_A_A_Z = response_A_A(a)
    _w_A_Ac_z, w_A_Ac_Z = response_A_Ac(a)
    return (
        F*phi_1**2*phi_bar_1
        + phi_1**2*phi_bar_3/2
        + phi_1*phi_3*phi_bar_1
        - phi_1*w_A_Ac_Z
        - phi_bar_1*w_A_A_Z
    )


@stage
def xi(a):
    """Solvability integral of dA/dt."""
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(phi*zeta)
    return total


@stage
def coefficient_alpha_plus_beta(a):
    """Solvability integral of A**2*conj(A), over -xi."""
    F = a.control
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    zeta_3, _zeta_2, zeta_1, zeta = adjoint_mode(a)
    total = a.integral(f_cubic_0(a)*zeta_3 - f_cubic_2(a)*zeta + f_cubic_4(a)*zeta_1)
    total = total + a.right(-F*phi_1**2*phi_bar_1*zeta/2)
    return -total/xi(a)


@stage
def coefficient_gamma(a):
    """Solvability integral of mu*A, over -xi."""
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, zeta_1, zeta = adjoint_mode(a)
    total = a.integral(phi_1*zeta_1)
    total = total + a.right(phi_1*zeta)
    return -total/xi(a)


AMPLITUDES = ("A", "Ac")
UNKNOWNS = (
    ("x", ""),
    ("z", ""),
    ("theta", ""),
    ("X", ""),
    ("Z", ""),
)
NORMALISED = "x"


@stage
def base(a):
    """The base state, unknown by unknown."""
    F = a.control
    s = a.s
    return (
        0,
        s,
        0,
        0,
        -F,
    )


@stage
def fields_mode(a):
    """The mode: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    F = a.control
    phi, phi_1, _phi_2, phi_3 = mode(a)
    return (
        ((1, 0), 1, {
            0: phi,
            2: phi_1,
            3: -F*phi_1 - phi_3,
        }),
    )


@stage
def fields_responses(a):
    """The responses of second order: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    w_A_A_z, w_A_A_Z = response_A_A(a)
    w_A_Ac_z, w_A_Ac_Z = response_A_Ac(a)
    return (
        ((2, 0), 2, {
            1: w_A_A_z,
            4: w_A_A_Z,
        }),
        ((1, 1), 0, {
            1: w_A_Ac_z,
            4: w_A_Ac_Z,
        }),
    )


def consistency(a):
    """What redundant equations demand at mu A, epsilon A and A**2: each must vanish."""
    return ()


def consistency_cubic(a):
    """What redundant equations demand of the responses and at third order: each must vanish."""
    return ()
