r"""How many eigenvalues lie right of a line, proved: the first instability as a statement.

The eigenvalues of a weight are the zeros of :math:`D(\lambda) = \det[S; T e^{PL}]` (without space of :math:`\det M`). At the threshold
the critical ones are known to be zeros; if the number of zeros with :math:`\mathrm{Re}\,\lambda \ge -\delta`, counted with
multiplicity, is theirs, they are simple and every other eigenvalue is stable.

* Large :math:`\lambda`: with :math:`\kappa = \lambda^{1/M}` and powers of it taken out of the unknowns, :math:`z' = \lambda^{q} Q(1/\kappa) z`.
  Where the exponents of Q stay off the imaginary axis the growing and the decaying ones separate, and the matrix of
  the boundary rows over them is regular for every :math:`1/\kappa` in a ball about 0: no eigenvalue there.
* The rest: the winding number of D about a rectangle, on segments so short that D stays within a half plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import acb, acb_mat, acb_poly, arb

from numerics.algebra import Algebra, Operator, number
from numerics.certified_linear import Unproved, solved, upper
from numerics.precision import EvaluationError, working_precision

if TYPE_CHECKING:
    from numerics.coefficients import Module

BITS = 80
MOST_SEGMENTS = 2500
MOST_PIECES = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstInstability:
    """What is proved of the eigenvalues at the threshold.

    `unstable` other eigenvalues in Re >= -margin (always 0 when proved), counted inside the rectangle [-margin, reach] x
    [-reach, reach] by the argument principle and excluded outside it by a bound; or the reason why there is no proof.
    """

    proved: bool
    reason: str = ""
    margin: str = ""
    reach: str = ""
    segments: int = 0

    def __str__(self) -> str:
        if not self.proved:
            return f"not proved: {self.reason}"
        return (f"proved: at the threshold no eigenvalue but the critical ones has a real part above -{self.margin} "
                f"(winding number over {self.segments} segments of the rectangle [-{self.margin}, {self.reach}] x [-{self.reach}, {self.reach}]i; a bound excludes eigenvalues beyond it)")

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        if not self.proved:
            return {"proved": False, "reason": self.reason}
        return {"proved": True, "others": 0, "margin": self.margin, "reach": self.reach, "segments": self.segments}


class TooLong(Unproved):
    """The count is given up: it would take too long."""


class Ratio:
    """A rational function of lambda over balls."""

    __slots__ = ("bottom", "top")

    def __init__(self, top: acb_poly, bottom: acb_poly) -> None:
        self.top, self.bottom = top, bottom

    def _other(self, other: Any) -> Ratio:
        if isinstance(other, Ratio):
            return other
        if isinstance(other, (int, acb)):
            return Ratio(acb_poly([number(other)]), acb_poly([1]))
        raise Unproved("the linear problem depends on s")

    def __add__(self, other: Any) -> Ratio:
        other = self._other(other)
        return Ratio(self.top * other.bottom + other.top * self.bottom, self.bottom * other.bottom)

    __radd__ = __add__

    def __neg__(self) -> Ratio:
        return Ratio(-self.top, self.bottom)

    def __sub__(self, other: Any) -> Ratio:
        return self + (-self._other(other))

    def __rsub__(self, other: Any) -> Ratio:
        return -self + other

    def __mul__(self, other: Any) -> Ratio:
        other = self._other(other)
        return Ratio(self.top * other.top, self.bottom * other.bottom)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Ratio:
        other = self._other(other)
        return Ratio(self.top * other.bottom, self.bottom * other.top)

    def __rtruediv__(self, other: Any) -> Ratio:
        return self._other(other) / self

    def __pow__(self, power: int) -> Ratio:
        return Ratio(self.top**power, self.bottom**power)

    def apply(self, name: str) -> Ratio:
        """Refuse: a delay or another function of the growth rate is not of this class."""
        raise Unproved(f"the linear problem holds {name} of the growth rate")

    @property
    def order(self) -> int | None:
        """The power of lambda at infinity; None for an exact zero."""
        return None if self.top.length() == 0 else self.top.degree() - self.bottom.degree()

    def at(self, z: acb) -> acb:
        """Return the value."""
        return self.top(z) / self.bottom(z)

    def beyond(self, w: acb) -> acb:
        """Return the value over lambda^order at lambda = 1/w; w may hold 0."""
        return acb_poly(self.top.coeffs()[::-1])(w) / acb_poly(self.bottom.coeffs()[::-1])(w)


def ratio(value: Any) -> Ratio:
    """Return a number as a function of lambda."""
    return value if isinstance(value, Ratio) else Ratio(acb_poly([number(value)]), acb_poly([1])) if isinstance(value, (int, acb)) else refuse()


def refuse() -> Ratio:
    """Refuse coefficients that depend on s."""
    raise Unproved("the linear problem depends on s")


Table = list[list[Ratio]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pencil:
    """y' = P y with S y = 0 at the left end and T y = 0 at the right; without space M y = 0. Entries are rational in lambda."""

    matrix: Table
    left: Table
    right: Table
    length: acb | None
    divisors: tuple[Ratio, ...]

    @property
    def polynomial(self) -> bool:
        """Whether D is a polynomial: no space, or exponents that do not depend on lambda."""
        return self.length is None

    def flow(self, z: acb, panels: int) -> acb_mat:
        """Return exp(P L / panels)."""
        assert self.length is not None
        return (acb_mat([[entry.at(z) for entry in row] for row in self.matrix]) * (self.length / panels)).exp()

    def march(self, z: acb, panels: int, changes: Sequence[acb_mat] | None, flow: acb_mat | None) -> tuple[acb_mat, list[acb_mat]]:
        """Return T y for the solutions y that meet the left rows, and the constant changes of basis made on the way.

        Its determinant is D times a constant: the left rows are in echelon form. Without a change of basis after every panel the
        solutions would become parallel.
        """
        if self.length is None:
            return acb_mat([[entry.at(z) for entry in row] for row in self.matrix]), []
        flow, basis = flow if flow is not None else self.flow(z, panels), self.start(z)
        made: list[acb_mat] = []
        for k in range(panels):
            basis = flow * basis
            change = changes[k] if changes is not None else triangular(basis)
            made.append(change)
            basis = basis * change
        return acb_mat([[entry.at(z) for entry in row] for row in self.right]) * basis, made

    def start(self, z: acb) -> acb_mat:
        """Return a basis of the null space of the left rows, which are in echelon form."""
        n = len(self.matrix)
        pivots = [next((j for j in range(n) if is_one(row[j]) and all(other is row or other[j].order is None for other in self.left)), -1) for row in self.left]
        if -1 in pivots:
            raise Unproved("the boundary rows are not in echelon form")
        free = [j for j in range(n) if j not in pivots]
        table: list[list[Any]] = [[0] * len(free) for _ in range(n)]
        for column, j in enumerate(free):
            table[j][column] = 1
            for row, pivot in zip(self.left, pivots, strict=True):
                table[pivot][column] = -row[j].at(z)
        return acb_mat(table)

    def panels(self, z: acb) -> int:
        """Return how many panels keep the growth on each moderate."""
        if self.length is None:
            return 1
        sizes = np.array([[abs(complex(entry.at(z).mid())) for entry in row] for row in self.matrix])
        rate = float(np.abs(np.linalg.eigvals(sizes)).max())
        return max(1, math.ceil(rate * float(abs(self.length).mid()) / 4))


