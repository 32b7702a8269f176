"""The main job: derivation, emitted code, coefficients by every route, comparison, states, figures, checks, as one folder with report.html."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache, partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from derive.derivation import Derivation, derive_amplitude_equation
from derive.files import check_folder, write_files
from derive.latex import Writer, document
from derive.problem import Problem
from derive.statement import DerivationError, one_line
from derive.states import States, derive_states
from numerics.coefficients import Result, evaluate
from numerics.comparison import Comparison, compare, further_values, reference_of
from numerics.precision import EvaluationError
from numerics.states import StatesResult, evaluate_states

if TYPE_CHECKING:
    from numerics.case import Case
    from numerics.figures import Spectra

FAILURES = (DerivationError, EvaluationError, ArithmeticError, ValueError, ImportError)
"""What may keep an optional part from the report: it then holds the reason. Anything else is a fault of the program, shown too, and no agreement."""
FAULT = "internal error: "
ROUTES = ("closed", "chebyshev", "quadrature", "certified")
DRAWINGS = ("growth", "mode", "bifurcation", "transients", "approach", "decay", "spacetime")
MEASURED = ("double, one", "closed, ", "certified, 100 ", *(f"{family}, {nodes} nodes" for family in ("chebyshev", "quadrature") for nodes in (8, 12, 16, 24)))
"""How the names of the routes begin whose speed a report measures: those that take little time; `fredholm bench` measures all."""
QUICK = "--quick was asked for"
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Digits of the coefficients, and whether animation, speed and validation are left out."""

    digits: int = 30
    quick: bool = False

    @property
    def stages(self) -> tuple[str, ...]:
        """Return the stages in the order in which they are run."""
        points, slow = ((), ()) if self.quick else (("states of the full problem",), ("animation", "speed", "validation"))
        return ("derivation", *(f"coefficients, {route}" for route in ROUTES), "comparison", "states", "numbers of the states", *points, "spectrum",
                *(f"figure {name}" for name in DRAWINGS), *slow, "files")


class Stages:
    """Runs stages: what each cost in processor time, and why one is missing."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.say = say
        self.seconds: dict[str, float] = {}
        self.reasons: dict[str, str] = {}

    def run(self, name: str, function: Callable[[], Value]) -> Value:
        """Return what a stage gives."""
        self.say(name)
        started = time.process_time()
        try:
            return function()
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - started

    def attempt(self, name: str, function: Callable[[], Value]) -> Value | None:
        """Return what a stage gives, or None with the reason kept."""
        try:
            return self.run(name, function)
        except FAILURES as reason:
            self.reasons[name] = one_line(str(reason)) or type(reason).__name__
        except Exception as reason:  # a fault of this program costs one part, not the report, which then disagrees
            self.reasons[name] = f"{FAULT}{type(reason).__name__}: {one_line(str(reason))}"
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Everything that a report shows."""

    derivation: Derivation
    emitted: str
    tex: str
    digits: int
    results: Mapping[str, Result]
    agreement: Mapping[str, int]
    comparison: Comparison | None
    states: States | None
    numbers: StatesResult | None
    drawings: Mapping[str, str]
    animation: Mapping[str, str | bytes]
    measurements: Sequence[Any]
    diagram: str
    validation: Any
    reasons: Mapping[str, str]
    seconds: Mapping[str, float]

    @property
    def best(self) -> Result:
        """Return the result that is shown."""
        return self.results.get("certified") or next(iter(self.results.values()))

    @property
    def routes_agree(self) -> bool:
        """Tell whether all routes give the same digits."""
        return all(count >= self.digits - 1 for count in self.agreement.values())

    @property
    def agrees(self) -> bool:
        """Tell whether nothing disagrees; what was left out does not."""
        sound = not any(one.failures for one in self.measurements) and not any(reason.startswith(FAULT) for reason in self.reasons.values())
        return self.routes_agree and sound and all(one is None or one.agrees for one in (self.comparison, self.validation))


def agreeing_digits(one: Result, other: Result) -> int:
    """Return the digits to which all coefficients and the threshold of two results agree (at most those asked for)."""
    least = min(one.digits, other.digits)
    pairs = [(one.threshold.control, "0", other.threshold.control, "0")]
    pairs += [(a.value.re, a.value.im, b.value.re, b.value.im) for a, b in zip(one.coefficients, other.coefficients, strict=True)]
    digits = least
    with localcontext(prec=least + 40):
        for re_a, im_a, re_b, im_b in pairs:
            difference = max(abs(Decimal(re_a) - Decimal(re_b)), abs(Decimal(im_a) - Decimal(im_b)))
            size = max(abs(Decimal(re_a)), abs(Decimal(im_a)))
            if difference and size:
                digits = min(digits, -(difference / size).adjusted() - 1)
    return digits


