"""`fredholm figures`: which figures there are for a problem, the same at every run, and what they mark."""

import subprocess
import sys
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS, ROOT, derivation_of

from derive.cli import main
from derive.spectrum import spectrum_curves
from derive.states import derive_states
from numerics import EvaluationError
from numerics.animation import animation_of, fragment_of, page_of
from numerics.case import bounded, branches, case_of
from numerics.drawing import saved, symbol
from numerics.figures import NAMES, Spectra, draw, joined


@cache
def case(target):
    generated = ROOT / "generated" / f"{target}.py"
    derivation = derivation_of(target)
    return case_of(generated.read_text(encoding="utf-8") if generated.is_file() else derivation.emit(), derive_states(derivation).emit())


def figures(*arguments):
    return CliRunner().invoke(main, ["figures", *map(str, arguments)])


def test_oscillation_starts_where_the_paper_says():
    """F_o = 20.051, in section Linear theory; the eigenvalue at the threshold is i omega."""
    curves = spectrum_curves(derivation_of("follower_force"), 5)
    assert curves.oscillation == pytest.approx(20.051, abs=5e-4)
    at = np.argmin(np.abs(curves.controls - 37.6954308))
    first = curves.eigenvalues[at, 0]
    assert abs(first.real) < 1e-4 and abs(first.imag) == pytest.approx(191.2586357, abs=1e-4)
    assert spectrum_curves(derivation_of("van_der_pol"), 5).oscillation is None


def test_a_figure_is_the_same_at_every_run_and_has_no_date():
    one, other = (saved(draw(case("van_der_pol"), "mode"), "svg") for _ in range(2))
    assert one == other and len(one) > 1000 and b"<dc:date>" not in one


@pytest.mark.slow
@pytest.mark.parametrize("form", ["svg", "png", "pdf"])
@pytest.mark.parametrize("name", ["bifurcation", "approach", "decay"])
def test_every_format_is_the_same_at_every_run(form, name):
    assert saved(draw(case("follower_force"), name), form) == saved(draw(case("follower_force"), name), form)


def test_one_figure_is_written(tmp_path):
    done = figures("van_der_pol", "--only", "bifurcation", "--out", tmp_path)
    assert done.exit_code == 0 and [path.name for path in tmp_path.iterdir()] == ["bifurcation.svg"]


def test_an_interruption_leaves_every_figure_that_was_there(tmp_path, monkeypatch):
    def interrupted(one, name, spectra=None):
        if name == "bifurcation":
            raise KeyboardInterrupt
        return draw(one, name, spectra)

    (tmp_path / "mode.svg").write_text("mine")
    monkeypatch.setattr("numerics.figures.NAMES", ("mode", "bifurcation"))
    monkeypatch.setattr("numerics.figures.draw", interrupted)
    done = figures("van_der_pol", "--out", tmp_path)
    assert done.exit_code == 130 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["mode.svg"] and (tmp_path / "mode.svg").read_text() == "mine"


def test_a_folder_that_cannot_be_written_is_said_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "taken").write_text("mine")
    monkeypatch.setattr("derive.cli.drawn", None)
    done = figures("van_der_pol", "--out", tmp_path / "taken" / "inside")
    assert done.exit_code == 2 and done.stdout == "" and len(done.stderr.splitlines()) == 1 and "found a file where a folder was expected" in done.stderr
    assert (tmp_path / "taken").read_text() == "mine"


def test_pyplot_is_not_touched():
    command = "import sys, numerics.figures, numerics.animation; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command], cwd=ROOT).returncode == 0


@pytest.mark.slow
def test_what_applies_is_drawn_and_what_does_not_is_said(tmp_path):
    done = figures("swift_hohenberg", "--out", tmp_path, "--format", "png")
    assert done.exit_code == 0
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.png" for name in ("growth", "mode", "bifurcation", "transients", "approach", "decay", "spacetime")}
    assert [line.split()[1] for line in done.stderr.splitlines()] == ["animation"]


@pytest.mark.parametrize("arguments", [("van_der_pol", "--only", "none"), ("van_der_pol", "--format", "gif"), ("van_der_pol", "--only", "spacetime")])
def test_a_mistake_is_one_line(tmp_path, arguments):
    done = figures(*arguments, "--out", tmp_path / "out")
    assert done.exit_code == 2 and len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "out").exists()


