"""States as numbers, confirmed by what shares none of their derivation: a brute-force search for roots of the reduced equation,
eigenvalues of its finite-difference linearisation in 50 digits, and long integrations at the threshold."""

import json
from decimal import Decimal
from functools import cache

import mpmath
import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS, derivation_of, result_of
from flint import acb, fmpq
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from derive import DerivationError
from derive.cli import main
from derive.states import FACTORS, analyse, derive_states, equation_of
from numerics import EvaluationError, evaluate_states, first_complex_pair, growth_rates
from numerics.algebra import Operator
from numerics.comparison import compare, further_values, reference_of

# (10 alpha, 10 beta, 10 gamma) with every pattern of signs that matters; real and imaginary parts.
PATTERNS = {
    "as the filament": ((-9, -7), (-10, 7), (7, 5)),
    "beating wins": ((6, 4), (-17, 3), (8, -5)),
    "beating subcritical": ((14, 3), (-6, 2), (9, 4)),
    "whirling subcritical": ((-25, 6), (8, 3), (5, 1)),
    "both subcritical": ((3, -8), (6, 2), (4, -3)),
    "both subcritical, whirling wins": ((-3, 5), (8, -2), (4, -3)),
}
MONOMIALS = {"vector": ("dot(A,A)*conj(A)", "dot(A,conj(A))*A", "mu*A"), "scalar": ("A**2*conj(A)", "mu*A")}


def tenth(value):
    return acb(fmpq(value[0], 10), fmpq(value[1], 10))


def emitted_form(kind, values):
    """An emitted module whose coefficients are given numbers: what `derive` would write for a normal form."""
    names = [f"coefficient_{k}" for k in range(len(values))]
    form = {
        "NAME": "form", "KIND": "hopf", "MULTIPLICITY": 2 if kind == "vector" else 1, "SPATIAL": False, "CONTROL_RANGE": ("-1", "1"), "ONSET": ("0", "1"), "QUADRATIC": None, "MIRROR": (),
        "WEAK": (), "COEFFICIENTS": tuple(zip(names, MONOMIALS[kind], names, strict=True)), "parameters": lambda a: {}, "xi": lambda a: a.one,
        "critical": lambda a: Operator(matrix=((a.control - a.i * a.frequency + a.i,),)), "mode": lambda a: (a.one,), "adjoint_mode": lambda a: (a.one,),
        "consistency": lambda a: (), "consistency_cubic": lambda a: (),
    }
    return form | {name: lambda a, value=value: tenth(value) for name, value in zip(names, values, strict=True)}


@cache
def states_of(target):
    return derive_states(derivation_of(target))


def states_text(name="follower_force"):
    return states_of(name).emit()


@pytest.fixture(scope="module")
def filament_text():
    return states_text()


def rate(values, mu):
    """dA/dt of a complex vector, in any numbers."""
    alpha, beta, gamma = values

    def of(A):
        C = [a.conjugate() for a in A]
        square, size = A[0] * A[0] + A[1] * A[1], A[0] * C[0] + A[1] * C[1]
        return [alpha * square * c + beta * size * a + gamma * mu * a for a, c in zip(A, C, strict=True)]

    return of


def complexes(pattern):
    return [complex(re, im) / 10 for re, im in PATTERNS[pattern]]


