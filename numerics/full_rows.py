r"""The full nonlinear problem on Chebyshev polynomials in space and harmonics in time, from the emitted rows.

An unknown whose highest space derivative in the rows is `d` is held as that derivative, a Chebyshev series, and `d` constants at the left
end; lower derivatives are its integrals. No column is a derivative of a polynomial, so more nodes lose no digits. Rows are collocated at more
points than there are coefficients and solved by least squares: redundant rows need no special care. Rows that are linear with constant
coefficients (:math:`r' = t`, a clamped end) are solved once, by restricting the coefficients to their null space.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from scipy.fft import dct
from scipy.linalg import qr

from numerics.precision import EvaluationError

Array = np.ndarray
SITES = ("interior", "left", "right")
MOST_SAMPLES, RESOLVABLE = 4096, 320


class Rows:
    """The emitted text of a full problem, run."""

    def __init__(self, text: str) -> None:
        if "Emitted by `fredholm full`" not in text.split("\n", 1)[0]:
            raise EvaluationError("found a text that `fredholm full` did not emit; expected the rows of a full problem")
        names: dict[str, Any] = {"__name__": "emitted_rows"}
        exec(compile(text, "<emitted rows>", "exec"), names)  # noqa: S102  (the emitted module is our own text)
        self.names = names
        self.jets: tuple[tuple[int, int, int], ...] = names["JETS"]
        self.count = len(names["UNKNOWNS"])
        self.component = tuple(unknown[2] for unknown in names["UNKNOWNS"])
        self.field = tuple(unknown[1] for unknown in names["UNKNOWNS"])
        self.weight = tuple(unknown[3] for unknown in names["UNKNOWNS"])
        self.spatial: bool = names["SPATIAL"]
        self.rotation: bool = names["ROTATION"]
        self.normalised: tuple[int, ...] = names["NORMALISED"]
        self.degree = tuple(max((ds for unknown, ds, _ in self.jets if unknown == k), default=0) for k in range(self.count))
        self.order = max((dt for _, _, dt in self.jets), default=0)

    @cached_property
    def samples(self) -> int:
        """How many points in space resolve the coefficients of the rows and the base state.

        Raises
        ------
        EvaluationError
            They vary too fast.
        """
        if not self.spatial:
            return 1
        left, right = self.names["INTERVAL"]
        s = left + (1 - np.cos((np.arange(MOST_SAMPLES) + 0.5) * np.pi / MOST_SAMPLES)) * (right - left) / 2
        lowest, jets = self.names["LOWEST"], np.tile(0.3 + 0.1 * np.arange(len(self.jets)), (len(s), 1))[:, :, None]
        columns = []
        for control in (lowest, lowest + 0.7 + 0.1 * abs(lowest)):  # a coefficient may vanish at the lower end
            values, _, slopes = self.evaluate("interior", s, control, jets)
            columns += [self.base(s, control)[0], values[:, :, 0], slopes[:, :, 0].reshape(len(s), -1)]
        table = np.concatenate(columns, axis=1)
        table = table[:, np.isfinite(table).all(axis=0) & (np.ptp(table, axis=0) > 0)]
        if not table.shape[1]:
            return 1
        spectrum = np.abs(dct(table, axis=0))
        needed = int(np.flatnonzero((spectrum > 1e-11 * spectrum.max(axis=0)).any(axis=1))[-1]) + 1
        if needed > RESOLVABLE:
            raise EvaluationError(f"full problem: found coefficients of the equations that {RESOLVABLE} polynomials on the whole interval do not resolve; expected smoother ones")
        return needed

    def __getattr__(self, name: str) -> Any:
        try:
            return self.names[name]
        except KeyError:
            raise AttributeError(name) from None

    def base(self, s: Array, control: float) -> tuple[Array, Array]:
        """Return every jet of the base state at the points, shape (points, jets), and its derivative with respect to the control."""
        table = self.names["base"](s, control, ())
        return tuple(np.stack([np.broadcast_to(np.asarray(row[part], dtype=float), s.shape) for row in table], axis=-1) for part in (0, 1))  # type: ignore[return-value]

    def evaluate(self, site: str, s: Array, control: float, jets: Array) -> tuple[Array, Array, Array]:
        """Return values, derivatives with respect to control and jets: shapes (points, rows, times), the same, (points, rows, times, jets)."""
        points, count, times = jets.shape
        uses = self.names["USES"][site]
        with np.errstate(all="ignore"):
            table = self.names[site](s[:, None], control, np.moveaxis(jets, 1, 0))
        values, in_control = np.empty((points, len(uses), times)), np.empty((points, len(uses), times))
        slopes = np.zeros((points, len(uses), times, count))
        for r, (row, which) in enumerate(zip(table, uses, strict=True)):
            values[:, r], in_control[:, r] = row[0], row[1]
            for slope, k in zip(row[2:], which, strict=True):
                slopes[:, r, :, k] = slope
        return values, in_control, slopes


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How the unknowns depend on time: `steady`, `rotating` about the axis, or `periodic`; half a period is a half-turn when `symmetric`."""

    kind: str
    symmetric: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Unknowns that have the same harmonics: `parity` 0 even, 1 odd, None all."""

    members: tuple[int, ...]
    parity: int | None = None

    def waves(self, harmonics: int) -> list[int]:
        """Return the columns, among 1, cos t, sin t, cos 2t, ..., of this group."""
        return [column for column in range(2 * harmonics + 1) if self.parity is None or ((column + 1) // 2) % 2 == self.parity]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state of the full problem: coefficients of the deviation from the base state, one array (space, harmonics) an unknown."""

    coefficients: tuple[Array, ...]
    nodes: int
    harmonics: int
    control: float
    omega: float


