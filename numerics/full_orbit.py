r"""Periodic orbits of the full problem by collocation in time: the cost grows in proportion to the number of time elements.

Radau IIA in each of K elements of a period, or of half of one where half a period is a half-turn :math:`S`. The unknowns split, :math:`y = (u, v)`,
into those whose time derivatives occur and the slaved rest. At every stage the slaved ones are eliminated by an orthogonal factor, each element by
least squares over its stages; what is left is the map of :math:`u` over all elements, :math:`\delta u_K = \Phi\,\delta u_0`, closed by :math:`u_K = S u_0`.
The eigenvalues of :math:`S\Phi` are the Floquet multipliers, at no further cost; for disturbances out of the plane of the motion alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.polynomial import Polynomial, legendre

from numerics.full_newton import LeastSquares, NotConverged
from numerics.full_rows import Array, Discretisation, Group, Motion, Rows, State, time_basis

STAGES = 4
STEPS = 12


def radau(stages: int) -> tuple[Array, Array]:
    """Return the points of Radau IIA in (0, 1], the last of which is 1, and its matrix of weights."""
    series = np.zeros(stages + 1)
    series[-2:] = -1, 1
    c = np.sort((legendre.legroots(series) + 1) / 2)
    c[-1] = 1.0
    lagrange = [Polynomial.fromroots(np.delete(c, j)) for j in range(stages)]
    return c, np.array([[(one.integ() / one(c[j]))(x) for j, one in enumerate(lagrange)] for x in c])


class Space:
    """Coefficients of some groups of unknowns in space, turned so that those with time derivatives come first."""

    def __init__(self, rows: Rows, motion: Motion, groups: Sequence[Group], nodes: int) -> None:
        self.rows, self.symmetric = rows, motion.symmetric
        self.grid = grid = Discretisation(rows, motion, groups, nodes, 2)
        moving: list[Array] = []
        slaved: list[Array] = []
        signs: list[float] = []
        offset, size = 0, sum(null.shape[1] for null in grid.null)
        for g, group in enumerate(groups):
            width = grid.null[g].shape[1]
            with_time = [grid.reduced[g, site, k, ds] for k, ds, dt in rows.jets if dt and k in group.members for site in grid.sites]
            block = np.vstack(with_time) if with_time else np.zeros((1, width))
            _, sizes, turn = np.linalg.svd(block, full_matrices=True)
            rank = int(np.sum(sizes > 1e-10 * max(sizes.max(), 1e-300)))
            for part, target in ((turn[:rank].T, moving), (turn[rank:].T, slaved)):
                column = np.zeros((size, part.shape[1]))
                column[offset:offset + width] = part
                target.append(column)
            signs += [-1.0 if motion.symmetric and group.parity == 1 else 1.0] * rank
            offset += width
        self.turn = np.hstack([*moving, *slaved])
        self.size, self.moving, self.signs = size, len(signs), np.array(signs)

    @cached_property
    def maps(self) -> dict[tuple[str, int], Array]:
        """Return the jets of each order in time at the points of each site: (points, jets, coefficients)."""
        made = {}
        for site in self.grid.sites:
            for order in range(self.rows.order + 1):
                total = np.zeros((len(self.grid.x[site]), len(self.rows.jets), self.size))
                start = 0
                for g in range(len(self.grid.groups)):
                    width = self.grid.null[g].shape[1]
                    for j, (k, ds, dt) in enumerate(self.rows.jets):
                        if dt == order and (g, site, k, ds) in self.grid.reduced:
                            total[:, j, start:start + width] = self.grid.reduced[g, site, k, ds]
                    start += width
                turned = total @ self.turn
                made[site, order] = turned[..., :self.moving] if order else turned
        return made

    def pack(self, state: State, times: Array) -> Array:
        """Return the turned coefficients of a state at some times, shape (times, coefficients)."""
        clock = time_basis(state.harmonics, times, 0)
        parts = []
        for null, group in zip(self.grid.null, self.grid.groups, strict=True):
            stacked = np.zeros((null.shape[0], len(times)))
            for k, where in self.grid.offsets(group).items():
                given = state.coefficients[k]
                rows = min(given.shape[0], where.stop - where.start)
                stacked[where.start:where.start + rows] = given[:rows] @ clock.T
            parts.append(null.T @ stacked)
        return np.concatenate(parts).T @ self.turn

    def unpack(self, Y: Array, control: float, omega: float) -> State:
        """Return the state through equally spaced instants of a period or half a period, the last of which ends it: trigonometric interpolation."""
        nodes = self.grid.nodes
        plain = Y @ self.turn.T
        total = len(Y) * (2 if self.symmetric else 1)
        harmonics = (total - 1) // 2
        coefficients = [np.zeros((nodes + degree, 2 * harmonics + 1)) for degree in self.rows.degree]
        start = 0
        for null, group in zip(self.grid.null, self.grid.groups, strict=True):
            values = null @ plain[:, start:start + null.shape[1]].T
            start += null.shape[1]
            if self.symmetric:
                values = np.hstack([values, -values if group.parity == 1 else values])
            waves = np.fft.rfft(np.roll(values, 1, axis=1), axis=1)[:, :harmonics + 1] / total  # the last instant is time 0 of the next
            table = np.zeros((len(values), 2 * harmonics + 1))
            table[:, 0] = waves[:, 0].real
            table[:, 1::2], table[:, 2::2] = 2 * waves[:, 1:].real, -2 * waves[:, 1:].imag
            for k, where in self.grid.offsets(group).items():
                coefficients[k][:] = table[where]
        return State(coefficients=tuple(coefficients), nodes=nodes, harmonics=harmonics, control=control, omega=omega)


@dataclass(frozen=True, slots=True, kw_only=True)
class Orbit:
    """An orbit at the stages (elements, stages, coefficients), its start (and derivative there, in the angle, for second order in time), frequency and control."""

    space: Space
    stages: Array
    start: Array
    omega: float
    control: float

    @property
    def state(self) -> State:
        """Return the orbit as harmonics."""
        return self.space.unpack(self.stages[:, -1], self.control, self.omega)

    @property
    def elements(self) -> int:
        """Return the number of elements in time."""
        return len(self.stages)

    @property
    def span(self) -> float:
        """Return the angle that the elements cover."""
        return pi if self.space.symmetric else 2 * pi


class Frame:
    """Radau IIA on equal elements: derivatives in the angle from differences of stage values."""

    def __init__(self, orbit: Orbit) -> None:
        self.c, matrix = radau(orbit.stages.shape[1])
        self.rate = np.linalg.inv(matrix) * (orbit.elements / orbit.span)
        moving = orbit.space.moving
        u = orbit.stages[..., :moving]
        before = np.concatenate([orbit.start[None, :moving], u[:-1, -1]])
        self.velocity = np.einsum("ij,ejn->ein", self.rate, u - before[:, None])
        if orbit.space.rows.order > 1:
            earlier = np.concatenate([orbit.start[None, moving:], self.velocity[:-1, -1]])
            self.acceleration = np.einsum("ij,ejn->ein", self.rate, self.velocity - earlier[:, None])
        else:
            self.acceleration = np.zeros_like(self.velocity)


def orbit_from(space: Space, state: State, elements: int) -> Orbit:
    """Return a state as an orbit on other elements: a start for Newton's method."""
    c, _ = radau(STAGES)
    span = pi if space.symmetric else 2 * pi
    times = ((np.arange(elements)[:, None] + c) * span / elements).ravel()
    start = space.pack(state, np.zeros(1))[0, :space.moving]
    if space.rows.order > 1:
        step = 1e-3  # a fourth-order difference is enough for a start
        near = space.pack(state, step * np.array([-2.0, -1, 1, 2]))[:, :space.moving]
        start = np.concatenate([start, np.array([1, -8, 8, -1]) @ near / (12 * step)])
    return Orbit(space=space, stages=space.pack(state, times).reshape(elements, STAGES, space.size), start=start, omega=state.omega, control=state.control)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slopes:
    """Rows at every stage: residual, derivatives with respect to frequency and control (stages, rows), and to the jets, by site."""

    residual: Array
    in_omega: Array
    in_control: Array
    table: dict[str, Array]


