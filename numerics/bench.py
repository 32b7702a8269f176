"""Speed against error: every route on one problem, with its time, its true error, the error it claims and its memory."""

from __future__ import annotations

import gc
import io
import statistics
import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import mpmath
import numpy as np
from flint import arb

from numerics import batch, doubles, explicit, sampled
from numerics.coefficients import GUARD, Computed, Module, Resolution, Result, beginning, compute, evaluate, level_of, nodes_for, uniform
from numerics.naive import Naive, Nested, NestedFiner, Sums, context_of, evaluate_naively
from numerics.precision import EvaluationError, bits_of, working_precision

Values = dict[str, tuple[Any, Any]]
"""name: (value, claimed error or None); a value is text, a pair of texts, or a number of Python or mpmath"""
REFERENCE_DIGITS = 130
BATCH = 1024
FIXED = ((8, 4), (12, 8), (16, 12), (24, 20), (32, 26))
"""nodes, and digits to which redundant equations are checked"""
PATIENCE = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A way to the numbers: what runs it, and by how many entries to divide its time."""

    name: str
    family: str
    run: Callable[[], Values]
    entries: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """Seconds of processor time and errors of a route; errors are the largest of control, frequency and coefficients, relative to the modulus (below 1: absolute)."""

    problem: str
    route: str
    family: str
    cold: float
    warm: float
    true_error: float
    claimed_error: float | None
    memory: int
    failures: tuple[str, ...]
    refusal: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; numbers are strings."""
        return {"problem": self.problem, "route": self.route, "family": self.family, "cold_seconds": f"{self.cold:.3g}", "warm_seconds": f"{self.warm:.3g}",
                "true_error": f"{self.true_error:.3g}", "claimed_error": None if self.claimed_error is None else f"{self.claimed_error:.3g}", "memory_bytes": str(self.memory),
                "failures": list(self.failures), "refusal": self.refusal}


def of_result(result: Result) -> Values:
    """Return what a result says."""
    values: Values = {"control": (result.threshold.control, result.threshold.error)}
    if result.threshold.frequency is not None:
        values["frequency"] = (result.threshold.frequency, None)
    return {**values, **{one.name: ((one.value.re, one.value.im), one.error) for one in result.coefficients}}


def of_batch(result: batch.BatchResult) -> Values:
    """Return what the first entry of a batch says."""
    reason = str(result.reason.ravel()[0])
    if reason:
        raise EvaluationError(reason)
    values: Values = {"control": (float(result.control.ravel()[0]), float(result.control_error.ravel()[0]))}
    if result.frequency is not None and result.frequency_error is not None:
        values["frequency"] = (float(result.frequency.ravel()[0]), float(result.frequency_error.ravel()[0]))
    for name, one in result.coefficients.items():
        if np.isfinite(one.ravel()[0]):
            values[name] = (complex(one.ravel()[0]), float(result.errors[name].ravel()[0]))
    return values


def naive_values(text: str, kind: type[Naive], digits: int) -> Values:
    """Return what a naive route says; it claims nothing."""
    control, frequency, coefficients = evaluate_naively(text, kind, digits)
    values: Values = {"control": (control, None)}
    if frequency is not None:
        values["frequency"] = (frequency, None)
    return {**values, **{name: (value, None) for name, value in coefficients.items()}}


def once(module: Module, route: str, digits: int, nodes: int) -> Values:
    """Return one computation with fixed nodes on two panels, checked to `digits` only: no second one, so it claims nothing."""
    with working_precision(192):
        onset = (arb(module.ONSET[0]), arb(module.ONSET[1]) if module.KIND == "hopf" else None)
    result = compute(module, route, bits_of(digits), 192, Resolution(nodes=nodes, breaks=uniform(2)), onset, None)
    return of_computed(module, result, 48)


def of_computed(module: Module, found: Computed, digits: int) -> Values:
    """Return what one computation gives."""
    values: Values = {"control": (arb_text(found.root.control, digits), None)}
    if module.KIND == "hopf":
        values["frequency"] = (arb_text(found.root.frequency, digits), None)
    for name, _, identifier in (*module.COEFFICIENTS, *([module.QUADRATIC] if module.QUADRATIC is not None else [])):
        if identifier in found.values:
            one = found.values[identifier]
            values[name] = ((arb_text(one.real, digits), arb_text(one.imag, digits) if module.KIND == "hopf" else "0"), None)
    return values


