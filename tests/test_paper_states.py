"""Displays of section IV, typed once from the paper, against what the program derives; chi is mu, T is t.

Vectors are components along e and n x e; a bar is a conjugate. Where a display is said to be wrong, the test shows that it is.
"""

import math

import numpy as np
import pytest
from conftest import derivation_of
from sympy import I, Matrix, Rational, Symbol, cancel, diff, expand, limit, oo, simplify, sqrt, symbols

from derive.states import AREA, COSINE, DOT, MAGNITUDE, MU, SINE, SQUARE, TURN, base_eigenvectors, characteristic, derive_states, dot_rate, invariant_rates, real_system
from derive.states import SIGMA as sigma


@pytest.fixture(scope="module")
def analysis():
    return derive_states(derivation_of("follower_force")).analyses[0]


@pytest.fixture(scope="module")
def paper(analysis):
    """The coefficients of the paper: alpha with its parts and conjugate, and so on."""
    return {term.name: (term.real + I * term.imaginary, term.real, term.imaginary) for term in analysis.equation.terms}


def same(one, other, equation=None):
    difference = one - other if equation is None else equation.in_parts(one) - equation.in_parts(other)
    return expand(cancel(difference)) == 0


def same_matrix(one, other):
    return all(same(a, b) for a, b in zip(one, other, strict=True)) and one.shape == other.shape


def dot(x, y):
    return x[0] * y[0] + x[1] * y[1]


def cross(x, y):
    return x[0] * y[1] - x[1] * y[0]


A, C = Matrix(symbols("A1 A2")), Matrix(symbols("C1 C2"))  # A and its conjugate


def right_side(paper, A=A, C=C):
    """(amplitude)."""
    alpha, beta, gamma = (paper[name][0] for name in ("alpha", "beta", "gamma"))
    return alpha * C * dot(A, A) + beta * A * dot(A, C) + MU * gamma * A


def rate_of(expression, analysis):
    """d/dT of an expression in the components of A and its conjugate, by the chain rule over what the program has."""
    equation = analysis.equation
    rate, conjugate = equation.rate(A, C), equation.rate(A, C).applyfunc(equation.conjugated).xreplace(dict(zip((*A, *C), (*C, *A), strict=True)))
    total = sum(diff(expression, a) * r for a, r in zip((*A, *C), (*rate, *conjugate), strict=True))
    return equation.in_parts(expand(total))


def test_amplitude_and_steady_amplitude(analysis, paper):
    assert same_matrix(analysis.equation.rate(A, C).applyfunc(analysis.equation.in_parts), right_side(paper).applyfunc(expand))


def test_crossing_with_the_amplitude_leaves_two_families(analysis, paper):
    """Text below (steady amplitude): alpha (A.A) A* x A = 0."""
    assert same(cross(A, analysis.equation.rate(A, C)), paper["alpha"][0] * dot(A, A) * cross(A, C), analysis.equation)
    assert [state.name for state in analysis.states] == ["undeformed", "beating", "whirling"]


@pytest.mark.parametrize("name", ["beating", "whirling"])
def test_beating_and_cw_eq_and_sol(analysis, paper, name):
    (alpha, a_r, a_i), (beta, b_r, b_i), (gamma, g_r, g_i) = (paper[key] for key in ("alpha", "beta", "gamma"))
    state = analysis[name]
    if name == "beating":
        assert same(state.condition, (alpha + beta) * MAGNITUDE**2 + MU * gamma, analysis.equation)
        assert same(state.amplitude_squared, -MU * g_r / (a_r + b_r))
        assert same(state.frequency_correction, MU * g_i - MU * g_r * (a_i + b_i) / (a_r + b_r))
        assert same(state.peak_squared, 4 * state.amplitude_squared)  # (beating tip): 2 |A|
    else:
        assert same(state.condition, beta * MAGNITUDE**2 + gamma * MU, analysis.equation)
        assert same(state.amplitude_squared, -MU * g_r / b_r)
        assert same(state.frequency_correction, MU * g_i - MU * g_r * b_i / b_r)
        assert same(state.peak_squared, 2 * state.amplitude_squared)  # (cw tip): sqrt(2) |A|