def slopes_of(orbit: Orbit, frame: Frame) -> Slopes:
    """Return the rows at every stage."""
    space, grid = orbit.space, orbit.space.grid
    count = orbit.elements * len(frame.c)
    values = [one.reshape(count, -1) for one in (orbit.stages, frame.velocity, frame.acceleration)]
    residual: list[Array] = []
    in_omega: list[Array] = []
    in_control: list[Array] = []
    table: dict[str, Array] = {}
    for site in grid.sites:
        keep, s = grid.kept(site), grid.points(site)
        base, base_slope = grid.rows.base(s, orbit.control)
        jets = np.repeat(base[:, :, None], count, axis=2)
        turning = np.zeros_like(jets)
        for order in range(space.rows.order + 1):
            part = orbit.omega**order * (space.maps[site, order] @ values[order].T)
            jets += part
            turning += order * part / orbit.omega
        value, partial, slope = grid.rows.evaluate(site, s, orbit.control, jets)
        slope = slope[:, keep]
        table[site] = slope
        partial = partial[:, keep] + np.einsum("prtj,pj->prt", slope, base_slope)
        for target, one in ((residual, value[:, keep]), (in_omega, np.einsum("prtj,pjt->prt", slope, turning)), (in_control, partial)):
            target.append(np.moveaxis(one, 2, 0).reshape(count, -1))
    return Slopes(residual=np.hstack(residual), in_omega=np.hstack(in_omega), in_control=np.hstack(in_control), table=table)


