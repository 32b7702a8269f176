"""The bench: routes that share nothing agree, a claim that is too small is a failure, the diagram is drawn."""

import importlib.util
import json

import mpmath
import pytest
from click.testing import CliRunner
from conftest import derivation_of, result_of

from derive.cli import main
from derive.hard_cases import hard_cases
from numerics import bench
from numerics.bench import Measurement, Route, compared, diagram, measure, of_result, table
from numerics.naive import Nested, Sums, evaluate_naively
from numerics.precision import EvaluationError


@pytest.mark.slow
def test_exponential_sums_in_mpmath_confirm_thirty_digits_of_the_filament():
    control, frequency, coefficients = evaluate_naively(derivation_of("follower_force").emit(), Sums, 34)
    result = result_of("follower_force", 30)
    context = mpmath.MPContext()
    context.dps = 40
    assert abs(control - context.mpf(result.threshold.control)) < context.mpf("1e-29")
    assert abs(frequency - context.mpf(result.threshold.frequency)) < context.mpf("1e-28")
    for one in result.coefficients:
        assert abs(coefficients[one.name] - context.mpc(one.value.re, one.value.im)) < context.mpf("1e-29") * abs(coefficients[one.name])


def test_heavy_column_is_that_of_bessel_functions():
    """W = (9/4) j^2 with J_{-1/3}(j) = 0, theta = sqrt(x) J_{-1/3}(j x^{3/2}) at x = 1 - s; cubic coefficient -(W/6) int x theta^4 / int theta^2."""
    mp = mpmath.MPContext()
    mp.dps = 25
    j = mp.findroot(lambda z: mp.besselj(-mp.mpf(1) / 3, z), 1.8663)
    weight = mp.mpf(9) / 4 * j**2

    def theta(x):
        return mp.sqrt(x) * mp.besselj(-mp.mpf(1) / 3, j * x ** mp.mpf("1.5")) if x else top

    top = (j / 2) ** (-mp.mpf(1) / 3) / mp.gamma(mp.mpf(2) / 3)
    square = mp.quad(lambda x: theta(x) ** 2, [0, 1])
    cubic = -weight / 6 * mp.quad(lambda x: x * theta(x) ** 4, [0, 1]) / square / top**2
    linear = mp.quad(lambda x: x * theta(x) ** 2, [0, 1]) / square
    result = result_of("heavy_column", 18)
    for text, exact in ((result.threshold.control, weight), (result["A**3"].value.re, cubic), (result["mu*A"].value.re, linear)):
        assert abs(mp.mpf(text) - exact) < mp.mpf("1e-17")


@pytest.mark.slow
def test_nested_quadrature_needs_only_the_emitted_text():
    control, frequency, coefficients = evaluate_naively(derivation_of("heavy_column").emit(), Nested, 15)
    assert frequency is None
    assert abs(control - mpmath.mpf("7.8373474389434839")) < 1e-13
    assert abs(coefficients["A**3"] - mpmath.mpf("-0.29709180255651702")) < 1e-11


def test_a_claim_below_the_true_error_is_a_failure():
    reference = {"control": ("1", "1e-100"), "alpha": (("1", "2"), "1e-100")}
    good = compared({"control": (1.0, 1e-15), "alpha": (complex(1, 2 + 1e-12), 2e-12)}, reference)
    assert good[2] == () and good[0] == pytest.approx(1e-12 / 5**0.5, rel=1e-3) and good[1] == pytest.approx(2e-12 / 5**0.5)
    bad = compared({"control": (1.0, 1e-15), "alpha": (complex(1, 2 + 1e-12), 1e-13)}, reference)
    assert len(bad[2]) == 1 and bad[2][0].startswith("alpha: true error 1.0e-12, claimed 1.0e-13")
    assert compared({"control": (1.0, None)}, reference)[2] == ("alpha is missing",)


def routes(text, quick):
    from numerics import evaluate

    return [Route(name="closed, 15 digits", family="closed in flint", run=lambda: of_result(evaluate(text, digits=15))),
            Route(name="refused", family="none", run=lambda: of_result(evaluate(text, digits=0)))]


