r"""The Fredholm alternative with boundary forcing.

For :math:`L\psi = f` with boundary rows :math:`S\psi = g`, :math:`T\psi = h` on the rows *of the statement*, the condition is

.. math:: \int \sum_i \zeta_i f_i\,ds + \sum_{ends,i,k} b_{ik}\,\partial_s^k f_i + \sum_j c_j g_j + \sum_j d_j h_j = 0 ,

with every multiplier an expression in the adjoint function. Derivatives of the forcing, where elimination made some, are
moved on to the adjoint by parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sympy import Expr, Integer, Symbol

from derive.adjoint import Adjoint, adjoint_of
from derive.expand import expand
from derive.formulation import Formulation
from derive.functions import Functions
from derive.operator import Elimination, FirstOrderOperator
from derive.ordinary import AlgebraicOperator


@dataclass(frozen=True, slots=True, kw_only=True)
class Solvability:
    """The condition that can be handed any forcing and any boundary forcing.

    Attributes
    ----------
    interior
        {row: multiplier}, functions of `s`.
    boundary
        {(end, row, derivative): multiplier} of the interior forcing read at an end; usually empty.
    data
        {(end, row): multiplier} of the boundary forcing.
    """

    interior: Mapping[int, Expr]
    boundary: Mapping[tuple[str, int, int], Expr]
    data: Mapping[tuple[str, int], Expr]
    zeta: tuple[Symbol, ...]
    adjoint: Adjoint | None

    def applied(self, given: Mapping[tuple[str, int], Expr], functions: Functions) -> tuple[Expr, dict[str, Expr]]:
        """Return (integrand, {end: terms read at that end}) for a forcing {(kind, row): expression}."""
        integrand: Expr = Integer(0)
        ends: dict[str, Expr] = {"left": Integer(0), "right": Integer(0)}
        for row, multiplier in self.interior.items():
            value = given.get(("row", row), Integer(0))
            if value != 0:
                integrand += multiplier * value
        for (end, row, order), multiplier in self.boundary.items():
            value = given.get(("row", row), Integer(0))
            if value != 0:
                ends[end] += multiplier * functions.derivative(value, order)
        for (end, row), multiplier in self.data.items():
            value = given.get((end, row), Integer(0))
            if value != 0:
                ends[end] += multiplier * value
        return integrand, ends


def solvability_of(operator: FirstOrderOperator | AlgebraicOperator, functions: Functions, formulation: Formulation, stem: str = "zeta") -> Solvability:
    """Return the solvability condition of the critical operator, in terms of the adjoint functions `zeta`.

    Notes
    -----
    Source: labels ``J explicit``, ``general solvability`` of the paper.
    """
    n = operator.size
    zeta = tuple(Symbol(stem if k == n - 1 else f"{stem}_{n - 1 - k}") for k in range(n))
    work = Elimination(formulation)
    if isinstance(operator, AlgebraicOperator):
        for symbol in zeta:
            functions.declare(symbol, Integer(0))
        interior: dict[int, Expr] = {}
        for symbol, forcing in zip(zeta, operator.forcing, strict=True):
            for (_, row, _), coefficient in forcing.items():
                interior[row] = interior.get(row, Integer(0)) + symbol * coefficient
        return Solvability(interior=interior, boundary={}, data={}, zeta=zeta, adjoint=None)
    adjoint = adjoint_of(operator)
    for i, symbol in enumerate(zeta):
        functions.declare(symbol, expand(sum((adjoint.matrix[i][j] * zeta[j] for j in range(n)), Integer(0))))
    weights: dict[tuple[int, int], Expr] = {}
    for symbol, forcing in zip(zeta, operator.forcing, strict=True):
        for (_, row, order), coefficient in forcing.items():
            weights[row, order] = weights.get((row, order), Integer(0)) + symbol * coefficient
    interior = {}
    boundary: dict[tuple[str, int, int], Expr] = {}
    data: dict[tuple[str, int], Expr] = {}
    for (row, order), weight in sorted(weights.items()):
        # int w D^k f = sum_{m<k} (-1)^m [D^m w D^(k-1-m) f] + (-1)^k int D^k w f
        for m in range(order):
            slope = (-1) ** m * functions.derivative(weight, m)
            for end, sign in (("right", 1), ("left", -1)):
                key = (end, row, order - 1 - m)
                boundary[key] = boundary.get(key, Integer(0)) + sign * slope
        interior[row] = expand(interior.get(row, Integer(0)) + (-1) ** order * functions.derivative(weight, order))
    # - z(r).y(r) + z(l).y(l) with y at the ends from the boundary rows: T y = h, z = T^T nu
    for end, rows, pivots, sign in (("right", operator.right, adjoint.right_pivots, -1), ("left", operator.left, adjoint.left_pivots, 1)):
        for forcing, pivot in zip(rows.forcing, pivots, strict=True):
            for (kind, row, order), coefficient in forcing.items():
                if kind == "row":
                    boundary[end, row, order] = boundary.get((end, row, order), Integer(0)) + sign * coefficient * zeta[pivot]
                else:
                    data[kind, row] = data.get((kind, row), Integer(0)) + sign * coefficient * zeta[pivot]
    # Adjoint rows turn the entries that are no pivots into those that are; what then cancels is dropped.
    place = dict(zip(("left", "right"), formulation.interval or (), strict=False))
    kept: dict[tuple[str, int, int], Expr] = {}
    for (end, row, order), multiplier in sorted(boundary.items()):
        rows, pivots = (operator.left, adjoint.left_pivots) if end == "left" else (operator.right, adjoint.right_pivots)
        table = {zeta[j]: sum((rows.matrix[i][j] * zeta[pivot] for i, pivot in enumerate(pivots)), Integer(0)) for j in range(n) if j not in pivots}
        at = multiplier.xreplace(table).subs(formulation.space, place[end])
        at = expand(at)
        parts = [(symbol, work.tidy(at.coeff(symbol))) for symbol in zeta]
        at = sum((symbol * part for symbol, part in parts if part != 0), Integer(0))
        if at != 0:
            kept[end, row, order] = at
    return Solvability(interior={row: interior[row] for row in sorted(interior)}, boundary=kept, data={key: data[key] for key in sorted(data)}, zeta=zeta, adjoint=adjoint)
