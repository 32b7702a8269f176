r"""Thresholds and coefficients in double precision for arrays of parameter values.

The threshold of every entry is continued from the known onset: along the straight line in parameter space, in steps, with a
secant predictor and Newton's method for :math:`g(c, \omega) = 0`. A few entries lead; the others start from the nearest of them.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from numerics.algebra import across
from numerics.coefficients import Module, evaluate
from numerics.doubles import Array, DoubleNumbers, Doubles, Scale, largest_of
from numerics.explicit import Explicit
from numerics.precision import EvaluationError
from numerics.tape import NotRecorded

EPSILON = float(np.finfo(float).eps)
CHUNK = 256
ROOTS_CHUNK, VALUES_CHUNK = 1024, 1024
"""the same for recorded problems: what stays in the cache"""
LEADERS = 64
RESOLUTIONS = ((20, 1), (24, 1), (28, 1), (32, 1), (24, 2), (32, 2), (28, 3), (32, 4), (32, 6), (32, 9), (32, 14), (32, 20))
SAFETY = 8.0
CONFIRMED = 1e-7
"""relative difference from the digits of `evaluate` at the nominal values; double precision alone stays well below where it resolves a problem"""
JOLT = 1 + 4 * EPSILON * np.array([0.0, 1.0])[:, None, None]
"""the second rule takes parameters four units in the last place off: the difference then shows how rounding on the way is amplified"""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """Arrays in the shape of the parameters; NaN where `reason` is not empty."""

    problem: str
    kind: str
    multiplicity: int
    parameters: Mapping[str, Array]
    control: Array
    control_error: Array
    frequency: Array | None
    frequency_error: Array | None
    monomials: Mapping[str, str]
    coefficients: Mapping[str, Array]
    errors: Mapping[str, Array]
    """estimates of |computed - true| by name"""
    reason: Array

    def __getitem__(self, name: str) -> Array:
        for key, monomial in self.monomials.items():
            if name in (key, monomial):
                return self.coefficients[key]
        raise KeyError(f"{name}: expected one of {', '.join(self.monomials)}")

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; numbers are strings."""
        def plain(values: Array | None) -> Any:
            return None if values is None else np.vectorize(repr, otypes=[object])(np.asarray(values)).tolist()

        return {
            "problem": self.problem, "kind": self.kind, "multiplicity": self.multiplicity,
            "parameters": {name: plain(values) for name, values in self.parameters.items()},
            "control": plain(self.control), "control_error": plain(self.control_error), "frequency": plain(self.frequency), "frequency_error": plain(self.frequency_error),
            "coefficients": [{"name": name, "monomial": self.monomials[name], "re": plain(np.real(values)), "im": plain(np.imag(values)), "error": plain(self.errors[name])}
                             for name, values in self.coefficients.items()],
            "reason": self.reason.tolist(),
        }

    def __repr__(self) -> str:
        good = self.reason == ""
        lines = [f"{self.problem}: {self.kind}, {good.sum()} of {good.size} entries, control {np.nanmin(self.control, initial=np.inf):.9g} to {np.nanmax(self.control, initial=-np.inf):.9g}"]
        lines += [f"  {name} ({self.monomials[name]}): largest error {np.nanmax(self.errors[name], initial=0.0):.2g}" for name in self.coefficients]
        return "\n".join(lines)


class Arithmetic(ast.NodeTransformer):
    """Rewrites what NumPy does slowly: a division by an integer becomes a leading factor, a power becomes products."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Rewrite x*y/4 to 0.25*x*y and x**3 to power(x, 3)."""
        self.generic_visit(node)
        if not (isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)):
            return node
        if isinstance(node.op, ast.Pow) and node.right.value > 2:
            return ast.Call(func=ast.Name(id="power", ctx=ast.Load()), args=[node.left, node.right], keywords=[])
        if isinstance(node.op, ast.Div):
            first = ast.Constant(value=1 / node.right.value)
            spot: ast.expr = node.left
            if not (isinstance(spot, ast.BinOp) and isinstance(spot.op, ast.Mult)):
                return ast.BinOp(left=first, op=ast.Mult(), right=spot)
            while isinstance(spot.left, ast.BinOp) and isinstance(spot.left.op, ast.Mult):
                spot = spot.left
            spot.left = ast.BinOp(left=first, op=ast.Mult(), right=spot.left)
            return node.left
        return node