def test_command_prints_json_and_writes_the_diagram(monkeypatch, tmp_path):
    monkeypatch.setattr(bench, "routes_of", routes)
    done = CliRunner().invoke(main, ["bench", "van_der_pol", "--json", *(["--out", str(tmp_path)] if importlib.util.find_spec("matplotlib") else [])])
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert found["reference_digits"] == "130"
    first, second = found["measurements"]
    assert float(first["true_error"]) <= float(first["claimed_error"]) < 1e-14
    assert "digits" in second["refusal"]
    if importlib.util.find_spec("matplotlib"):
        assert {path.name for path in tmp_path.iterdir()} == {"bench.json", "van_der_pol.svg", "van_der_pol.png"}
        assert json.loads((tmp_path / "bench.json").read_text()) == found


def test_command_fails_on_a_claim_that_is_too_small(monkeypatch):
    def lying(text, quick):
        return [Route(name="liar", family="none", run=lambda: {**of_result(result_of("van_der_pol", 15)), "A**2*conj(A)": (("-0.5", "1e-9"), "1e-12")})]

    monkeypatch.setattr(bench, "routes_of", lying)
    done = CliRunner().invoke(main, ["bench", "van_der_pol"])
    assert done.exit_code == 1
    assert "claimed error below the true one: van_der_pol, liar: A**2*conj(A)" in done.stderr
    assert "FAILED" in done.stdout


def some_cases():
    """A case that is right, one that loses digits, and one that is refused."""
    return [one for one in hard_cases() if one.name in ("exponents 40 +- i pi", "second harmonic 1e-4 from resonance", "Hopf, omega^2 = 0", "parameters of size 1e12")]


def test_hard_cases_are_reported_with_the_digits_lost(monkeypatch):
    monkeypatch.setattr(bench, "routes_of", routes)
    monkeypatch.setattr("derive.hard_cases.hard_cases", some_cases)
    done = CliRunner().invoke(main, ["bench", "van_der_pol", "--hard", "--json"])
    assert done.exit_code == 0, done.output
    found = {one["name"]: one for one in json.loads(done.stdout)["hard_cases"]}
    assert found["Hopf, omega^2 = 0"]["outcome"] == "refused" and "stable" in found["Hopf, omega^2 = 0"]["said"][0]
    assert float(found["exponents 40 +- i pi"]["digits_lost"]) > 5
    assert 2 < float(found["second harmonic 1e-4 from resonance"]["digits_lost"]) < 8
    assert float(found["parameters of size 1e12"]["error_of_doubles"]) < 1e-12
    assert all(float(one["true_error"]) <= float(one["claimed_error"]) < 1e-16 for one in found.values() if one["outcome"] == "right")
    done = CliRunner().invoke(main, ["bench", "van_der_pol", "--hard"])
    assert "hard cases" in done.stdout and "refused: " in done.stdout


def test_a_wrong_hard_case_fails(monkeypatch):
    monkeypatch.setattr(bench, "routes_of", routes)
    monkeypatch.setattr("derive.hard_cases.hard_cases", lambda: some_cases()[:1])
    monkeypatch.setattr(bench, "second_route", lambda text, result, near: {"control": ("1600", None), **{one.name: ((one.value.re, one.value.im), None) for one in result.coefficients}})
    done = CliRunner().invoke(main, ["bench", "van_der_pol", "--hard"])
    assert done.exit_code == 1 and "WRONG" in done.stdout and "exponents 40 +- i pi" in done.stderr


def test_table_and_diagram_hold_every_route():
    pytest.importorskip("matplotlib")
    made = measure("van_der_pol", Route(name="closed", family="closed in flint", run=lambda: of_result(result_of("van_der_pol", 15))), of_result(result_of("van_der_pol", 40)))
    assert isinstance(made, Measurement) and made.failures == () and made.warm > 0
    assert "closed" in table([made], {"van_der_pol": False})
    assert diagram("van_der_pol", [made], "svg").startswith(b"<?xml") and diagram("van_der_pol", [made], "png").startswith(b"\x89PNG")


def test_without_space_there_is_no_naive_route():
    with pytest.raises(EvaluationError, match="found no space"):
        evaluate_naively(derivation_of("van_der_pol").emit(), Sums, 15)