def test_states_are_drawn_with_their_stability():
    filament = {one.name: one for one in branches(case("follower_force"))}
    assert (filament["beating"].stability, filament["whirling"].stability) == ("partly", "stable")
    assert filament["beating"].peak * np.sqrt(filament["beating"].share) == pytest.approx(0.17412, abs=5e-6)
    assert filament["whirling"].peak * np.sqrt(filament["whirling"].share) == pytest.approx(0.16840, abs=5e-6)
    assert [one.stability for one in branches(case(str(PROBLEMS / "isotropic_vdp.py")))] == ["stable", "unstable"]
    (cycle,) = branches(case(str(PROBLEMS / "lorenz_hopf.py")))
    assert cycle.stability == "unstable" and cycle.share < 0
    assert "-." in {line.get_linestyle() for line in draw(case("follower_force"), "bifurcation").axes[0].lines}


def test_a_motion_that_becomes_infinite_is_drawn_until_it_leaves_the_panel():
    """dA/dt = gamma mu A + c A^2 from A < 0 above the threshold: |A| reaches 3 of its scale in a finite time, a little before it is infinite."""
    fisher = case(str(PROBLEMS / "fisher.py"))
    size, sign = fisher.size, -1 if fisher.planar.real < 0 else 1
    for share in (0.03, 0.2):
        motion, until = bounded(fisher, (complex(sign * share * size),), 1.0, 6 / fisher.gamma.real, 3 * size)
        assert 2.5 * size < abs(motion.amplitude(np.array([until]))[0]) <= 3 * size


def test_growth_rates_and_a_control_of_the_same_letter_are_told_apart():
    spectra = Spectra(controls=np.linspace(-1, 1, 5), eigenvalues=np.linspace(-1, 1, 5).reshape(5, 1) + 0j, oscillation=None)
    problem = case("swift_hohenberg")
    named = replace(problem, module=SimpleNamespace(CONTROL="lambda"))
    assert draw(problem, "growth", spectra).axes[0].get_ylabel() == r"$\lambda$" and draw(named, "growth", spectra).axes[0].get_ylabel() == r"$\sigma$"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["steady", "transcritical", "subcritical", "real vector"])
def test_every_kind_is_drawn_and_saved(name):
    target = {"steady": "chafee", "transcritical": "fisher", "subcritical": "lorenz_hopf", "real vector": "buckle3d"}[name]
    for figure in ("mode", "bifurcation", "transients", "approach"):
        assert len(saved(draw(case(str(PROBLEMS / f"{target}.py")), figure), "svg")) > 1000


@pytest.mark.parametrize("name", ["mode", "transients", "approach", "decay"])
def test_the_figures_of_the_filament_have_panels_with_lines(name):
    figure = draw(case("follower_force"), name)
    assert len(figure.axes) == {"mode": 4, "transients": 4, "approach": 6, "decay": 1}[name]
    assert all(axes.lines for axes in figure.axes)


def test_a_vanishing_cubic_coefficient_is_said():
    with pytest.raises(EvaluationError, match="vanishing"):
        draw(case(str(PROBLEMS / "zero_cubic.py")), "bifurcation")


def test_the_animation_whirls_at_the_end_and_its_page_loads_nothing():
    animation = animation_of(case("follower_force"), turns=3, places=5)
    radius = np.hypot(*animation.curves[-8:, -1, :2].T)
    assert radius == pytest.approx(0.16840 * np.sqrt(case("follower_force").mu), rel=0.03)
    assert np.abs(animation.curves[:, 0]).max() < 1e-12
    page = page_of(animation)
    assert page == page_of(animation) and fragment_of(animation) in page
    assert "http" not in page and "src=" not in page and "@" not in page.replace("@media", "")
    with pytest.raises(EvaluationError, match="animation"):
        animation_of(case("van_der_pol"))


def test_eigenvalue_curves_are_joined_by_nearness():
    values = np.array([[1, 2], [2.1, 1.1], [1.2, 2.2]], dtype=complex)
    assert joined(values)[:, 0].real == pytest.approx([1, 1.1, 1.2])


def test_symbols():
    assert symbol("lambda_1", "c") == r"\lambda_{1,c}" and symbol("F", "o") == "F_{o}" and symbol("Re") == r"\mathrm{Re}" and symbol("s_") == "s"
    assert len(set(NAMES)) == 8 and Spectra.__slots__
