"""Amplitude equation of follower_force. Emitted by `fredholm derive`; do not edit."""

from numerics.algebra import Operator, stage

NAME = "follower_force"
KIND = "hopf"
MULTIPLICITY = 2
SPATIAL = True
CONTROL = "F"
CONTROL_RANGE = ("0.0", "60.0")
ONSET = ("37.695431", "191.259")
NEIGHBOUR = "-2.1e+03"  # the growth rate of the next mode there, roughly
COEFFICIENTS = (
    ("alpha", "dot(A,A)*conj(A)", "coefficient_alpha"),
    ("beta", "dot(A,conj(A))*A", "coefficient_beta"),
    ("gamma", "mu*A", "coefficient_gamma"),
)
QUADRATIC = None
MIRROR = (
)
PENCILS = ((0, "pencil_0"), (1, "pencil_1"),)
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
    return Operator(
        matrix=(
            (0, 0),
            (lam/2, 0),
        ),
        left=(
            (1, 0),
        ),
        right=(
            (0, 1),
        ),
    )


def divisors_0(a, lam):
    """What was divided by: eigenvalues where one of these vanishes may be missing from `pencil_0`."""
    return ()


def pencil_1(a, lam):
    """The linear problem of weight 1 at the growth rate lam."""
    F = a.control
    return Operator(
        matrix=(
            (0, 1, 0, 0),
            (0, 0, 1, 0),
            (0, 0, 0, 1),
            (-lam, 0, -F, 0),
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


def divisors_1(a, lam):
    """What was divided by: eigenvalues where one of these vanishes may be missing from `pencil_1`."""
    return ()


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
def response_Ap_Cm(a):
    """Response to Ap Cm (harmonic 0): w_Ap_Cm_r_n, w_Ap_Cm_F_n."""
    F = a.control
    w_Ap_Cm_r_n = a.integral_from_left(f_Ap_Cm_row_12(a)/2)
    w_Ap_Cm_F_n = a.right(-F*f_Ap_Cm_row_12(a)/2) - a.integral_to_right(f_Ap_Cm_row_5(a))
    return w_Ap_Cm_r_n, w_Ap_Cm_F_n


@stage
def response_Ap_Am(a):
    """Response to Ap Am (harmonic 2): w_Ap_Am_r_n, w_Ap_Am_F_n."""
    omega = a.frequency
    F = a.control
    w_Ap_Am_r_n = a.integral_from_left(f_Ap_Am_row_12(a)/2)
    w_Ap_Am_F_n = a.right(-F*f_Ap_Am_row_12(a)/2) - a.integral_to_right((
        f_Ap_Am_row_5(a)
        + a.i*omega*w_Ap_Am_r_n
    ))
    return w_Ap_Am_r_n, w_Ap_Am_F_n


@stage
def f_Ap_Cm_row_5(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -a.i*omega*phi*phi_bar_1/4 + a.i*omega*phi_1*phi_bar/4


@stage
def f_Ap_Cm_row_8(a):
    _phi, phi_1, _phi_2, phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, phi_bar_3 = mode_bar(a)
    return a.i*phi_1*phi_bar_3/2 - a.i*phi_3*phi_bar_1/2


@stage
def f_Ap_Cm_row_11(a):
    _phi, phi_1, phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, phi_bar_2, _phi_bar_3 = mode_bar(a)
    return a.i*phi_1*phi_bar_2/2 - a.i*phi_2*phi_bar_1/2


@stage
def f_Ap_Cm_row_12(a):
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -phi_1*phi_bar_1


@stage
def f_Ap_Am_row_5(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    return -a.i*omega*phi*phi_1/2


@stage
def f_Ap_Am_row_12(a):
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    return -phi_1**2


@stage
def f_alpha_3(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    w_Ap_Am_r_n, _w_Ap_Am_F_n = response_Ap_Am(a)
    return a.i*omega*phi*phi_1*phi_bar_1/2 + a.i*omega*phi_bar_1*w_Ap_Am_r_n


@stage
def f_alpha_6(a):
    F = a.control
    _phi_bar, phi_bar_1, _phi_bar_2, phi_bar_3 = mode_bar(a)
    _w_Ap_Am_r_n, w_Ap_Am_F_n = response_Ap_Am(a)
    return (
        -a.i*F*f_Ap_Am_row_12(a)*phi_bar_1/2
        - a.i*f_Ap_Am_row_12(a)*phi_bar_3/2
        - a.i*phi_bar_1*w_Ap_Am_F_n
    )


@stage
def t_n_Am_Cp_s(a):
    _phi, phi_1, phi_2, _phi_3 = mode(a)
    _phi_bar, phi_bar_1, phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -phi_1*phi_bar_2/2 - phi_2*phi_bar_1/2


@stage
def t_n_Ap_Am_s(a):
    _phi, phi_1, phi_2, _phi_3 = mode(a)
    return -phi_1*phi_2


@stage
def f_alpha_9(a):
    _phi_bar, phi_bar_1, phi_bar_2, _phi_bar_3 = mode_bar(a)
    return -a.i*f_Ap_Am_row_12(a)*phi_bar_2/2 + a.i*phi_bar_1*t_n_Ap_Am_s(a)


@stage
def f_beta_3(a):
    omega = a.frequency
    phi, phi_1, _phi_2, _phi_3 = mode(a)
    phi_bar, phi_bar_1, _phi_bar_2, _phi_bar_3 = mode_bar(a)
    return a.i*omega*phi*phi_1*phi_bar_1/2 - a.i*omega*phi_1**2*phi_bar/2


@stage
def f_beta_6(a):
    F = a.control
    _phi, phi_1, _phi_2, phi_3 = mode(a)
    _w_Ap_Cm_r_n, w_Ap_Cm_F_n = response_Ap_Cm(a)
    return -a.i*F*f_Ap_Cm_row_12(a)*phi_1 - a.i*f_Ap_Cm_row_12(a)*phi_3 - 2*a.i*phi_1*w_Ap_Cm_F_n


@stage
def f_beta_9(a):
    _phi, phi_1, phi_2, _phi_3 = mode(a)
    return -a.i*f_Ap_Cm_row_12(a)*phi_2 + 2*a.i*phi_1*t_n_Am_Cp_s(a)


@stage
def xi(a):
    """Solvability integral of dA/dt."""
    phi, _phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, _zeta_1, zeta = adjoint_mode(a)
    total = a.integral(phi*zeta)
    return total


@stage
def coefficient_alpha(a):
    """Solvability integral of dot(A,A)*conj(A), over -xi."""
    F = a.control
    _zeta_3, zeta_2, zeta_1, zeta = adjoint_mode(a)
    integrand = (
        -f_alpha_3(a)*zeta
        - a.i*f_alpha_6(a)*zeta_1
        + (-a.i*F*zeta + a.i*zeta_2)*f_alpha_9(a)
    )
    total = a.integral(integrand)
    return -total/xi(a)


@stage
def coefficient_beta(a):
    """Solvability integral of dot(A,conj(A))*A, over -xi."""
    F = a.control
    _zeta_3, zeta_2, zeta_1, zeta = adjoint_mode(a)
    integrand = (
        -f_beta_3(a)*zeta
        - a.i*f_beta_6(a)*zeta_1
        + (-a.i*F*zeta + a.i*zeta_2)*f_beta_9(a)
    )
    total = a.integral(integrand)
    return -total/xi(a)


@stage
def coefficient_gamma(a):
    """Solvability integral of mu*A, over -xi."""
    _phi, phi_1, _phi_2, _phi_3 = mode(a)
    _zeta_3, _zeta_2, zeta_1, zeta = adjoint_mode(a)
    total = a.integral(phi_1*zeta_1)
    total = total + a.right(phi_1*zeta)
    return -total/xi(a)


AMPLITUDES = ("Ap", "Am", "Cp", "Cm")
UNKNOWNS = (
    ("r", "p"),
    ("r", "m"),
    ("r", "n"),
    ("t", "p"),
    ("t", "m"),
    ("t", "n"),
    ("F", "p"),
    ("F", "m"),
    ("F", "n"),
    ("M", "p"),
    ("M", "m"),
    ("M", "n"),
)
NORMALISED = "r"


def frame(a):
    """Return e1, e2 and the rotation axis."""
    return (
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
    )


@stage
def base(a):
    """The base state, unknown by unknown."""
    F = a.control
    s = a.s
    return (
        0,
        0,
        s,
        0,
        0,
        1,
        0,
        0,
        -F,
        0,
        0,
        0,
    )


@stage
def fields_mode(a):
    """The mode: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    F = a.control
    phi, phi_1, phi_2, phi_3 = mode(a)
    return (
        ((1, 0, 0, 0), 1, {
            0: phi,
            3: phi_1,
            6: -F*phi_1 - phi_3,
            9: a.i*phi_2,
        }),
        ((0, 1, 0, 0), 1, {
            1: phi,
            4: phi_1,
            7: -F*phi_1 - phi_3,
            10: -a.i*phi_2,
        }),
    )


@stage
def fields_responses(a):
    """The responses of second order: exponents over AMPLITUDES, harmonic, and {unknown: function of s}."""
    w_Ap_Cm_r_n, w_Ap_Cm_F_n = response_Ap_Cm(a)
    w_Ap_Am_r_n, w_Ap_Am_F_n = response_Ap_Am(a)
    return (
        ((1, 0, 0, 1), 0, {
            2: w_Ap_Cm_r_n,
            5: f_Ap_Cm_row_12(a)/2,
            8: w_Ap_Cm_F_n,
            11: f_Ap_Cm_row_11(a),
        }),
        ((0, 1, 1, 0), 0, {
            2: w_Ap_Cm_r_n,
            5: f_Ap_Cm_row_12(a)/2,
            8: w_Ap_Cm_F_n,
            11: -f_Ap_Cm_row_11(a),
        }),
        ((1, 1, 0, 0), 2, {
            2: w_Ap_Am_r_n,
            5: f_Ap_Am_row_12(a)/2,
            8: w_Ap_Am_F_n,
        }),
    )


def consistency(a):
    """What redundant equations demand at mu A, epsilon A and A**2: each must vanish."""
    return ()


def consistency_cubic(a):
    """What redundant equations demand of the responses and at third order: each must vanish."""
    _phi, phi_1, _phi_2, phi_3 = mode(a)
    _phi_bar, phi_bar_1, _phi_bar_2, phi_bar_3 = mode_bar(a)
    return (
        ("equations[2], equations[3]",
            f_Ap_Cm_row_8(a) - a.i*phi_1*phi_bar_3/2 + a.i*phi_3*phi_bar_1/2),
        ("boundary[0][1], equations[4]",
            a.left(-f_Ap_Cm_row_12(a)/2)),
        ("boundary[1][1], equations[3]",
            a.right(-f_Ap_Cm_row_11(a))),
        ("equations[2], equations[3]",
            -f_Ap_Cm_row_8(a) + a.i*phi_1*phi_bar_3/2 - a.i*phi_3*phi_bar_1/2),
        ("boundary[1][1], equations[3]",
            a.right(f_Ap_Cm_row_11(a))),
        ("boundary[0][1], equations[4]",
            a.left(-f_Ap_Am_row_12(a)/2)),
    )
