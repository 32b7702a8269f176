r"""Direct simulation of the full problem, a stiff differential-algebraic system, by Radau IIA with five stages.

Order 9, stiffly accurate: algebraic rows are met at the end of every step, not only in the limit. The unknowns split, :math:`y = (u, v)`, into those
whose time derivatives occur and the slaved rest. With stage values Y, :math:`V = (hA)^{-1}(Y - u_n)` and :math:`(hA)^{-1}(V - w_n)` enter the rows.
Simplified Newton steps decouple in the eigenvectors z of :math:`(hA)^{-1}`; the slaved unknowns, which no z multiplies, are eliminated once for all of
them by an orthogonal factor, and what is left for u is small. All are least-squares solutions, so that redundant rows need no care.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import lapack, solve_triangular

from numerics.full_newton import NotConverged
from numerics.full_orbit import Space, radau
from numerics.full_rows import Array, Group, Motion, Rows, State, space_basis

STAGES = 5
C, WEIGHTS = radau(STAGES)
INVERSE = np.linalg.inv(WEIGHTS)
KNOTS = np.concatenate([[0.0], C])  # a step's start and its stages
TAIL = np.linalg.inv(legendre.legvander(2 * KNOTS - 1, STAGES))[-2:]  # the last two Legendre coefficients of the polynomial through them
ITERATIONS = 25
CONVERGED = 1e-13
SLOW, MANY, FACTORS = 0.4, 7, 3  # contraction and iterations from which a new factor costs less; factors in a step, after which a shorter one is better


class Failed(NotConverged):
    """A step does not converge, or has too large an error: a shorter one may do."""


def lagrange(knots: Array, at: Array) -> Array:
    """Return the values at some points of the polynomials that are 1 at one knot and 0 at the others, one row a point."""
    return np.array([[np.prod([(x - other) / (one - other) for j, other in enumerate(knots) if j != i]) for i, one in enumerate(knots)] for x in at])


def spectrum_of_stages() -> tuple[Array, Array, Array, Array]:
    """Return eigenvalues of the inverse of the weights, one of each conjugate pair, how often each counts, right and left eigenvectors."""
    values, vectors = np.linalg.eig(INVERSE)
    upper = values.imag > -1e-9 * np.abs(values)
    real = np.abs(values[upper].imag) < 1e-9 * np.abs(values[upper])
    return np.where(real, values[upper].real, values[upper]), np.where(real, 1.0, 2.0), vectors[:, upper], np.linalg.inv(vectors)[upper]


VALUES, COUNTS, RIGHT, LEFT = spectrum_of_stages()


class System:
    """All rows on one grid at one control, over coefficients of which those with time derivatives come first."""

    def __init__(self, rows: Rows, control: float, nodes: int) -> None:
        self.rows, self.control, self.order = rows, control, rows.order
        self.space = Space(rows, Motion(kind="steady"), (Group(members=tuple(range(rows.count))),), nodes)
        self.grid, self.moving, self.size = self.space.grid, self.space.moving, self.space.size
        self.base = {site: rows.base(self.grid.points(site), control)[0][:, :, None] for site in self.grid.sites}
        self.kept = {site: self.grid.kept(site) for site in self.grid.sites}
        self.used = {site: sorted({j for r in kept for j in rows.names["USES"][site][r]}) for site, kept in self.kept.items()}
        self.stacked = {site: np.concatenate([self.space.maps[site, order][:, used] for order in range(self.order + 1)], axis=2) for site, used in self.used.items()}
        self.height = max(float(np.abs(one).max()) for one in self.base.values())

    def pack(self, state: State) -> Array:
        """Return the coefficients of a state."""
        return self.grid.pack(state) @ self.space.turn

    def unpack(self, y: Array) -> State:
        """Return the state with these coefficients."""
        return self.grid.unpack(self.space.turn @ y, self.control, 0.0)

    def jets(self, site: str, values: Sequence[Array]) -> Array:
        """Return the jets at some instants, (points, jets, instants), from coefficients and their derivatives in time; those that only rows met already hold are at rest."""
        stacked, base = self.stacked[site], self.base[site]
        jets = np.repeat(base, values[0].shape[1], axis=2)
        jets[:, self.used[site]] += (stacked.reshape(-1, stacked.shape[2]) @ np.concatenate(values)).reshape(*stacked.shape[:2], jets.shape[2])
        return jets

    def residual(self, values: Sequence[Array]) -> Array:
        """Return all rows that are not met already, one column an instant."""
        found = []
        for site in self.grid.sites:
            jets = np.moveaxis(self.jets(site, values), 1, 0)
            with np.errstate(all="ignore"):
                table = self.rows.names[site](self.grid.points(site)[:, None], self.control, jets)
            block = np.empty((jets.shape[1], len(self.kept[site]), jets.shape[2]))
            for k, r in enumerate(self.kept[site]):
                block[:, k] = table[r][0]
            found.append(block.reshape(-1, jets.shape[2]))
        return np.concatenate(found)

    def blocks(self, values: Sequence[Array]) -> list[Array]:
        """Return the derivatives of the rows with respect to coefficients and their derivatives in time at one instant: (points, rows, coefficients) by site."""
        table = []
        for site in self.grid.sites:
            slopes = self.rows.evaluate(site, self.grid.points(site), self.control, self.jets(site, values))[2]
            table.append(slopes[:, self.kept[site], 0][:, :, self.used[site]] @ self.stacked[site])
        return table

    def jacobian(self, values: Sequence[Array], rate: float) -> tuple[list[Array], Array]:
        """Return the derivatives with respect to each order in time, rows scaled to unit size at that rate of change, and the scale (0 for a row without unknowns)."""
        blocks, m = self.blocks(values), self.moving
        cuts = [self.size + k * m for k in range(self.order)]
        powers = np.repeat(float(rate) ** np.arange(self.order + 1), [self.size] + [m] * self.order)
        sizes = [np.broadcast_to(np.linalg.norm(block * powers, axis=2).max(axis=0, initial=0.0), block.shape[:2]).ravel() for block in blocks]
        size = np.concatenate(sizes)
        if not np.all(np.isfinite(size)):
            raise Failed("found values of the rows that are not finite; expected a state in the domain of the equations")
        scale = np.where(size > 0, 1 / np.maximum(size, max(1e-6 * size.max(), 1e-300)), 0.0)
        matrix = np.concatenate([block.reshape(-1, block.shape[2]) for block in blocks]) * scale[:, None]
        return np.split(matrix, cuts, axis=1), scale

    @cached_property
    def readings(self) -> tuple[Array, Array]:
        """Return the rows that read what moves, at the points, and the field that each belongs to."""
        parts, fields = [], []
        for j, (k, _, dt) in enumerate(self.rows.jets):
            if dt:
                matrix = self.space.maps["interior", dt][:, j]
                parts.append(matrix)
                fields += [self.rows.field[k]] * len(matrix)
        return np.vstack(parts), np.array(fields)

    @cached_property
    def place(self) -> Array:
        """Return the rows that read the normalised field at its place."""
        return np.array([self.grid.reading(k, 0) @ self.space.turn for k in self.rows.normalised])

    @cached_property
    def between(self) -> tuple[Array, list[tuple[int, int, int, Array]]]:
        """Return points between the nodes, and (jet, unknown, order in time, basis) there."""
        grid = self.grid
        x = np.cos(np.pi * (np.arange(2 * grid.nodes) + 0.5) / (2 * grid.nodes)) if self.rows.spatial else np.zeros(1)
        bases = [(j, k, dt, space_basis(self.rows.degree[k], grid.nodes, grid.length, x, ds)) for j, (k, ds, dt) in enumerate(self.rows.jets)]
        return grid.left + (x + 1) * grid.length / 2, bases

    def violation(self, values: Sequence[Array]) -> float:
        """Return the largest residual of the rows without time derivative between the nodes and at the ends, each by its largest coefficient (1 if that is smaller)."""
        grid, worst = self.grid, 0.0
        s, bases = self.between
        states = [self.grid.unpack(self.space.turn[:, :len(one)] @ one, self.control, 0.0) for one in values]
        inner = self.rows.base(s, self.control)[0][:, :, None]
        for j, k, dt, basis in bases:
            inner[:, j, 0] += basis @ states[dt].coefficients[k][:, 0]
        columns = [one[:, None] for one in values]
        for site in grid.sites:
            jets, where = (inner, s) if site == "interior" else (self.jets(site, columns), grid.points(site))
            value, _, slope = self.rows.evaluate(site, where, self.control, jets)
            size = np.maximum(np.abs(slope).max(axis=(0, 2, 3)), 1.0)
            still = [not any(self.rows.jets[j][2] for j in uses) for uses in self.rows.names["USES"][site]]
            worst = max(worst, float((np.abs(value[..., 0]).max(axis=0) / size)[still].max(initial=0.0)))
        return worst


class Reflections:
    """The orthogonal factor of a matrix, as reflections: it is never formed."""

    def __init__(self, matrix: Array) -> None:
        self.count = matrix.shape[1]
        self.packed, self.factors, _, _ = lapack.dgeqrf(matrix)
        self.triangle = self.packed[:self.count]
        diagonal = np.abs(np.diag(self.triangle))
        if self.count and not diagonal.min() > 1e-13 * diagonal.max():
            raise NotConverged("found unknowns without time derivative that the rows at an instant do not determine")

    def split(self, right: Array) -> tuple[Array, Array]:
        """Return the least-squares solution with the matrix, and the combinations of rows that do not hold its unknowns."""
        if not self.count:
            return right[:0], right
        turned, _, _ = lapack.dormqr("L", "T", self.packed, self.factors, right, 64 * right.shape[1])
        return solve_triangular(self.triangle, turned[:self.count], check_finite=False), turned[self.count:]


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """The linearisation at one instant, factored for steps of about one size."""

    scale: Array  # of the rows
    slaved: Reflections
    follow: tuple[Array, ...]  # slaved unknowns from u and its derivatives
    inverses: tuple[Array, ...]  # of what is left for u, at each eigenvalue


def factor(system: System, values: Sequence[Array], step: float) -> Factor:
    """Return the factored linearisation."""
    (first, *others), scale = system.jacobian(values, float(np.abs(VALUES).min()) / step)
    m = system.moving
    if len(first) < system.size:
        raise NotConverged("found fewer rows than unknowns at an instant")
    slaved = Reflections(first[:, m:])
    follow, parts = zip(*(slaved.split(one) for one in [first[:, :m], *others]), strict=True)
    inverses = []
    for value in VALUES / step:
        z = value.real if value.imag == 0 else value
        q, triangle = np.linalg.qr(sum(z**power * part for power, part in enumerate(parts)))
        diagonal = np.abs(np.diag(triangle))
        if not diagonal.min() > 1e-15 * diagonal.max():
            raise Failed("found a singular linearisation: fewer independent rows than unknowns")
        inverses.append(solve_triangular(triangle, q.conj().T, check_finite=False))
    return Factor(scale=scale, slaved=slaved, follow=follow, inverses=tuple(inverses))


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """Coefficients and time derivatives of those that move, at one time."""

    y: Array
    rate: Array
    second: Array

    def values(self, order: int) -> list[Array]:
        """Return what the rows hold."""
        return [self.y, self.rate, self.second][:order + 1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """The stages of one step, the values there of the first and second derivatives, and the start u."""

    start: Array
    size: float
    Y: Array
    V: Array
    L: Array

    def end(self) -> Instant:
        """Return where it ends."""
        return Instant(y=self.Y[:, -1], rate=self.V[:, -1], second=self.L[:, -1])

    def beyond(self, share: float) -> Array:
        """Return the collocation polynomial continued to the stages of a next step, `share` times as long."""
        m = len(self.start)
        at = 1 + share * C
        u = np.column_stack([self.start, self.Y[:m]]) @ lagrange(KNOTS, at).T
        return np.vstack([u, self.Y[m:] @ lagrange(C, at).T])


@dataclass(slots=True, kw_only=True)
class Costs:
    """How much was done."""

    steps: int = 0
    rejected: int = 0
    iterations: int = 0
    factors: int = 0


@dataclass(slots=True, kw_only=True)
class Stepper:
    """Steps of any size; the factor is kept as long as it contracts well, whatever the step."""

    system: System
    converged: float = CONVERGED  # size of a change, of the largest coefficient, that ends the iterations
    iterations: int = ITERATIONS  # most in a step
    kept: Factor | None = None
    largest: float = 0.0  # of the coefficients so far
    costs: Costs = field(default_factory=Costs)

    def derivatives(self, Y: Array, u: Array, w: Array, step: float) -> tuple[Array, Array]:
        """Return first and second derivatives at the stages."""
        V = (Y[:self.system.moving] - u[:, None]) @ INVERSE.T / step
        return V, (V - w[:, None]) @ INVERSE.T / step

    def solve(self, start: Instant, step: float, guess: Array) -> Step:
        """Return a step by simplified Newton iterations from a guess of the stages.

        Raises
        ------
        Failed
            They do not converge.
        """
        system, m = self.system, self.system.moving
        u, w, Y = start.y[:m], start.rate, guess
        largest = max(self.largest, float(np.abs(u).max(initial=0.0)), 1e-6 * system.height, 1e-300)
        before, made = np.inf, 0
        for count in range(1, self.iterations + 1):
            V, L = self.derivatives(Y, u, w, step)
            values = [Y, V, L][:system.order + 1]
            if self.kept is None:
                self.kept = factor(system, [one[:, STAGES // 2:STAGES // 2 + 1] for one in values], step)
                made += 1
                self.costs.factors += 1
            residual = system.residual(values)
            self.costs.iterations += 1
            change = self.change(residual, step)
            Y = Y + change
            size = float(np.abs(change[:m]).max(initial=0.0)) / largest
            if not np.isfinite(size) or size > 1e3:
                break
            if size < self.converged or (size < 1e-9 and size > 0.5 * before and made):
                self.largest = largest
                if count > MANY:
                    self.kept = None
                V, L = self.derivatives(Y, u, w, step)
                return Step(start=u, size=step, Y=Y, V=V, L=L)
            if size > SLOW * before and made < FACTORS:
                self.kept, size = None, np.inf
            elif size > 0.9 * before:
                break
            before = size
        self.kept = None
        raise Failed(f"a step of {step:.3g} in time did not converge (last relative change {size:.1e})")

    def change(self, residual: Array, step: float) -> Array:
        """Return the change of all stages that removes the residual, to first order."""
        kept = self.kept
        assert kept is not None
        v, rest = kept.slaved.split(residual * kept.scale[:, None])
        modes = rest @ LEFT.T
        u = np.zeros((self.system.moving, STAGES))
        for k, inverse in enumerate(kept.inverses):
            right = modes[:, k] if np.iscomplexobj(inverse) else modes[:, k].real
            u -= COUNTS[k] * np.real(np.outer(inverse @ right, RIGHT[:, k]))
        v, part = -v, u
        for matrix in kept.follow:
            v -= matrix @ part
            part = part @ INVERSE.T / step
        return np.vstack([u, v])