def is_one(entry: Ratio) -> bool:
    """Tell whether an entry is exactly 1."""
    return entry.order == 0 and entry.top.degree() == 0 and entry.at(acb(0)) == 1


def triangular(basis: acb_mat) -> acb_mat:
    """Return a constant matrix that makes the columns of the midpoint nearly orthonormal."""
    _, upper_factor = np.linalg.qr(np.array([[complex(entry.mid()) for entry in row] for row in basis.tolist()]))
    inverse = np.linalg.inv(upper_factor)
    return acb_mat([[acb(float(z.real), float(z.imag)) for z in row] for row in inverse])


def pencil_of(module: Module, a: Algebra, weight: int, length: acb | None) -> Pencil:
    """Return the pencil of a weight."""
    lam = Ratio(acb_poly([0, 1]), acb_poly([1]))
    operator: Operator = module.names[f"pencil_{weight}"](a, lam)
    tables = [[[ratio(entry) for entry in row] for row in rows] for rows in (operator.matrix, operator.left, operator.right)]
    divisors = tuple(ratio(one) for one in module.names[f"divisors_{weight}"](a, lam))
    return Pencil(matrix=tables[0], left=tables[1], right=tables[2], length=length, divisors=divisors)


# Large lambda


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """y_i = lambda^d_i z_i turns y' = P y into z' = lambda^q Q z with bounded Q; all powers are multiples of 1/root."""

    q: Fraction
    d: tuple[Fraction, ...]
    root: int


