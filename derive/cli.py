"""The command `fredholm`; with `derive.report` the only module here that knows the numeric layer."""

from __future__ import annotations

import contextlib
import difflib
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from threadpoolctl import threadpool_limits

from derive.derivation import Derivation, derive_amplitude_equation
from derive.files import check_file, check_folder, write_files
from derive.problem import Problem, bundled_names, load_problem
from derive.statement import DerivationError, ProblemError, one_line
from numerics.coefficients import ROUTES, Result, evaluate
from numerics.precision import EvaluationError

MISTAKES = (ProblemError, DerivationError, EvaluationError)


class Command(click.Group):
    """A group whose mistakes end with one line on standard error and exit status 2, never with a traceback."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        options["standalone_mode"] = False
        if sys.stdout is None:  # Python's way to say that it was closed
            fail("found standard output closed; expected a file, a pipe or a terminal to print to")
        try:
            with threadpool_limits(limits=1):  # small matrices: threads of BLAS only cost, and other processes want the cores
                status = super().main(*arguments, **options)
            sys.exit(status if isinstance(status, int) else 0)
        except MISTAKES as mistake:
            fail(str(mistake))
        except click.exceptions.NoArgsIsHelpError as mistake:
            click.echo(mistake.format_message())
            sys.exit(0)
        except click.ClickException as mistake:
            fail(mistake.format_message())
        except (click.exceptions.Abort, KeyboardInterrupt):
            fail("interrupted; nothing that was there before is changed", 130)
        except click.exceptions.Exit as done:
            sys.exit(done.exit_code)
        except OSError as mistake:
            fail(f"{mistake.filename or 'output'}: {mistake.strerror or mistake}")
        except RecursionError:
            fail("the expressions of the problem are nested too deeply; write them with named intermediate fields")
        except MemoryError:
            fail("out of memory; ask for fewer digits")


def fail(message: str, status: int = 2) -> None:
    """Write one line to standard error and leave."""
    click.echo(f"fredholm: {one_line(message)}", err=True)
    sys.exit(status)


@click.group(cls=Command, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="fredholm", prog_name="fredholm")
def main() -> None:
    """From governing equations to the amplitude equation that rules the onset of instability."""


def loaded(target: str) -> Problem:
    """Return the problem; what the file prints goes to standard error, and only if the file is sound: a mistake is one line."""
    said = io.StringIO()
    with standard_output_aside(), contextlib.redirect_stdout(said):
        problem = load_problem(target)
    click.echo(said.getvalue(), err=True, nl=False)
    return problem


@contextlib.contextmanager
def standard_output_aside() -> Iterator[None]:
    """Send to standard error what passes Python's `print` by, such as the output of a program that a problem file starts."""
    sys.stdout.flush()
    kept = os.dup(1)
    aside = os.open(os.devnull, os.O_WRONLY) if sys.__stderr__ is None else os.dup(2)
    os.dup2(aside, 1)
    try:
        yield
    finally:
        if sys.__stdout__ is not None:
            sys.__stdout__.flush()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(aside)


def derived(target: str) -> Derivation:
    """Return the derivation of a target."""
    return derive_amplitude_equation(loaded(target))


@main.command(name="list")
def list_models() -> None:
    """List the bundled models, a line each."""
    for name in bundled_names():
        text = load_model_title(name)
        click.echo(f"{name:24}{text}")


def load_model_title(name: str) -> str:
    """Return the first line of a model's docstring, without running it."""
    import ast

    from derive.problem import MODELS

    document = ast.get_docstring(ast.parse((MODELS / f"{name}.py").read_text(encoding="utf-8"))) or ""
    return document.split("\n")[0]


def targets_of(targets: Sequence[str], everything: bool) -> tuple[str, ...]:
    """Return the targets, or all bundled models."""
    if everything:
        return (*bundled_names(), *targets)
    if not targets:
        raise click.UsageError("found no TARGET; expected a bundled model, the path of a problem file, or --all")
    return tuple(targets)