def arb_text(value: arb, digits: int) -> str:
    """Return a number as text."""
    return str(value.mid().str(digits, radius=False))


def routes_of(text: str, quick: bool) -> list[Route]:
    """Return the routes, the slow ones only where not `quick`."""
    module = Module(text)
    routes = [
        Route(name="double, one", family="NumPy doubles", run=lambda: of_batch(batch.evaluate_batch(text))),
        Route(name=f"double, {BATCH} at once", family="NumPy doubles, batched", entries=BATCH, run=lambda: of_batch(many(text))),
    ]

    def by(route: str, digits: int, certify: bool = False) -> Callable[[], Values]:
        return lambda: of_result(evaluate(text, digits=digits, route=route, certify=certify, count=False))

    routes += [Route(name=f"closed, {digits} digits", family="closed in flint", run=by("closed", digits)) for digits in (15, 30, 50, 100)]
    routes += [Route(name=f"certified, {digits} digits", family="certified balls", run=by("auto", digits, certify=True)) for digits in (15, 30, 50, 100)]
    routes += [Route(name=f"closed in mpmath, {digits} digits", family="closed in mpmath", run=partial(naive_values, text, Sums, digits)) for digits in (15, 30, 50)]
    sizes = (15, 30) if quick else (15, 30, 50)
    routes += [Route(name=f"chebyshev, {digits} digits", family="chebyshev", run=by("chebyshev", digits)) for digits in sizes]
    routes += [Route(name=f"chebyshev, {nodes} nodes x 2", family="chebyshev, fixed nodes", run=partial(once, module, "chebyshev", digits, nodes))
               for nodes, digits in FIXED if module.SPATIAL]
    routes += [Route(name=f"quadrature, {digits} digits", family="Gauss-Legendre", run=by("quadrature", digits)) for digits in sizes[:2]]
    routes += [Route(name=f"quadrature, {nodes} nodes x 2", family="Gauss-Legendre, fixed nodes", run=partial(once, module, "quadrature", digits, nodes))
               for nodes, digits in FIXED if module.SPATIAL]
    routes += [Route(name="nested quad of mpmath, degree 3", family="nested quadrature in mpmath", run=lambda: naive_values(text, Nested, 15))]
    if not quick:
        routes += [Route(name="nested quad of mpmath, degree 4", family="nested quadrature in mpmath", run=lambda: naive_values(text, NestedFiner, 15))]
    return routes


def many(text: str) -> batch.BatchResult:
    """Return a batch whose first entry is nominal: the first parameter spread by five per cent, or the same values again where there is none."""
    evaluator = batch.evaluator_of(text)
    points = np.repeat(evaluator.nominal_point, BATCH, axis=0)
    if points.shape[1]:
        points[:, 0] *= 1 + np.linspace(0, 0.05, BATCH)
    with np.errstate(all="ignore"):
        return batch.computed(evaluator, points, (BATCH,))


def reference_of(text: str) -> tuple[Values, bool]:
    """Return values with more digits than any route gives, and whether they are proved."""
    try:
        return of_result(evaluate(text, digits=REFERENCE_DIGITS, certify=True)), True
    except EvaluationError:
        return of_result(evaluate(text, digits=REFERENCE_DIGITS)), False


def number_of(context: Any, value: Any) -> Any:
    """Return text, a pair of texts or a number as a complex number of the context."""
    return context.mpc(*value) if isinstance(value, tuple) else context.mpc(value)


