"""Cubic coefficients against the full nonlinear problem, solved by harmonic balance: nothing of the derivation is used.

In `gamma mu + kappa a^2 - i (Omega - omega) = O(a^4)` the solver measures mu and Omega at two amplitudes.
"""

import pytest
from conftest import PROBLEMS, derivation_of, result_of
from harmonic_balance import cubic_coefficient

CUBIC = ("A**2*conj(A)", "A**3", "dot(A,A)*conj(A)", "dot(A,conj(A))*A", "dot(A,A)*A")

CASES = [
    # problem, amplitude, nodes, relative tolerance
    ("implicit", 0.01, 1, 2e-3), ("pendulum_cart", 0.03, 1, 1e-5), ("lorenz_pitch", 0.05, 1, 1e-9), ("chafee", 0.1, 16, 1e-5), ("varcoef", 0.05, 18, 1e-5),
    ("basedep", 0.05, 18, 1e-5), ("brus_pde", 0.01, 18, 1e-4), ("beck", 0.003, 20, 1e-3), ("tipmass", 0.001, 16, 3e-3), ("elastica", 0.1, 16, 1e-5),
    pytest.param("fhn_nodiff", 0.05, 16, 1e-4, marks=pytest.mark.slow), ("auxiliary", 0.05, 16, 1e-6), ("isotropic_vdp", 0.05, 1, 1e-5), ("ks", 0.2, 16, 1e-4),
]


def measured_and_derived(target, amplitude, nodes, direction=None):
    derivation, result = derivation_of(target), result_of(target)
    frequency = float(result.threshold.frequency) if result.threshold.frequency else None
    gamma = complex(next(one.value for one in result.coefficients if one.monomial == "mu*A"))
    cubic = [complex(one.value) for one in result.coefficients if one.monomial in CUBIC]
    kappa, _ = cubic_coefficient(derivation.problem.formulation, float(result.threshold.control), frequency, gamma, amplitude, nodes, direction=direction)
    return kappa, (2 * cubic[1] if direction == "whirling" else sum(cubic))


@pytest.mark.parametrize(("name", "amplitude", "nodes", "tolerance"), CASES)
def test_the_cubic_coefficient_is_that_of_the_full_problem(name, amplitude, nodes, tolerance):
    kappa, derived = measured_and_derived(str(PROBLEMS / f"{name}.py"), amplitude, nodes)
    assert abs(kappa - derived) < tolerance * abs(derived)


def test_whirling_of_the_full_problem_gives_the_other_coefficient():
    """A circular state has dot(A,A) = 0, so it measures the coefficient of dot(A,conj(A))*A alone."""
    kappa, derived = measured_and_derived(str(PROBLEMS / "isotropic_vdp.py"), 0.05, 1, "whirling")
    assert abs(kappa - derived) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["follower_force", str(PROBLEMS / "ff_iso.py"), str(PROBLEMS / "ff_inertia.py")])
@pytest.mark.parametrize("direction", [None, "whirling"])
def test_beating_and_whirling_of_filaments(name, direction):
    kappa, derived = measured_and_derived(name, 0.003, 14, direction)
    assert abs(kappa - derived) < 2e-3 * abs(derived)