@main.command()
@click.argument("targets", nargs=-1)
@click.option("--all", "everything", is_flag=True, help="All bundled models.")
@click.option("--out", default="generated", show_default=True, help="Folder to write to.")
@click.option("--check", is_flag=True, help="Write nothing; show what differs and exit 1 if anything does.")
def derive(targets: tuple[str, ...], everything: bool, out: str, check: bool) -> int:
    """Write NAME.py and NAME.tex."""
    from derive.latex import document

    texts: dict[Path, str] = {}
    for target in targets_of(targets, everything):
        derivation = derived(target)
        stem = Path(out) / derivation.problem.name
        texts |= {Path(f"{stem}.py"): derivation.emit(), Path(f"{stem}.tex"): document(derivation)}
    if not check:
        write_files(texts)
        for path in texts:
            click.echo(path)
        return 0
    differs = False
    for path, text in texts.items():
        before = path.read_text(encoding="utf-8") if path.is_file() else ""
        if before != text:
            differs = True
            lines = difflib.unified_diff(before.splitlines(), text.splitlines(), f"{path} (there)", f"{path} (derived now)", lineterm="")
            click.echo("\n".join(lines))
    return 1 if differs else 0


@main.command()
@click.argument("target")
@click.option("--part", type=click.Choice(["statement", "orders", "adjoint", "solvability", "amplitude", "all"]), default="all", show_default=True)
@click.option("--order", default=None, help="One order only: 1/2, 1, 3/2, ...")
@click.option("--symbol", "symbols", multiple=True, metavar="NAME=LATEX", help="Write a name of the statement, or mode, adjoint, amplitude, frequency, shift, small, axis, xi, ..., as LATEX.")
def latex(target: str, part: str, order: str | None, symbols: tuple[str, ...]) -> None:
    """LaTeX of a part of the derivation, on standard output; it compiles inside amsmath."""
    given = {}
    for entry in symbols:
        name, sign, text = entry.partition("=")
        if not (name and sign and text):
            raise click.UsageError(f"--symbol: found {entry!r}; expected NAME=LATEX")
        given[name] = text
    click.echo(derived(target).latex(part, order, given))


def coefficients_of(target: str, digits: int, route: str, certify: bool) -> tuple[Derivation, Result]:
    """Return derivation and result; the time of the derivation is in the result."""
    from dataclasses import replace
    from types import MappingProxyType

    started = time.perf_counter()
    derivation = derived(target)
    text = derivation.emit()
    seconds = time.perf_counter() - started
    result = evaluate(text, digits=digits, route=route, certify=certify)
    return derivation, replace(result, seconds=MappingProxyType({**result.seconds, "derive": seconds}))