def compared(derivation: Derivation, result: Result, reference: Mapping[str, Any]) -> Comparison:
    """Return the comparison with every published number: threshold, coefficients, states and spectrum."""
    if not reference.get("state"):
        return compare(result, reference)
    return compare(result, reference, further_values(reference, derivation.emit(), derive_states(derivation).emit()))


def reproduce(problem: Problem, folder: Path | None, settings: Settings, say: Callable[[str], None], show: Callable[[str], None]) -> int:
    """Write the folder and print a summary; return 1 if anything disagrees."""
    folder = folder or Path(f"{problem.name}-report")
    stages = Stages(say)
    derivation = stages.run("derivation", lambda: derive_amplitude_equation(problem))
    check_folder(folder)
    findings = gather(derivation, settings, stages)
    say("files")
    summary = summary_of(findings)
    write_files({folder / name: content for name, content in files_of(findings, summary, show)})
    show(summary)
    show(f"written to {folder}; open {folder / 'report.html'}")
    return 0 if findings.agrees else 1


def gather(derivation: Derivation, settings: Settings, stages: Stages) -> Findings:
    """Return what the report shows; a part that fails is left out, with its reason."""
    emitted = derivation.emit()
    results: dict[str, Result] = {}
    for route in ROUTES:
        result = stages.attempt(f"coefficients, {route}", partial(by_route, emitted, settings.digits, route))
        if result is not None:
            results[route] = result
    if not results:
        raise EvaluationError("; ".join(dict.fromkeys(stages.reasons.values())))
    best = results.get("certified") or next(iter(results.values()))
    reference = reference_of(derivation.problem.name)
    comparison = stages.attempt("comparison", lambda: compared(derivation, best, reference) if reference else None)
    states = stages.attempt("states", lambda: derive_states(derivation))
    numbers = stages.attempt("numbers of the states", lambda: evaluate_states(emitted, states.emit(), "1", min(settings.digits, 12))) if states else None
    case = cache(partial(case_of, emitted, states))
    points = None if settings.quick else stages.attempt("states of the full problem", lambda: full_points_of(derivation, case, best))
    drawings = drawings_of(derivation, case, points, stages)
    animation = diagram = validation = None
    measurements: list[Any] = []
    if settings.quick:
        stages.reasons.update(dict.fromkeys(("animation", "speed", "validation"), QUICK))
    else:
        animation = stages.attempt("animation", lambda: animation_of(case))
        measured = stages.attempt("speed", lambda: speed_of(derivation.problem.name, emitted))
        measurements, diagram = measured or ([], "")
        validation = stages.attempt("validation", lambda: validation_of(derivation, emitted, best))
    return Findings(
        derivation=derivation, emitted=emitted, tex=document(derivation), digits=settings.digits, results=results, agreement={route: agreeing_digits(best, result) for route, result in results.items()},
        comparison=comparison, states=states, numbers=numbers, drawings=drawings, animation=animation or {}, measurements=measurements, diagram=diagram or "", validation=validation,
        reasons=stages.reasons, seconds=stages.seconds,
    )


def by_route(emitted: str, digits: int, route: str) -> Result:
    """Return the coefficients by one route."""
    return evaluate(emitted, digits=digits, certify=True) if route == "certified" else evaluate(emitted, digits=digits, route=route)


def case_of(emitted: str, states: States | None) -> Case:
    """Return what the figures are drawn of."""
    from numerics import figures

    if states is None:
        raise EvaluationError("found no states of the amplitude equation; the figures show them")
    return figures.case_of(emitted, states.emit())


def full_points_of(derivation: Derivation, case: Callable[[], Case], result: Result) -> Mapping[str, Any]:
    """Return a few states of the full nonlinear problem for the bifurcation diagram."""
    from derive.residual import emit_residual
    from numerics.full import measured_points

    return measured_points(emit_residual(derivation.problem), result, 2 * case().mu)


def spectra_of(derivation: Derivation) -> Spectra:
    """Return the eigenvalues against the control."""
    from derive.spectrum import spectrum_curves
    from numerics.figures import Spectra

    curves = spectrum_curves(derivation)
    return Spectra(controls=curves.controls, eigenvalues=curves.eigenvalues, oscillation=curves.oscillation)


