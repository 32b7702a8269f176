r"""The adjoint operator, its boundary rows, and the boundary form.

For :math:`y' = P y + \hat f`, :math:`S y = \hat g` at the left end, :math:`T y = \hat h` at the right end, the adjoint is
:math:`z' = -P^{T} z` (the pairing is bilinear; conjugation is structural), since

.. math:: [z^{T} y]_{l}^{r} = \int z^{T} \hat f\,ds .

Adjoint rows: z is a combination of the rows of S at the left end and of those of T at the right end, so that the boundary form
:math:`[z^{T}y]` vanishes for every y that meets the homogeneous rows.
"""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Expr, Integer

from derive.operator import BoundaryRows, FirstOrderOperator


@dataclass(frozen=True, slots=True, kw_only=True)
class Adjoint:
    """The adjoint first-order system.

    Attributes
    ----------
    matrix
        -P^T, shape (n, n).
    left, right
        Rows that the adjoint functions meet at the ends; n - k at the left where the operator has k.
    """

    matrix: tuple[tuple[Expr, ...], ...]
    left: tuple[tuple[Expr, ...], ...]
    right: tuple[tuple[Expr, ...], ...]

    @property
    def size(self) -> int:
        """Return n."""
        return len(self.matrix)


def adjoint_of(operator: FirstOrderOperator) -> Adjoint:
    """Return the formal adjoint and the boundary rows that go with it.

    Notes
    -----
    Dimensionless. Source: labels ``adjoint problem``, ``adjoint bcs`` of the paper.
    """
    n = operator.size
    return Adjoint(
        matrix=tuple(tuple(-operator.matrix[j][i] for j in range(n)) for i in range(n)),
        left=annihilator(operator.left, n), right=annihilator(operator.right, n),
    )


def annihilator(rows: BoundaryRows, n: int) -> tuple[tuple[Expr, ...], ...]:
    """Return the rows that vanish on every combination of `rows`: one for each column that is no pivot."""
    result = []
    for j in range(n):
        if j in rows.pivots:
            continue
        row = [Integer(0)] * n
        row[j] = Integer(1)
        for i, pivot in enumerate(rows.pivots):
            row[pivot] = -rows.matrix[i][j]
        result.append(tuple(row))
    return tuple(result)
