"""The report: one sound page, for any problem, in any browser; a folder that is never half written."""

import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest
from click.testing import CliRunner
from conftest import PROBLEMS

from derive.cli import main
from derive.mathml import broken, cells, display, math, width
from derive.problem import load_problem
from derive.report import Settings, reproduce

SECTIONS = ("statement", "symbols", "orders", "adjoint", "solvability", "amplitude", "coefficients", "comparison", "states", "figures", "animation", "speed", "validation", "confirmation", "emitted")
VOID = frozenset("meta link br wbr input img hr".split())
TARGETS = {"follower_force": "follower_force", "fisher": str(PROBLEMS / "fisher.py"), "brus": str(PROBLEMS / "brusselator_ode.py")}
"""name of the problem: TARGET"""


class Page(HTMLParser):
    """Reads a page; every element that is not void has to be closed where it was opened."""

    def __init__(self, text):
        super().__init__()
        self.open, self.identifiers, self.links, self.addresses, self.counts, self.faults = [], [], [], [], {}, []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        for name, value in attributes:
            if name == "id":
                self.identifiers.append(value)
            elif name == "href" and tag == "a":
                self.links.append(value)
            elif name in ("src", "href", "xlink:href", "action", "data", "poster"):
                self.addresses.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.faults.append(tag)


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Return the folder of each target, reproduced quickly and with few figures."""
    folders = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("derive.report.DRAWINGS", ("mode", "bifurcation"))
        for name, target in TARGETS.items():
            folder = tmp_path_factory.mktemp("report") / "out"
            done = CliRunner().invoke(main, ["reproduce", target, "--quick", "--digits", "15", "--out", str(folder)])
            assert done.exit_code == 0, done.output
            folders[name] = folder
    return folders


@pytest.mark.parametrize("name", TARGETS)
def test_the_page_is_sound_and_loads_nothing(reports, name):
    text = (reports[name] / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not page.faults and not page.open
    assert len(page.identifiers) == len(set(page.identifiers))
    assert set(SECTIONS) <= set(page.identifiers)
    assert all(link.startswith("#") and link[1:] in page.identifiers for link in page.links) and len(page.links) > 40
    assert all(address.startswith(("#", "data:")) for address in page.addresses)
    assert all(address[1:] in page.identifiers for address in page.addresses if address.startswith("#"))
    rest = text.replace("http://www.w3.org/1999/xlink", "").replace("http://www.w3.org/2000/svg", "")
    assert "http:" not in rest and "https:" not in rest and "@import" not in text and not re.search(r"url\((?!#)", text)
    assert page.counts["math"] > 40 and page.counts["h1"] == 1 and page.counts["svg"] >= 2
    assert "<code>\\" not in text.split('<section id="comparison"')[0]  # every formula is rendered


def test_the_page_holds_the_digits_and_the_comparison(reports):
    text = (reports["follower_force"] / "report.html").read_text(encoding="utf-8")
    for value in ("37.695430840", "451.037653968", "6 digits", "Misprints in the source", "whirling", "Something DISAGREES"):
        assert (value in text) == (value != "Something DISAGREES")
    other = (reports["fisher"] / "report.html").read_text(encoding="utf-8")
    assert "no published values" in other and "the animation needs" not in other and "--quick was asked for" in other


@pytest.mark.parametrize("name", TARGETS)
def test_the_folder_keeps_what_it_should(reports, name):
    names = {path.name for path in reports[name].iterdir()}
    expected = {f"{name}.py", f"{name}.tex", "coefficients.json", "summary.txt", "report.html", "figures"}
    assert expected <= names <= expected | {"report.pdf"}
    assert ("report.pdf" in names) == (shutil.which("pdflatex") is not None)
    assert {path.suffix for path in (reports[name] / "figures").iterdir()} == {".svg"}


@pytest.fixture
def no_figures(monkeypatch):
    """Draw nothing."""
    monkeypatch.setattr("derive.report.drawings_of", lambda derivation, emitted, points, stages: {})


def test_without_latex_one_line_says_so(tmp_path, monkeypatch, no_figures):
    monkeypatch.setenv("PATH", str(tmp_path))
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0 and not (tmp_path / "out" / "report.pdf").exists()
    assert [line for line in done.stdout.splitlines() if "pdflatex" in line] == ["no report.pdf: found no pdflatex on PATH; install a LaTeX distribution to get the derivation as PDF"]


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path / "file" / "out")])
    assert done.exit_code == 2 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("quick", [True, False])
def test_the_stages_are_run_in_the_order_in_which_they_are_announced(tmp_path, monkeypatch, quick):
    monkeypatch.setattr("derive.report.DRAWINGS", ("growth",))
    for name in ("full_points_of", "speed_of", "validation_of"):
        monkeypatch.setattr(f"derive.report.{name}", lambda *arguments: None)
    settings, announced = Settings(digits=12, quick=quick), []
    reproduce(load_problem("van_der_pol"), tmp_path, settings, announced.append, lambda line: None)
    assert tuple(announced) == settings.stages


def test_a_mistake_in_the_digits_is_told_once(tmp_path):
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--digits", "0", "--out", str(tmp_path)])
    assert done.exit_code == 2 and done.stdout == "" and done.stderr.count("found 0") == len(done.stderr.splitlines()) == 1


def test_an_interrupted_run_leaves_what_was_there(tmp_path, monkeypatch, no_figures):
    (tmp_path / "report.html").write_text("before")

    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("derive.report.summary_of", interrupt)
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 130 and {path.name: path.read_text() for path in tmp_path.iterdir()} == {"report.html": "before"}


def test_a_part_that_fails_shows_its_reason_and_a_disagreement_is_status_1(tmp_path, monkeypatch, no_figures):
    from numerics.precision import EvaluationError

    def refuse(*arguments):
        raise EvaluationError("the states\nwould not come")

    monkeypatch.setattr("derive.report.evaluate_states", refuse)
    monkeypatch.setattr("derive.report.compared", refuse)
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 0 and "the states would not come" in (tmp_path / "report.html").read_text(encoding="utf-8")
    monkeypatch.setattr("derive.report.agreeing_digits", lambda one, other: 3)
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 1 and "Something DISAGREES" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_fault_of_the_program_is_shown_and_is_status_1(tmp_path, monkeypatch, no_figures):
    monkeypatch.setattr("derive.report.evaluate_states", lambda *arguments: {}["nothing"])
    done = CliRunner().invoke(main, ["reproduce", "van_der_pol", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 1 and "internal error: KeyError" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_rows_are_cut_at_their_alignment_only():
    row = r"\left(\begin{array}{cc} a & b \\ c & d \end{array}\right) x &= \frac{1}{2} y \\" "\n" r"&\quad + z"
    assert cells(row) == [(r"\left(\begin{array}{cc} a & b \\ c & d \end{array}\right) x", r"= \frac{1}{2} y"), ("", r"\quad + z")]
    page = Page(display([row], "matrix"))
    assert not page.faults and not page.open and page.counts["mtable"] == 1 and page.counts["tr"] == 2


def test_a_pair_of_delimiters_may_go_over_lines():
    (_, one), (_, other) = cells(r"x &= \left\{ a \\" "\n" r"&\quad + b \right\}")
    assert (one, other) == (r"= \left\{ a  \right.", r"\left. \quad + b \right\}")


def test_a_broken_line_keeps_every_symbol_and_balances_its_delimiters():
    latex = r"= \frac{1}{\xi} \left\{ \int_{0}^{1} \left[" + " + ".join(rf"\phi_{{{k}}} \left(a_{{{k}}} - b\right)" for k in range(20)) + r"\right] \mathrm{d} s \right\}"
    lines = broken(latex, 60)
    assert len(lines) > 2 and max(map(width, lines)) < 90
    assert all(line.count(r"\left") == line.count(r"\right") for line in lines)
    rejoined = "".join(line.replace(r"\right.", "").replace(r"\left.", "").replace(r"\quad", "") for line in lines)
    assert rejoined.replace(" ", "") == latex.replace(" ", "")
    assert all(not Page(math(line)).faults for line in lines)


def chromium(page, tmp_path, *options):
    """Return what a headless browser writes to standard error and standard output."""
    program = next((found for found in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if found), None)
    if program is None:
        pytest.skip("found no Chromium on PATH")
    common = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run", "--hide-scrollbars",
              f"--user-data-dir={tmp_path / 'profile'}", "--enable-logging=stderr", "--v=0")
    done = subprocess.run([program, *common, *options, page.as_uri()], capture_output=True, timeout=120, check=True)
    return done.stderr.decode("utf-8", "replace"), done.stdout.decode("utf-8", "replace")


@pytest.mark.parametrize("wide", [1280, 400])
def test_a_browser_shows_formulas_and_figures_without_an_error(reports, tmp_path, wide):
    from PIL import Image

    said, _ = chromium(reports["follower_force"] / "report.html", tmp_path, f"--window-size={wide},4000", f"--screenshot={tmp_path / 'page.png'}")
    assert "CONSOLE" not in said
    with Image.open(tmp_path / "page.png") as image:
        grey = image.convert("L")
        assert grey.size == (wide, 4000)
        for top in range(0, 4000, 1000):  # every part of the page holds ink, and is not full of it
            dark = sum(grey.crop((0, top, wide, top + 1000)).histogram()[:110])
            assert 0.002 < dark / (1000 * wide) < 0.2


@pytest.mark.slow
def test_the_whole_job_agrees_with_itself(tmp_path):
    done = CliRunner().invoke(main, ["reproduce", "follower_force", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    page = Page((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert not page.faults and page.counts["canvas"] == 1 and page.counts["svg"] == 7
    assert {"animation.gif", "animation.html", "speed.svg"} <= {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    said, dumped = chromium(tmp_path / "out" / "report.html", tmp_path, "--dump-dom")
    assert "CONSOLE" not in said
    assert dumped.count("<svg") == 7 and dumped.count("<math") > 100 and dumped.count("<mfrac") > 30
