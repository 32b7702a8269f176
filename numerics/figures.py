"""Figures of a problem from its emitted module: matplotlib `Figure` objects. One that does not apply to a problem is refused, with the reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from numerics.case import Case, along, approach_scene, bounded, branches, case_of, field_symbol, modulus, nice
from numerics.drawing import BLACK, BLUE, GREEK, GREEN, GREY, ORANGE, PURPLE, RED, SKY, bold, fade, letter, saved, styled, symbol
from numerics.motion import Motion, fast_phase, shapes_of
from numerics.precision import EvaluationError


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectra:
    """Eigenvalues against the control, shape (controls, n), NaN where there are fewer; where they start to oscillate, if they do."""

    controls: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    oscillation: float | None


# (1) growth rate and frequency against the control


def growth_figure(case: Case, spectra: Spectra) -> Figure:
    """Return growth rate and frequency of the rightmost eigenvalues against the control, with F_o and F_c marked (label fig:linear)."""
    tracks = joined(spectra.eigenvalues)
    row = int(np.argmin(np.abs(spectra.controls - case.threshold)))
    order = np.argsort([abs(complex(one.real, abs(one.imag) - case.omega)) if np.isfinite(one) else np.inf for one in tracks[row]], kind="stable")
    critical = order[:2] if case.omega else order[:1]
    leading = tracks[:, critical]
    fastest = float(np.nanmax(np.abs(leading.imag)))
    oscillates = fastest > 1e-6 * float(np.nanmax(np.abs(leading)))
    figure = Figure(figsize=(4.6, 4.2 if oscillates else 2.8), layout="constrained")
    panels = figure.subplots(2 if oscillates else 1, 1, sharex=True, squeeze=False)[:, 0]
    top, bottom = panels[0], panels[-1]
    for k in reversed(order):
        for axes, values in zip(panels, (tracks[:, k].real, np.abs(tracks[:, k].imag)), strict=False):
            axes.plot(spectra.controls, values, color=BLUE if k in critical else GREY, lw=1.5 if k in critical else 0.9)
    low, high = float(np.nanmin(leading.real)), float(np.nanmax(leading.real))
    span = high - low or 1.0
    growth = r"\sigma" if case.control.startswith(r"\lambda") else r"\lambda"  # two quantities, two letters
    top.set_ylim(low - 0.12 * span, high + 0.08 * span)
    top.axhline(0, color=BLACK, lw=0.6)
    marks = [(case.threshold, "c")] + ([(spectra.oscillation, "o")] if spectra.oscillation is not None else [])
    close = len(marks) == 2 and abs(marks[0][0] - marks[1][0]) < 0.25 * (spectra.controls[-1] - spectra.controls[0])
    for place, name in marks:
        side = "center" if not close else "left" if name == "c" else "right"
        for axes in panels:
            axes.axvline(place, color=RED if name == "c" else GREEN, lw=0.9, ls=":" if name == "c" else "--")
        label = rf"${symbol(case.module.CONTROL, name)} = {place:.5g}$"
        top.annotate(label, (place, 1), xycoords=("data", "axes fraction"), xytext=(0, 3), textcoords="offset points", ha=side, va="bottom", color=RED if name == "c" else GREEN)
    if oscillates:
        bottom.set_ylim(-0.04 * fastest, 1.08 * fastest)
        bottom.plot([case.threshold], [case.omega], "o", ms=4, color=RED)
        bottom.annotate(rf"$\omega = {case.omega:.5g}$" if case.omega else "", (case.threshold, case.omega), xytext=(6, -6), textcoords="offset points", va="top", color=RED)
        bottom.set_ylabel(rf"$|{growth}_i|$")
    top.set_ylabel(rf"${growth}_r$" if oscillates else rf"${growth}$")
    bottom.set_xlabel(rf"${case.control}$")
    bottom.set_xlim(spectra.controls[0], spectra.controls[-1])
    return figure


def joined(eigenvalues: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the eigenvalues reordered so that each column is one curve: the nearest assignment from row to row."""
    from scipy.optimize import linear_sum_assignment

    result = eigenvalues.copy()
    for k in range(1, len(result)):
        before, now = result[k - 1], result[k]
        distance = np.nan_to_num(np.abs(before[:, None] - now[None, :]), nan=1e30)
        result[k] = now[linear_sum_assignment(distance)[1]]
    return result


# (2) the critical mode


