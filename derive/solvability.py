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


def solvability_of(operator: FirstOrderOperator | AlgebraicOperator, functions: Functions, formulation: Formulation) -> Solvability:
    """Return the solvability condition of the critical operator, in terms of the adjoint functions `zeta`.

    Notes
    -----
    Source: labels ``J explicit``, ``general solvability`` of the paper.
    """
    n = operator.size
    zeta = tuple(Symbol("zeta" if k == n - 1 else f"zeta_{n - 1 - k}") for k in range(n))
    weights: dict[tuple[int, int], Expr] = {}  # of each row and each derivative of it
    for symbol, forcing in zip(zeta, operator.forcing, strict=True):
        for (_, row, order), coefficient in forcing.items():
            weights[row, order] = weights.get((row, order), Integer(0)) + symbol * coefficient
    if isinstance(operator, AlgebraicOperator):
        for symbol in zeta:
            functions.declare(symbol, Integer(0))
        return Solvability(interior={row: weight for (row, _), weight in weights.items()}, boundary={}, data={}, zeta=zeta, adjoint=None)
    adjoint = adjoint_of(operator)
    for i, symbol in enumerate(zeta):
        functions.declare(symbol, expand(sum((adjoint.matrix[i][j] * zeta[j] for j in range(n)), Integer(0))))
    interior, boundary = by_parts(weights, functions)
    data: dict[tuple[str, int], Expr] = {}
    # - z(r).y(r) + z(l).y(l) with y at the ends from the boundary rows: T y = h, z = T^T nu
    for end, rows, sign in (("right", operator.right, -1), ("left", operator.left, 1)):
        for forcing, pivot in zip(rows.forcing, rows.pivots, strict=True):
            for (kind, row, order), coefficient in forcing.items():
                if kind == "row":
                    boundary[end, row, order] = boundary.get((end, row, order), Integer(0)) + sign * coefficient * zeta[pivot]
                else:
                    data[kind, row] = data.get((kind, row), Integer(0)) + sign * coefficient * zeta[pivot]
    kept = {key: multiplier for key, value in sorted(boundary.items()) if (multiplier := at_end(value, key[0], operator, zeta, formulation)) != 0}
    return Solvability(interior=dict(sorted(interior.items())), boundary=kept, data=dict(sorted(data.items())), zeta=zeta, adjoint=adjoint)


def by_parts(weights: Mapping[tuple[int, int], Expr], functions: Functions) -> tuple[dict[int, Expr], dict[tuple[str, int, int], Expr]]:
    """Return {row: multiplier} and {(end, row, derivative): multiplier} of the forcing, derivatives moved from it to the adjoint."""
    interior: dict[int, Expr] = {}
    boundary: dict[tuple[str, int, int], Expr] = {}
    for (row, order), weight in sorted(weights.items()):
        # int w D^k f = sum_{m<k} (-1)^m [D^m w D^(k-1-m) f] + (-1)^k int D^k w f
        for m in range(order):
            slope = (-1) ** m * functions.derivative(weight, m)
            for end, sign in (("right", 1), ("left", -1)):
                key = (end, row, order - 1 - m)
                boundary[key] = boundary.get(key, Integer(0)) + sign * slope
        interior[row] = expand(interior.get(row, Integer(0)) + (-1) ** order * functions.derivative(weight, order))
    return interior, boundary


def at_end(multiplier: Expr, end: str, operator: FirstOrderOperator, zeta: tuple[Symbol, ...], formulation: Formulation) -> Expr:
    """Return a multiplier read at an end, by the adjoint rows over the entries of zeta that are pivots; what then cancels is dropped."""
    rows = operator.left if end == "left" else operator.right
    place = dict(zip(("left", "right"), formulation.interval or (), strict=False))[end]
    table = {symbol: sum((line[j] * zeta[pivot] for line, pivot in zip(rows.matrix, rows.pivots, strict=True)), Integer(0)) for j, symbol in enumerate(zeta) if j not in rows.pivots}
    value = expand(multiplier.xreplace(table).subs(formulation.space, place))
    work = Elimination(formulation)
    return sum((symbol * work.tidy(value.coeff(symbol)) for symbol in zeta), Integer(0))
