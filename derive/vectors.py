r"""Vector notation: from circular components back to vectors, the axis, dot and cross products.

In circular components :math:`v_\pm = v\cdot(e_1 \pm i e_2)`, :math:`v_n = v\cdot n` every form that rotations leave alone has one weight:
:math:`u\cdot v = (u_+v_- + u_-v_+)/2 + u_n v_n`, :math:`(u\times v)_\pm = \pm i(u_n v_\pm - u_\pm v_n)`,
:math:`(u\times v)_n = (u_-v_+ - u_+v_-)/2i`. A multilinear form in components is matched with a list of vector forms by linear
algebra, exactly; the match is complete or refused, so what is printed is what was derived.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

from sympy import QQ_I, Expr, I, Integer, Matrix, Rational
from sympy.polys.matrices import DomainMatrix

from derive.expand import expand

COMPONENTS = ("p", "m", "n")
Product = tuple[tuple[int, str], ...]
"""A product of components of vectors: sorted (number of the vector, component)."""
Polynomial = Mapping[Product, Expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """A scalar or vector form: its components as polynomials in those of its vectors, and how it is written.

    `scalars` and `body` hold `{0}`, `{1}`, ... for the vectors and `{n}` for the axis; `body` is empty for a scalar.
    """

    components: Mapping[str, Polynomial]  # "" for a scalar, else "p", "m", "n"
    scalars: tuple[str, ...] = ()
    body: str = ""

    def text(self, vectors: Sequence[str], axis: str) -> str:
        """Return the form in LaTeX."""
        alone = len(self.scalars) == 1 and not self.body
        parts = [scalar if alone else rf"\left({scalar}\right)" for scalar in self.scalars]
        if self.body:
            parts.append(rf"\left({self.body}\right)" if parts and "\\times" in self.body else self.body)
        return re.sub(r"\{(n|\d)\}", lambda match: axis if match[1] == "n" else vectors[int(match[1])], " ".join(parts))


def times(a: Polynomial, b: Polynomial, factor: Expr | int = 1) -> dict[Product, Expr]:
    """Return the product of two polynomials times a number."""
    result: dict[Product, Expr] = {}
    for one, x in a.items():
        for other, y in b.items():
            key = tuple(sorted((*one, *other)))
            result[key] = result.get(key, Integer(0)) + factor * x * y
    return result


def plus(*polynomials: Polynomial) -> dict[Product, Expr]:
    """Return the sum of polynomials, without zeros."""
    result: dict[Product, Expr] = {}
    for polynomial in polynomials:
        for key, value in polynomial.items():
            result[key] = expand(result.get(key, Integer(0)) + value)
    return {key: value for key, value in result.items() if value != 0}


def vector(slot: int, number: int) -> Form:
    """Return the vector in `slot`, whose components are those of vector `number` (equal for equal vectors)."""
    return Form(components={c: {((number, c),): Integer(1)} for c in COMPONENTS}, body=f"{{{slot}}}")


AXIS = Form(components={"p": {}, "m": {}, "n": {(): Integer(1)}}, body="{n}")
ONE = Form(components={"": {(): Integer(1)}})


def dot(u: Form, v: Form) -> Form:
    """Return u . v."""
    a, b = u.components, v.components
    value = plus(times(a["p"], b["m"], Rational(1, 2)), times(a["m"], b["p"], Rational(1, 2)), times(a["n"], b["n"]))
    return Form(components={"": value}, scalars=(f"{u.body} \\cdot {v.body}",))


def cross(u: Form, v: Form) -> Form:
    """Return u x v."""
    a, b = u.components, v.components
    return Form(
        components={
            "p": plus(times(a["n"], b["p"], I), times(a["p"], b["n"], -I)),
            "m": plus(times(a["n"], b["m"], -I), times(a["m"], b["n"], I)),
            "n": plus(times(a["m"], b["p"], -I / 2), times(a["p"], b["m"], I / 2)),
        },
        body=f"{u.body} \\times {v.body}",
    )


def triple(u: Form, v: Form) -> Form:
    """Return n . (u x v)."""
    return Form(components={"": cross(u, v).components["n"]}, scalars=(rf"{{n}} \cdot {u.body} \times {v.body}",))


def scaled(scalar: Form, other: Form) -> Form:
    """Return a scalar form times another form."""
    return Form(
        components={c: plus(times(scalar.components[""], value)) for c, value in other.components.items()},
        scalars=(*scalar.scalars, *other.scalars), body=other.body,
    )


@cache
def scalar_forms(numbers: tuple[int, ...], slots: tuple[int, ...]) -> tuple[Form, ...]:
    """Return the scalar forms of the vectors in `slots`, simplest first."""
    vectors = [vector(slot, number) for slot, number in zip(slots, numbers, strict=True)]
    if not vectors:
        return (ONE,)
    if len(vectors) == 1:
        return (dot(AXIS, vectors[0]),)
    found: list[Form] = []
    for j in range(1, len(vectors)):  # the partner of the first vector
        rest = tuple(k for k in range(1, len(vectors)) if k != j)
        others = scalar_forms(tuple(numbers[k] for k in rest), tuple(slots[k] for k in rest))
        pairs = [dot(vectors[0], vectors[j])]
        if numbers[0] != numbers[j]:
            pairs.append(triple(vectors[0], vectors[j]))
        found += [scaled(pair, other) for pair in pairs for other in others]
    rest = tuple(range(1, len(vectors)))
    others = scalar_forms(tuple(numbers[k] for k in rest), tuple(slots[k] for k in rest))
    found += [scaled(dot(AXIS, vectors[0]), other) for other in others]
    return tuple(found)


@cache
def vector_forms(numbers: tuple[int, ...], slots: tuple[int, ...]) -> tuple[Form, ...]:
    """Return the vector forms of the vectors in `slots`, simplest first."""
    count = len(numbers)

    def others(used: Sequence[int]) -> tuple[Form, ...]:
        rest = tuple(k for k in range(count) if k not in used)
        return scalar_forms(tuple(numbers[k] for k in rest), tuple(slots[k] for k in rest))

    vectors = [vector(slot, number) for slot, number in zip(slots, numbers, strict=True)]
    found: list[Form] = []
    for j, k in combinations(range(count), 2):
        if numbers[j] != numbers[k]:
            found += [scaled(other, cross(vectors[j], vectors[k])) for other in others((j, k))]
    for j in range(count):
        found += [scaled(other, vectors[j]) for other in others((j,))]
    found += [scaled(other, AXIS) for other in others(())]
    for j in range(count):
        found += [scaled(other, cross(AXIS, vectors[j])) for other in others((j,))]
    return tuple(found)


@cache
def matching(numbers: tuple[int, ...], is_vector: bool) -> tuple[tuple[Form, ...], tuple[tuple[str, Product], ...], tuple[int, ...], list[list[Expr]]]:
    """Return independent forms, all (component, product) keys, the keys that determine the forms, and the inverse over those."""
    candidates = (vector_forms if is_vector else scalar_forms)(numbers, tuple(range(len(numbers))))
    keys = tuple(sorted({(c, product) for form in candidates for c, polynomial in form.components.items() for product in polynomial}))
    table = [[form.components.get(c, {}).get(product, Integer(0)) for form in candidates] for c, product in keys]
    columns = DomainMatrix.from_Matrix(Matrix(table)).convert_to(QQ_I)
    _, kept = columns.rref()
    independent = columns.extract(list(range(len(keys))), list(kept))
    _, rows = independent.transpose().rref()
    inverse = independent.extract(list(rows), list(range(len(kept)))).inv().to_Matrix().tolist()
    return tuple(candidates[k] for k in kept), keys, tuple(rows), inverse


def written(components: Mapping[str, Polynomial], numbers: tuple[int, ...], is_zero: Callable[[Expr], bool]) -> list[tuple[Expr, Form]] | None:
    """Return a multilinear form as [(coefficient, form)], or None where rotations do not leave it alone.

    Parameters
    ----------
    components
        {"p", "m", "n": polynomial} of a vector form, or {"": polynomial} of a scalar one.
    numbers
        Which vector stands in each slot; equal numbers, equal vectors.
    is_zero
        Tells whether an expression vanishes.
    """
    is_vector = "" not in components
    given = {(c, product): value for c, polynomial in components.items() for product, value in polynomial.items() if value != 0}
    if not given:
        return []
    candidates = (vector_forms if is_vector else scalar_forms)(numbers, tuple(range(len(numbers))))
    for form in candidates:  # a single form, if one will do
        own = {(c, product): value for c, polynomial in form.components.items() for product, value in polynomial.items()}
        if set(own) == set(given):
            first = next(iter(own))
            factor = expand(given[first] / own[first])
            if all(is_zero(expand(given[key] - factor * value)) for key, value in own.items()):
                return [(factor, form)]
    forms, keys, rows, inverse = matching(numbers, is_vector)
    if set(given) - set(keys):
        return None
    right = [given.get(keys[row], Integer(0)) for row in rows]
    factors = [expand(sum((entry * value for entry, value in zip(line, right, strict=True) if entry != 0), Integer(0))) for line in inverse]
    found = [(factor, form) for factor, form in zip(factors, forms, strict=True) if not is_zero(factor)]
    total: dict[tuple[str, Product], Expr] = {key: -value for key, value in given.items()}
    for factor, form in found:
        for c, polynomial in form.components.items():
            for product, value in polynomial.items():
                total[c, product] = total.get((c, product), Integer(0)) + factor * value
    return found if all(is_zero(expand(value)) for value in total.values()) else None