def mode_figure(case: Case) -> Figure:
    r"""Return the critical mode: real and imaginary part of the functions of every field; without space, one period of each."""
    shapes = shapes_of(case.emitted, case.result, 0.0, "1/2", 201)
    names = [case.module.NORMALISED, *(name for name in shapes.fields if name != case.module.NORMALISED)]
    known = [(name, direction, values) for name in names for direction, values in mode_components(name, shapes.terms, shapes.unknowns)]
    largest = max(float(np.abs(values).max()) for _, _, values in known)
    panels = [one for one in known if float(np.abs(one[2]).max()) > 1e-9 * largest][:8]
    columns = min(len(panels), 4)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(max(3.4, 2.3 * columns), 2.5 * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.ravel()[len(panels):]:
        axes.set_axis_off()
    for axes, (name, direction, values) in zip(grid.ravel(), panels, strict=False):
        axes.axhline(0, color=GREY, lw=0.5)
        if shapes.spatial:
            draw_shape(axes, shapes.places, values, case.steady)
            title = r"\varphi" if name == case.module.NORMALISED else rf"\tilde{{{bold(name) if direction else symbol(name)}}}"
            axes.set_title(rf"${title}\ (\mathrm{{along}}\ {direction})$" if direction else f"${title}$")
        elif case.steady:
            axes.bar([0], [values[0].real], width=0.4, color=BLUE)
            axes.set_xticks([])
            axes.set_xlim(-1, 1)
            axes.set_title(rf"${symbol(name)}$")
        else:
            draw_period(axes, values[0])
            axes.set_title(rf"$2\,\mathrm{{Re}}(\tilde{{{symbol(name)}}}\,e^{{i\omega t}})$")
    if not case.steady and shapes.spatial:
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def draw_shape(axes: Axes, places: NDArray[np.float64], values: NDArray[np.complex128], steady: bool) -> None:
    """Draw a function of s; a complex one by its parts."""
    axes.plot(places, values.real, color=BLUE, label="real part" if not steady else None)
    if not steady:
        axes.plot(places, values.imag, color=RED, ls="--", label="imaginary part")
    axes.set_xlabel(r"$s$")
    axes.set_xlim(places[0], places[-1])


def draw_period(axes: Axes, value: complex) -> None:
    """Draw one period of what oscillates with a complex amplitude."""
    angle = np.linspace(0, 2 * pi, 201)
    axes.plot(angle / (2 * pi), 2 * np.real(value * np.exp(1j * angle)), color=BLUE)
    axes.set_xlabel(r"$\omega t/2\pi$")
    axes.set_xlim(0, 1)


def mode_components(name: str, terms: Sequence[Any], unknowns: Sequence[tuple[str, str]]) -> list[tuple[str, NDArray[np.complex128]]]:
    """Return the functions of a field in the mode, with the direction where it has one; for a vector amplitude along e1."""
    total = [np.zeros(1, dtype=complex)] * len(unknowns)
    for term in terms:  # A = e1: A_+ = A_- = 1
        for k, values in term.values.items():
            total[k] = total[k] + values
    parts = {component: total[k] for k, (field, component) in enumerate(unknowns) if field == name}
    if "p" in parts:
        e1, e2 = (parts["p"] + parts["m"]) / 2, (parts["p"] - parts["m"]) / 2j
        chosen = [(r"\mathbf{e}_1", e1), (r"\mathbf{e}_2", e2), (r"\mathbf{n}", parts["n"])]
    else:
        chosen = [(rf"\mathbf{{e}}_{component}" if component else "", values) for component, values in parts.items()]
    return chosen


# (3) the bifurcation diagram


def bifurcation_figure(case: Case, measured: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None) -> Figure:
    """Return the largest displacement of the states against the control, with stability by line style (label fig:states).

    `measured` holds {name of a state: (controls, peaks)} of the full problem, drawn as symbols.
    """
    figure = Figure(figsize=(4.8, 3.7), layout="constrained")
    axes = figure.subplots()
    reach = 2 * case.mu
    colours = {"beating": RED, "whirling": BLUE, "cycle": BLUE, "branch": BLUE}
    axes.plot([case.threshold - reach, case.threshold], [0, 0], color=BLACK, label="base state, stable")
    axes.plot([case.threshold, case.threshold + reach], [0, 0], color=BLACK, ls="--", label="base state, unstable")
    styles = {"stable": "-", "unstable": "--", "partly": "-."}
    words = {"stable": "stable", "unstable": "unstable", "partly": "unstable across its plane"}
    mu = reach * np.linspace(-1, 1, 801)
    for branch in branches(case):
        if case.transcritical:  # both sides: unstable below the threshold
            for side, label in ((mu >= 0, "stable"), (mu <= 0, "unstable")):
                axes.plot(case.threshold + mu[side], branch.share * mu[side], color=colours[branch.name], ls=styles[label], label=f"branch, {label}")
            continue
        inside = branch.share * mu >= 0
        peak = branch.peak * np.sqrt(branch.share * mu[inside])
        for sign in (1, -1) if case.steady and not case.vector else (1,):
            axes.plot(case.threshold + mu[inside], sign * peak, color=colours[branch.name], ls=styles[branch.stability],
                      label=f"{branch.name}, {words[branch.stability]}" if sign > 0 else None)
    for (name, (controls, peaks)), marker in zip(sorted((measured or {}).items()), "osD^v", strict=False):
        axes.plot(controls, peaks, marker, ms=4, mfc="none", color=colours.get(name, BLACK), label=f"{name}, full problem")
    axes.axvline(case.threshold, color=GREY, lw=0.7, ls=":")
    axes.annotate(rf"${case.control_c}$", (case.threshold, 1), xycoords=("data", "axes fraction"), xytext=(0, 3), textcoords="offset points", ha="center", color=GREY)
    axes.set_xlabel(rf"${case.control}$")
    axes.set_ylabel("amplitude $A$" if case.steady and not case.vector else rf"largest displacement of ${field_symbol(case)}$")
    axes.set_xlim(case.threshold - reach, case.threshold + reach)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.05 * (high - low))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