@pytest.mark.parametrize("mu", [1, -1])
@pytest.mark.parametrize("pattern", sorted(PATTERNS))
def test_random_starts_find_these_states_and_no_others(filament_text, pattern, mu):
    """All roots of dA/dt = i nu A + Omega n x A, from random starts: nothing but A = 0, beating and whirling, with Omega = 0 but for the circle."""
    result = evaluate_states(emitted_form("vector", PATTERNS[pattern]), filament_text, mu)
    of = rate(complexes(pattern), mu)

    def residual(x):
        A = [complex(x[0], x[1]), complex(x[2], x[3])]
        turning = [-x[5] * A[1], x[5] * A[0]]
        parts = [r - 1j * x[4] * a - t for r, a, t in zip(of(A), A, turning, strict=True)]
        return [part for value in parts for part in (value.real, value.imag)]

    rng = np.random.default_rng(7)
    found = set()
    for _ in range(10):
        root = least_squares(residual, rng.normal(size=6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        size, square = root.x[:4] @ root.x[:4], abs(complex(root.x[0], root.x[1]) ** 2 + complex(root.x[2], root.x[3]) ** 2)
        if root.cost > 1e-20 or 1e-12 < size < 1e-6:
            continue
        if size < 1e-6:
            found.add("undeformed")
            continue
        name = "beating" if abs(square - size) < 1e-6 else "whirling"
        if name == "whirling":
            assert square < 1e-6
        turn = 0.0 if name == "beating" else root.x[5] * np.sign(root.x[0] * root.x[3] - root.x[1] * root.x[2])  # on a circle a rotation is a shift of phase
        assert result[name].exists
        assert abs(size - float(result[name].amplitude_squared)) < 1e-6
        assert abs(root.x[4] + turn - float(result[name].frequency_correction)) < 1e-6 or abs(root.x[4] - turn - float(result[name].frequency_correction)) < 1e-6
        assert name == "whirling" or abs(root.x[5]) < 1e-6
        found.add(name)
    assert found - {"undeformed"} == {state.name for state in result.states[1:] if state.exists}


def shape_of(name, size):
    root = mpmath.sqrt(size)
    turn = mpmath.expj(mpmath.mpf(2) / 7)
    return {"undeformed": [mpmath.mpc(0), mpmath.mpc(0)], "beating": [root * turn * mpmath.mpf(3) / 5, root * turn * mpmath.mpf(4) / 5],
            "whirling": [root * turn / mpmath.sqrt(2), 1j * root * turn / mpmath.sqrt(2)]}[name]


def numerical_eigenvalues(of, A, nu):
    """Eigenvalues of the central-difference Jacobian of dA/dt - i nu A for real and imaginary parts."""
    n, step = len(A), mpmath.mpf(10) ** -17
    columns = []
    for k in range(2 * n):
        sides = []
        for sign in (1, -1):
            moved = [a + (sign * step * (1j if k % 2 else 1) if j == k // 2 else 0) for j, a in enumerate(A)]
            sides.append([r - 1j * nu * a for r, a in zip(of(moved), moved, strict=True)])
        columns.append([part / (2 * step) for p, m in zip(*sides, strict=True) for part in ((p - m).real, (p - m).imag)])
    return [mpmath.mpc(value) for value in mpmath.eig(mpmath.matrix(columns).T, left=False, right=False)]


def paired(one, other, tolerance):
    """Tell whether two lists of numbers are the same up to their order."""
    rest = list(other)
    for value in one:
        nearest = min(rest, key=lambda candidate: abs(candidate - value))
        if abs(nearest - value) > tolerance:
            return False
        rest.remove(nearest)
    return not rest


@pytest.mark.parametrize("mu", ["1", "-3/7"])
@pytest.mark.parametrize("pattern", sorted(PATTERNS))
def test_eigenvalues_are_those_of_a_numerical_linearisation(filament_text, pattern, mu):
    result = evaluate_states(emitted_form("vector", PATTERNS[pattern]), filament_text, mu, 12)
    with mpmath.workdps(50):
        values = [mpmath.mpc(re, im) / 10 for re, im in PATTERNS[pattern]]
        distance = mpmath.mpf(1) if mu == "1" else -mpmath.mpf(3) / 7
        for state in result.states:
            if not state.exists:
                continue
            measured = numerical_eigenvalues(rate(values, distance), shape_of(state.name, mpmath.mpf(state.amplitude_squared)), mpmath.mpf(state.frequency_correction))
            listed = [mpmath.mpc(one.re, one.im) for one in state.eigenvalues]
            assert paired(listed, measured, mpmath.mpf(10) ** -11), (state.name, listed, measured)
            assert state.stable == all(value.real < 0 for value in measured if abs(value) > 1e-5)
            assert sum(one.neutral is not None for one in state.eigenvalues) == sum(abs(value) < 1e-5 for value in measured)


def test_the_filament_in_40_digits_against_a_numerical_linearisation():
    derivation = derivation_of("follower_force")
    result = evaluate_states(derivation.emit(), states_text(), "1", 40)
    coefficients = result_of("follower_force", 55)
    with mpmath.workdps(60):
        values = [mpmath.mpc(coefficients[name].value.re, coefficients[name].value.im) for name in ("alpha", "beta", "gamma")]
        for state in result.states:
            size, nu = mpmath.mpf(state.amplitude_squared), mpmath.mpf(state.frequency_correction)
            A = shape_of(state.name, size)
            if state.name != "undeformed":
                assert max(abs(r - 1j * nu * a) for r, a in zip(rate(values, 1)(A), A, strict=True)) < 1e-38
            listed = [mpmath.mpc(one.re, one.im) for one in state.eigenvalues]
            assert paired(listed, numerical_eigenvalues(rate(values, 1), A, nu), mpmath.mpf(10) ** -15)
    assert [state.stable for state in result.states] == [False, False, True] and result.criticality == "supercritical"


def test_every_digit_asked_for_is_right(filament_text):
    emitted = derivation_of("follower_force").emit()
    reference = evaluate_states(emitted, filament_text, "2/3", 60)
    with mpmath.workdps(70):
        for digits in (1, 7, 30):
            check_digits(evaluate_states(emitted, filament_text, "2/3", digits), reference, digits)


def check_digits(result, reference, digits):
    for one, right in zip(result.states, reference.states, strict=True):
        for name in ("amplitude_squared", "peak", "frequency_correction"):
            value = mpmath.mpf(getattr(right, name))
            assert abs(mpmath.mpf(getattr(one, name)) - value) <= abs(value) * mpmath.mpf(10) ** -digits
        for a, b in zip(one.eigenvalues, right.eigenvalues, strict=True):
            value = mpmath.mpc(b.re, b.im)
            assert abs(mpmath.mpc(a.re, a.im) - value) <= abs(value) * mpmath.mpf(10) ** -digits


@pytest.mark.parametrize("pattern", ["as the filament", "beating wins", "beating subcritical", "both subcritical"])
@pytest.mark.parametrize("start", [(1, 0), (0.5, 0.8660254j), (1, 0.02j)])
def test_decay_prefactors_against_long_integrations(filament_text, pattern, start):
    """At mu = 0: |A| t^(1/2) at a late time; or |A| becomes infinite as (t* - t)^(-1/2) with the prefactor given."""
    result = evaluate_states(emitted_form("vector", PATTERNS[pattern]), filament_text, 0)
    law = {one.perturbation: one for one in result.at_threshold}["planar" if start[1] == 0 else "general"]
    of = rate(complexes(pattern), 0)
    # time from the size: d theta = |A|^2 dt keeps steps of order one; the last unknown is t, the one before log |A|
    def stretched(theta, y):
        A = [complex(y[0], y[1]), complex(y[2], y[3])]
        A = [a / np.sqrt(sum(abs(b) ** 2 for b in A)) for a in A]
        slope = of(A)
        growth = sum((a.conjugate() * s).real for a, s in zip(A, slope, strict=True))
        direction = [s - growth * a for a, s in zip(A, slope, strict=True)]
        return [direction[0].real, direction[0].imag, direction[1].real, direction[1].imag, growth, np.exp(-2 * y[4])]

    y = np.array([start[0], 0, 0, complex(start[1]).imag, 0, 0], dtype=float)
    norm = np.sqrt(np.sum(y[:4] ** 2))
    y[:4] /= norm
    y[4] = np.log(norm)
    done = solve_ivp(stretched, (0, 14), y, rtol=1e-10, atol=1e-12, method="DOP853", dense_output=True)
    size, time = np.exp(done.y[4, -1]), done.y[5, -1]
    if law.decays:
        assert time > 1e3
        assert abs(size * np.sqrt(time) - float(law.prefactor)) < 2e-3 * float(law.prefactor)
    else:
        middle = done.sol(9.0)
        assert size > 50
        assert abs(np.exp(middle[4]) * np.sqrt(time - middle[5]) - float(law.prefactor)) < 2e-3 * float(law.prefactor)
    assert result["undeformed"].stable == {one.perturbation: one.decays for one in result.at_threshold}["general"]


def test_a_number_that_vanishes_is_said_and_not_guessed(filament_text):
    no_beating = evaluate_states(emitted_form("vector", ((7, 3), (-7, 2), (5, 1))), filament_text)
    assert no_beating["beating"].exists is False and no_beating.criticality is None and "next order" in " ".join(no_beating.warnings)
    neutral = evaluate_states(emitted_form("vector", ((0, 3), (-7, 2), (5, 1))), filament_text)
    assert neutral["whirling"].stable is None and neutral["beating"].stable is None and "ellipses" in " ".join(neutral.warnings)
    assert [one.im for one in neutral["whirling"].eigenvalues][2:] != ["0", "0"] and [one.re for one in neutral["whirling"].eigenvalues][2:] == ["0", "0"]


def test_cancellation_costs_digits_and_gets_them(filament_text):
    """alpha_r + beta_r = 10^-25: 15 digits of the beating state all the same."""
    form = emitted_form("vector", ((-9, 0), (9, 0), (5, 0)))
    tiny = acb(fmpq(1, 10**25))
    values = dict(form) | {"coefficient_1": lambda a: tenth((9, 0)) - tiny}
    state = evaluate_states(values, filament_text)["beating"]
    assert abs(Decimal(state.amplitude_squared) / Decimal("5e24") - 1) < Decimal("1e-15")


@pytest.mark.parametrize(("name", "mu", "expected"), [
    # van der Pol: radius 2 sqrt(mu), no frequency correction at this order
    ("van_der_pol", "1/4", {"cycle": ("0.25", "1", ["0", "-0.25"], True), "base": ("0", "0", ["0.125", "0.125"], False)}),
    # mu A - (3/4) A^3
    ("swift_hohenberg", "3", {"branch": ("4", "2", ["-6"], True), "base": ("0", "0", ["3"], False)}),
    # mu A - (A.A) A: radial and rotation
    ("vec_pitch", "1/4", {"branch": ("0.25", "0.5", ["-0.5", "0"], True), "base": ("0", "0", ["0.25", "0.25"], False)}),
    # Lorenz: 10/11 (mu A - (3/8) A^3)
    ("lorenz_pitch", "3/2", {"branch": ("4", "2", ["-2.72727272727273"], True)}),
])
def test_scalar_and_steady_states_known_by_hand(name, mu, expected):
    target = name if name in ("van_der_pol", "swift_hohenberg") else str(PROBLEMS / f"{name}.py")
    result = evaluate_states(derivation_of(target).emit(), states_text(target), mu)
    for state, (size, peak, eigenvalues, stable) in expected.items():
        one = result[state]
        assert one.exists and one.stable is stable
        assert abs(Decimal(one.amplitude_squared) - Decimal(size)) < Decimal("1e-14") and abs(Decimal(one.peak) - Decimal(peak)) < Decimal("1e-14")
        assert len(one.eigenvalues) == len(eigenvalues)
        assert all(abs(Decimal(value.re) - Decimal(right)) < Decimal("1e-13") for value, right in zip(one.eigenvalues, eigenvalues, strict=True))
    assert result.criticality == "supercritical"


def test_a_transcritical_branch_exists_on_both_sides_and_exchanges_stability():
    """mu A - 8/(3 pi) A^2."""
    target = str(PROBLEMS / "fisher.py")
    emitted, text = derivation_of(target).emit(), states_text(target)
    for mu, stable in (("2", True), ("-2", False)):
        result = evaluate_states(emitted, text, mu)
        assert result.criticality == "transcritical" and result["branch"].stable is stable and result["base"].stable is not stable
        assert abs(float(result["branch"].peak) - 2 * 3 * np.pi / 8) < 1e-13
        assert result["branch"].eigenvalues[0].re.startswith("-2.0" if stable else "2.0")


def test_the_hopf_bifurcation_of_the_lorenz_equations_is_subcritical():
    """Known since McLaughlin and Martin (1975): an unstable cycle below the threshold, growth at it."""
    target = str(PROBLEMS / "lorenz_hopf.py")
    emitted, text = derivation_of(target).emit(), states_text(target)
    below, there, above = (evaluate_states(emitted, text, mu) for mu in (-1, 0, 1))
    assert below.criticality == "subcritical" and below["cycle"].exists and below["cycle"].stable is False and below["base"].stable is True
    assert above["cycle"].exists is False and there["base"].stable is False and there.at_threshold[0].decays is False


def test_weak_effects_are_left_out_and_said():
    target = str(PROBLEMS / "weak_iso.py")
    result = evaluate_states(derivation_of(target).emit(), states_text(target))
    assert "epsilon = 0" in " ".join(result.warnings) and result["beating"].stable is True
    zero = str(PROBLEMS / "zero_cubic.py")
    assert evaluate_states(derivation_of(zero).emit(), states_text(zero))["branch"].exists is False


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_the_command_prints_the_contract():
    done = run("states", "follower_force", "--digits", "20", "--json")
    assert done.exit_code == 0
    data = json.loads(done.stdout)
    assert (data["problem"], data["mu"], data["digits"], data["criticality"]) == ("follower_force", "1", 20, "supercritical")
    assert [one["name"] for one in data["states"]] == ["undeformed", "beating", "whirling"]
    assert data["states"][1]["peak"].startswith("0.1741227769117924136") and data["states"][2]["frequency_correction"].startswith("10.36184626126612942")
    assert [set(one) for one in data["states"][1]["eigenvalues"]] == [{"re", "im", "direction", "neutral"}] * 4
    below = json.loads(run("states", "van_der_pol", "--mu", "-0.5", "--json").stdout)
    assert below["states"][1] == {"name": "cycle", "exists": False, "criticality": "supercritical", "amplitude_squared": None, "peak": None, "frequency_correction": None,
                                  "eigenvalues": [], "stable": None}
    assert below["states"][0]["stable"] is True
    assert "cycle: stable" in run("states", "van_der_pol").stdout


@pytest.mark.parametrize("mu", ["nan", "0.1.2", "1/0", "", "1_0", "1e99999", "x"])
def test_a_mu_that_is_no_exact_number_is_one_line_and_status_2(mu):
    done = run("states", "van_der_pol", "--mu", mu)
    assert done.exit_code == 2 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1 and "mu:" in done.stderr


def test_a_float_is_no_exact_mu(filament_text):
    with pytest.raises(EvaluationError, match="exact number"):
        evaluate_states(derivation_of("follower_force").emit(), filament_text, 0.5)
    with pytest.raises(EvaluationError, match="digits"):
        evaluate_states(derivation_of("follower_force").emit(), filament_text, 1, 0)


def test_texts_of_the_wrong_kind_and_digits_out_of_reach_are_said(filament_text, monkeypatch):
    form = emitted_form("vector", ((-9, 0), (9, 0), (5, 0)))
    with pytest.raises(EvaluationError, match="expected its text"):
        evaluate_states(form, "x = 1\n")
    monkeypatch.setattr("numerics.states.GUARDS", (8,))
    with pytest.raises(EvaluationError, match="15 digits of the states are not reached"):
        evaluate_states(form, filament_text)


def test_an_equation_with_other_families_is_refused(monkeypatch):
    monkeypatch.setattr("derive.states.FACTORS", FACTORS | {"dot(A,conj(A))*A": ("A", "A*", "A*")})
    with pytest.raises(DerivationError, match="other factors"):
        analyse(equation_of("complex vector", [(monomial, monomial) for monomial in MONOMIALS["vector"]]))


@pytest.mark.parametrize("name", ["follower_force", "van_der_pol", "swift_hohenberg", "vec_pitch", "fisher"])
def test_latex_of_the_states(name):
    target = name if not (PROBLEMS / f"{name}.py").exists() else str(PROBLEMS / f"{name}.py")
    states = states_of(target)
    text = run("states", target, "--latex").stdout.rstrip("\n") if name == "van_der_pol" else states.latex()
    assert text == states.latex() and "No others" in text
    assert text.count("\\begin{aligned}") == text.count("\\end{aligned}") > 4
    assert text.count("\\left") == text.count("\\right") > 0
    assert states._repr_latex_().startswith("$$") and states.as_dict()["analyses"]


# The spectrum at any control.

def test_the_first_complex_pair_of_the_filament_against_its_characteristic_determinant():
    """(ode) and (ode bcs), typed here: x'''' + F x'' + lambda x = 0; D = D_lambda = 0 by mpmath."""
    with mpmath.workdps(40):
        def D(growth, force):
            # exponents +-p, +-q with k^4 + F k^2 + lambda = 0; the basis is even and odd at s = 0
            root = mpmath.sqrt(mpmath.mpc(force) ** 2 / 4 - growth)
            p, q = mpmath.sqrt(-force / 2 + root), mpmath.sqrt(-force / 2 - root)
            even = [p**2 * mpmath.cosh(p) - q**2 * mpmath.cosh(q), p**3 * mpmath.sinh(p) - q**3 * mpmath.sinh(q)]
            odd = [p * mpmath.sinh(p) - q * mpmath.sinh(q), p**2 * mpmath.cosh(p) - q**2 * mpmath.cosh(q)]
            return even[0] * odd[1] - even[1] * odd[0]

        def both(growth, force):
            return [D(growth, force).real, mpmath.diff(lambda one: D(one, force), growth).real]

        growth, force = mpmath.findroot(both, (mpmath.mpf(-121), mpmath.mpf(20)), tol=1e-25)
        merging = first_complex_pair(derivation_of("follower_force").emit(), 20)
        assert abs(mpmath.mpf(merging.control) / force - 1) < 1e-20
        assert abs(mpmath.mpf(merging.growth_rate) / growth - 1) < 1e-20


def test_growth_rates_below_and_above_the_merging():
    emitted = derivation_of("follower_force").emit()
    below, above = growth_rates(emitted, 20.0), growth_rates(emitted, 20.1)
    assert np.abs(below[:2].imag).max() < 1e-6 and abs(above[0].imag) > 1 and abs(above[0] - above[1].conjugate()) < 1e-6
    # (ode) without force: x'''' = -lambda x, the clamped-free beam: k = 1.8751040687
    assert abs(growth_rates(emitted, 0.0)[0] + 1.8751040687119611664**4) < 1e-6


@pytest.mark.parametrize(("target", "said"), [("swift_hohenberg", "steady"), ("van_der_pol", "no control")])
def test_where_there_is_no_merging_it_is_said(target, said):
    with pytest.raises(EvaluationError, match=said):
        first_complex_pair(derivation_of(target).emit())


@pytest.mark.parametrize(("name", "count"), [("follower_force", 5), ("follower_force_planar", 3), ("van_der_pol", 2)])
def test_check_covers_every_published_number_of_states_and_spectrum(name, count):
    reference = reference_of(name)
    further = further_values(reference, derivation_of(name).emit(), states_text(name))
    comparison = compare(result_of(name), reference, further)
    names = [entry["name"] for entry in reference["state"]]
    assert len(names) == count and [line.name for line in comparison.lines][-count:] == names
    assert comparison.agrees
    wrong = [dict(entry, printed=entry["printed"][:-1] + ("1" if entry["printed"][-1] != "1" else "3")) for entry in reference["state"]]
    assert not any(line.agrees for line in compare(result_of(name), reference | {"state": wrong}, further).lines[-count:])
    assert not compare(result_of(name), reference, {}).agrees


def test_the_check_command_compares_states_too():
    done = run("check", "van_der_pol")
    assert done.exit_code == 0 and "cycle.peak" in done.stdout and "DISAGREES" not in done.stdout


def test_an_operator_that_is_no_polynomial_in_the_growth_rate_is_refused():
    form = emitted_form("scalar", ((-9, 0), (5, 0))) | {"critical": lambda a: Operator(matrix=((a.control - a.i * a.frequency + 1 / (a.frequency + 9),),))}
    with pytest.raises(EvaluationError, match="no polynomial in the growth rate"):
        growth_rates(form, 0.0)