def drawings_of(derivation: Derivation, case: Callable[[], Case], points: Mapping[str, Any] | None, stages: Stages) -> dict[str, str]:
    """Return the figures that apply, as SVG."""
    spectra = stages.attempt("spectrum", partial(spectra_of, derivation)) if "growth" in DRAWINGS else None

    def drawn(name: str) -> str:
        from numerics.figures import draw, saved

        return saved(draw(case(), name, spectra, points), "svg").decode("utf-8")

    drawings = {name: stages.attempt(f"figure {name}", partial(drawn, name)) for name in DRAWINGS}
    return {name: svg for name, svg in drawings.items() if svg is not None}


def animation_of(case: Callable[[], Case]) -> dict[str, str | bytes]:
    """Return the animation as a piece of HTML, as a page and as a GIF."""
    from numerics.animation import animation_of as animated
    from numerics.animation import fragment_of, gif_of, page_of

    animation = animated(case())
    return {"fragment": fragment_of(animation), "figures/animation.html": page_of(animation), "figures/animation.gif": gif_of(animation, case())}


def speed_of(name: str, emitted: str) -> tuple[list[Any], str]:
    """Return speed against error of the routes that take well under a second, and the diagram."""
    from numerics import bench

    reference, _ = bench.reference_of(emitted)
    measurements = [bench.measure(name, route, reference) for route in bench.routes_of(emitted, True) if route.name.startswith(MEASURED)]
    return measurements, bench.diagram(name, measurements, "svg").decode("utf-8")


def validation_of(derivation: Derivation, emitted: str, result: Result) -> Any:
    """Return the measurement of threshold and coefficients on the full problem."""
    from derive.residual import emit_residual
    from numerics.full_validate import validate

    return validate(emit_residual(derivation.problem), emitted, result)


def summary_of(findings: Findings) -> str:
    """Return the results as lines of text."""
    best, name = findings.best, findings.derivation.problem.name
    lines = [f"{name}: {best.threshold.kind} bifurcation, multiplicity {best.threshold.multiplicity}", f"  control    {best.threshold.control}"]
    if best.threshold.frequency is not None:
        lines.append(f"  frequency  {best.threshold.frequency}")
    lines += [f"  {one.name} = {one.value!r}   error {one.error}" for one in best.coefficients]
    lines += [f"  route {route}: {count} of {findings.digits} digits agree" for route, count in findings.agreement.items()]
    lines.append(findings.comparison.text() if findings.comparison else "no published values")
    if findings.numbers is not None:
        lines.append(findings.numbers.text())
    if findings.validation is not None:
        lines.append(findings.validation.text())
    lines += [f"  claimed error below the true one: {one.route}: {text}" for one in findings.measurements for text in one.failures]
    lines += [f"  left out: {stage}: {reason}" for stage, reason in findings.reasons.items()]
    return "\n".join(lines)


def data_of(findings: Findings) -> dict[str, Any]:
    """Return the results as plain data."""
    return {
        "problem": findings.derivation.problem.name, "results": [result.as_dict() for result in findings.results.values()], "agreeing_digits": dict(findings.agreement),
        "refused": {stage.removeprefix("coefficients, "): reason for stage, reason in findings.reasons.items() if stage.startswith("coefficients")},
        "comparison": findings.comparison.as_dict() if findings.comparison else None, "states": findings.numbers.as_dict() if findings.numbers else None,
        "validation": findings.validation.as_dict() if findings.validation else None, "speed": [one.as_dict() for one in findings.measurements], "left_out": dict(findings.reasons),
    }


def files_of(findings: Findings, summary: str, show: Callable[[str], None]) -> Iterator[tuple[str, str | bytes]]:
    """Yield name and content of every file, the page last."""
    name = findings.derivation.problem.name
    yield f"{name}.py", findings.emitted
    yield f"{name}.tex", findings.tex
    yield "coefficients.json", json.dumps(data_of(findings), indent=1) + "\n"
    yield "summary.txt", summary + "\n"
    for figure, svg in findings.drawings.items():
        yield f"figures/{figure}.svg", svg
    if findings.diagram:
        yield "figures/speed.svg", findings.diagram
    yield from ((path, content) for path, content in findings.animation.items() if path != "fragment")
    try:
        yield "report.pdf", compiled(findings.tex)
    except EvaluationError as reason:
        show(f"no report.pdf: {reason}")
    yield "report.html", html_of(findings)