# (4) transients


def transients_figure(case: Case) -> Figure:
    """Return transients along a line: fast oscillation with its envelope for several mu (label fig:planar); A(t) when steady."""
    return steady_transients(case) if case.steady else oscillating_transients(case)


def oscillating_transients(case: Case) -> Figure:
    """Return the displacement at the place of the normalisation against time in periods, with envelopes, for several mu."""
    small, sub = nice(0.23 * case.size), case.planar.real > 0
    unit = case.mu
    scenes = [(-2 * unit, 0.95 * case.size), (-unit, 0.95 * case.size), (-unit, 1.05 * case.size), (unit, small)] if sub else [(2 * unit, small), (unit, small), (unit / 2, small), (-unit, small)]
    end = 4.5 / (case.gamma.real * unit)
    figure = Figure(figsize=(6.3, 1.45 * len(scenes) + 0.5), layout="constrained")
    panels = figure.subplots(len(scenes), 1, sharex=True)
    turn = 2 * pi / case.omega
    for k, (axes, (mu, start)) in enumerate(zip(panels, scenes, strict=True)):
        scale = np.sqrt(abs(mu))
        motion, until = bounded(case, along(case, start * scale), mu, end, 3 * case.size * scale)
        times = np.linspace(0, until, int(until / turn * 48) + 2)
        amplitude = motion.amplitude(times)[..., 0] if case.vector else motion.amplitude(times)
        axes.plot(times / turn, 2 * np.real(amplitude * np.exp(1j * case.omega * times)) / scale, color=BLUE, lw=0.7)
        for sign in (1, -1):
            axes.plot(times / turn, sign * 2 * np.abs(amplitude) / scale, color=RED, ls="--", lw=1.1, label=r"$\pm 2|A|$" if sign > 0 else None)
        if mu * case.planar.real < 0:
            for sign in (1, -1):
                axes.axhline(sign * 2 * case.size, color=BLACK, ls="-.", lw=0.8, label="unstable state" if sub and sign > 0 else "periodic state" if sign > 0 else None)
        axes.set_title(rf"${case.control}-{case.control_c} = {mu:g}$", loc="right", pad=3)
        reach = 2.35 * case.size if not sub else 6.6 * case.size if until < end else 2.6 * case.size
        axes.set_ylim(-reach, reach)
        letter(axes, "abcd"[k])
    panels[0].set_xlim(0, end / turn)
    panels[-1].set_xlabel(r"$\omega t/2\pi$")
    figure.supylabel(case.scaled_by(rf"{field_symbol(case)}\cdot\mathbf{{e}}_1" if case.vector else f"({field_symbol(case)}-{field_symbol(case)}_0)"), fontsize=10)
    handles, labels = panels[0 if not sub else 1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)
    return figure