@main.command()
@click.argument("target")
@click.option("--digits", default=15, show_default=True, type=int, help="Significant digits of the modulus.")
@click.option("--route", default="auto", show_default=True, type=click.Choice(ROUTES))
@click.option("--certify", is_flag=True, help="Prove the error bounds, or say why they cannot be proved.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def coefficients(target: str, digits: int, route: str, certify: bool, as_json: bool) -> None:
    """Threshold and coefficients, right to the digits asked for."""
    _, result = coefficients_of(target, digits, route, certify)
    for warning in result.warnings:
        click.echo(f"fredholm: warning: {warning}", err=True)
    if as_json:
        click.echo(json.dumps(result.as_dict()))
        return
    threshold = result.threshold
    click.echo(f"{result.problem}: {threshold.kind} bifurcation, multiplicity {threshold.multiplicity}, route {result.route}")
    click.echo(f"  control    {threshold.control}")
    if threshold.frequency is not None:
        click.echo(f"  frequency  {threshold.frequency}")
    for one in result.coefficients:
        title = one.monomial if one.name == one.monomial else f"{one.name}  ({one.monomial})"
        click.echo(f"  {title} = {one.value!r}   error {one.error}")
    if result.first_instability is not None:
        click.echo(f"  first instability {result.first_instability}")


@main.command()
@click.argument("targets", nargs=-1, required=True)
@click.option("--digits", default=15, show_default=True, type=int)
def check(targets: tuple[str, ...], digits: int) -> int:
    """Compare with published values; exit 1 on a disagreement."""
    from derive.report import compared
    from numerics.comparison import reference_of

    agree = True
    for target in targets:
        reference = reference_of(loaded(target).name)
        if reference is None:
            click.echo(f"{target}: no published values")
            continue
        derivation, result = coefficients_of(target, digits, "auto", False)
        comparison = compared(derivation, result, reference)
        click.echo(comparison.text())
        agree = agree and comparison.agrees
    return 0 if agree else 1


@main.command()
@click.argument("target")
@click.option("--out", default=None, help="Folder to write to (default: NAME-report).")
@click.option("--digits", default=30, show_default=True, type=int)
@click.option("--quick", is_flag=True, help="Leave out the animation, the measurement of speed and the validation on the full problem.")
def reproduce(target: str, out: str | None, digits: int, quick: bool) -> int:
    """The main job: derivation, coefficients, comparison, states, figures and checks, in one folder with report.html."""
    from derive.report import Settings
    from derive.report import reproduce as run

    settings = Settings(digits=digits, quick=quick)
    problem = loaded(target)
    with click.progressbar(length=len(settings.stages), label="derivation", file=sys.stderr, hidden=not sys.stderr.isatty(), width=24) as bar:
        def say(stage: str) -> None:
            bar.label = f"{stage:28}"
            bar.update(0 if stage == "derivation" else 1)
            bar.render_progress()

        said: list[str] = []
        status = run(problem, Path(out) if out else None, settings, say, said.append)
        bar.update(1)
    click.echo("\n".join(said))
    return status


@main.command()
@click.argument("target")
@click.option("--mu", default="1", show_default=True, help="Distance control - threshold, an exact decimal or rational number.")
@click.option("--digits", default=15, show_default=True, type=int, help="Significant digits.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--latex", "as_latex", is_flag=True, help="Print the states in closed form, with proofs and stability, as LaTeX.")
def states(target: str, mu: str, digits: int, as_json: bool, as_latex: bool) -> None:
    """All states of the amplitude equation and their stability."""
    from derive.states import derive_states
    from numerics.states import evaluate_states, exact_number

    exact_number(mu)
    derivation = derived(target)
    found = derive_states(derivation)
    if as_latex:
        click.echo(found.latex())
        return
    result = evaluate_states(derivation.emit(), found.emit(), mu, digits)
    for warning in result.warnings:
        click.echo(f"fredholm: warning: {warning}", err=True)
    click.echo(json.dumps(result.as_dict()) if as_json else result.text())


@main.command()
@click.argument("targets", nargs=-1)
@click.option("--out", default=None, help="Folder for bench.json and the diagrams (SVG, PNG; needs matplotlib).")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
@click.option("--quick", is_flag=True, help="Leave the slow routes out.")
@click.option("--hard/--no-hard", "with_hard", default=None, help="With the hard cases and the digits lost in each; by default where no target is given, without --quick.")
def bench(targets: tuple[str, ...], out: str | None, as_json: bool, quick: bool, with_hard: bool | None) -> int:
    """Speed against error of every route, and hard cases; exit 1 if a claimed error is below the true one."""
    from importlib.util import find_spec

    from derive.hard_cases import HardCase, hard_cases
    from numerics.bench import REFERENCE_DIGITS, Hard, Measurement, diagram, hard_table, measure, measure_hard, reference_of, routes_of, table

    def measured(case: HardCase) -> Hard:
        try:
            text = derive_amplitude_equation(case.problem()).emit()
        except (ProblemError, DerivationError) as refusal:
            return Hard(name=case.name, outcome="refused", digits=case.digits, said=(str(refusal),))
        return measure_hard(case.name, text, case.digits, case.near)

    if out is not None and find_spec("matplotlib") is None:
        raise click.UsageError("--out: found no matplotlib, which draws the diagrams; install it, or leave --out away")
    problems = [(derivation.problem.name, derivation.emit()) for derivation in map(derived, targets or bundled_names())]
    if out is not None:
        check_folder(Path(out))
    measurements: list[Measurement] = []
    proved = {}
    for name, text in problems:
        reference, proved[name] = reference_of(text)
        with click.progressbar(routes_of(text, quick), label=name, file=sys.stderr, hidden=not sys.stderr.isatty()) as routes:
            measurements += [measure(name, route, reference) for route in routes]
    hard: list[Hard] = []
    if with_hard if with_hard is not None else not targets and not quick:
        with click.progressbar(list(hard_cases()), label="hard cases", file=sys.stderr, hidden=not sys.stderr.isatty()) as cases:
            hard = [measured(case) for case in cases]
    plain = {"hard_cases": [one.as_dict() for one in hard], "reference_digits": str(REFERENCE_DIGITS), "reference_certified": proved, "measurements": [one.as_dict() for one in measurements]}
    if out is not None:
        diagrams = {Path(out) / f"{name}.{kind}": diagram(name, measurements, kind) for name, _ in problems for kind in ("svg", "png")}
        write_files({Path(out) / "bench.json": json.dumps(plain, indent=1) + "\n", **diagrams})
    click.echo(json.dumps(plain) if as_json else table(measurements, proved) + (hard_table(hard) if hard else ""))
    failed = [f"{one.problem}, {one.route}: {text}" for one in measurements for text in one.failures] + [f"{one.name}: {'; '.join(one.said)}" for one in hard if one.outcome == "WRONG"]
    for text in failed:
        click.echo(f"fredholm: claimed error below the true one: {text}", err=True)
    return 1 if failed else 0


def full_problem(target: str) -> tuple[Derivation, Result, str]:
    """Return derivation, coefficients and the emitted rows of the full nonlinear problem, which is held by polynomials on the whole interval."""
    from derive.residual import emit_residual
    from numerics.scout import refuse_narrow

    derivation, result = coefficients_of(target, 15, "auto", False)
    refuse_narrow(derivation.emit())
    return derivation, result, emit_residual(derivation.problem)


@main.command()
@click.argument("target")
@click.option("--state", required=True, help="undeformed, beating, whirling for a vector amplitude; base, cycle, branch for the others.")
@click.option("--mu", type=float, default=None, help="Distance of the control from the threshold.")
@click.option("--mu-range", type=float, nargs=2, default=None, help="Follow the branch from the first to the second.")
@click.option("--branch", "as_branch", is_flag=True, help="With --mu-range: write a table of the branch and its secondary bifurcations.")
@click.option("--tolerance", type=float, default=1e-10, show_default=True, help="Relative error of peak and frequency.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def full(target: str, state: str, mu: float | None, mu_range: tuple[float, float] | None, as_branch: bool, tolerance: float, as_json: bool) -> None:
    """A state of the full nonlinear problem, with its stability."""
    from numerics.full import follow_branch, solve_state

    if (mu is None) == (mu_range is None) or as_branch != (mu_range is not None):
        raise click.UsageError("expected either --mu X, or --mu-range A B with --branch")
    derivation, result, text = full_problem(target)
    if mu is not None:
        found = solve_state(text, result, state, mu, tolerance)
        click.echo(json.dumps(found.as_dict()) if as_json else found.text())
        return
    assert mu_range is not None
    points = []
    for one in follow_branch(text, result, state, *mu_range, tolerance):
        points.append(one)
        if not as_json:
            click.echo(one.line())
    if as_json:
        click.echo(json.dumps([one.as_dict() for one in points]))


@main.command()
@click.argument("target")
@click.option("--initial", required=True, help="A(0): 0.03 for a scalar; for a vector two components across the axis, along e1 and e2: 0.03,0.005i")
@click.option("--mu", required=True, type=float, help="Distance of the control from the threshold.")
@click.option("--until", required=True, type=float, help="Final time.")
@click.option("--out", required=True, help="File to write; .npz or .nc unless --format says which.")
@click.option("--order", default="1", show_default=True, type=click.Choice(["1/2", "1"]), help="Order of the fields in mu: the mode, or the responses of second order too.")
@click.option("--points", default=401, show_default=True, type=int, help="Number of times in the file.")
@click.option("--places", default=51, show_default=True, type=int, help="Number of places along space.")
@click.option("--spacing", default="linear", show_default=True, type=click.Choice(["linear", "log"]), help="Spacing of the times.")
@click.option("--format", "form", default=None, type=click.Choice(["npz", "nc"]), help="NPZ, or NetCDF.")
@click.option("--full", "as_full", is_flag=True, help="Integrate the full nonlinear problem itself, from the shape that the amplitude has to that order.")
@click.option("--steps", default=6, show_default=True, type=click.IntRange(1, 100_000), help="With --full: fewest time steps in a period of the threshold (in the whole time when steady).")
@click.option("--tolerance", default=1e-6, show_default=True, type=float, help="With --full: error of the normalised field, as a share of its largest value: change by half the steps and more nodes.")
def simulate(target: str, initial: str, mu: float, until: float, out: str, order: str, points: int, places: int, spacing: str, form: str | None, as_full: bool, steps: int,
             tolerance: float) -> None:
    """Integrate the amplitude equation, or with --full the full problem, and write the fields along the motion.

    Amplitude and time are the original ones, dA/dt = gamma mu A + ..., without a small parameter: u = base + A phi exp(i omega t) + c.c., so that A is half
    the peak of the normalised field (for a steady bifurcation u = base + A phi, A real). The paper's scaled amplitude and slow time are A/epsilon^(1/2) and
    epsilon t with mu = epsilon chi. Weak effects are left out (epsilon = 0).
    """
    from numerics.motion import Scene
    from numerics.simulation import FORMATS, Sampling, parse_amplitude
    from numerics.simulation import simulate as run

    path = Path(out)
    form = form or path.suffix.removeprefix(".")
    if form not in FORMATS:
        raise click.UsageError(f"--out: found {path.name!r}; expected a name that ends in .npz or .nc, or --format")
    check_file(path)
    scene = Scene(initial=parse_amplitude(initial), mu=mu, until=until)
    sampling = Sampling(times=points, places=places, logarithmic=spacing == "log", order=order)
    if as_full:
        from numerics.full_simulation import Accuracy, simulate_fields

        derivation, result, text = full_problem(target)
        data = simulate_fields(text, derivation.emit(), result, scene, sampling, Accuracy(steps=steps, tolerance=tolerance))
    else:
        data = run(derived(target).emit(), scene, sampling)
    if data.attributes.get("phase_error", 0.0) > 1e-3:
        click.echo(f"fredholm: warning: slow phases at the end are known to {data.attributes['phase_error']:.1g} rad only", err=True)
    write_files({path: data.as_bytes(form)})
    click.echo(path)


@main.command()
@click.argument("target")
@click.option("--out", default=None, help="Folder to write to (default: NAME-figures).")
@click.option("--format", "form", default="svg", show_default=True, type=click.Choice(["svg", "png", "pdf"]))
@click.option("--only", default=None, help="One figure: growth, mode, bifurcation, transients, approach, decay, spacetime or animation.")
def figures(target: str, out: str | None, form: str, only: str | None) -> None:
    """Draw the figures of a problem: what does not apply to it is left out, and said."""
    from numerics.figures import NAMES

    if only is not None and only not in NAMES:
        raise click.UsageError(f"--only: found {only!r}; expected one of {', '.join(NAMES)}")
    derivation = derived(target)
    folder = Path(out) if out else Path(f"{derivation.problem.name}-figures")
    check_folder(folder)
    files = {folder / name: content for name, content in drawn(derivation, form, (only,) if only else NAMES, only is not None)}
    write_files(files)
    for path in files:
        click.echo(path)


def drawn(derivation: Derivation, form: str, names: Sequence[str], strict: bool) -> Iterator[tuple[str, bytes]]:
    """Yield file name and content of each figure; one that does not apply is an error when `strict`, else a line on standard error."""
    from derive.report import spectra_of
    from derive.states import derive_states
    from numerics.animation import animation_of, gif_of, page_of
    from numerics.figures import case_of, draw, saved

    case = case_of(derivation.emit(), derive_states(derivation).emit())
    for name in names:
        try:
            if name == "animation":
                animation = animation_of(case)
                yield "animation.gif", gif_of(animation, case)
                yield "animation.html", page_of(animation).encode("utf-8")
            else:
                yield f"{name}.{form}", saved(draw(case, name, spectra_of(derivation) if name == "growth" else None), form)
        except EvaluationError as reason:
            if strict:
                raise
            click.echo(f"fredholm: {name} is left out: {one_line(str(reason))}", err=True)


@main.command()
@click.argument("target")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def validate(target: str, as_json: bool) -> int:
    """Measure threshold and coefficients on the full nonlinear problem; exit 1 if they do not agree with the derived ones."""
    from numerics.full_validate import validate as run

    derivation, result, rows = full_problem(target)

    def say(text: str) -> None:
        if sys.stderr.isatty():
            click.echo(text, err=True)

    found = run(rows, derivation.emit(), result, say)
    click.echo(json.dumps(found.as_dict()) if as_json else found.text())
    return 0 if found.agrees else 1


if __name__ == "__main__":
    main()