def scaling_of(pencil: Pencil) -> Scaling:
    """Return the scaling: q is the largest mean power over the cycles of P."""
    n = len(pencil.matrix)
    k = [[pencil.matrix[i][j].order for j in range(n)] for i in range(n)]
    walk: list[list[Fraction | None]] = [[Fraction(0) if i == j else None for j in range(n)] for i in range(n)]
    q: Fraction | None = None
    for steps in range(1, n + 1):
        walk = [[max((w + k[m][j] for m in range(n) if (w := walk[i][m]) is not None and k[m][j] is not None), default=None) for j in range(n)] for i in range(n)]  # type: ignore[operator]
        for i in range(n):
            if (w := walk[i][i]) is not None and (q is None or w / steps > q):
                q = w / steps
    if q is None or q <= 0:
        raise Unproved("the characteristic exponents do not grow with the growth rate")
    d = [Fraction(0)] * n
    for _ in range(n):
        d = [max([d[i], *(d[j] + order - q for j in range(n) if (order := k[i][j]) is not None)]) for i in range(n)]
    return Scaling(q=q, d=tuple(d), root=math.lcm(q.denominator, *(one.denominator for one in d)))


def scaled_entry(entry: Ratio, power: Fraction, scaling: Scaling, mu: acb) -> acb:
    """Return entry lambda^power, bounded at infinity, at 1/kappa = mu."""
    if entry.order is None:
        return acb(0)
    exponent = -(entry.order + power) * scaling.root
    return entry.beyond(mu**scaling.root) * mu ** int(exponent)


def diagonalised(matrix: acb_mat) -> tuple[acb_mat, list[acb], list[list[acb]]] | None:
    """Return an exact change of basis V, discs that hold one eigenvalue each (Gershgorin), and the eigenvectors over V."""
    n = matrix.nrows()
    doubles = np.array([[complex(entry.mid()) for entry in row] for row in matrix.tolist()])
    if not np.all(np.isfinite(doubles)):
        return None
    change = acb_mat([[acb(float(z.real), float(z.imag)) for z in row] for row in np.linalg.eig(doubles)[1]])
    try:
        near = (change.inv() * (matrix * change)).tolist()  # nearly diagonal; an exact matrix inverted first, for narrow balls
    except ZeroDivisionError:
        return None
    discs = []
    for i in range(n):
        radius = sum((upper(near[i][j]) for j in range(n) if j != i), arb(0)).upper()
        if not radius.is_finite():
            return None
        discs.append(near[i][i] + acb(arb(0, radius), arb(0, radius)))
    if any(one.overlaps(other) for k, one in enumerate(discs) for other in discs[:k]):
        return None
    vectors = []
    for j, tau in enumerate(discs):
        others = [i for i in range(n) if i != j]
        try:
            rest = solved([[near[i][m] - (tau if i == m else 0) for m in others] for i in others], [-near[i][j] for i in others]) if others else []
        except Unproved:
            return None
        vectors.append([*rest[:j], acb(1), *rest[j:]])
    return change, discs, vectors


def separated(pencil: Pencil, scaling: Scaling, size: arb, angle: arb) -> bool:
    """Tell whether no eigenvalue lies at 1/kappa = t exp(-i angle), t in `size`: growing and decaying exponents separate and D has no zero."""
    assert pencil.length is not None
    n = len(pencil.matrix)
    d, q = scaling.d, scaling.q
    mu = size * acb(angle.cos(), -angle.sin())
    table = [[scaled_entry(pencil.matrix[i][j], d[j] - d[i] - q, scaling, mu) for j in range(n)] for i in range(n)]
    matrix = acb_mat(table)
    if not all(entry.is_finite() for line in table for entry in line):
        return False
    parts = diagonalised(matrix)
    if parts is None:
        return False
    change, exponents, vectors = parts
    direction = angle * int(q * scaling.root)
    turned = [(tau * acb(direction.cos(), direction.sin())).real for tau in exponents]
    if any(one.contains(0) for one in turned):
        return False
    growing = [one > 0 for one in turned]
    if sum(growing) != len(pencil.right):
        raise Unproved("the exponents that grow at large growth rates are not as many as the boundary rows at the right end")
    rows = []
    for row in (*pencil.left, *pencil.right):
        top = max(entry.order + d[j] for j, entry in enumerate(row) if entry.order is not None)
        rows.append([scaled_entry(entry, d[j] - top, scaling, mu) for j, entry in enumerate(row)])
    values = (acb_mat(rows) * change * acb_mat([list(line) for line in zip(*vectors, strict=True)])).tolist()
    for j, (grows, one) in enumerate(zip(growing, turned, strict=True)):
        # |exp(lambda^q tau L)|^-+1 <= exp(-|Re| |kappa|^(q M) L), |kappa| >= 1/upper(t)
        small = (-(abs(one).lower() * abs(pencil.length).lower() / size.upper() ** int(q * scaling.root))).exp().upper()
        faint = acb(arb(0, small), arb(0, small))
        for i in range(n):
            if grows == (i < len(pencil.left)):
                values[i][j] = values[i][j] * faint
    matrix = acb_mat(values)
    try:
        determinant = (matrix.mid().inv().mid() * matrix).det()
    except ZeroDivisionError:
        return False
    return bool(determinant.is_finite() and not determinant.contains(0))


