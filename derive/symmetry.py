r"""A symmetry that forbids even powers of a real amplitude.

Signs of the unknowns, alone or with the reflection of the interval :math:`s \to s_l + s_r - s`, that turn every row into itself up
to its sign: then a simple mode is mapped to plus or minus itself, and if its normalised value changes sign the amplitude equation is
odd. Balls cannot tell whether a number is exactly zero; this can.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations, product

from sympy import Expr

from derive.expansion import Expansion
from derive.formulation import Formulation, Jet

MOST_UNKNOWNS = 10
MOST_ROWS = 6


def amplitude_is_odd(expansion: Expansion) -> bool:
    """Tell whether a symmetry of all rows changes the sign of the real scalar amplitude."""
    formulation = expansion.formulation
    count = len(formulation.unknowns)
    if count > MOST_UNKNOWNS:
        return False
    leading = formulation.normalised[0]
    for signs in product((-1, 1), repeat=count):
        if signs[leading] == -1 and (keeps_rows(expansion, signs) or reflects_rows(expansion, signs)):
            return True
    return False


def sign_of(jets: Sequence[Jet], signs: Sequence[int], reflected: bool) -> int:
    """Return the sign of a product of jets."""
    sign = 1
    for unknown, ds, _ in jets:
        sign *= signs[unknown] * (-1 if reflected and ds % 2 else 1)
    return sign


def keeps_rows(expansion: Expansion, signs: Sequence[int]) -> bool:
    """Tell whether the signs turn every row into plus or minus itself."""
    return all(len({sign_of(jets, signs, False) for jets in row.terms}) <= 1 for rows in (expansion.rows, *expansion.ends) for row in rows)


def reflects_rows(expansion: Expansion, signs: Sequence[int]) -> bool:
    """Tell whether the signs with the reflection of the interval turn the rows into each other, the place of normalisation in the middle."""
    formulation = expansion.formulation
    if formulation.interval is None or formulation.place is None:
        return False
    total = formulation.interval[0] + formulation.interval[1]
    if not formulation.probe.is_zero(2 * formulation.place - total):
        return False
    for row in expansion.rows:
        image = {jets: value.subs(formulation.space, total - formulation.space) for jets, value in row.terms.items()}
        if not related(row.terms, image, signs, formulation):
            return False
    left, right = expansion.ends
    if len(left) != len(right) or len(left) > MOST_ROWS:
        return False
    return any(all(related(row.terms, other.terms, signs, formulation) for row, other in zip(left, order, strict=True)) for order in permutations(right))


def related(one: Mapping[tuple[Jet, ...], Expr], other: Mapping[tuple[Jet, ...], Expr], signs: Sequence[int], formulation: Formulation) -> bool:
    """Tell whether `other`, with the signs of its jets, is plus or minus `one`."""
    if set(one) != set(other):
        return False
    return any(all(formulation.probe.is_zero(value - sign * sign_of(jets, signs, True) * other[jets]) for jets, value in one.items()) for sign in (1, -1))