def steady_transients(case: Case) -> Figure:
    """Return A(t) from several initial values, for both signs of mu, in scaled variables."""
    figure = Figure(figsize=(6.3, 2.9), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    size, rate = case.size, case.gamma.real
    end = 6 / rate
    shares = (0.03, 0.2, 0.9, 1.6, 2.2)
    signs = (1,) if case.vector else (1, -1)
    for k, (axes, mu) in enumerate(zip(panels, (1.0, -1.0), strict=True)):
        axes.axhline(0, color=BLACK, ls="--" if mu > 0 else "-", lw=1)
        for branch in branches(case):
            if branch.exists(mu) or case.transcritical:
                for sign in ((1,) if case.transcritical else signs):
                    level = branch.share * mu if case.transcritical else sign * size
                    stable = mu > 0 if case.transcritical else branch.stability == "stable"
                    axes.axhline(level, color=BLACK, ls="-" if stable else "--", lw=1)
        for share in shares:
            for sign in signs:
                motion, until = bounded(case, along(case, complex(sign * share * size)), mu, end, 3 * size)
                times = np.linspace(0, until, 400)
                values = motion.amplitude(times)
                axes.plot(times, values[..., 0].real if case.vector else values.real, color=BLUE if sign > 0 else RED, lw=1.1)
        control = rf"{case.control} {'>' if mu > 0 else '<'} {case.control_c}"
        axes.set_title(rf"${control}$")
        axes.set_xlabel(rf"$|{case.control}-{case.control_c}|\,t$")
        axes.set_xlim(0, end)
        axes.set_ylim(-2.4 * size if not case.vector else -0.1 * size, 2.4 * size)
        letter(axes, "ab"[k])
    panels[0].set_ylabel(case.scaled_by("A" if not case.vector else "|A|"))
    return figure


# (5) approach


def approach_figure(case: Case) -> Figure:
    """Return how a general disturbance approaches a state: top views for a vector (label fig:nearplanar), else the phase portrait."""
    return top_views(case) if case.vector and not case.steady else portrait(case)


def top_views(case: Case) -> Figure:
    """Return the top view of an approach to the stable state in six panels."""
    start, mu, motion, end = approach_scene(case)
    scale = np.sqrt(mu)
    shapes = shapes_of(case.emitted, case.result, mu, "1/2", 61)
    turn = 2 * pi / case.omega
    stamps = turn * np.round(np.linspace(0, end, 6) / turn) + turn * np.array([0, 0.13, 0.27, 0.4, 0.55, 0.7])
    figure = Figure(figsize=(6.6, 4.7), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    e1, e2 = shapes.frame[:2]
    whirling = [branch for branch in branches(case) if branch.name == "whirling" and branch.exists(mu)]
    circle = np.exp(1j * np.linspace(0, 2 * pi, 241))
    reach = 0.0
    for k, axes in enumerate(panels.ravel()):
        stamp = stamps[k]
        if whirling:
            radius = whirling[0].peak * np.sqrt(whirling[0].share)
            axes.plot(radius * circle.real, radius * circle.imag, color=GREEN, ls="-.", lw=0.8, label="whirling state")
            reach = max(reach, radius)
        if k:
            times = np.linspace(max(stamps[k - 1], stamp - 12 * turn), stamp, int(min(stamp - stamps[k - 1], 12 * turn) / turn * 60) + 2)
            path = trajectory(case, motion, times) / scale
            fade(axes, path, SKY)
        amplitude = motion.amplitude(np.array([stamp]))[0]
        orbit = 2 * np.real(amplitude[:, None] * circle) / scale
        axes.plot(orbit[0], orbit[1], color=RED, ls="--", lw=1.1, label="orbit at that time")
        field = shapes.at(amplitude, fast_phase(case.result.threshold.frequency, stamp))[case.module.NORMALISED]
        if shapes.spatial:
            axes.plot(field @ e1 / scale, field @ e2 / scale, color=BLACK, lw=2, solid_capstyle="round", label=rf"projection of ${field_symbol(case)}$")
        tip = trajectory(case, motion, np.array([stamp]))[:, 0] / scale
        axes.plot(*tip, "o", ms=5, color=BLACK)
        reach = max(reach, float(np.abs(orbit).max()))
        axes.set_title(rf"$\omega t/2\pi = {stamp / turn:.2f}$", pad=3)
        axes.set_aspect("equal")
        letter(axes, "abcdef"[k])
    panels[0, 0].set_xlim(-1.15 * reach, 1.15 * reach)
    panels[0, 0].set_ylim(-1.15 * reach, 1.15 * reach)
    for axes in panels[-1]:
        axes.set_xlabel(case.scaled_by(rf"{field_symbol(case)}\cdot\mathbf{{e}}_1", False))
    for axes in panels[:, 0]:
        axes.set_ylabel(case.scaled_by(rf"{field_symbol(case)}\cdot\mathbf{{e}}_2", False))
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def trajectory(case: Case, motion: Motion, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normalised field at its place, shape (2, times) or (times,), to leading order."""
    amplitude = motion.amplitude(times)
    turn = np.exp(1j * fast_phase(case.result.threshold.frequency, times))
    return 2 * np.real(amplitude.T * turn)


def portrait(case: Case) -> Figure:
    """Return the phase portrait of the amplitude equation in scaled variables, for mu of the sign that has states and for the other."""
    figure = Figure(figsize=(6.3, 3.3), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    size, rate = case.size, case.gamma.real
    circle = np.exp(1j * np.linspace(0, 2 * pi, 241))
    for k, (axes, mu) in enumerate(zip(panels, (1.0, -1.0), strict=True)):
        if case.steady and not case.vector:
            line_portrait(case, axes, mu)
        else:
            for branch in branches(case):
                if branch.exists(mu):
                    level = np.sqrt(abs(branch.share)) * circle
                    axes.plot(level.real, level.imag, color=BLACK, ls="-" if branch.stability == "stable" else "--", lw=1.2)
            spiral = abs(case.planar.imag / case.planar.real)
            for angle in np.arange(8 if spiral < 2 else 2) * pi / (4 if spiral < 2 else 1):
                for share in (0.12, 0.93, 1.07, 1.8) if spiral < 2 else (0.12, 1.8):
                    start = share * size * np.exp(1j * angle)
                    initial = (complex(start.real), complex(start.imag)) if case.vector else (complex(start),)
                    motion, until = bounded(case, initial, mu, 6 / rate, 2.1 * size)
                    turned = (abs(case.gamma.imag) + 4 * abs(case.planar.imag) * size**2) * until
                    values = motion.amplitude(np.linspace(0, until, min(300 + int(20 * turned), 20000)))
                    x, y = (values[:, 0].real, values[:, 1].real) if case.vector else (values.real, values.imag)
                    axes.plot(x, y, color=BLUE if share < 1 else RED, lw=0.6)
                    axes.plot(x[:1], y[:1], ".", ms=2.5, color=BLUE if share < 1 else RED)
            axes.plot([0], [0], "o", ms=4, mfc="white" if mu > 0 else BLACK, color=BLACK)
            axes.set_aspect("equal")
            axes.set_xlim(-2.1 * size, 2.1 * size)
            axes.set_ylim(-2.1 * size, 2.1 * size)
            axes.set_xlabel(case.scaled_by("A_1" if case.vector else "A_r"))
        axes.set_title(rf"${case.control} {'>' if mu > 0 else '<'} {case.control_c}$")
        letter(axes, "ab"[k])
    if not (case.steady and not case.vector):
        panels[0].set_ylabel(case.scaled_by("A_2" if case.vector else "A_i"))
    return figure


def line_portrait(case: Case, axes: Axes, mu: float) -> None:
    """Draw dA/dt against A, with the rest points."""
    reach = 1.6 * case.size
    values = np.linspace(-reach, reach, 401)
    power = 1 if case.transcritical else 2
    speed = values * (case.gamma.real * mu + case.planar.real * values**power)
    unit = case.gamma.real * case.size
    axes.plot(values / case.size, speed / unit, color=BLUE)
    axes.axhline(0, color=GREY, lw=0.6)
    rests = [0.0]
    for branch in branches(case):
        if case.transcritical:
            rests.append(branch.share * mu)
        elif branch.exists(mu):
            rests += [case.size, -case.size]
    for rest in rests:
        slope = case.gamma.real * mu + (power + 1) * case.planar.real * rest**power
        axes.plot([rest / case.size], [0], "o", ms=6, mfc=BLACK if slope < 0 else "white", color=BLACK, zorder=5)
    axes.set_ylim(-2, 2)
    axes.set_xlabel(r"$A/|\bar{A}|$")
    axes.set_ylabel(r"$\dot{A}/(\gamma|\mu||\bar{A}|)$" if mu > 0 else "")


# (6) decay at the threshold


def decay_figure(case: Case) -> Figure:
    """Return the algebraic decay at the threshold with its asymptotes, and the trajectory in an inset (label fig:threshold).

    Raises
    ------
    EvaluationError
        Disturbances do not decay at the threshold.
    """
    k = case.planar.real
    if not (k < 0 or case.transcritical):
        raise EvaluationError("figures: found a bifurcation without decay at the threshold")
    figure = Figure(figsize=(4.8, 3.8), layout="constrained")
    axes = figure.subplots()
    rate = (1 if case.transcritical else 2) * abs(k)
    times = np.geomspace(1e-3 / rate, 2e3 / rate, 500)
    late = times[times > 3 / rate]
    start = complex(-np.sign(k)) if case.transcritical else 1
    law = 1 / (rate * late) if case.transcritical else 1 / np.sqrt(rate * late)
    values = modulus(case.move(along(case, start), 0.0, float(times[-1])).amplitude(times), case.vector)
    plane = r"$|\mathbf{A}|$, planar" if case.vector and not case.steady else r"$|\mathbf{A}|$" if case.vector else "$|A|$"
    axes.loglog(times, values, color=BLACK, lw=2, label=plane)
    names = [coefficient_name(case, one.monomial) for one in case.result.coefficients if one.monomial != "mu*A" and not one.monomial.startswith("epsilon")]
    named = rf"(-2{names[0]}\,T)^{{-1/2}}" if len(names) == 1 else rf"(-2({'+'.join(names)})\,T)^{{-1/2}}"
    formula = rf"$({rate:.4g}\,T)^{{{-1 if case.transcritical else '-1/2'}}}$" if "" in names or case.transcritical else f"${named}$"
    axes.loglog(late, law, color=ORANGE, lw=1, ls="-", label=formula)
    general = case.vector and not case.steady and case.circular.real < 0 and case.values["dot(A,A)*conj(A)"].real < 0
    if general:
        motion = case.move((0.5, 0.5j * np.sqrt(3)), 0.0, float(times[-1]))
        amplitude = motion.amplitude(times)
        cross = 2 * np.abs((np.conj(amplitude[:, 0]) * amplitude[:, 1]).imag)
        beta = case.circular.real
        axes.loglog(times, modulus(amplitude, True), color=BLUE, lw=2, ls="-.", label=r"$|\mathbf{A}|$, not planar")
        law_of = rf"-2{names[1]}\,T" if names[1] else rf"{-2 * beta:.4g}\,T"
        axes.loglog(late, 1 / np.sqrt(-2 * beta * late), color=SKY, lw=1, label=rf"$({law_of})^{{-1/2}}$")
        axes.loglog(times, cross, color=RED, lw=2, ls="--", label=r"$|\mathbf{B}| = |\mathbf{A}^*\times\mathbf{A}|$")
        axes.loglog(late, -1 / (2 * beta * late), color=PURPLE, lw=1, label=rf"$({law_of})^{{-1}}$")
    axes.set_xlabel(r"$T$")
    axes.set_xlim(times[0], times[-1])
    bottom = 1e-6 if general else 1e-4 if case.transcritical else 1e-3
    axes.set_ylim(bottom, 3 if case.steady else 3e3 if general else 1e2)
    axes.legend(loc="lower left")
    if not case.steady:
        scene = (0.5, 0.5j * np.sqrt(3)) if general else along(case, 1)
        inset_trajectory(case, axes, scene, rate if not general else -2 * case.circular.real)
    return figure


def coefficient_name(case: Case, monomial: str) -> str:
    """Return the real part of a coefficient as mathtext; empty where the user gave no name that is a letter."""
    name = case.result[monomial].name
    letter_like = name in GREEK or len(name) == 1 and name.isalpha()
    return "" if not letter_like else symbol(name) if case.steady else f"{symbol(name)}_r"


def inset_trajectory(case: Case, axes: Axes, scene: Sequence[complex], rate: float) -> None:
    """Draw the first turns of the decaying motion, scaled by epsilon^(1/2)."""
    epsilon = min(nice(17 * case.omega / (2 * pi * rate)), 0.5)
    inset = axes.inset_axes((0.69, 0.63, 0.28, 0.30))
    turn = 2 * pi * epsilon / case.omega
    times = np.linspace(0, 8 * turn, 2400)
    amplitude = case.move(scene, 0.0, float(times[-1])).amplitude(times)
    path = 2 * np.real(amplitude.T * np.exp(1j * case.omega * times / epsilon))
    if case.vector:
        inset.plot(path[0], path[1], color=BLUE, lw=0.7)
        inset.plot(path[0][:1], path[1][:1], "o", ms=3, color=BLUE)
        inset.set_aspect("equal")
        inset.set_xlim(-1.15, 1.15)
        inset.set_ylim(-1.15, 1.15)
    else:
        inset.plot(times / turn, path, color=BLUE, lw=0.7)
        inset.set_xlabel(r"$\omega t/2\pi$", fontsize=7, labelpad=1)
    inset.tick_params(labelsize=6, top=False, right=False)
    shown = field_symbol(case) if case.vector else f"({field_symbol(case)}-{field_symbol(case)}_0)"
    inset.set_title(rf"${shown}/\epsilon^{{1/2}},\ \epsilon = {epsilon:g}$", fontsize=7, pad=2)


# (7) the field in space and time


def spacetime_figure(case: Case) -> Figure:
    """Return the disturbance of the normalised scalar field against space and time, along a transient.

    Raises
    ------
    EvaluationError
        The problem has no space, or its normalised field is a vector.
    """
    if not case.module.SPATIAL or case.vector:
        raise EvaluationError("figures: found no scalar field of space and time")
    mu = case.mu * (1 if case.planar.real < 0 or case.transcritical else -1)
    size = case.size * case.scale(mu)
    share = 0.15 if mu > 0 else 0.9
    start = complex(-np.sign(case.planar.real) * share * size) if case.transcritical else complex(share * size)
    end = 5 / (case.gamma.real * abs(mu)) if case.steady else 12 * 2 * pi / case.omega
    motion, until = bounded(case, (start,), mu, end, 3 * size)
    shapes = shapes_of(case.emitted, case.result, mu, "1", 121)
    times = np.linspace(0, until, 241)
    fields = shapes.at(motion.amplitude(times), fast_phase(case.result.threshold.frequency, times))
    still = shapes.at(np.zeros_like(times, dtype=complex), np.zeros_like(times))
    known = fields.get(case.module.NORMALISED)
    assert known is not None
    disturbance = known - still[case.module.NORMALISED]
    if disturbance.ndim == 3:
        disturbance = disturbance[..., int(np.abs(disturbance).max(axis=(0, 1)).argmax())]
    figure = Figure(figsize=(4.8, 3.2), layout="constrained")
    axes = figure.subplots()
    most = float(np.abs(disturbance).max())
    unit = 1.0 if case.steady else 2 * pi / case.omega
    mesh = axes.pcolormesh(times / unit, shapes.places, disturbance.T, cmap="RdBu_r", vmin=-most, vmax=most, shading="gouraud", rasterized=True)
    bar = figure.colorbar(mesh, ax=axes)
    bar.set_label(rf"${symbol(case.module.NORMALISED)}-{symbol(case.module.NORMALISED)}_0$")
    axes.set_xlabel(r"$t$" if case.steady else r"$\omega t/2\pi$")
    axes.set_ylabel(r"$s$")
    axes.set_title(rf"${case.control}-{case.control_c} = {mu:g}$")
    return figure


FIGURES: Mapping[str, Callable[[Case], Figure]] = {
    "mode": mode_figure, "bifurcation": bifurcation_figure, "transients": transients_figure, "approach": approach_figure, "decay": decay_figure, "spacetime": spacetime_figure,
}
NAMES = ("growth", *FIGURES, "animation")


def draw(case: Case, name: str, spectra: Spectra | None = None, measured: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None) -> Figure:
    """Return one figure by name; `spectra` for the growth rates, `measured` points of the full problem for the bifurcation diagram.

    Raises
    ------
    EvaluationError
        The figure does not apply to this problem; the message says why.
    """
    with styled():
        if name == "growth":
            if spectra is None:
                raise EvaluationError("figures: found no eigenvalues; the figure growth needs them")
            return growth_figure(case, spectra)
        if name != "mode" and name in FIGURES and not case.planar.real:
            raise EvaluationError("figures: found a vanishing nonlinear coefficient; the next order decides what there is to draw")
        if name == "bifurcation":
            return bifurcation_figure(case, measured)
        return FIGURES[name](case)


__all__ = ["NAMES", "Spectra", "case_of", "draw", "saved"]