def compared(values: Values, reference: Values, digits: int = REFERENCE_DIGITS) -> tuple[Any, Any, tuple[str, ...]]:
    """Return the largest true and claimed relative errors (numbers of mpmath; None: nothing is claimed), and where a claimed error is below the true one."""
    context = context_of(digits + 10)
    true_error, claimed_error = context.mpf(0), None
    failures = []
    for name, (truth, uncertainty) in reference.items():
        if name not in values:
            failures.append(f"{name} is missing")
            continue
        exact = number_of(context, truth)
        found, claim = values[name]
        error = abs(number_of(context, found) - exact)
        scale = max(abs(exact), context.mpf(10) ** -3)
        true_error = max(true_error, error / scale)
        if claim is not None:
            claim = context.mpf(claim)
            claimed_error = max(claimed_error or context.mpf(0), claim / scale)
            if error > claim + context.mpf(uncertainty or 0):
                failures.append(f"{name}: true error {context.nstr(error, 3)}, claimed {context.nstr(claim, 3)}")
    return true_error, claimed_error, tuple(failures)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hard:
    """A hard case: right, refused or WRONG; digits asked for, true and claimed error, digits lost by one computation, error of doubles (None: refused), seconds."""

    name: str
    outcome: str
    digits: int
    route: str = ""
    true_error: str = ""
    claimed_error: str = ""
    lost: float = 0.0
    doubles: float | None = None
    seconds: float = 0.0
    said: tuple[str, ...] = ()
    """the refusal, or the warnings"""

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; numbers are strings."""
        return {"name": self.name, "outcome": self.outcome, "digits": self.digits, "route": self.route, "true_error": self.true_error, "claimed_error": self.claimed_error,
                "digits_lost": f"{self.lost:.1f}", "error_of_doubles": None if self.doubles is None else f"{self.doubles:.3g}", "seconds": f"{self.seconds:.3g}", "said": list(self.said)}


def measure_hard(name: str, text: str, digits: int, near: tuple[str, str] | None) -> Hard:
    """Return what a hard case gives, beside a computation of more digits by another route."""
    begun = time.process_time()
    try:
        result = evaluate(text, digits=digits, near=near)
    except EvaluationError as refusal:
        return Hard(name=name, outcome="refused", digits=digits, said=(str(refusal),))
    seconds = time.process_time() - begun
    truth = second_route(text, result, near)
    true_error, claimed_error, failures = compared(of_result(result), truth, digits + 60)
    doubles = None
    if near is None:
        with suppress(EvaluationError):
            doubles = float(compared(of_batch(batch.evaluate_batch(text)), truth)[0])
    return Hard(name=name, outcome="right" if not failures and true_error <= mpmath.mpf(10) ** -digits else "WRONG", digits=digits, route=result.route,
                true_error=mpmath.nstr(true_error, 2), claimed_error=mpmath.nstr(claimed_error, 2), lost=max(0.0, lost_digits(text, result, truth, near)), doubles=doubles, seconds=seconds,
                said=(*failures, *result.warnings))


def second_route(text: str, result: Result, near: tuple[str, str] | None) -> Values:
    """Return 40 digits more by another route: enclosures where the closed form has them, else the other rule."""
    digits = result.digits + 40
    if near is None and result.route == "closed":
        with suppress(EvaluationError):
            return of_result(evaluate(text, digits=digits, certify=True, count=False))
    return of_result(evaluate(text, digits=digits, route="chebyshev" if result.route == "closed" else "quadrature", near=near))


def lost_digits(text: str, result: Result, truth: Values, near: tuple[str, str] | None) -> float:
    """Return how many of the digits of the working precision a single computation does not keep, in the worst of its coefficients."""
    module = Module(text)
    goal = bits_of(result.digits)
    onset, width, breaks = beginning(module, result.route, goal, near)
    resolution = Resolution(nodes=nodes_for(goal), breaks=breaks)
    found = compute(module, result.route, goal, GUARD, resolution, onset, None, width)
    working = level_of(module, result.route, goal, resolution, GUARD).bits / bits_of(1000) * 1000
    context = context_of(result.digits + 60)
    worst = context.mpf(10) ** -round(working)
    for name, (value, _) in of_computed(module, found, context.dps).items():
        exact = number_of(context, truth[name][0]) if name in truth else 0
        worst = max(worst, abs(number_of(context, value) - exact) / abs(exact)) if exact else worst
    return float(working + context.log10(worst))


def forget() -> None:
    """Drop what routes keep between calls, so that the next call is cold."""
    batch.evaluator_of.cache_clear()
    for one in (doubles.rules_of, doubles.reading_at, doubles.series_of, explicit.series):
        one.cache_clear()
    sampled._NODES.clear()


def measure(problem: str, route: Route, reference: Values) -> Measurement:
    """Return time (cold: first call; warm: median of repeats), errors and the peak of Python's memory in one more call."""
    forget()
    gc.collect()
    begun = time.process_time()
    try:
        values = route.run()
    except (EvaluationError, ArithmeticError, ValueError) as refusal:
        return Measurement(problem=problem, route=route.name, family=route.family, cold=float("nan"), warm=float("nan"), true_error=float("nan"), claimed_error=None, memory=0, failures=(),
                           refusal=" ".join(str(refusal).split()))
    cold = time.process_time() - begun
    seconds: list[float] = []
    spent = 0.0
    while len(seconds) < 3 and spent + cold < 4 * PATIENCE or spent < PATIENCE / 10 and len(seconds) < 50:
        begun = time.process_time()
        values = route.run()
        seconds.append(time.process_time() - begun)
        spent += seconds[-1]
    warm = statistics.median(seconds or [cold])
    memory = 0
    if warm < PATIENCE:
        tracemalloc.start()
        try:
            route.run()
            memory = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
    true_error, claimed_error, failures = compared(values, reference)
    return Measurement(problem=problem, route=route.name, family=route.family, cold=cold / route.entries, warm=warm / route.entries, true_error=float(true_error),
                       claimed_error=None if claimed_error is None else float(claimed_error), memory=memory, failures=failures)