def free_beyond(pencil: Pencil, reach: arb, margin: arb) -> bool:
    """Tell whether there is no eigenvalue with |lambda| >= reach and Re >= -margin."""
    if pencil.polynomial:
        raise AssertionError("a polynomial has a bound on its roots")
    scaling = scaling_of(pencil)
    outer = (arb.pi() / 2 + (margin / reach).asin()) / scaling.root
    first = (reach.log() / (-scaling.root)).exp().upper()  # 1/|kappa|
    pieces = [(0.0, 1.0, -1.0, 1.0, 0)]
    for _ in range(MOST_PIECES):
        if not pieces:
            return True
        a, b, low, high, depth = pieces.pop()
        size = first * arb((a + b) / 2, (b - a) / 2)
        if separated(pencil, scaling, size.nonnegative_part() if a == 0 else size, outer * arb((low + high) / 2, (high - low) / 2)):
            continue
        if depth > 9:
            return False
        if (high - low) >= (b - a):
            middle = (low + high) / 2
            pieces += [(a, b, low, middle, depth + 1), (a, b, middle, high, depth + 1)]
        else:
            middle = (a + b) / 2
            pieces += [(a, middle, low, high, depth + 1), (middle, b, low, high, depth + 1)]
    return False


# The winding number


class Winding:
    """The change of arg D along segments, each proved short enough."""

    def __init__(self, pencil: Pencil) -> None:
        self.pencil = pencil
        self.segments = 0
        self.flows: dict[tuple[complex, int], acb_mat] = {}

    def along(self, start: complex, end: complex, depth: int = 0) -> arb:
        """Return the change of arg D from start to end, halving the segment until D stays within a half plane."""
        turn = self.short(start, end)
        if turn is not None:
            self.segments += 1
            if self.segments > MOST_SEGMENTS:
                raise TooLong(f"the winding number needs more than {MOST_SEGMENTS} segments")
            return turn
        middle = (start + end) / 2
        if depth > 40 or middle in (start, end):
            raise Unproved("an eigenvalue lies on the contour, or nearly")
        return self.along(start, middle, depth + 1) + self.along(middle, end, depth + 1)

    def flow(self, z: complex, panels: int) -> acb_mat | None:
        """Return exp(P L / panels) at a point, remembered: segments share their ends."""
        if self.pencil.length is None:
            return None
        if (z, panels) not in self.flows:
            self.flows[z, panels] = self.pencil.flow(ball(z), panels)
        return self.flows[z, panels]

    def short(self, start: complex, end: complex) -> arb | None:
        """Return the change of arg D on a segment, parallel to an axis, on which D / D(middle) is proved to have a positive real part."""
        middle = (start + end) / 2
        panels = self.pencil.panels(ball(middle))
        whole = acb(arb(start.real).union(arb(end.real)), arb(start.imag).union(arb(end.imag)))
        try:
            about, changes = self.pencil.march(ball(middle), panels, None, self.flow(middle, panels))
            inverse = about.mid().inv().mid()
        except (ZeroDivisionError, np.linalg.LinAlgError):
            return None
        share = (inverse * self.pencil.march(whole, panels, changes, None)[0]).det()
        if not (share.is_finite() and share.real > 0):
            return None
        first, last = ((inverse * self.pencil.march(ball(z), panels, changes, self.flow(z, panels))[0]).det() for z in (start, end))
        turn = (last / first).arg()
        return turn if turn.is_finite() else None