def power(value: Any, exponent: int) -> Any:
    """Return a power by repeated products."""
    half = value if exponent < 4 else power(value, exponent // 2)
    if exponent < 4:
        return value if exponent == 1 else value * value if exponent == 2 else value * value * value
    return half * half * value if exponent % 2 else half * half


def module_of(text: str) -> Module:
    """Return the emitted module, its arithmetic written for arrays."""
    module = Module(text)
    tree = ast.fix_missing_locations(Arithmetic().visit(ast.parse(text)))
    module.names["power"] = power
    exec(compile(tree, "<emitted>", "exec"), module.names)  # noqa: S102  (the emitted module is our own text)
    return module


@dataclass(frozen=True, slots=True, kw_only=True)
class Roots:
    """Control and frequency, shape (rules, batch), the last Newton steps, and why there is none."""

    control: Array
    frequency: Array
    control_step: Array
    frequency_step: Array
    reason: Array

    def taken(self, which: Array | slice) -> Roots:
        """Return a part of the batch."""
        return Roots(control=self.control[:, which], frequency=self.frequency[:, which], control_step=self.control_step[:, which], frequency_step=self.frequency_step[:, which],
                     reason=self.reason[which])


class Evaluator:
    """An emitted module with what does not depend on parameter values: resolution, nominal threshold, derivatives there."""

    def __init__(self, text: str) -> None:
        self.module = module_of(text)
        names = self.module.names
        self.hopf = names["KIND"] == "hopf"
        probe = DoubleNumbers(control=np.zeros((2, 1, 1)), frequency=np.zeros((2, 1, 1)), values={})
        self.nominal = {name: float(np.real(value)) for name, value in names["parameters"](probe).items()}
        self.names = {names.get("PARAMETER_NAMES", {}).get(name, name): name for name in self.nominal}
        left, right = names["interval"](probe) if names["SPATIAL"] else (0, 0)
        self.ends = (float(np.real(left)), float(np.real(right)))
        self.spatial: bool = names["SPATIAL"]
        low, high = (float(end) for end in names["CONTROL_RANGE"])
        self.range = (low, high)
        self.width = high - low
        self.resolution = (0, 1)
        self.scales: dict[str, Scale] = {}
        self.nominal_point = np.array([[self.nominal[name] for name in self.names.values()]])
        self.listed = [*names["COEFFICIENTS"], *([names["QUADRATIC"]] if names["QUADRATIC"] is not None else [])]
        self.explicit: Explicit | None = None
        self.ill = math.inf
        self.growth = next((identifier for _, monomial, identifier in self.listed if monomial == "mu*A"), "")
        with np.errstate(all="ignore"):
            self.choose_resolution()
            nodes, panels = self.resolution
            if panels == 1 and self.spatial:
                with suppress(NotRecorded):
                    explicit = Explicit(names, self.ends, nodes, list(self.names.values()), self.scales["mode"])
                    explicit.prepare(self.start.control, self.start.frequency, jolted(self.nominal_point, 2))
                    self.explicit = explicit
            self.ill = float(self.raw_values(self.start, self.nominal_point)[1][0])
            if self.spatial and self.explicit is None:
                self.confirm(text)
            self.slopes = self.derivatives(*self.onset, self.nominal_point)[1:]

    # Algebra and threshold

    def algebra(self, control: Array, frequency: Array, points: Array) -> Any:
        """Return the algebra at thresholds (2, batch) and parameter values (batch, parameters)."""
        values = {name: points[None, :, k, None] * JOLT for k, name in enumerate(self.names.values())}
        common: dict[str, Any] = {"control": control[..., None], "frequency": frequency[..., None], "values": values, "scales": self.scales}
        if not self.spatial:
            return DoubleNumbers(**common)
        return Doubles(ends=self.ends, nodes=self.resolution[0], panels=self.resolution[1], **common)

    def residual(self, control: Array, frequency: Array, points: Array) -> Array:
        """Return g(c, omega), shape (rules, batch)."""
        if self.explicit:
            return self.explicit.criticality(control, frequency, jolted(points, len(control)))
        a = self.algebra(control, frequency, points)
        return a.criticality(self.module.names["critical"](a))  # type: ignore[no-any-return]

    def derivatives(self, control: Array, frequency: Array, points: Array) -> tuple[Array, Array, Array]:
        """Return g and its derivatives to control and frequency, by differences."""
        h = 1e-7 * (np.abs(control) + self.width * 2e-3)
        k = 1e-7 * (np.abs(frequency) + 1e-30)
        parts = 3 if self.hopf else 2
        controls = np.concatenate([control, control + h, control][:parts], axis=1)
        frequencies = np.concatenate([frequency, frequency, frequency + k][:parts], axis=1)
        values = np.split(self.residual(controls, frequencies, np.tile(points, (parts, 1))), parts, axis=1)
        return values[0], (values[1] - values[0]) / h, (values[2] - values[0]) / k if self.hopf else np.zeros_like(values[0])

    def newton_step(self, value: Array, by_control: Array, by_frequency: Array) -> tuple[Array, Array]:
        """Return the real steps (dc, domega) with g_c dc + g_omega domega = g."""
        if not self.hopf:
            return np.real(value / by_control), np.zeros_like(value.real)
        bottom = np.imag(np.conj(by_control) * by_frequency)
        return np.imag(np.conj(value) * by_frequency) / bottom, np.imag(np.conj(by_control) * value) / bottom

    def corrected(self, control: Array, frequency: Array, points: Array, slopes: tuple[Array, Array] | None = None, rounds: int = 9) -> Roots:
        """Return the roots near a guess, by Newton's method: Broyden's update of the slopes, which are taken anew only while steps are large and shrink slowly."""
        control, frequency = control.copy(), frequency.copy()
        batch = control.shape[1]
        active: Any = slice(None)
        reason = np.full(batch, "", dtype=object)
        steps = np.full((2, *control.shape), np.inf)
        scales = np.abs(control[0]) + self.width * 1e-3, np.abs(frequency[0]) if self.hopf else np.ones(batch)
        largest = np.full(batch, np.inf)
        dc = dw = np.zeros((1, 0))
        for attempt in range(rounds):
            c, w, points_here = control[:, active], frequency[:, active], points[active]
            scale_c, scale_w = scales[0][active], scales[1][active]
            if slopes is None:
                value, *rest = self.derivatives(c, w, points_here)
                slopes = (rest[0], rest[1])
            else:
                value = self.residual(c, w, points_here)
                if attempt:  # J += g dx^T/|dx|^2 for a full step dx = -(dc, dw)
                    share = value / ((dc / scale_c) ** 2 + (dw / scale_w) ** 2 + 1e-300)
                    slopes = slopes[0] - share * dc / scale_c**2, slopes[1] - share * dw / scale_w**2
            dc, dw = self.newton_step(value, *slopes)
            control[:, active], frequency[:, active] = c - dc, w - dw
            steps[0][:, active], steps[1][:, active] = np.abs(dc), np.abs(dw)
            size = (np.abs(dc) / scale_c + np.abs(dw) / scale_w).max(axis=0)
            ratio = size / largest[active] if attempt else np.ones(size.size)
            lost = ~np.isfinite(size) | (size > 0.5) | (attempt > 0) & (ratio > 0.7) & (size > 1e-11)
            # a step that is small by chance promises nothing: no entry counts on more than four digits a round
            done = ~lost & ((size < 1e-14) | (size * np.clip(ratio, 1e-4, 1) < 1e-16) | (attempt > 2) & (size < 1e-11) & (ratio > 0.3))
            if lost.any():
                reason[np.arange(batch)[active][lost]] = "threshold: Newton's method does not converge"
            largest[active] = size
            keep = ~(lost | done)
            if not keep.any():
                break
            if np.median(ratio[keep] / 10 if attempt else size[keep]) > 1e-2 and size[keep].max() > 1e-9:
                slopes = None
            if not keep.all():
                slopes = (slopes[0][:, keep], slopes[1][:, keep]) if slopes else None
                active, dc, dw = np.arange(batch)[active][keep], dc[:, keep], dw[:, keep]
        else:
            reason[active] = "threshold: Newton's method does not converge"
        return Roots(control=control, frequency=frequency, control_step=steps[0], frequency_step=steps[1], reason=reason)

    def from_onset(self) -> Roots:
        """Return the root at the nominal values, from the one found when the resolution was chosen, with the slopes known there."""
        control, frequency = self.start.control, self.start.frequency
        scale = abs(control[0, 0]) + self.width * 1e-3, abs(frequency[0, 0]) if self.hopf else 1.0
        before = math.inf
        for _ in range(4):
            dc, dw = self.newton_step(self.residual(control, frequency, self.nominal_point), *self.slopes)
            control, frequency = control - dc, frequency - dw
            dc, dw = np.abs(dc), np.abs(dw)
            size = float((dc / scale[0] + dw / scale[1]).max())
            if size < 1e-10 and size * size < 1e-15 * before < math.inf or size < 1e-14:
                return Roots(control=control, frequency=frequency, control_step=dc, frequency_step=dw, reason=np.array([""], dtype=object))
            before = size
        return self.corrected(*self.onset, self.nominal_point)

    # Coefficients

    def values(self, roots: Roots, points: Array) -> tuple[dict[str, Array], Array, list[tuple[Array, str]]]:
        """Return the coefficients, shape (rules, batch), how ill-conditioned the entries are, and those that have none, with the reason."""
        result, ill, troubles = self.raw_values(roots, points)
        return result, ill, [(~(ill < 1e9 * self.ill), "threshold: the product of direct and adjoint mode vanishes: the critical eigenvalue is defective"), *troubles]

    def raw_values(self, roots: Roots, points: Array) -> tuple[dict[str, Array], Array, list[tuple[Array, str]]]:
        """Return the same without a look for defective eigenvalues, which are told by their distance from the nominal one."""
        names = self.module.names
        if self.explicit:
            return self.explicit.values(roots.control, roots.frequency, jolted(points, len(roots.control)))
        a = self.algebra(roots.control, roots.frequency, points)
        result: dict[str, Array] = {}
        size = largest_of(names["mode"](a)) * largest_of(names["adjoint_mode"](a))
        total = a.number(names["xi"](a))
        for _, _, identifier in self.listed:
            result[identifier] = a.number(names[identifier](a))
        for name, _, _ in names["WEAK"]:
            result[name] = a.number(names[name](a))
        return result, 1 + size / np.abs(total).min(axis=0), a.troubles

    def contradictions(self, roots: Roots, points: Array) -> list[tuple[Array, str]]:
        """Return the entries at which redundant equations contradict each other, or the two senses of rotation differ, with the reason."""
        names = self.module.names
        a = self.algebra(roots.control, roots.frequency, points)
        reference = np.maximum(1, largest_of(names["mode"](a))) ** 2
        troubles = []
        for identifier, mirror in names["MIRROR"]:
            one, other = a.number(names[identifier](a)), a.number(names[mirror](a))
            troubles.append(((np.abs(other - one) > 1e-7 * (1 + np.abs(other))).any(axis=0), "rotation_axis: different coefficients for the two senses of rotation"))
        for labels, condition in (*names["consistency"](a), *names["consistency_cubic"](a)):
            size = np.abs(condition) * np.ones((2, a.batch, 1))
            troubles.append((size.max(axis=(0, 2)) > 1e-7 * reference, f"equations: {labels} contradict each other beyond the linear terms"))
        return troubles

    def choose_resolution(self) -> None:
        """Take the first resolution at which both rules agree as closely as any later one does, at the nominal values."""
        names = self.module.names
        self.onset = guess = np.full((2, 1), float(names["ONSET"][0])), np.full((2, 1), float(names["ONSET"][1] or 0))
        best: tuple[float, tuple[int, int], Roots, dict[str, Scale]] | None = None
        for resolution in RESOLUTIONS if self.spatial else ((0, 1),):
            self.resolution, self.scales = resolution, {}
            away = self.algebra(guess[0] + 0.03 * self.width, guess[1] * 1.1, self.nominal_point)
            names["mode"](away), names["adjoint_mode"](away)
            roots = self.corrected(*guess, self.nominal_point)
            if roots.reason[0]:
                continue
            values = with_meaning(self.values(roots, self.nominal_point)[0], names)
            largest = max(np.abs(one).max() for one in values.values())
            spread = max(float(np.abs(one[0] - one[1]).max() / max(np.abs(one).max(), 1e-3 * largest, 1e-300)) for one in values.values())
            spread = max(spread, float(np.ptp(roots.control) / (np.abs(roots.control).max() + 1e-3 * self.width)))
            if best is not None and best[0] < 1e-12 and spread > best[0] / 4:
                break
            if best is None or spread < best[0]:
                best = (spread, resolution, roots, self.scales)
            if best[0] < 2e-14:
                break
        if best is None or best[0] > 1e-5:
            raise EvaluationError(f"{names['NAME']}: double precision does not resolve the problem; use evaluate(...), which raises precision and resolution")
        _, self.resolution, self.start, self.scales = best

    def confirm(self, text: str) -> None:
        """Refuse to go on where the nominal values are not those of `evaluate`: both rules may step over a narrow feature of a coefficient."""
        result = evaluate(text)
        values = self.values(self.start, self.nominal_point)[0]
        pairs = [(complex(self.start.control[0, 0]), complex(float(result.threshold.control)), abs(self.start.control[0, 0]) + 1e-3 * self.width)]
        largest = max(abs(one[0, 0]) for one in values.values())
        pairs += [(complex(values[identifier][0, 0]), complex(one.value), largest) for one in result.coefficients for name, _, identifier in self.listed if name == one.name]
        if any(abs(a - b) > CONFIRMED * size for a, b, size in pairs):
            raise EvaluationError(f"{self.module.NAME}: double precision does not resolve the problem; use evaluate(...), which raises precision and resolution")

    # Continuation

    def travelled(self, points: Array, steps: int) -> Roots:
        """Return the roots at `points`, continued from the nominal values along straight lines."""
        batch = len(points)
        which = np.zeros(batch, dtype=int)
        before = after = self.start.taken(which)
        reason = np.full(batch, "", dtype=object)
        for k in range(1, steps + 1):
            here = self.nominal_point + (points - self.nominal_point) * (k / steps) ** 1.07  # no round shares: symmetric points are where modes cross
            guess = (2 * after.control - before.control, 2 * after.frequency - before.frequency) if k > 1 else (after.control, after.frequency)
            fresh = self.corrected(guess[0], guess[1], here)
            moved = np.abs(fresh.control - guess[0]).max(axis=0) / (np.abs(guess[0][0]) + 1e-2 * self.width)
            if self.hopf:
                moved = np.maximum(moved, np.abs(fresh.frequency / guess[1] - 1).max(axis=0))
            reason = np.where(reason != "", reason, np.where(fresh.reason != "", fresh.reason, np.where(
                moved > (0.3 if k == 1 else 0.1), "threshold: Newton's method goes to another branch", "")))
            before, after = after, fresh
        return replace(after, reason=reason)

    def led(self, points: Array) -> Roots:
        """Return the roots at `points`, with ever smaller steps for those that need them."""
        if (points == self.nominal_point).all():
            roots = self.from_onset()
            return roots if len(points) == 1 else roots.taken(np.zeros(len(points), dtype=int))
        roots = self.travelled(points, 4)
        for steps in (16, 64, 256):
            lost = np.flatnonzero(roots.reason != "")
            if not lost.size:
                break
            again = self.travelled(points[lost], steps)
            for whole, part in zip((roots.control, roots.frequency, roots.control_step, roots.frequency_step), (again.control, again.frequency, again.control_step, again.frequency_step), strict=True):
                whole[:, lost] = part
            roots.reason[lost] = again.reason
        return roots

    def gradients(self, roots: Roots, points: Array) -> tuple[Array, Array, tuple[Array, Array]]:
        """Return dc/dp and domega/dp of each parameter at roots, shape (2, batch, parameters), with g_c dc + g_omega domega + g_p dp = 0, and g_c and g_omega."""
        value, by_control, by_frequency = self.derivatives(roots.control, roots.frequency, points)
        columns = []
        for k in range(points.shape[1]):
            h = 1e-6 * (np.abs(points[:, k]) + np.ptp(points[:, k]) + 1e-12)
            moved = points.copy()
            moved[:, k] += h
            slope = (self.residual(roots.control, roots.frequency, moved) - value) / h
            columns.append(self.newton_step(-slope, by_control, by_frequency))
        if not columns:
            return np.zeros((*value.shape, 0)), np.zeros((*value.shape, 0)), (by_control, by_frequency)
        return np.stack([one for one, _ in columns], axis=-1), np.stack([one for _, one in columns], axis=-1), (by_control, by_frequency)

    def follow(self, points: Array) -> tuple[Roots, Array, Array]:
        """Return the roots of all entries, the indices of the entries that lead, and for each entry the leaders from the nearest on, shape (batch, 3)."""
        reach = np.abs(points - self.nominal_point).max(axis=0)
        scaled = (points - self.nominal_point) / np.where(reach > 0, reach, 1)
        leaders = spread_out(scaled, min(len(points), max(8, min(LEADERS, len(points) // 64))))
        lead = self.led(points[leaders])
        if len(leaders) == len(points):
            order = np.argsort(leaders)
            return lead.taken(order), leaders, order[:, None]
        near = nearest(scaled, scaled[leaders], 3)
        rules = 1 if self.explicit else 2
        *slopes, jacobian = self.gradients(lead, points[leaders])
        first = near[:, 0]
        step = points - points[leaders[first]]
        guess = [here[:rules, first] + (slope[:rules, first] * step).sum(axis=-1) for here, slope in zip((lead.control, lead.frequency), slopes, strict=True)]
        start = [one[:rules, first] for one in jacobian] if self.explicit else None
        if (lead.reason == "").all():
            fit = fitted(points[leaders], np.stack([lead.control[0], lead.frequency[0]]), np.stack([one[0] for one in slopes]), points)
            guess = guess if fit is None else [np.repeat(one[None], rules, axis=0) for one in fit]
            fit = fitted(points[leaders], np.stack([one[0] for one in jacobian]), np.zeros((2, 0, 0)), points) if start else None
            start = start if fit is None else [fit[:1], fit[1:]]
        chunk = ROOTS_CHUNK if self.explicit else CHUNK
        pieces = [slice(k, k + chunk) for k in range(0, len(points), chunk)]
        roots = joined_roots([self.corrected(guess[0][:, some], guess[1][:, some], points[some], (start[0][:, some], start[1][:, some]) if start else None) for some in pieces])
        away = np.abs(roots.control - guess[0]).max(axis=0) / (np.abs(guess[0][0]) + 1e-2 * self.width)
        if self.hopf:
            away = np.maximum(away, np.abs(roots.frequency / guess[1] - 1).max(axis=0))
        doubtful = np.flatnonzero((roots.reason != "") | ~(away < 0.03))
        for k in range(0, doubtful.size, CHUNK):
            some = doubtful[k:k + CHUNK]
            again = self.led(points[some])
            for whole, part in zip((roots.control, roots.frequency, roots.control_step, roots.frequency_step), (again.control, again.frequency, again.control_step, again.frequency_step), strict=True):
                whole[:, some] = part[:rules]
            roots.reason[some] = again.reason
        return roots, leaders, near

    # Is it the first instability?

    def determinant(self, control: Array, frequency: Array, points: Array) -> Array:
        """Return the phase of the critical determinant, by the first rule."""
        if self.explicit:
            return self.explicit.determinant(control, frequency, jolted(points, 1))
        a = self.algebra(control, frequency, points)
        operator = self.module.names["critical"](a)
        matrix = a.flow(operator)[1] if self.spatial else a.table(operator.matrix)
        return np.linalg.slogdet(matrix[0])[0]  # type: ignore[no-any-return]

    def phases(self, shares: Array, control: Array, frequency: Array, points: Array) -> Array:
        """Return the phase of D(i omega)/(omega_c^2 - omega^2) at omega = shares omega_c."""
        parts = []
        for k in range(0, shares.size, CHUNK):
            c, w, x = control[k:k + CHUNK], shares[k:k + CHUNK] * frequency[k:k + CHUNK], points[k:k + CHUNK]
            parts.append(self.determinant(np.tile(c, (2, 1)), np.tile(w, (2, 1)), x))
        return np.concatenate(parts) * np.sign(1 - shares**2)

    def winding(self, control: float, frequency: float, point: Array, count: int = 128) -> float:
        """Return the angle through which the phase turns, or NaN where it is not resolved."""
        shares = np.concatenate([np.linspace(0.003, 2.003, count, endpoint=False), 2.003 * 16 ** np.linspace(0, 1, count)])
        every = np.ones(shares.size)
        phase = self.phases(shares, control * every, frequency * every, np.tile(point, (shares.size, 1)))
        turns = np.angle(phase[1:] * np.conj(phase[:-1]))
        if np.abs(turns).max() > 2.2 and count < 4096:
            return self.winding(control, frequency, point, count * 4)
        return float(turns.sum()) if np.abs(turns).max() < 2.8 else float("nan")

    def others_crossed(self, roots: Roots, points: Array) -> Array:
        r"""Tell for each entry how many other modes have crossed the axis between the nominal values and there (NaN: not known).

        Hopf: the change of the winding of :math:`D(i\omega)/(\omega_c^2 - \omega^2)` over :math:`0 < \omega < 32\,\omega_c`, less the change of the phase at its
        ends. Steady: sign changes of D(0) at controls below the threshold, against those at the nominal values.
        """
        start_control, start_frequency, start_point = self.start.control[0, 0], self.start.frequency[0, 0], self.nominal_point[0]
        if not self.hopf:
            return np.array([self.sign_changes(c, x) for c, x in zip(roots.control[0], points, strict=True)]) - self.sign_changes(start_control, start_point)
        steps = np.linspace(0, 1, 33)
        result = []
        before = self.winding(start_control, start_frequency, start_point)
        for control, frequency, point in zip(roots.control[0], roots.frequency[0], points, strict=True):
            change = self.winding(control, frequency, point) - before
            path = (start_control + steps * (control - start_control), start_frequency + steps * (frequency - start_frequency), start_point + steps[:, None] * (point - start_point))
            for share, sign in ((0.003, 1), (2.003 * 16, -1)):
                phase = self.phases(np.full(steps.size, share), *path)
                change += sign * np.angle(phase[1:] * np.conj(phase[:-1])).sum()
            result.append(change / (2 * np.pi))
        return np.round(result)

    def sign_changes(self, control: float, point: Array, count: int = 128) -> int:
        """Return how often D(0) changes sign at controls below the threshold."""
        controls = np.linspace(self.range[0], control - 1e-4 * self.width, count)
        phase = self.determinant(np.tile(controls, (2, 1)), np.zeros((2, count)), np.tile(point, (count, 1)))
        turn = np.real(phase * np.conj(phase[0]))
        return int((np.diff(np.sign(turn)) != 0).sum())


def jolted(points: Array, rules: int) -> list[Array]:
    """Return each parameter by the rules, shape (rules, batch)."""
    return [points[:, k] * JOLT[:rules, :, 0] for k in range(points.shape[1])]


def spread_out(points: Array, count: int) -> Array:
    """Return the indices of entries that cover the batch, each the farthest from those before."""
    if len(points) <= count:
        return np.arange(len(points))
    some = np.unique(np.concatenate([np.arange(0, len(points), max(1, len(points) // 2048)), points.argmin(axis=0), points.argmax(axis=0)]))
    chosen = [int(np.argmax((points[some] ** 2).sum(axis=1)))]
    distance = np.full(some.size, np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, ((points[some] - points[some[chosen[-1]]]) ** 2).sum(axis=1))
        if distance.max() == 0:
            break
        chosen.append(int(distance.argmax()))
    return some[chosen]  # type: ignore[no-any-return]


def nearest(points: Array, centres: Array, count: int) -> Array:
    """Return for each point the nearest centres, the nearest first."""
    parts = []
    for k in range(0, len(points), 4096):
        distance = (centres**2).sum(axis=1) - 2 * points[k:k + 4096] @ centres.T  # less |point|^2
        first = np.argpartition(distance, min(count, len(centres)) - 1, axis=1)[:, :count]
        parts.append(np.take_along_axis(first, np.argsort(np.take_along_axis(distance, first, axis=1), axis=1), axis=1))
    return np.concatenate(parts)


def fitted(places: Array, values: Array, gradients: Array, points: Array) -> Array | None:
    """Return quantities at `points` by the polynomial in the parameters that fits values (quantities, leaders) and gradients, if any; None where it does not fit."""
    low, high = places.min(axis=0), places.max(axis=0)
    moving = np.flatnonzero(high > low)
    middle, half = (low + high)[moving] / 2, (high - low)[moving] / 2
    known = len(places) * (1 + moving.size) // 3 if gradients.size else len(places) // 2
    degree = max(k for k in range(9) if math.comb(k + moving.size, k) <= max(1, known))
    powers = [one for one in itertools.product(range(degree + 1), repeat=moving.size) if sum(one) <= degree] if moving.size < 5 else []
    if len(powers) < 3:
        return None
    x = (places[:, moving] - middle) / half

    def monomials(at: Array, less: int | None = None) -> Array:
        table = at[..., None] ** np.arange(degree + 1)
        one = np.ones((len(powers), len(at)))
        for k in range(moving.size):
            exponents = np.array([power[k] for power in powers])
            one *= (exponents[:, None] * table[:, k, np.maximum(exponents - 1, 0)].T) if k == less else table[:, k, exponents].T
        return one.T

    sloping = list(enumerate(moving)) if gradients.size else []
    system = np.concatenate([monomials(x), *(monomials(x, k) for k, _ in sloping)])
    right = np.concatenate([values.T, *((gradients[:, :, j] * half[k]).T for k, j in sloping)])
    found = np.linalg.lstsq(system, right, rcond=1e-13)[0]
    left_over = np.abs(system @ found - right)[:len(places)].max(axis=0)
    if not (left_over <= 1e-3 * np.abs(values).max(axis=1)).all():
        return None
    return np.concatenate([monomials((points[k:k + 4096, moving] - middle) / half) @ found for k in range(0, len(points), 4096)]).T


def joined_roots(parts: list[Roots]) -> Roots:
    """Return one batch."""
    return Roots(control=np.concatenate([one.control for one in parts], axis=1), frequency=np.concatenate([one.frequency for one in parts], axis=1),
                 control_step=np.concatenate([one.control_step for one in parts], axis=1), frequency_step=np.concatenate([one.frequency_step for one in parts], axis=1),
                 reason=np.concatenate([one.reason for one in parts]))


@lru_cache(maxsize=16)
def evaluator_of(text: str) -> Evaluator:
    """Return the evaluator of an emitted text, made once."""
    return Evaluator(text)


def evaluate_batch(emitted: str | Path, parameters: Mapping[str, Any] | None = None) -> BatchResult:
    """Return threshold and coefficients in double precision for arrays of parameter values.

    Parameters
    ----------
    emitted
        The text that `Derivation.emit` returns, or the path of an emitted module.
    parameters
        Arrays by the name of the symbol in the problem; they are broadcast against each other. What is left out has its nominal value.

    Returns
    -------
    BatchResult
        Arrays in the shape of the parameters. Each value comes with an estimate of its error: the difference of two rules, eight times, and not
        less than the largest relative difference in its entry. NaN, with the reason, where there is none.

    Raises
    ------
    EvaluationError
        A name that is not a parameter of the emitted text, or one that the text holds at its nominal value only; values that are not real numbers;
        a problem that double precision does not resolve.

    Notes
    -----
    Every entry is on the branch of the nominal threshold, continued in the parameters. At some entries that cover the batch (at all where these differ) it is checked
    that no other mode of the critical weight has crossed the imaginary axis (Hopf, frequencies up to 32 times the critical one), or that no steady instability
    comes before (steady). Instabilities of other azimuthal weights, and oscillating ones before a steady one, are not looked for: `derive` at those values does.
    """
    text = str(emitted)
    if "\n" not in text and Path(text).is_file():
        text = Path(text).read_text(encoding="utf-8")
    evaluator = evaluator_of(text)
    points, shape = points_of(evaluator, parameters or {})
    with np.errstate(all="ignore"):
        return computed(evaluator, points, shape)


def points_of(evaluator: Evaluator, parameters: Mapping[str, Any]) -> tuple[Array, tuple[int, ...]]:
    """Return the parameter values, shape (batch, parameters), and the shape of the batch."""
    if not parameters:
        return evaluator.nominal_point.copy(), ()
    names = evaluator.module.names
    arrays = []
    for name, values in parameters.items():
        if name in names.get("PARAMETERS_ZERO", ()):
            raise EvaluationError(f"parameters: {name} is 0 in the problem and left out of the emitted text; derive it at a value that is not 0")
        if name not in evaluator.names:
            raise EvaluationError(f"parameters: found {name!r}; expected {', '.join(evaluator.names) or 'none: the emitted text has no parameters'}")
        if name in names.get("PARAMETERS_FIXED", ()):
            raise EvaluationError(f"parameters: the emitted text holds at the nominal value of {name} only (terms vanish there); derive the problem at another value")
        array = np.asarray(values)
        if array.dtype.kind not in "iuf":
            raise EvaluationError(f"parameters: found {array.dtype} values for {name}; expected real numbers")
        arrays.append(array.astype(float))
    shape = np.broadcast_shapes(*(array.shape for array in arrays)) if arrays else ()
    points = np.tile(evaluator.nominal_point, (int(np.prod(shape)), 1))
    for name, array in zip(parameters, arrays, strict=True):
        points[:, list(evaluator.names).index(name)] = np.broadcast_to(array, shape).ravel()
    return points, shape


def computed(evaluator: Evaluator, points: Array, shape: tuple[int, ...]) -> BatchResult:
    """Return the result of a batch."""
    finite = np.asarray(np.isfinite(points).all(axis=1))
    sound = points if finite.all() else np.where(finite[:, None], points, evaluator.nominal_point)
    roots, leaders, near = evaluator.follow(sound)
    reason = roots.reason.copy()

    def refuse(where: Array, why: str) -> None:
        if np.any(where):
            reason[where & (reason == "")] = why

    reason[~finite] = "parameters: found a value that is not finite"

    low, high = evaluator.range
    control = roots.control[0]
    refuse(~((control >= low - 1e-9 * evaluator.width) & (control <= high + 1e-9 * evaluator.width)), "threshold: it leaves control_range")
    if evaluator.hopf:
        refuse(~(roots.frequency[0] / evaluator.start.frequency[0, 0] > 1e-6), "threshold: the frequency reaches zero: the kind changes")
    if (sound != evaluator.nominal_point).any():
        crossed = first_instability(evaluator, roots, sound, leaders, near, reason)
        refuse(crossed != 0, "threshold: it is not known to be the first instability: another mode has crossed the axis before")
    good = np.flatnonzero(reason == "")
    parameters = dict(zip(evaluator.names, points.T, strict=True))
    if not good.size:
        return assembled(evaluator, roots, None, good, reason, parameters, shape)
    if good.size < len(points):
        roots, sound = roots.taken(good), sound[good]
    estimate = evaluated(evaluator, roots, sound)
    poor = ~(estimate.spread <= 1e-5).all(axis=0)
    for where, why in (*estimate.troubles, (poor, "double precision does not resolve the problem there; use evaluate(...), which raises precision and resolution")):
        if where.any():
            spots = good[where]
            reason[spots[reason[spots] == ""]] = why
    return assembled(evaluator, roots, estimate, good, reason, parameters, shape)


def first_instability(evaluator: Evaluator, roots: Roots, points: Array, leaders: Array, near: Array, reason: Array) -> Array:
    """Return for each entry what `others_crossed` says there, or at the leaders about it where these agree."""
    result = np.zeros(len(points))
    known = leaders[reason[leaders] == ""]
    some = known[:6]
    verdict = evaluator.others_crossed(roots.taken(some), points[some])
    if not np.any(verdict != 0) and known.size == leaders.size:
        return result
    lead = np.full(leaders.size, np.nan)
    chosen = np.flatnonzero(reason[leaders] == "")
    lead[chosen] = evaluator.others_crossed(roots.taken(known), points[known])
    about = lead[near]
    mixed = np.flatnonzero(~(about == about[:, :1]).all(axis=1) & (reason == ""))
    result = about[:, 0]
    result[mixed] = evaluator.others_crossed(roots.taken(mixed), points[mixed])
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Coefficients by identifier, relative differences of the two rules in control, frequency and coefficients, and the entries that have none."""

    values: dict[str, Array]
    spread: Array
    """shape (3, batch)"""
    troubles: list[tuple[Array, str]]


def with_meaning(values: dict[str, Array], names: Mapping[str, Any]) -> dict[str, Array]:
    """Return the values of both rules with 0 for a cubic coefficient beside a quadratic one: the response that it needs does not exist."""
    if names["QUADRATIC"] is None:
        return values
    quadratic = values["coefficient_A2"]
    size = np.abs(quadratic).max(axis=0)
    present = (size > 1e-10 * (1 + size)) & (np.abs(quadratic[0] - quadratic[1]) < 1e-4 * size)
    cubic = next(identifier for _, monomial, identifier in names["COEFFICIENTS"] if monomial == "A**3")
    return {**values, cubic: np.where(present, 0, values[cubic])}


def spread_of(evaluator: Evaluator, roots: Roots, values: dict[str, Array]) -> Array:
    """Return the relative differences of the two rules, the largest of all coefficients."""
    result = np.zeros((3, roots.control.shape[1]))
    result[0] = np.abs(roots.control[0] - roots.control[1]) / (np.abs(roots.control[0]) + 1e-3 * evaluator.width)
    if evaluator.hopf:
        result[1] = np.abs(roots.frequency[0] - roots.frequency[1]) / np.abs(roots.frequency[0])
    every = np.stack(list(with_meaning(values, evaluator.module.names).values()))
    size = np.abs(every).max(axis=1)
    result[2] = np.maximum(result[0], (np.abs(every[:, 0] - every[:, 1]) / (size + 1e-3 * size.max(axis=0) + 1e-300)).max(axis=0))
    return result


def evaluated(evaluator: Evaluator, roots: Roots, points: Array) -> Estimate:
    """Return the coefficients at roots; by one rule, the differences at some entries give those of the others in proportion to how ill-conditioned these are."""
    chunk = VALUES_CHUNK if evaluator.explicit else CHUNK
    pieces = [slice(k, k + chunk) for k in range(0, len(points), chunk)]
    parts = [evaluator.values(roots.taken(some), points[some]) for some in pieces]
    if len(parts) == 1:
        values, ill, troubles = parts[0]
    else:
        values = {name: np.concatenate([part[0][name] for part in parts], axis=1) for name in parts[0][0]}
        ill = np.concatenate([part[1] for part in parts])
        troubles = [(np.concatenate([part[2][k][0] for part in parts]), parts[0][2][k][1]) for k in range(len(parts[0][2]))]
    if len(roots.control) == 2:
        spread = spread_of(evaluator, roots, values)
        mean = np.sqrt((spread[2] ** 2).mean())
        spread[2] = np.maximum(spread[2], mean if np.isfinite(mean) else 0)
        return Estimate(values=values, spread=spread, troubles=troubles)
    if evaluator.hopf and evaluator.growth in values:
        growth = values[evaluator.growth][0]
        ill = ill * np.abs(growth / growth.real)
    some = np.unique(np.concatenate([np.arange(0, len(points), max(1, len(points) // max(64, len(points) // 32))), np.argsort(ill)[-16:]]))
    pair = evaluator.corrected(np.repeat(roots.control[:, some], 2, axis=0), np.repeat(roots.frequency[:, some], 2, axis=0), points[some])
    seen = spread_of(evaluator, pair, evaluated(evaluator, pair, points[some]).values)
    share = (seen / ill[some])[:, np.isfinite(seen).all(axis=0) & (pair.reason == "")]
    spread = ill * share.max(axis=1, initial=0)[:, None]
    spread[:, some] = np.maximum(spread[:, some], np.where(pair.reason == "", seen, np.inf))
    return Estimate(values=values, spread=spread, troubles=troubles)


def assembled(evaluator: Evaluator, roots: Roots, estimate: Estimate | None, good: Array, reason: Array, parameters: dict[str, Array], shape: tuple[int, ...]) -> BatchResult:
    """Return the arrays in the shape of the parameters, NaN where there is a reason; roots and estimate are those of the entries `good`."""
    names = evaluator.module.names
    size = reason.size
    refused = reason != ""
    any_refused = bool(refused.any())

    def whole(one: Array, kind: type) -> Array:
        if good.size == size and not any_refused:
            return np.array(one, dtype=kind).reshape(shape)
        result: Array = np.full(size, np.nan, dtype=kind)
        if good.size:
            result[good] = one
        result[refused] = np.nan
        return result.reshape(shape)

    values: dict[str, Array] = {}
    errors: dict[str, Array] = {}
    spread = np.zeros((3, 0))
    if estimate is not None:
        values, spread = estimate.values, estimate.spread
        sizes = np.abs(np.stack(list(values.values()))).max(axis=1)
        bounds = SAFETY * (spread[2] + 4 * EPSILON) * (sizes + 1e-3 * sizes.max(axis=0))
        errors = dict(zip(values, bounds, strict=True))
    else:
        roots = roots.taken(good)

    pairs = {identifier: (name, monomial) for name, monomial, identifier in evaluator.listed}
    results: dict[str, tuple[Array, Array]] = {name: (values[name][0], errors[name]) for name in pairs if name in values} if good.size else {name: (np.zeros(0), np.zeros(0)) for name in pairs}
    for name, monomial, one, error in weak_effects(evaluator, values, errors):
        pairs[monomial], results[monomial] = (name, monomial), (one, error)
    if names["QUADRATIC"] is not None and good.size:
        quadratic, error = results["coefficient_A2"]
        present = np.abs(quadratic) > np.maximum(1e-10 * (1 + np.abs(quadratic)), 4 * error)
        cubic = next(identifier for _, monomial, identifier in names["COEFFICIENTS"] if monomial == "A**3")
        results["coefficient_A2"] = (np.where(present, quadratic, 0), error)
        results[cubic] = (np.where(present, np.nan, results[cubic][0]), np.where(present, np.nan, results[cubic][1]))  # the equation ends at A**2
    kind = complex if evaluator.hopf else float
    coefficients = {pairs[key][0]: whole(one if evaluator.hopf else np.real(one), kind) for key, (one, _) in results.items()}
    margin = SAFETY * 4 * EPSILON

    def error_of(one: Array, apart: Array, steps: Array) -> Array:
        return SAFETY * apart * np.abs(one) + 0.01 * steps.max(axis=0) + margin * np.abs(one)

    control_error = error_of(roots.control[0], spread[0], roots.control_step) + (margin + SAFETY * spread[0]) * 1e-3 * evaluator.width
    frequency_error = error_of(roots.frequency[0], spread[1], roots.frequency_step)
    return BatchResult(
        problem=names["NAME"], kind=names["KIND"], multiplicity=names["MULTIPLICITY"], parameters={name: one.reshape(shape) for name, one in parameters.items()},
        control=whole(roots.control[0], float), control_error=whole(control_error, float),
        frequency=whole(roots.frequency[0], float) if evaluator.hopf else None, frequency_error=whole(frequency_error, float) if evaluator.hopf else None,
        monomials={name: monomial for name, monomial in pairs.values()}, coefficients=coefficients,
        errors={pairs[key][0]: whole(error, float) for key, (_, error) in results.items()}, reason=reason.reshape(shape),
    )


def weak_effects(evaluator: Evaluator, values: dict[str, Array], errors: dict[str, Array]) -> list[tuple[str, str, Array, Array]]:
    """Return the weak effects on a vector amplitude: name, monomial, values, errors in the directions e1, e2 across the axis."""
    names = evaluator.module.names
    if not names["WEAK"]:
        return []
    known = {(row, column): name for name, row, column in names["WEAK"]}
    nothing = np.zeros(next(iter(values.values())).shape[1]) if values else np.zeros(0)
    entries = across({key: values[name][0] for key, name in known.items() if values}, nothing, 1j)
    error = sum((errors[name] for name in known.values() if name in errors), nothing)
    titles = names["WEAK_NAMES"]
    if all((np.abs(one) <= error).all() for one in (entries["12"], entries["21"], entries["11"] - entries["22"])):
        return [(titles.get("epsilon*A", "epsilon*A"), "epsilon*A", entries["11"], error)]
    result = []
    for key, one in entries.items():
        monomial = f"epsilon*dot(A,e{key[1]})*e{key[0]}"
        if (np.abs(one) > error).any():
            result.append((titles.get(monomial, monomial), monomial, one, error))
    return result


__all__ = ["BatchResult", "Evaluator", "evaluate_batch", "evaluator_of"]