def table(measurements: Sequence[Measurement], proved: Mapping[str, bool]) -> str:
    """Return the measurements as text."""
    lines = []
    for problem in dict.fromkeys(one.problem for one in measurements):
        lines += [f"{problem}: errors against {REFERENCE_DIGITS} digits ({'certified' if proved[problem] else 'two computations'}); processor time",
                  f"  {'route':34}{'warm':>12}{'cold':>12}{'true error':>12}{'claimed':>12}{'memory':>12}"]
        for one in measurements:
            if one.problem != problem:
                continue
            if one.refusal:
                lines.append(f"  {one.route:34}refused: {one.refusal}"[:160])
                continue
            claimed = "none" if one.claimed_error is None else f"{one.claimed_error:.1e}"
            memory = f"{one.memory / 1024:.0f} KiB" if one.memory else "-"
            lines.append(f"  {one.route:34}{shown(one.warm):>12}{shown(one.cold):>12}{one.true_error:>12.1e}{claimed:>12}{memory:>12}" + "".join(f"  FAILED {text}" for text in one.failures))
        lines.append("")
    return "\n".join(lines)


def hard_table(cases: Sequence[Hard]) -> str:
    """Return the hard cases as text."""
    lines = ["hard cases: true error against 40 digits more by another route; digits of the working precision that one computation loses; what doubles give",
             f"  {'case':44}{'outcome':>9}{'digits':>8}{'route':>11}{'true error':>12}{'claimed':>12}{'lost':>7}{'doubles':>10}{'time':>10}"]
    for one in cases:
        if one.outcome == "refused":
            lines.append(f"  {one.name:44}  refused: {one.said[0]}"[:200])
            continue
        doubles = "refused" if one.doubles is None else f"{one.doubles:.1e}"
        lines.append(f"  {one.name:44}{one.outcome:>9}{one.digits:>8}{one.route:>11}{one.true_error:>12}{one.claimed_error:>12}{one.lost:>7.1f}{doubles:>10}{shown(one.seconds):>10}"
                     + ("  warned" if one.said else ""))
    return "\n".join([*lines, ""])


def shown(seconds: float) -> str:
    """Return seconds with a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def diagram(problem: str, measurements: Sequence[Measurement], kind: str) -> bytes:
    """Return the work-precision diagram of a problem, `svg` or `png`: true error (claimed: hollow) against warm time."""
    import matplotlib
    from matplotlib.figure import Figure

    mine = [one for one in measurements if one.problem == problem and not one.refusal]
    with matplotlib.rc_context({"svg.hashsalt": "fredholm", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(7.6, 5.2), layout="constrained")
        axes = figure.add_subplot()
        for k, family in enumerate(dict.fromkeys(one.family for one in mine)):
            points = sorted((one for one in mine if one.family == family), key=lambda one: -one.true_error)
            colour, marker = f"C{k % 10}", "osD^vP*X<>"[k % 10]
            times = [one.warm for one in points]
            axes.plot(times, [max(one.true_error, 1e-130) for one in points], color=colour, marker=marker, markersize=5, linewidth=1, label=family)
            for one in points:
                if one.claimed_error:
                    axes.plot([one.warm, one.warm], [max(one.true_error, 1e-130), one.claimed_error], color=colour, linewidth=0.6, linestyle=":")
                    axes.plot([one.warm], [one.claimed_error], color=colour, marker=marker, markersize=5, markerfacecolor="none", linestyle="none")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("seconds of processor time, warm, threshold included")
        axes.set_ylabel("largest relative error (filled: true, hollow: claimed)")
        axes.set_title(problem)
        axes.grid(True, which="major", linewidth=0.3)
        axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        content = io.BytesIO()
        figure.savefig(content, format=kind, dpi=150, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return content.getvalue()


__all__ = ["Hard", "Measurement", "Route", "diagram", "hard_table", "measure", "measure_hard", "reference_of", "routes_of", "table"]
