"""The chapters of the report, from the derivation and from plain results; the numeric layer is not known here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from sympy import latex

from derive.latex import TITLES, Writer
from derive.latex_adjoint import coefficient_symbols
from derive.mathml import display, math
from derive.notation import half
from derive.page import Chapter, Markup, figure, folded, left_out, number, paragraph, table, verdict
from derive.states import States
from derive.states_latex import parts_of
from derive.symbols import Entry, symbols_of

LEADS = {
    "statement": "What was given: the governing equations, the boundary conditions and the base state. Everything below follows from them.",
    "adjoint": "The linear problem of the critical mode, its adjoint with the adjoint boundary conditions, and what integration by parts leaves at the ends.",
    "solvability": "The condition on a forcing and on boundary data for the inhomogeneous linear problem to have a solution (the Fredholm alternative).",
    "amplitude": "The amplitude equation in original time, without a small parameter, and its coefficients as quadratures: solvability of the order at which the amplitude equation arises.",
}
CAPTIONS = {
    "growth": "Growth rate and frequency of the leading perturbations of the base state against the control.", "mode": "The critical mode, real and imaginary parts where it is complex.",
    "bifurcation": "Bifurcation diagram: solid lines are stable states, broken lines unstable ones.", "transients": "Transients of the amplitude equation, with their envelopes where they oscillate.",
    "approach": "The approach to the states that bifurcate.", "decay": "Decay at the threshold, with its algebraic asymptotes.", "spacetime": "The field in space and time.",
}


def where(entries: Sequence[Entry], rows: Sequence[str]) -> str:
    """Return links to the meaning of the symbols that occur in some rows."""
    text = " ".join(rows)
    links = " ".join(f'<a href="#{one.identifier}" aria-label="symbol: {escape(one.meaning)}">{math(one.latex)}</a>' for one in entries if one.occurs_in(text))
    return f'<p class="where">Symbols: {links}</p>\n' if links else ""


def derivation_chapters(writer: Writer) -> list[Chapter]:
    """Return statement, symbols, orders, adjoint, solvability and amplitude equation."""
    entries = symbols_of(writer)
    parts = {part: writer.rows(part) for part in LEADS}
    orders = [(half(k), writer.order(k)) for k in (1, 2, 3)]
    everything = " ".join([*(row for rows in parts.values() for row in rows), *(row for _, rows in orders for row in rows)])
    used = [one for one in entries if one.occurs_in(everything) or one.chapter == "states"]
    body = {part: paragraph(LEADS[part]) + display(rows, TITLES[part]) + where(used, rows) for part, rows in parts.items()}
    small = writer.notation.symbol["small"]
    body["orders"] = paragraph("Each order, with the forcing in harmonics and the solution where the amplitude equation needs it; c.c. is the complex conjugate, n.s.t. stands for terms that are not secular.")
    for order, rows in orders:
        body["orders"] += f"<h3>Order {math(f'{small}^{{{order}}}')}</h3>\n" + display(rows, f"Order {order}") + where(used, rows)
    body["statement"] += facts(writer)
    chapters = [Chapter(identifier=part, title=TITLES[part], body=body[part]) for part in ("statement", "orders", "adjoint", "solvability", "amplitude")]
    return [chapters[0], symbol_chapter(used), *chapters[1:]]


def facts(writer: Writer) -> str:
    """Return the rest of the statement: intervals, parameters, normalisation."""
    notation, formulation = writer.notation, writer.derivation.expansion.formulation
    low, high = map(tex, formulation.control_range)
    rows: list[tuple[object, object]] = [("control, and where to look for the threshold", Markup(math(rf"{notation.control}, \quad {low} \text{{ to }} {high}")))]
    if formulation.interval is not None:
        rows.append(("interval", Markup(math(rf"{tex(formulation.interval[0])} \leq {notation.space} \leq {tex(formulation.interval[1])}"))))
    rows += [("parameter", Markup(math(f"{notation.names[symbol]} = {tex(value)}"))) for symbol, value in formulation.parameters.items()]
    field = notation.field(formulation.normalised[0]) if notation.vector else notation.component(formulation.normalised[0])
    rows.append(("normalised: the critical mode equals the amplitude in", Markup(math(field + (rf" \text{{ at }} {notation.space} = {tex(formulation.place)}" if formulation.place is not None else "")))))
    if formulation.frame is not None:
        rows.append(("axis of the rotational symmetry", Markup(math(rf"{notation.axis} = \left({', '.join(map(tex, formulation.frame[2]))}\right)"))))
    return table("What else was given", ("", ""), rows)


def tex(value: Any) -> str:
    """Return an expression as LaTeX."""
    return str(latex(value))


def symbol_chapter(entries: Sequence[Entry]) -> Chapter:
    """Return the table of symbols, each with a link to where it is defined."""
    titles = {**TITLES, "orders": "Orders of the expansion", "coefficients": "Coefficients", "states": "States and stability"}
    rows = [(Markup(f'<span id="{one.identifier}">{math(one.latex)}</span>'), one.meaning, Markup(f'<a href="#{one.chapter}">{escape(titles[one.chapter])}</a>')) for one in entries]
    return Chapter(identifier="symbols", title="Symbols", body=table("Symbols, their meaning and where they are defined", ("symbol", "meaning", "defined in"), rows))


def coefficient_chapter(writer: Writer, results: Mapping[str, Any], agreement: Mapping[str, int], refused: Mapping[str, str], digits: int) -> Chapter:
    """Return threshold and coefficients with their errors, and the digits by every route."""
    best = results.get("certified") or next(iter(results.values()))
    listed = list(writer.derivation.reduction.coefficients)
    symbols = {one.name: symbol for one, symbol in zip(listed, coefficient_symbols(listed).values(), strict=True)}
    kind = "proved" if best.certified else "estimated from two independent computations"
    control = rf"{{{writer.notation.control}}}_{{c}}"
    rows: list[Sequence[object]] = [(Markup(math(control)), "", number(best.threshold.control), "", number(best.threshold.error))]
    if best.threshold.frequency is not None:
        rows.append((Markup(math(writer.notation.symbol["frequency"])), "", number(best.threshold.frequency), "", ""))
    for one in best.coefficients:
        imaginary = number(one.value.im) if best.threshold.frequency is not None else ""
        rows.append((Markup(math(symbols.get(one.name, rf"\text{{{one.name}}}"))), one.monomial, number(one.value.re), imaginary, number(one.value.error)))
    text = paragraph(f"{best.threshold.kind.capitalize()} bifurcation, multiplicity {best.threshold.multiplicity}. {digits} significant digits of the modulus; error bounds are {kind}.")
    text += table("Threshold and coefficients", ("", "monomial", "value, or real part", "imaginary part", "error below"), rows)
    text += "".join(f'<p class="note">Warning: {escape(one)}</p>\n' for one in best.warnings)
    routes: list[Sequence[object]] = []
    for route, result in results.items():
        seconds = sum(value for key, value in result.seconds.items() if key != "derive")
        routes.append((route, verdict(agreement[route] >= digits - 1, f"{agreement[route]} of {digits} digits agree"), "proved" if result.certified else "estimated", f"{seconds:.2f} s"))
    routes += [(route, Markup(f"left out: {escape(refused[route])}"), "", "") for route in ("closed", "chebyshev", "quadrature", "certified") if route in refused]
    text += table("The same emitted text by every route", ("route", "agreement with the values above", "error", "time"), routes)
    for route, result in results.items():
        if result is not best:
            lines = [(one.name, number(one.value.re), number(one.value.im), number(one.value.error)) for one in result.coefficients]
            text += folded(f"All digits by the route {route}", table(f"Route {route}, control {result.threshold.control}", ("", "real part", "imaginary part", "error below"), lines))
    return Chapter(identifier="coefficients", title="Coefficients", body=text)


def comparison_chapter(comparison: Any, reason: str) -> Chapter:
    """Return computed beside published values, and the misprints."""
    if comparison is None:
        return Chapter(identifier="comparison", title="Comparison with published values", body=left_out(reason or "no published values are known for this problem."))
    rows = [(one.name, number(one.printed), number(one.computed), verdict(one.agrees, f"agrees, {one.digits} digits" if one.agrees else ""), f"{one.label} ({one.caveat})" if one.caveat else one.label)
            for one in comparison.lines]
    text = paragraph("A number agrees if it lies within half a unit of the last printed digit.")
    text += table("Published and computed", ("quantity", "printed", "computed", "", "source"), rows)
    if comparison.misprints:
        text += f"<h3>Misprints in the source ({len(comparison.misprints)})</h3>\n"
        found = [(one["label"], *(Markup(f"<code>{escape(one[key])}</code>") for key in ("printed", "right")), one["why"]) for one in comparison.misprints]
        text += table("Misprints", ("place", "printed", "right", "why"), found)
    return Chapter(identifier="comparison", title="Comparison with published values", body=text)


def states_chapter(states: States | None, numbers: Any, reason: str, writer: Writer) -> Chapter:
    """Return states and stability in closed form and as numbers."""
    title = "States and stability"
    if states is None:
        return Chapter(identifier="states", title=title, body=left_out(reason))
    text = left_out(reason) if numbers is None else numbers_of_states(numbers)
    entries = symbols_of(writer)
    for heading, rows in parts_of(states):
        text += f"<h3>{escape(heading)}</h3>\n" + display(rows, heading)
    text += where(entries, [row for _, rows in parts_of(states) for row in rows])
    return Chapter(identifier="states", title=title, body=text)


def numbers_of_states(numbers: Any) -> str:
    """Return the table of states at one distance from the threshold."""
    text = paragraph(f"All states of the amplitude equation at mu = {numbers.mu}; the bifurcation is {numbers.criticality or 'undecided at this order'}.")
    rows: list[Sequence[object]] = []
    for one in numbers.states:
        if not one.exists:
            rows.append((one.name, "does not exist here", "", "", "", one.criticality or ""))
            continue
        values = Markup("".join(f'<span class="line">{eigenvalue(value).html} {escape(value.direction)}{escape(f" (neutral: {value.neutral})" if value.neutral else "")}</span>' for value in one.eigenvalues))
        stable = {True: "stable", False: "unstable", None: "undecided"}[one.stable]
        rows.append((one.name, stable, number(one.amplitude_squared), number(one.peak), number(one.frequency_correction), values))
    text += table("States, to the digits shown", ("state", "stability", "|A| squared", "largest displacement", "frequency correction", "eigenvalues"), rows)
    laws = [(law.perturbation or "any", law.text() or "decided by the next order") for law in numbers.at_threshold]
    text += table("At the threshold", ("perturbation", "law"), laws) if laws else ""
    return text + "".join(f'<p class="note">{escape(one)}</p>\n' for one in numbers.warnings)


def eigenvalue(value: Any) -> Markup:
    """Return a complex number."""
    return number(value.re if value.im == "0" else f"{value.re} {'-' if value.im.startswith('-') else '+'} {value.im.lstrip('-')} i")


def figure_chapter(drawings: Mapping[str, str], reasons: Mapping[str, str]) -> Chapter:
    """Return the figures, and what is not drawn."""
    body = "".join(figure(name, svg, CAPTIONS.get(name, name)) for name, svg in drawings.items())
    rows = [(name, reason) for name, reason in reasons.items()]
    return Chapter(identifier="figures", title="Figures", body=body + (table("Figures that are left out", ("figure", "why"), rows) if rows else ""))


def speed_chapter(measurements: Sequence[Any], diagram: str, reason: str) -> Chapter:
    """Return speed against error of every route."""
    title = "Speed against error"
    if not measurements:
        return Chapter(identifier="speed", title=title, body=left_out(reason))
    rows: list[Sequence[object]] = []
    for one in measurements:
        if one.refusal:
            rows.append((one.route, f"left out: {one.refusal}", "", "", ""))
            continue
        holds = verdict(not one.failures, "; ".join(one.failures) or "claim holds") if one.claimed_error is not None else ""
        rows.append((one.route, f"{1000 * one.warm:.3g} ms", f"{one.true_error:.1e}", "none" if one.claimed_error is None else f"{one.claimed_error:.1e}", holds))
    text = figure("speed", diagram, "Speed against error: largest relative error of threshold and coefficients (filled), and the error that is claimed (hollow).")
    return Chapter(identifier="speed", title=title, body=text + table("Routes", ("route", "time", "true error", "claimed error", ""), rows))


def validation_chapter(validation: Any, reason: str) -> Chapter:
    """Return the measurement of the theory on the full problem."""
    title = "Validation against the full problem"
    if validation is None:
        return Chapter(identifier="validation", title=title, body=left_out(reason))
    text = paragraph("The full nonlinear problem is solved by other code from the same statement; near the threshold its states are extrapolated to zero amplitude. "
                     "Nothing of the derivation enters but the start of Newton's method.")
    data = validation.as_dict()
    rows = [(one["name"], complex_number(one["derived"]), complex_number(one["measured"]), verdict(one["agrees"], f"{one['digits']} digits agree"), one["source"]) for one in data["checks"]]
    text += table("Derived and measured", ("quantity", "derived", "measured", "", "from"), rows)
    shown = []
    for one in data["validity"]:
        limits = ", ".join(f"{100 * float(share):g} %: {'beyond what was followed' if mu is None else mu}" for share, mu in one["within"].items())
        shown.append((one["state"], one["order_peak"] or "too small to measure", one["order_frequency"] or "", limits, verdict(one["agrees"])))
    text += table("How far the theory reaches", ("state", "order in mu of the relative error of the peak", "of the frequency", "peak within, at mu =", ""), shown)
    return Chapter(identifier="validation", title=title, body=text)


def complex_number(parts: Mapping[str, str]) -> Markup:
    """Return a number to 12 digits."""
    re, im = float(parts["re"]), float(parts["im"])
    return number(f"{re:.12g}" + (f" {'-' if im < 0 else '+'} {abs(im):.12g} i" if im else ""))


def confirmation_chapter(rows: Sequence[tuple[str, str, bool | None, str]], seconds: Mapping[str, float]) -> Chapter:
    """Return how each result was confirmed, and what every stage cost."""
    lines = [(what, how, verdict(agrees) if agrees is not None else "not done here", Markup(f'<a href="#{place}">{place}</a>')) for what, how, agrees, place in rows]
    text = table("How each result was confirmed", ("result", "by", "", "see"), lines)
    costs = [(name, f"{value:.2f} s") for name, value in seconds.items()]
    return Chapter(identifier="confirmation", title="How each result was confirmed", body=text + folded("Processor time of every stage", table("Processor time", ("stage", "time"), costs)))


def emitted_chapter(name: str, emitted: str) -> Chapter:
    """Return the emitted code."""
    body = paragraph(f"All numbers above come from the text below, which the derivation emits; it is also in {name}.py, the LaTeX of the derivation in {name}.tex.")
    return Chapter(identifier="emitted", title="Emitted code", body=body + folded(f"{name}.py", f'<pre tabindex="0">{escape(emitted)}</pre>'))


__all__ = [
    "coefficient_chapter", "comparison_chapter", "confirmation_chapter", "derivation_chapters", "emitted_chapter", "figure_chapter", "speed_chapter", "states_chapter", "validation_chapter",
]