def ball(z: complex) -> acb:
    """Return a point exactly."""
    return acb(z.real, z.imag)


def zeros_right_of(pencil: Pencil, line: float, reach: float) -> tuple[int, int]:
    """Return the number of zeros of D in the rectangle [line, reach] x [-reach, reach], and the number of segments."""
    winding = Winding(pencil)
    real = all(c.imag == 0 for table in (pencil.matrix, pencil.left, pencil.right) for row in table for entry in row for part in (entry.top, entry.bottom) for c in part.coeffs())
    corners = [complex(reach, 0), complex(reach, reach), complex(line, reach), complex(line, 0)]
    if not real:
        corners += [complex(line, -reach), complex(reach, -reach), complex(reach, 0)]
    total = sum((winding.along(a, b) for a, b in zip(corners[:-1], corners[1:], strict=True)), arb(0))
    count = (total / arb.pi() / (1 if real else 2)).unique_fmpz()
    if count is None:
        raise Unproved("the winding number is not resolved")
    return int(count), winding.segments


def polynomial_of(table: Sequence[Sequence[Ratio]]) -> acb_poly:
    """Return the determinant of a matrix of polynomials."""
    n = len(table)
    if not all(entry.bottom.degree() == 0 for row in table for entry in row):
        raise Unproved("the elimination divided by an expression in the growth rate")
    known: dict[int, acb_poly] = {0: acb_poly([1])}
    for mask in range(1, 1 << n):  # expansion along rows, over sets of columns
        i = mask.bit_count() - 1
        total, sign = acb_poly([0]), 1 if i % 2 == 0 else -1
        for j in range(n):
            if mask >> j & 1:
                total = total + table[i][j].top * known[mask & ~(1 << j)] * (sign / table[i][j].bottom.coeffs()[0])
                sign = -sign
        known[mask] = total
    return known[(1 << n) - 1]


def reduced(pencil: Pencil) -> Pencil:
    """Return the pencil, with D as a 1 x 1 polynomial where it is one: no space, or exp(PL) polynomial in lambda."""
    if pencil.length is None:
        determinant = polynomial_of(pencil.matrix)
    elif not pencil.right:
        determinant = acb_poly([1])  # all rows at the left end: no eigenvalue
    else:
        flow = polynomial_flow(pencil)
        if flow is None:
            return pencil
        n = len(pencil.matrix)
        determinant = polynomial_of([*pencil.left, *([sum((row[m] * flow[m][j] for m in range(n)), ratio(0)) for j in range(n)] for row in pencil.right)])
    return Pencil(matrix=[[Ratio(determinant, acb_poly([1]))]], left=[], right=[], length=None, divisors=pencil.divisors)


def polynomial_flow(pencil: Pencil) -> Table | None:
    """Return exp(P L) where it is a polynomial in lambda: P is nilpotent, or free of lambda."""
    n = len(pencil.matrix)
    assert pencil.length is not None
    if all(entry.order is None or entry.top.degree() == 0 == entry.bottom.degree() for row in pencil.matrix for entry in row):
        flow = (acb_mat([[entry.at(acb(0)) for entry in row] for row in pencil.matrix]) * pencil.length).exp()
        return [[ratio(flow[i, j]) for j in range(n)] for i in range(n)]
    total = [[ratio(1 if i == j else 0) for j in range(n)] for i in range(n)]
    power = total
    for k in range(1, n + 1):
        power = [[sum((power[i][m] * pencil.matrix[m][j] for m in range(n) if power[i][m].order is not None and pencil.matrix[m][j].order is not None), ratio(0)) * (pencil.length / k)
                  for j in range(n)] for i in range(n)]
        if all(entry.order is None for row in power for entry in row):
            return total
        total = [[a + b for a, b in zip(one, other, strict=True)] for one, other in zip(total, power, strict=True)]
    return None


def root_bound(polynomial: acb_poly) -> arb:
    """Return Cauchy's bound on the moduli of the roots."""
    coefficients = polynomial.coeffs()
    lead = coefficients[-1].abs_lower()
    if not lead > 0:
        raise Unproved("the highest power of the growth rate may vanish")
    return (1 + max((upper(c) / lead for c in coefficients[:-1]), key=lambda c: float(c.mid()), default=arb(0)) * arb("1.001")).upper()