def test_cw_form_turns_clockwise_with_the_plus_sign(analysis):
    """(cw form), (cw tip) and the statement above (axes): Im(A x A*) gives the motion by the right-hand rule."""
    shape = np.array([complex(entry.subs(MAGNITUDE, 1)) for entry in analysis["whirling"].shape])
    assert np.allclose(shape, np.array([1, 1j]) / math.sqrt(2))  # e + i n x e

    def tip(phase):
        return 2 * (shape * np.exp(1j * phase)).real

    for phase in (0.0, 1.0, 4.0):
        assert np.allclose(tip(phase), math.sqrt(2) * np.array([math.cos(phase), -math.sin(phase)]))  # (cw tip)
        velocity = (tip(phase + 1e-6) - tip(phase - 1e-6)) / 2e-6
        assert cross(tip(phase), velocity) < 0 and cross(shape, shape.conj()).imag < 0  # clockwise, seen with n towards the eye


def test_axes_are_those_of_the_ellipse():
    """(axes), the area and both footnotes, by measuring the orbit."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        A = rng.normal(size=2) + 1j * rng.normal(size=2)
        phases = np.linspace(0, 2 * math.pi, 40001)
        orbit = 2 * (A[:, None] * np.exp(1j * phases)).real
        N, B = np.vdot(A, A).real, abs(cross(A, A.conj()))
        sizes = np.hypot(*orbit)
        assert abs(sizes.max() - (math.sqrt(N + B) + math.sqrt(N - B))) < 1e-6
        assert abs(sizes.min() - (math.sqrt(N + B) - math.sqrt(N - B))) < 1e-6
        area = abs(np.sum(orbit[0, :-1] * np.diff(orbit[1]) - orbit[1, :-1] * np.diff(orbit[0]))) / 2
        assert abs(area - 2 * math.pi * B) < 1e-5
        assert abs(abs(dot(A, A)) ** 2 - (N**2 - B**2)) < 1e-9
        assert abs(cross(A, A.conj()) + 2j * cross(A.real, A.imag)) < 1e-12
        major = (A / np.sqrt(dot(A, A))).real
        assert abs(cross(major, orbit[:, sizes.argmax()])) < 1e-3 * sizes.max() * np.hypot(*major)


def test_stability_stationary_sys_and_eigenvalues(analysis, paper):
    gamma, g_r, g_i = paper["gamma"]
    state = analysis["undeformed"]
    system = MU * Matrix([[g_r, -g_i], [g_i, g_r]])
    assert same_matrix(real_system(analysis.equation, state.P * MAGNITUDE**2, state.Q * MAGNITUDE**2)[:2, :2], system)
    displayed = [MU * (g_r + I * g_i), MU * (g_r - I * g_i)] * 2  # sigma(1..4), by pairs along e_1 and e_2
    assert all(same(one.value, value) for one, value in zip(state.eigenvalues, displayed, strict=True))
    (first, vector), (second, other) = base_eigenvectors(analysis.equation)
    assert vector == Matrix([1, -I]) and other == Matrix([1, I])  # (stationary stability eigenvectors a)
    for value, column in ((first, vector), (second, other)):
        assert same_matrix(system * column, MU * analysis.equation.in_parts(value) * column)


def test_stationary_stability_eigenvectors_b_as_printed_is_wrong(paper):
    """The misprint: (e_2, -+ e_2) is no eigenvector of (stability stationary sys), (e_2, -+ i e_2) is."""
    _, g_r, g_i = paper["gamma"]
    system = Matrix([[g_r, -g_i], [g_i, g_r]])
    for sign in (1, -1):
        printed, right = system * Matrix([1, -sign]), system * Matrix([1, -sign * I])
        assert expand(printed[1] * 1 - printed[0] * (-sign)) != 0
        assert expand(right[1] * 1 - right[0] * (-sign * I)) == 0


def test_linear_amplitude(analysis, paper):
    """(linear amplitude), with chi = 1, for any steady state: the derivative of (amplitude) along a."""
    (alpha, *_), (beta, *_), (gamma, *_) = (paper[key] for key in ("alpha", "beta", "gamma"))
    a, b, eta, nu = Matrix(symbols("a1 a2")), Matrix(symbols("b1 b2")), Symbol("eta"), Symbol("nu", real=True)  # b is the conjugate of a
    derivative = (analysis.equation.rate(A + eta * a, C + eta * b) - I * nu * (A + eta * a)).diff(eta).subs(eta, 0).subs(MU, 1)
    displayed = (2 * alpha * C * dot(A, a) + alpha * b * dot(A, A) + beta * A * dot(A, b) + beta * A * dot(a, C) + (gamma - I * nu + beta * dot(A, C)) * a)
    assert all(same(one, other, analysis.equation) for one, other in zip(derivative, displayed, strict=True))


def test_beating_stability_decomposed_and_real_systems(analysis, paper):
    (alpha, a_r, a_i), (beta, *_), _ = (paper[key] for key in ("alpha", "beta", "gamma"))
    state, equation, N = analysis["beating"], analysis.equation, MAGNITUDE**2
    zeta = alpha + beta
    assert same_matrix(state.P.applyfunc(equation.in_parts), Matrix([[zeta * N, 0], [0, -alpha * N]]).applyfunc(expand))
    assert same_matrix(state.Q.applyfunc(equation.in_parts), Matrix([[zeta * N * TURN**2, 0], [0, alpha * N * TURN**2]]).applyfunc(expand))
    z_r, z_i = zeta.as_real_imag()
    parallel = Matrix([[z_r * (1 + COSINE) - z_i * SINE, z_r * SINE - z_i * (1 - COSINE)], [z_r * SINE + z_i * (1 + COSINE), z_r * (1 - COSINE) + z_i * SINE]])
    perpendicular = Matrix([[a_r * (COSINE - 1) - a_i * SINE, a_r * SINE + a_i * (1 + COSINE)], [a_r * SINE + a_i * (COSINE - 1), -a_r * (1 + COSINE) + a_i * SINE]])
    system = real_system(equation, state.P, state.Q)
    assert same_matrix(system[:2, :2], parallel.applyfunc(expand)) and same_matrix(system[2:, 2:], perpendicular.applyfunc(expand))
    assert system[:2, 2:] == Matrix.zeros(2) and system[2:, :2] == Matrix.zeros(2)


def test_beating_eigenvalues(analysis, paper):
    _, a_r, _ = paper["alpha"]
    _, b_r, _ = paper["beta"]
    _, g_r, _ = paper["gamma"]
    found = [(one.direction, one.neutral, one.value.subs(MU, 1)) for one in analysis["beating"].eigenvalues]
    assert found[0] == ("parallel", ("phase",), 0) and found[1] == ("parallel", (), -2 * g_r)
    assert found[2] == ("perpendicular", ("rotation",), 0) and found[3][:2] == ("perpendicular", ())
    assert same(found[3][2], 2 * a_r * g_r / (a_r + b_r))


def test_cw_stability_decomposed_and_real_system(analysis, paper):
    (alpha, a_r, a_i), (beta, b_r, b_i), _ = (paper[key] for key in ("alpha", "beta", "gamma"))
    state, equation, N = analysis["whirling"], analysis.equation, MAGNITUDE**2
    a, b = Matrix(symbols("a1 a2")), Matrix(symbols("b1 b2"))
    derived = (state.P * a + state.Q * b).applyfunc(equation.in_parts)
    half = Rational(1, 2)
    displayed = Matrix([
        alpha * N * (a[0] + I * a[1]) + half * beta * N * (a[0] + b[0] + I * b[1] - I * a[1]),
        alpha * N * (a[1] - I * a[0]) + half * beta * N * (a[1] - b[1] + I * a[0] + I * b[0]),
    ])
    assert same_matrix(derived, displayed)
    system = Matrix([[a_r + b_r, -a_i, -a_i, b_r - a_r], [a_i + b_i, a_r, a_r, b_i - a_i], [a_i - b_i, a_r, a_r, -(a_i + b_i)], [b_r - a_r, a_i, a_i, a_r + b_r]])
    assert same_matrix(real_system(equation, state.P, state.Q), system)


def test_cw_dispersion_and_eigenvalues(analysis, paper):
    (alpha, a_r, a_i), (_, b_r, _), (_, g_r, _) = (paper[key] for key in ("alpha", "beta", "gamma"))
    state, N = analysis["whirling"], MAGNITUDE**2
    polynomial = characteristic(analysis.equation, Matrix(state.P), Matrix(state.Q))
    displayed = sigma * (sigma - 2 * N * b_r) * (sigma**2 - 4 * a_r * N * sigma + 4 * N**2 * (a_r**2 + a_i**2))
    assert same(polynomial, displayed, analysis.equation)
    values = [one.value.subs(MU, 1) for one in state.eigenvalues]
    assert values[:2] == [0, -2 * g_r]
    assert same(values[2], -2 * g_r / b_r * alpha) and same(values[3], -2 * g_r / b_r * (a_r - I * a_i))
    assert state.eigenvalues[0].neutral == ("phase", "rotation")


def test_relations(analysis, paper):
    """(relations a-c), derived by the product rule, and again by the chain rule in components."""
    (alpha, a_r, _), (beta, b_r, _), (gamma, g_r, _) = (paper[key] for key in ("alpha", "beta", "gamma"))
    equation = analysis.equation
    square, area = invariant_rates(equation)
    assert same(area, 2 * (b_r * SQUARE + MU * g_r) * AREA, equation)
    assert same(2 * dot_rate(equation, "A"), 2 * ((alpha + beta) * SQUARE + MU * gamma) * DOT, equation)
    assert same(square, 2 * (a_r + b_r) * SQUARE**2 - 2 * a_r * AREA**2 + 2 * MU * g_r * SQUARE, equation)
    N, B = dot(A, C), cross(C, A)
    assert same(rate_of(B, analysis), 2 * (b_r * N + MU * g_r) * B)
    assert same(rate_of(dot(A, A), analysis), 2 * ((alpha + beta) * N + MU * gamma) * dot(A, A))
    # |A* x A|^2 is -(A* x A)^2: the vector is imaginary
    assert same(rate_of(N, analysis), 2 * (a_r + b_r) * N**2 + 2 * a_r * B**2 + 2 * MU * g_r * N)


def test_nonlinear_stability_at_the_threshold(analysis, paper):
    """(nonlinear stability AB eqs), (planar sol), (nonplanar powerlaws) and the asymptote of the axes below them."""
    (_, a_r, _), (_, b_r, _) = paper["alpha"], paper["beta"]
    square, area = (analysis.equation.in_parts(rate).subs(MU, 0) for rate in invariant_rates(analysis.equation))
    size = Symbol("size", positive=True)
    assert same((square / (2 * size)).subs(SQUARE, size**2), (a_r + b_r) * size**3 - a_r * AREA**2 / size)
    assert same(area, 2 * b_r * SQUARE * AREA)
    planar, circular = analysis.thresholds
    T, start = Symbol("T", positive=True), Symbol("start", positive=True)
    p, q = Symbol("p", positive=True), Symbol("q", positive=True)  # -(alpha_r + beta_r), -beta_r
    solution = start / sqrt(1 + 2 * start**2 * p * T)
    assert simplify(solution.diff(T) + p * solution**3) == 0
    assert limit(solution * sqrt(2 * p * T), T, oo) == 1
    assert same(planar.rate, 2 * (a_r + b_r)) and same(circular.rate, 2 * b_r) and planar.exponent == circular.exponent == -Rational(1, 2)
    size_squared, moment = 1 / (2 * q * T), 1 / (2 * q * T)  # -1/(2 beta_r T), both
    assert simplify(sqrt(size_squared + moment) + sqrt(size_squared - moment) - 1 / sqrt(q * T)) == 0
    assert same(analysis.selection, a_r)


def test_the_neutral_eigenvectors_are_the_generators_of_the_symmetries(analysis):
    """i A and n x A are annihilated by the real systems that the program prints."""
    for name in ("beating", "whirling"):
        state = analysis[name]
        system = real_system(analysis.equation, state.P, state.Q)
        turn = {TURN: Rational(3, 5) + I * Rational(4, 5)}  # cos(theta) = 3/5
        shape = [entry.subs(turn) / MAGNITUDE for entry in state.shape]
        for generator in ([I * entry for entry in shape], [-shape[1], shape[0]]):
            parts = Matrix([part for entry in generator for part in expand(entry).as_real_imag()])
            image = system.subs({COSINE: Rational(-7, 25), SINE: Rational(24, 25)}) * parts
            assert all(expand(entry) == 0 for entry in image) and any(entry != 0 for entry in parts)