def space_basis(degree: int, nodes: int, length: float, x: Array, order: int) -> Array:
    """Return the derivative of that order of the basis of an unknown held by its derivative `degree`, at x in (-1, 1)."""
    columns = []
    for power in range(degree):
        rest = power - order
        columns.append((x + 1) ** rest / float(np.prod(np.arange(1, rest + 1))) if rest >= 0 else np.zeros_like(x))
    series: Array = np.eye(nodes)
    if degree - order:
        series = chebyshev.chebint(series, m=degree - order, lbnd=-1, axis=0)
    return np.hstack([np.array(columns).reshape(degree, len(x)).T, chebyshev.chebval(x, series).reshape(nodes, len(x)).T]) * (2 / length) ** order


def time_basis(harmonics: int, times: Array, order: int) -> Array:
    """Return the derivative of that order of 1, cos t, sin t, ... at the times."""
    columns = [np.full(len(times), 1.0 if order == 0 else 0.0)]
    for h in range(1, harmonics + 1):
        columns += [h**order * np.cos(h * times + order * np.pi / 2), h**order * np.sin(h * times + order * np.pi / 2)]
    return np.array(columns).T


class Discretisation:
    """Residual and Jacobian of all rows over the coefficients of some groups of unknowns."""

    def __init__(self, rows: Rows, motion: Motion, groups: Sequence[Group], nodes: int, harmonics: int = 0) -> None:
        self.rows, self.motion, self.groups = rows, motion, tuple(groups)
        self.nodes, self.harmonics = (nodes if rows.spatial else 1), (harmonics if motion.kind == "periodic" else 0)
        self.left, self.right = rows.INTERVAL
        self.length = self.right - self.left if rows.spatial else 2.0
        count = max(self.nodes + max(rows.degree) + 1, rows.samples) if rows.spatial else 1
        inner = -np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count)) if rows.spatial else np.zeros(1)
        self.x = {"interior": inner, "left": np.array([-1.0]), "right": np.array([1.0])}
        self.sites = tuple(site for site in SITES if site in rows.USES and rows.USES[site])
        self.keys = sorted({(k, ds) for k, ds, _ in rows.jets} | {(k, 0) for k in range(rows.count)})
        if motion.kind == "rotating":
            self.keys = sorted({*self.keys, *((self.partner(k), ds) for k, ds in self.keys)})
        if motion.kind != "periodic":
            self.times = np.zeros(1)
        else:
            instants = self.harmonics + 2 if motion.symmetric else 2 * self.harmonics + 3
            self.times = (np.pi if motion.symmetric else 2 * np.pi) * np.arange(instants) / instants
        self.null = tuple(self.null_space(group) for group in self.groups)
        self.shapes = tuple((null.shape[1], len(group.waves(self.harmonics))) for null, group in zip(self.null, self.groups, strict=True))
        self.sizes = tuple(a * b for a, b in self.shapes)
        self.size = sum(self.sizes)
        self.last_maps: dict[tuple[int, str, str], tuple[float, dict[int, Array]]] = {}
        self.last_base: dict[str, tuple[float, Array, Array]] = {}
        self.clocks = tuple(tuple(time_basis(self.harmonics, self.times, order)[:, group.waves(self.harmonics)] for order in range(3)) for group in self.groups)

    def points(self, site: str) -> Array:
        """Return the points of a site in s."""
        return self.left + (self.x[site] + 1) * self.length / 2

    def partner(self, k: int) -> int:
        """Return the other component across the axis."""
        return k + self.rows.weight[k]

    @cached_property
    def basis(self) -> Mapping[tuple[str, int, int], Array]:
        """Every derivative that is used, at the points of every site, over the coefficients of one unknown."""
        made: dict[tuple[str, int, int], Array] = {}
        table: dict[tuple[str, int, int, int], Array] = {}
        for site in self.sites:
            for k, ds in self.keys:
                degree = self.rows.degree[k]
                key = (site, degree, ds, self.nodes)
                if key not in table:
                    table[key] = space_basis(degree, self.nodes, self.length, self.x[site], ds)
                made[site, k, ds] = table[key]
        return made

    def offsets(self, group: Group) -> dict[int, slice]:
        """Return where the coefficients of each member stand before the restriction to the null space."""
        table, start = {}, 0
        for k in group.members:
            width = self.nodes + self.rows.degree[k]
            table[k] = slice(start, start + width)
            start += width
        return table

    def null_space(self, group: Group) -> Array:
        """Return an orthonormal basis of the coefficients that meet the constant linear rows."""
        offsets = self.offsets(group)
        total = max((where.stop for where in offsets.values()), default=0)
        blocks = []
        for site in self.sites:
            which = self.rows.CONSTANT[site]
            if not which:
                continue
            _, _, slopes = self.rows.evaluate(site, self.points(site), self.rows.LOWEST, np.zeros((len(self.x[site]), len(self.rows.jets), 1)))
            for r in which:
                block = np.zeros((len(self.x[site]), total))
                for j, (k, ds, _) in enumerate(self.rows.jets):
                    if k in offsets and np.any(slopes[:, r, 0, j]):
                        block[:, offsets[k]] += slopes[:, r, 0, j, None] * self.basis[site, k, ds]
                if np.any(block):
                    blocks.append(block / np.abs(block).max())
        if not blocks:
            return np.eye(total)
        q, triangle, _ = qr(np.vstack(blocks).T, pivoting=True)
        sizes = np.abs(np.diag(triangle))
        return q[:, int(np.sum(sizes > 1e-10 * sizes[0])):]

    @cached_property
    def reduced(self) -> Mapping[tuple[int, str, int, int], Array]:
        """Every derivative over the restricted coefficients of each group."""
        table = {}
        for g, group in enumerate(self.groups):
            offsets = self.offsets(group)
            for (site, k, ds), matrix in self.basis.items():
                if k in offsets:
                    table[g, site, k, ds] = matrix @ self.null[g][offsets[k]]
        return table

    def terms(self, jet: tuple[int, int, int], omega: float, part: str) -> list[tuple[float, int, int]]:
        r"""Return a jet as a sum of (factor, unknown, order of the time basis).

        `part` is `value`; `omega` for its derivative with respect to the frequency; `growth` and `growth2` for the coefficients of
        :math:`\lambda` and :math:`\lambda^2` when the disturbance carries :math:`e^{\lambda t}`.
        """
        k, _, dt = jet
        if part == "growth2":
            return [(1.0, k, 0)] if dt == 2 else []
        if part == "growth":
            return [] if dt == 0 else [(float(dt) * factor, unknown, order) for factor, unknown, order in self.terms((k, jet[1], dt - 1), omega, "value")]
        factor = omega**dt if part == "value" else (dt * omega ** (dt - 1) if dt else 0.0)
        if dt == 0 or self.motion.kind == "periodic":
            return [(factor, k, dt)] if factor else []
        weight = self.rows.weight[k]
        if self.motion.kind == "steady" or weight == 0:
            return []
        # d/dt = Omega e_n x: (v1, v2)' = Omega (-v2, v1)
        return [(-weight * factor, self.partner(k), 0)] if dt == 1 else [(-factor, k, 0)]

    def maps(self, g: int, site: str, omega: float, part: str) -> dict[int, Array]:
        """Return {order of the time basis: (points, jets, coefficients)} of one group, kept as long as the frequency stays the same."""
        known = self.last_maps.get((g, site, part))
        if known is not None and known[0] == omega:
            return known[1]
        made: dict[int, Array] = {}
        for j, jet in enumerate(self.rows.jets):
            for factor, k, order in self.terms(jet, omega, part):
                matrix = self.reduced.get((g, site, k, jet[1]))
                if matrix is not None and factor:
                    if order not in made:
                        made[order] = np.zeros((matrix.shape[0], len(self.rows.jets), self.shapes[g][0]))
                    made[order][:, j] += factor * matrix
        self.last_maps[g, site, part] = (omega, made)
        return made

    def base(self, site: str, control: float) -> tuple[Array, Array]:
        """Return the jets of the base state at the points of a site, and their derivative, kept as long as the control stays the same."""
        known = self.last_base.get(site)
        if known is None or known[0] != control:
            known = self.last_base[site] = (control, *self.rows.base(self.points(site), control))
        return known[1:]

    def split(self, y: Array) -> list[Array]:
        """Return the coefficients of each group, shape (space, harmonics)."""
        return [part.reshape(shape) for part, shape in zip(np.split(y, np.cumsum(self.sizes)[:-1]), self.shapes, strict=True)]

    def deviation(self, y: Array, site: str, omega: float, part: str = "value") -> Array:
        """Return the jets of the deviation, shape (points, jets, times)."""
        total = np.zeros((len(self.x[site]), len(self.rows.jets), len(self.times)))
        for g, values in enumerate(self.split(y)):
            for order, matrix in self.maps(g, site, omega, part).items():
                total += matrix @ (values @ self.clocks[g][order].T)
        return total

    def kept(self, site: str) -> list[int]:
        """Return the rows that are not met already."""
        return [r for r in range(len(self.rows.USES[site])) if r not in self.rows.CONSTANT[site]]

    def linearise(self, y: Array, control: float, omega: float) -> Linearisation:
        """Return the residual of all rows and what their derivatives are made of."""
        values, in_control, in_omega, slopes = [], [], [], {}
        for site in self.sites:
            keep = self.kept(site)
            s = self.points(site)
            base, base_slope = self.base(site, control)
            jets = base[:, :, None] + self.deviation(y, site, omega)
            value, partial, slope = self.rows.evaluate(site, s, control, jets)
            value, partial, slope = value[:, keep], partial[:, keep], slope[:, keep]
            values.append(value.ravel())
            in_control.append((partial + np.einsum("prtj,pj->prt", slope, base_slope)).ravel())
            in_omega.append(np.einsum("prtj,pjt->prt", slope, self.deviation(y, site, omega, "omega")).ravel())
            slopes[site] = slope
        return Linearisation(grid=self, omega=omega, residual=np.concatenate(values), in_control=np.concatenate(in_control), in_omega=np.concatenate(in_omega), slopes=slopes)

    def pack(self, state: State) -> Array:
        """Return the restricted coefficients of a state held at this or a coarser resolution."""
        parts = []
        for g, group in enumerate(self.groups):
            waves = group.waves(self.harmonics)
            stacked = np.zeros((self.null[g].shape[0], 2 * self.harmonics + 1))
            for k, where in self.offsets(group).items():
                given = state.coefficients[k]
                a, b = min(given.shape[0], where.stop - where.start), min(given.shape[1], stacked.shape[1])
                stacked[where.start:where.start + a, :b] = given[:a, :b]
            parts.append((self.null[g].T @ stacked[:, waves]).ravel())
        return np.concatenate(parts)

    def unpack(self, y: Array, control: float, omega: float) -> State:
        """Return the state with these coefficients."""
        coefficients = [np.zeros((self.nodes + degree, 2 * self.harmonics + 1)) for degree in self.rows.degree]
        for group, null, values in zip(self.groups, self.null, self.split(y), strict=True):
            full = null @ values
            for k, where in self.offsets(group).items():
                coefficients[k][:, group.waves(self.harmonics)] = full[where]
        return State(coefficients=tuple(coefficients), nodes=self.nodes, harmonics=self.harmonics, control=control, omega=omega)

    def reading(self, unknown: int, wave: int) -> Array:
        """Return the row that reads one harmonic of an unknown at the place of the normalisation (zeros when it is held at zero)."""
        row = np.zeros(self.size)
        x = np.array([2 * (self.rows.PLACE - self.left) / self.length - 1]) if self.rows.spatial else np.zeros(1)
        start = 0
        for g, group in enumerate(self.groups):
            waves = group.waves(self.harmonics)
            if unknown in group.members and wave in waves:
                at = space_basis(self.rows.degree[unknown], self.nodes, self.length, x, 0)[0] @ self.null[g][self.offsets(group)[unknown]]
                block = np.zeros(self.shapes[g])
                block[:, waves.index(wave)] = at
                row[start:start + self.sizes[g]] = block.ravel()
            start += self.sizes[g]
        return row


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearisation:
    """Residual and derivatives of all rows at a state."""

    grid: Discretisation
    omega: float
    residual: Array
    in_control: Array
    in_omega: Array
    slopes: Mapping[str, Array]

    def matrix(self, part: str = "value", grid: Discretisation | None = None) -> Array:
        """Return the derivative of all rows with respect to the coefficients of a discretisation on the same points and times."""
        grid = grid or self.grid
        blocks = []
        for site, slope in self.slopes.items():
            points, rows, times, jets = slope.shape
            columns = []
            for g in range(len(grid.groups)):
                total = np.zeros((points, rows, times, *grid.shapes[g]))
                for order, matrix in grid.maps(g, site, self.omega, part).items():
                    product = (slope.reshape(points, rows * times, jets) @ matrix).reshape(points, rows, times, grid.shapes[g][0])
                    total += product[..., None] * grid.clocks[g][order][:, None, :]
                columns.append(total.reshape(points * rows * times, grid.sizes[g]))
            blocks.append(np.hstack(columns))
        return np.vstack(blocks)

    def scales(self, matrix: Array, others: Array | None = None) -> Array:
        """Return the factor that brings each row to unit size over all points and times; 0 for a row that holds neither the unknowns nor `others` (frequency, control)."""
        size = self.sizes(matrix)
        if others is not None:
            size = np.where(size > 0, size, self.sizes(others))
        return np.where(size > 0, 1 / np.maximum(size, max(1e-6 * size.max(), 1e-300)), 0.0)

    def sizes(self, matrix: Array) -> Array:
        """Return the largest norm of each row over all points and times, at every one of them."""
        sizes, start = [], 0
        norms = np.linalg.norm(matrix, axis=1)
        for slope in self.slopes.values():
            points, rows, times, _ = slope.shape
            block = norms[start:start + points * rows * times].reshape(points, rows, times)
            sizes.append(np.broadcast_to(block.max(axis=(0, 2), initial=0.0)[None, :, None], block.shape).ravel())
            start += points * rows * times
        return np.concatenate(sizes)