def check_divisors(pencil: Pencil, margin: float) -> None:
    """Refuse divisors that vanish in Re >= -margin: eigenvalues there may be lost."""
    for divisor in pencil.divisors:
        for polynomial in (divisor.top, divisor.bottom):
            if polynomial.degree() > 0:
                try:
                    roots = polynomial.roots()
                except ValueError:
                    raise Unproved("the elimination divided by an expression in the growth rate whose zeros are not separated") from None
                if not all(root.real < arb(-margin) for root in roots):
                    raise Unproved("the elimination divided by an expression in the growth rate that may vanish in the right half plane")


def first_instability(module: Module, control: arb, frequency: arb, neighbour: float | None) -> FirstInstability:
    """Return what is proved of the eigenvalues at the threshold.

    Raises
    ------
    EvaluationError
        Others are proved to be unstable: the threshold is not the first loss of stability.
    """
    with working_precision(BITS):
        try:
            return counted(module, control, frequency, neighbour)
        except Unproved as reason:
            return FirstInstability(proved=False, reason=str(reason))


def counted(module: Module, control: arb, frequency: arb, neighbour: float | None) -> FirstInstability:
    """Return the proof, or raise the reason why there is none."""
    from numerics.certified_linear import CertifiedConstants

    weights = [weight for weight, _ in module.names.get("PENCILS", ())]
    if not weights:
        raise Unproved("the linear problem depends on s; the count is made for constant coefficients only")
    probe = CertifiedConstants(control=acb(0), frequency=acb(0), values={})
    values = {name: acb(value) for name, value in module.parameters(probe).items()}
    a = CertifiedConstants(control=acb(control), frequency=acb(frequency), values=values)
    length: acb | None = None
    if module.SPATIAL:
        ends = tuple(acb(end) for end in module.interval(probe))
        length = ends[1] - ends[0]
    pencils = {weight: reduced(pencil_of(module, a, weight, length)) for weight in weights}
    hopf = module.KIND == "hopf"
    scale = float(abs(frequency).mid()) if hopf else 1.0
    if neighbour:
        scale = min(scale, abs(neighbour)) if hopf else abs(neighbour)
    reason: Unproved | None = None
    for share in (2, 16, 256):
        margin = float(f"{scale / share:.3g}")  # what is printed is what is proved
        try:
            return proof(pencils, module, margin, 2 * max(scale, float(abs(frequency).mid())))
        except TooLong:
            raise
        except Unproved as problem:
            reason = problem
    assert reason is not None
    raise reason


def proof(pencils: dict[int, Pencil], module: Module, margin: float, start: float) -> FirstInstability:
    """Return the proof for one margin."""
    critical_weight = 1 if module.MULTIPLICITY == 2 else 0
    critical = 2 if module.KIND == "hopf" else 1
    reach_of_all, segments = 0.0, 0
    for weight, pencil in pencils.items():
        check_divisors(pencil, margin)
        reach = reach_beyond(pencil, start, margin)
        expected = critical if weight == critical_weight else 0
        if pencil.polynomial and pencil.matrix[0][0].top.degree() <= 0:
            found, more = 0, 0
        else:
            found, more = zeros_right_of(pencil, -margin, reach)
        segments += more
        reach_of_all = max(reach_of_all, reach)
        if found > expected:
            for line in (margin, margin / 16):
                unstable = zeros_right_of(pencil, line, reach)[0]
                if unstable:
                    raise EvaluationError(f"threshold: proved that {unstable} other eigenvalue{'s have' if unstable > 1 else ' has'} a real part above {line:.3g} there: "
                                          "stability is lost before; lower the lower end of control_range")
        if found != expected:
            raise Unproved(f"{found} eigenvalues with a real part above -{margin:.3g} are found where {expected} are critical")
    return FirstInstability(proved=True, margin=f"{margin:.6g}", reach=f"{reach_of_all:.6g}", segments=segments)


def reach_beyond(pencil: Pencil, start: float, margin: float) -> float:
    """Return a distance beyond which there is no eigenvalue."""
    if pencil.polynomial:
        return float(f"{max(float(root_bound(pencil.matrix[0][0].top)) * 1.01, 2 * margin):.4g}")
    reach = float(f"{max(start, 4 * margin):.3g}")
    for _ in range(24):
        if free_beyond(pencil, arb(reach), arb(margin)):
            return reach
        reach = 2 * reach
    raise Unproved("large eigenvalues are not excluded: growing and decaying exponents do not separate in the right half plane")
