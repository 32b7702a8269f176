"""How figures look: palette, style, symbols as mathtext; made without pyplot, and the same at every run."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray

# Okabe and Ito's palette, which the colour-blind can tell apart.
BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#777777"
STYLE: dict[str, Any] = {
    "font.size": 9, "axes.labelsize": 10, "legend.fontsize": 8, "xtick.labelsize": 8, "ytick.labelsize": 8, "axes.titlesize": 9,
    "font.family": "DejaVu Sans", "mathtext.fontset": "dejavuserif", "axes.linewidth": 0.7, "lines.linewidth": 1.3, "legend.frameon": False, "legend.handlelength": 2.6,
    "xtick.direction": "in", "ytick.direction": "in", "xtick.top": True, "ytick.right": True, "savefig.dpi": 200, "figure.facecolor": "white", "svg.hashsalt": "fredholm",
    "svg.fonttype": "path", "pdf.fonttype": 42, "axes.formatter.use_mathtext": True, "axes.formatter.useoffset": False, "agg.path.chunksize": 0,
}
GREEK = frozenset("alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega".split())


def styled() -> Any:
    """Return the context in which figures are made: the style above over matplotlib's defaults, whatever the user has set."""
    default: dict[Any, Any] = dict(matplotlib.rcParamsDefault)
    kept: Any = {key: value for key, value in default.items() if not key.startswith(("backend", "interactive", "toolbar"))}
    kept.update(STYLE)
    return matplotlib.rc_context(kept)


def symbol(name: str, extra: str = "") -> str:
    """Return a name as mathtext, `lambda_1` as a Greek letter with a subscript; `extra` joins the subscript."""
    stem, _, below = re.sub(r"\W", "", name).strip("_").partition("_")
    stem = f"\\{stem}" if stem in GREEK else stem if len(stem) == 1 else rf"\mathrm{{{stem}}}"
    below = ",".join(part for part in (below.replace("_", ","), extra) if part)
    return f"{stem}_{{{below}}}" if below else stem


def bold(name: str) -> str:
    """Return the name of a vector as mathtext."""
    return rf"\mathbf{{{name}}}" if len(name) == 1 else symbol(name)


def letter(axes: Axes, text: str) -> None:
    """Put a panel's letter in its corner."""
    axes.annotate(f"({text})", (0, 1), xycoords="axes fraction", xytext=(-4, 5), textcoords="offset points", ha="right", va="bottom")


def fade(axes: Axes, path: NDArray[np.float64], colour: str) -> None:
    """Draw a path that fades towards its beginning."""
    points = path.T[:, None, :]
    segments = np.concatenate([points[:-1], points[1:]], axis=1)
    red, green, blue, _ = to_rgba(colour)
    shades = [(red, green, blue, 0.08 + 0.92 * share) for share in np.linspace(0, 1, len(segments))]
    axes.add_collection(LineCollection(list(segments), colors=shades, linewidths=0.8))


def saved(figure: Figure, form: str) -> bytes:
    """Return a figure as the bytes of an SVG, PNG or PDF file: the same at every run, without a date."""
    memory = io.BytesIO()
    every: dict[str, Any] = {"svg": {"Date": None, "Creator": "fredholm"}, "pdf": {"CreationDate": None, "Creator": "fredholm"}, "png": {"Software": "fredholm"}}
    with styled():
        figure.savefig(memory, format=form, metadata=every[form])
    return memory.getvalue()