def compiled(tex: str) -> bytes:
    """Return a LaTeX document as PDF.

    Raises
    ------
    EvaluationError
        There is no pdflatex, or it fails.
    """
    program = shutil.which("pdflatex")
    if program is None:
        raise EvaluationError("found no pdflatex on PATH; install a LaTeX distribution to get the derivation as PDF")
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "report.tex"
        path.write_text(tex, encoding="utf-8")
        settings = {**os.environ, "SOURCE_DATE_EPOCH": "0", "FORCE_SOURCE_DATE": "1"}
        try:
            done = subprocess.run([program, "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", path.name], cwd=place, env=settings, stdin=subprocess.DEVNULL,
                                  capture_output=True, timeout=120, check=False)
        except (subprocess.TimeoutExpired, OSError) as reason:
            raise EvaluationError(f"pdflatex: {reason}") from None
        if done.returncode:
            said = next((line for line in done.stdout.decode("utf-8", "replace").splitlines() if line.startswith("!")), f"status {done.returncode}")
            raise EvaluationError(f"pdflatex failed: {said}")
        return path.with_suffix(".pdf").read_bytes()


def html_of(findings: Findings) -> str:
    """Return the page."""
    from derive import chapters
    from derive.page import Chapter, left_out, page

    writer, reasons = Writer(findings.derivation), findings.reasons
    routes = {stage.removeprefix("coefficients, "): reason for stage, reason in reasons.items() if stage.startswith("coefficients")}
    undrawn = {stage.removeprefix("figure "): reason for stage, reason in reasons.items() if stage.startswith("figure ") or stage == "spectrum"}
    fragment = findings.animation.get("fragment")
    listed = [
        *chapters.derivation_chapters(writer),
        chapters.coefficient_chapter(writer, findings.results, findings.agreement, routes, findings.digits),
        chapters.comparison_chapter(findings.comparison, reasons.get("comparison", "")),
        chapters.states_chapter(findings.states, findings.numbers, reasons.get("states", reasons.get("numbers of the states", "")), writer),
        chapters.figure_chapter(findings.drawings, undrawn),
        Chapter(identifier="animation", title="Animation", body=str(fragment) if fragment else left_out(reasons["animation"])),
        chapters.speed_chapter(findings.measurements, findings.diagram, reasons.get("speed", "")),
        chapters.validation_chapter(findings.validation, reasons.get("validation", "")),
        chapters.confirmation_chapter(confirmations(findings), findings.seconds),
        chapters.emitted_chapter(findings.derivation.problem.name, findings.emitted),
    ]
    return page(f"{findings.derivation.problem.name}: weakly nonlinear analysis", lead_of(findings), listed)


def lead_of(findings: Findings) -> str:
    """Return what a reader in a hurry wants."""
    best = findings.best
    where = f"control {best.threshold.control[:12]}" + (f", frequency {best.threshold.frequency[:12]}" if best.threshold.frequency else "")
    kind = findings.numbers.criticality if findings.numbers else None
    values = "; ".join(f"{one.name} = {short(one.value.re)}" + (f" {'-' if one.value.im.startswith('-') else '+'} {short(one.value.im.lstrip('-'))} i" if one.value.im != "0" else "") for one in best.coefficients)
    said = [f"{best.threshold.kind.capitalize()} bifurcation{f', {kind}' if kind else ''}, at {where}.", f"Coefficients: {values}."]
    said.append("Everything that was checked agrees." if findings.agrees else "Something DISAGREES: see below.")
    return "".join(f"<p>{escape(one)}</p>\n" for one in said)


def short(text: str) -> str:
    """Return a decimal number to six digits."""
    return f"{float(text):.6g}"


def confirmations(findings: Findings) -> list[tuple[str, str, bool | None, str]]:
    """Return (result, how it was confirmed, whether it holds, chapter) for everything in the report."""
    others = [route for route in findings.results if findings.results[route] is not findings.best]
    certified = "certified" in findings.results
    rows: list[tuple[str, str, bool | None, str]] = [
        ("threshold and coefficients", f"the emitted text over function algebras that share nothing but the text: {', '.join(findings.results)}", findings.routes_agree if others else None, "coefficients"),
        ("their errors", "proved by ball arithmetic" if certified else "two computations, with more digits and other nodes", True if certified else None, "coefficients"),
        ("threshold, coefficients, states", "published values, to half a unit of the last printed digit", findings.comparison.agrees if findings.comparison else None, "comparison"),
        ("threshold, frequency, coefficients", "states of the full nonlinear problem, extrapolated to zero amplitude", findings.validation.agrees if findings.validation else None, "validation"),
        ("states and their stability", "closed forms over balls that hold the coefficients; every neutral eigenvalue belongs to a symmetry", True if findings.numbers else None, "states"),
        ("claimed errors", "true errors against 130 digits", not any(one.failures for one in findings.measurements) if findings.measurements else None, "speed"),
    ]
    return rows
