"""Every coefficient against bordered least squares on the rows as stated: no elimination, no adjoint, no amplitude algebra is shared."""

import pytest
from bordered import bordered_coefficients, compressed_spectrum
from conftest import PROBLEMS, derivation_of, result_of

QUICK = {"ziegler", "bc_eps", "bc_tds", "chafee", "fisher", "isotropic_vdp", "ks", "lorenz_hopf", "mass_matrix", "pendulum_cart", "vec_norot", "vec_pitch", "weak_iso", "weak_scalar"}
LARGE = {"layer": 150}
CASES = [pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.slow) for path in sorted(PROBLEMS.glob("*.py"))]


@pytest.mark.parametrize("name", CASES)
def test_bordered_systems_give_the_same_coefficients(name):
    target = str(PROBLEMS / f"{name}.py")
    formulation, result = derivation_of(target).problem.formulation, result_of(target)
    frequency = float(result.threshold.frequency) if result.threshold.frequency else None
    found, _ = bordered_coefficients(formulation, float(result.threshold.control), frequency, LARGE.get(name, 32))
    for one in result.coefficients:
        if one.monomial.startswith("epsilon*dot"):
            i, j = int(one.monomial[-1]) - 1, int(one.monomial[len("epsilon*dot(A,e")]) - 1
            expected = found["weak"][i][j]
        else:
            expected = found["weak"][0][0] if one.monomial == "epsilon*A" else found[one.monomial]
        assert abs(complex(one.value) - expected) <= 1e-6 * max(abs(expected), 1e-6)


@pytest.mark.parametrize("name", ["bc_tds", "brusselator_ode", "chafee", "lorenz_hopf", "pendulum_cart"])
def test_nothing_grows_below_the_threshold_and_something_does_above(name):
    """The spectrum of the rectangular pencil of all rows, by two random compressions."""
    target = str(PROBLEMS / f"{name}.py")
    formulation, control = derivation_of(target).problem.formulation, float(result_of(target).threshold.control)
    low, high = (float(end) for end in formulation.control_range)
    below, above = (max(value.real for value in compressed_spectrum(formulation, place, 16) if abs(value) < 1e3) for place in (control - (control - low) / 10, control + (high - control) / 10))
    assert below < -1e-6 and above > 1e-6
