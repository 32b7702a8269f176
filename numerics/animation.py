"""The approach to a stable state in three dimensions: a GIF, and a page that needs nothing but a browser.

The two times are shown apart: slow time runs from the start to the end of the approach while the fast oscillation is slowed down, so that
one turn on the screen stands for many. Geometry is true, to the order of mu.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from numerics.case import Case, approach_scene, field_symbol
from numerics.drawing import BLACK, BLUE, GREY, RED, styled
from numerics.motion import shapes_of
from numerics.precision import EvaluationError

FRAMES_A_TURN = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Animation:
    """Curves of the normalised vector field, shape (frames, places, 3), along e1, e2 and the axis; times in periods."""

    problem: str
    curves: NDArray[np.float64]
    periods: NDArray[np.float64]
    distance: str
    field: str
    turns: int


def animation_of(case: Case, turns: int = 9, places: int = 33) -> Animation:
    """Return the curves of an approach to the stable state.

    Raises
    ------
    EvaluationError
        The problem has no curve that moves in three dimensions, or no stable state.
    """
    if not (case.vector and case.module.SPATIAL) or case.steady:
        raise EvaluationError("figures: found no curve that oscillates in three dimensions; the animation needs a Hopf bifurcation with rotation_axis and space")
    _, mu, motion, end = approach_scene(case)
    shapes = shapes_of(case.emitted, case.result, mu, "1", places)
    frames = turns * FRAMES_A_TURN
    times = np.linspace(0, 1.1 * end, frames)
    fields = shapes.at(motion.amplitude(times), 2 * np.pi * np.arange(frames) / FRAMES_A_TURN)
    curves = fields[case.module.NORMALISED] @ shapes.frame.T
    control = case.module.CONTROL.rstrip("_")
    return Animation(problem=case.module.NAME, curves=curves, periods=times * case.omega / (2 * np.pi), distance=f"{control} - {control}_c = {mu:g}", field=case.module.NORMALISED, turns=turns)


def box_of(animation: Animation) -> tuple[float, float, float]:
    """Return the half width across the axis, and the lowest and highest place along it."""
    low, high = float(animation.curves[..., 2].min()), float(animation.curves[..., 2].max())
    return max(1.4 * float(np.abs(animation.curves[..., :2]).max()), 0.25 * (high - low)), low, high


def gif_of(animation: Animation, case: Case, every: int = 3) -> bytes:
    """Return the animation as an animated GIF, drawn frame by frame."""
    across, low, high = box_of(animation)
    images = []
    palette = palette_image()
    with styled():
        figure = Figure(figsize=(3.6, 4.0), dpi=90)
        canvas = FigureCanvasAgg(figure)
        axes: Any = figure.add_axes((0.0, 0.06, 1.0, 0.84), projection="3d")
        axes.set(xlim=(-across, across), ylim=(-across, across), zlim=(low, high + 0.05 * (high - low)))
        axes.set_box_aspect((2 * across, 2 * across, 1.05 * (high - low)), zoom=1.0)
        axes.view_init(elev=22, azim=-50)
        axes.tick_params(labelsize=6, pad=-2)
        axes.locator_params(nbins=4)
        name = field_symbol(case)
        axes.set_xlabel(rf"${name}\cdot\mathbf{{e}}_1$", labelpad=-6, fontsize=8)
        axes.set_ylabel(rf"${name}\cdot\mathbf{{e}}_2$", labelpad=-6, fontsize=8)
        (curve,) = axes.plot([], [], [], color=BLACK, lw=3)
        (shadow,) = axes.plot([], [], [], color=GREY, lw=1.5, alpha=0.6)
        (path,) = axes.plot([], [], [], color=BLUE, lw=0.9)
        (tip,) = axes.plot([], [], [], "o", color=RED, ms=5)
        title = figure.text(0.5, 0.95, "", ha="center")
        for k in range(0, len(animation.curves), every):
            x, y, z = animation.curves[k].T
            curve.set_data_3d(x, y, z)
            shadow.set_data_3d(x, y, np.full_like(z, low))
            path.set_data_3d(*animation.curves[max(0, k - FRAMES_A_TURN):k + 1, -1].T)
            tip.set_data_3d(x[-1:], y[-1:], z[-1:])
            title.set_text(rf"${case.control}-{case.control_c} = {case.mu:g}$,  $\omega t/2\pi = {animation.periods[k]:.0f}$")
            canvas.draw()
            images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).quantize(palette=palette, dither=Image.Dither.NONE))
    memory = io.BytesIO()
    images[0].save(memory, format="GIF", save_all=True, append_images=images[1:], duration=110, loop=0, optimize=False)
    return memory.getvalue()


def palette_image() -> Image.Image:
    """Return a palette of greys and of the colours in use, mixed with white: the same for every frame."""
    colours = [tuple(int(255 * (share * part + 1 - share)) for part in to_rgba(colour)[:3]) for colour in (BLUE, RED) for share in np.linspace(0.1, 1, 12)]
    greys = [(k, k, k) for k in range(0, 256, 5)] + [(255, 255, 255)]
    image = Image.new("P", (1, 1))
    image.putpalette([part for colour in (*greys, *colours) for part in colour])
    return image


def fragment_of(animation: Animation) -> str:
    """Return a piece of HTML that plays the animation on a canvas; it loads nothing."""
    across, low, high = box_of(animation)
    data = {
        "curves": np.round(animation.curves, 4).tolist(), "periods": np.round(animation.periods, 1).tolist(), "across": round(across, 4), "low": round(low, 4),
        "high": round(high, 4), "turn": FRAMES_A_TURN,
    }
    skipped = round(float(animation.periods[-1]) / animation.turns)
    caption = (f"{animation.problem}: approach to the stable state at {animation.distance}. One turn on the screen stands for about {skipped} periods; "
               "drag, or use the arrow keys, to look from elsewhere.")
    return FRAGMENT.replace("@DATA@", json.dumps(data, separators=(",", ":"))).replace("@LAST@", str(len(animation.curves) - 1)).replace("@CAPTION@", caption)


def page_of(animation: Animation) -> str:
    """Return the animation as a whole page."""
    return PAGE.replace("@TITLE@", animation.problem).replace("@BODY@", fragment_of(animation))


FRAGMENT = """<figure class="approach">
<canvas width="640" height="640" tabindex="0" role="img" aria-label="@CAPTION@"></canvas>
<div><button type="button" aria-pressed="false">Pause</button>
<label>time <input type="range" min="0" max="@LAST@" value="0"></label> <output></output></div>
<figcaption>@CAPTION@</figcaption>
<script>
(function () {
  "use strict";
  const data = @DATA@;
  const figure = document.currentScript.parentElement;
  const canvas = figure.querySelector("canvas"), context = canvas.getContext("2d");
  const button = figure.querySelector("button"), slider = figure.querySelector("input"), output = figure.querySelector("output");
  let azimuth = -0.9, elevation = 0.38, frame = 0, playing = !window.matchMedia("(prefers-reduced-motion: reduce)").matches, last = 0;
  const middle = (data.low + data.high) / 2, size = Math.max(2 * data.across, data.high - data.low);
  function project(p) {
    const c = Math.cos(azimuth), s = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
    const x = c * p[0] - s * p[1], y = s * p[0] + c * p[1], z = p[2] - middle;
    const scale = 0.74 * canvas.width / size;
    return [canvas.width / 2 + scale * x, canvas.height / 2 - scale * (z * ce + y * se)];
  }
  function line(points, colour, width) {
    context.beginPath();
    points.forEach(function (p, k) { const q = project(p); if (k) context.lineTo(q[0], q[1]); else context.moveTo(q[0], q[1]); });
    context.strokeStyle = colour; context.lineWidth = width; context.lineJoin = context.lineCap = "round"; context.stroke();
  }
  function draw() {
    const style = getComputedStyle(figure), ink = style.color, a = data.across, curve = data.curves[frame], tip = curve[curve.length - 1];
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.globalAlpha = 0.35;
    line([[-a, -a, data.low], [a, -a, data.low], [a, a, data.low], [-a, a, data.low], [-a, -a, data.low]], ink, 1.5);
    line([[0, 0, data.low], [0, 0, data.high]], ink, 1);
    line(curve.map(function (p) { return [p[0], p[1], data.low]; }), ink, 4);
    context.globalAlpha = 1;
    const path = [];
    for (let k = Math.max(0, frame - data.turn); k <= frame; k++) path.push(data.curves[k][curve.length - 1]);
    line(path, "#56B4E9", 2.5);
    line(curve, ink, 7);
    const q = project(tip);
    context.beginPath(); context.arc(q[0], q[1], 9, 0, 2 * Math.PI); context.fillStyle = "#D55E00"; context.fill();
    slider.value = frame; output.textContent = data.periods[frame].toFixed(0) + " periods";
  }
  function step(now) {
    if (playing && now - last > 40) { last = now; frame = (frame + 1) % data.curves.length; draw(); }
    window.requestAnimationFrame(step);
  }
  function show() { button.textContent = playing ? "Pause" : "Play"; button.setAttribute("aria-pressed", String(!playing)); }
  button.addEventListener("click", function () { playing = !playing; show(); });
  slider.addEventListener("input", function () { frame = Number(slider.value); playing = false; show(); draw(); });
  function turn(da, de) { azimuth += da; elevation = Math.min(1.57, Math.max(0, elevation + de)); draw(); }
  canvas.addEventListener("pointermove", function (event) { if (event.buttons) turn(-event.movementX / 120, event.movementY / 120); });
  canvas.addEventListener("keydown", function (event) {
    const moves = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (event.key in moves) { event.preventDefault(); turn(moves[event.key][0], moves[event.key][1]); }
  });
  show(); draw(); window.requestAnimationFrame(step);
})();
</script>
</figure>
"""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
:root { color-scheme: light dark; }
body { margin: 1rem auto; max-width: 44rem; padding: 0 1rem; font: 1rem/1.5 system-ui, sans-serif; color: #111; background: #fff; }
figure { margin: 0; }
canvas { width: 100%; height: auto; touch-action: none; }
input { vertical-align: middle; max-width: 50%; }
@media (prefers-color-scheme: dark) { body { color: #eee; background: #16181b; } }
</style>
</head>
<body>
<h1>@TITLE@</h1>
@BODY@
</body>
</html>
"""