class Condensed:
    """The linearisation over a class of disturbances, condensed to the map of the moving coefficients over all elements."""

    def __init__(self, orbit: Orbit, frame: Frame, slopes: Slopes, space: Space) -> None:
        self.space, self.frame, self.shape = space, frame, orbit.stages.shape[:2]
        elements, stages = self.shape
        orders = space.rows.order
        d = self.d = space.moving
        blocks = [orbit.omega**order * self.rows_of(slopes, order) for order in range(orders + 1)]
        scale = self.scales(slopes, np.sqrt(sum(np.sum(block**2, axis=2) for block in blocks)))
        keep = scale > 0
        scale = scale[keep]
        blocks = [block[:, keep] * scale[:, None] for block in blocks]
        right = np.stack([slopes.in_omega, slopes.in_control, slopes.residual], axis=2)[:, keep] * scale[:, None]
        self.largest = float(np.abs(right[..., 2]).max())
        slaved = space.size - d
        if blocks[0].shape[1] < space.size:
            raise NotConverged("found fewer rows than unknowns at an instant")
        if not all(np.all(np.isfinite(block)) for block in blocks):
            raise NotConverged("found values of the rows that are not finite; expected a state in the domain of the equations")
        q, triangle = np.linalg.qr(blocks[0][..., d:], mode="complete")
        self.triangle = triangle[:, :slaved]
        if slaved:
            diagonal = np.abs(np.diagonal(self.triangle, axis1=1, axis2=2))
            if not np.all(diagonal.min(axis=1) > 1e-12 * diagonal.max(axis=1)):
                raise NotConverged("found unknowns without time derivative that the rows at an instant do not determine")
        # Q^T (A, J1, J2, in_omega, in_control, residual)
        turned = np.swapaxes(q, 1, 2) @ np.concatenate([blocks[0][..., :d], *blocks[1:], right], axis=2)
        self.top = turned[:, :slaved]
        self.chain(turned[:, slaved:])

    def rows_of(self, slopes: Slopes, order: int) -> Array:
        """Return the derivative of the rows with respect to the coefficients of that order in time: (stages, rows, coefficients)."""
        parts = []
        for site, slope in slopes.table.items():
            points, rows, count, jets = slope.shape
            matrix = self.space.maps[site, order]
            product = (slope.reshape(points, rows * count, jets) @ matrix).reshape(points, rows, count, matrix.shape[2])
            parts.append(np.moveaxis(product, 2, 0).reshape(count, points * rows, matrix.shape[2]))
        return np.concatenate(parts, axis=1)

    def scales(self, slopes: Slopes, norms: Array) -> Array:
        """Return the factor that brings each row to unit size over all points and instants; 0 for a row that holds none of the unknowns."""
        sizes, start = [], 0
        largest = norms.max(axis=0)
        for slope in slopes.table.values():
            points, rows = slope.shape[:2]
            block = largest[start:start + points * rows].reshape(points, rows)
            sizes.append(np.broadcast_to(block.max(axis=0, initial=0.0), block.shape).ravel())
            start += points * rows
        size = np.concatenate(sizes)
        return np.where(size > 1e-12 * size.max(), 1 / np.maximum(size, max(1e-6 * size.max(), 1e-300)), 0.0)

    def chain(self, rest: Array) -> None:
        """Eliminate the stages of each element; multiply the maps of the elements."""
        elements, stages = self.shape
        d, orders = self.d, self.space.rows.order
        rest = rest.reshape(elements, stages, *rest.shape[1:])
        count, wide = rest.shape[2], orders * d
        rate = self.frame.rate
        second = rate @ rate
        self.local = np.empty((elements, stages, d, wide + 3))  # stages from start, frequency, control and residual
        self.before = np.empty((elements + 1, wide, wide + 3))
        self.before[0] = np.eye(wide, wide + 3)
        identity = np.eye(stages)
        for e in range(elements):
            A, J1 = rest[e, ..., :d], rest[e, ..., d:2 * d]
            matrix = np.einsum("imn,ij->imjn", A, identity) + np.einsum("imn,ij->imjn", J1, rate)
            right = np.zeros((stages, count, wide + 3))
            right[..., :d] = J1 * rate.sum(axis=1)[:, None, None]
            right[..., wide:] = -rest[e, ..., -3:]
            if orders > 1:
                J2 = rest[e, ..., 2 * d:3 * d]
                matrix += np.einsum("imn,ij->imjn", J2, second)
                right[..., :d] += J2 * second.sum(axis=1)[:, None, None]
                right[..., d:wide] = J2 * rate.sum(axis=1)[:, None, None]
            solver = LeastSquares(matrix.reshape(stages * count, stages * d))
            local = solver.solve(right.reshape(stages * count, wide + 3)).reshape(stages, d, wide + 3)
            self.local[e] = local
            end = np.zeros((wide, wide + 3))
            end[:d] = local[-1]
            if orders > 1:
                end[d:] = np.einsum("j,jnc->nc", rate[-1], local)
                end[d:, :d] -= rate[-1].sum() * np.eye(d)
            self.before[e + 1] = end[:, :wide] @ self.before[e]
            self.before[e + 1][:, wide:] += end[:, wide:]

    def multipliers(self) -> Array:
        """Return the Floquet multipliers over all elements, the half-turn undone."""
        wide = self.before.shape[1]
        signs = np.tile(self.space.signs, self.space.rows.order)
        return np.linalg.eigvals(signs[:, None] * self.before[-1][:, :wide])

    def expanded(self, change: Array) -> Array:
        """Return the change of all stages for a change of (start, frequency, control), the residual being removed."""
        elements, stages = self.shape
        d, orders = self.d, self.space.rows.order
        wide = orders * d
        tail = np.append(change[wide:], 1.0)
        starts = self.before[:-1] @ np.concatenate([change[:wide], tail])
        u = self.local[..., :wide] @ starts[:, None, :, None]
        u = u[..., 0] + self.local[..., wide:] @ tail
        rate = self.frame.rate
        parts = [u, np.einsum("ij,ejn->ein", rate, u - starts[:, None, :d])]
        if orders > 1:
            parts.append(np.einsum("ij,ejn->ein", rate, parts[1] - starts[:, None, d:]))
        known = np.concatenate([*parts, np.broadcast_to(tail, (elements, stages, 3))], axis=2).reshape(elements * stages, -1)
        v = -np.linalg.solve(self.triangle, self.top @ known[..., None])[..., 0] if self.triangle.shape[1] else np.zeros((elements * stages, 0))
        return np.concatenate([u, v.reshape(elements, stages, -1)], axis=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """An orbit that meets all rows, with its last linearisation."""

    orbit: Orbit
    frame: Frame
    slopes: Slopes
    condensed: Condensed
    residual: float
    steps: int

    def multipliers(self, space: Space) -> Array:
        """Return the Floquet multipliers of a class of disturbances."""
        condensed = self.condensed if space is self.orbit.space else Condensed(self.orbit, self.frame, self.slopes, space)
        return condensed.multipliers()


def solve_orbit(orbit: Orbit, width: float) -> Found:
    """Return the orbit at the control of a start, by Newton's method; its phase is that of the start.

    Raises
    ------
    NotConverged
        The steps do not become small; the message gives the control and the last step.
    """
    space = orbit.space
    wide = space.rows.order * space.moving
    signs = np.tile(space.signs, space.rows.order)
    reference, direction = orbit.start[:space.moving], Frame(orbit).velocity[-1, -1] * space.signs
    size = before = np.inf
    for count in range(1, STEPS + 1):
        frame = Frame(orbit)
        slopes = slopes_of(orbit, frame)
        condensed = Condensed(orbit, frame, slopes, space)
        if size < 1e-9:  # the linearisation at the solution itself
            return Found(orbit=orbit, frame=frame, slopes=slopes, condensed=condensed, residual=condensed.largest, steps=count)
        end = np.concatenate([orbit.stages[-1, -1, :space.moving], frame.velocity[-1, -1] if space.rows.order > 1 else ()])
        whole = condensed.before[-1]
        matrix = np.zeros((wide + 1, wide + 1))
        matrix[:wide, :wide] = whole[:, :wide] - np.diag(signs)
        matrix[:wide, wide] = whole[:, wide]
        matrix[wide, :space.moving] = direction / np.linalg.norm(direction)
        right = np.append(signs * orbit.start - end - whole[:, wide + 2], matrix[wide, :space.moving] @ (reference - orbit.start[:space.moving]))
        found = np.linalg.solve(matrix, right)
        change = np.append(found, 0.0)
        stages = condensed.expanded(change)
        size = max(float(np.abs(stages).max() / np.abs(orbit.stages).max()), abs(found[-1] / orbit.omega))
        if not np.isfinite(size) or size > 10 or (count > 4 and size > before):
            break
        before = size
        orbit = replace(orbit, stages=orbit.stages + stages, start=orbit.start + found[:wide], omega=orbit.omega + float(found[-1]))
    raise NotConverged(f"at control {orbit.control:.6g}: Newton's method for the orbit did not converge in {count} steps (last relative step {size:.1e})")
