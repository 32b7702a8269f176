r"""Expansion about the base state, row by row.

A row :math:`E(u;\lambda)` becomes :math:`\sum_j l_j z_j + \sum_{j\le k} q_{jk} z_j z_k + \sum_{j\le k\le m} c_{jkm} z_j z_k z_m`
over the jets :math:`z` (unknowns and their derivatives) of the disturbance, with exact coefficients in `s`, the control and
the parameters. Each order of the multiple-scale expansion is a sum of these multilinear forms, so no factor 2, 3 or 6 is
ever written by hand: the monomial :math:`z_j z_k` of the row is the product of two expansions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import factorial
from typing import Any

from sympy import Add, Expr, I, Integer, Matrix, Mul, Rational, Symbol, nan, oo, zoo

from derive.expand import expand
from derive.formulation import Formulation, Jet, RawRow, base_jets
from derive.statement import ProblemError

ORDER = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class TaylorRow:
    """A row of the problem to third order in the disturbance.

    Attributes
    ----------
    terms
        {sorted jets: coefficient}; one jet is a linear term, two a quadratic, three a cubic one.
    weak
        {jet: coefficient} of the part of first order in epsilon.
    weight
        Weight of the row under rotations: a row of weight m couples monomials of weight m only.
    """

    terms: Mapping[tuple[Jet, ...], Expr]
    weak: Mapping[Jet, Expr]
    weight: int
    label: str

    def linear(self) -> dict[Jet, Expr]:
        """Return the linear part."""
        return {jets[0]: value for jets, value in self.terms.items() if len(jets) == 1}


@dataclass(frozen=True, slots=True, kw_only=True)
class Expansion:
    """All rows to third order: interior rows, and boundary rows at each end."""

    formulation: Formulation
    rows: tuple[TaylorRow, ...]
    ends: tuple[tuple[TaylorRow, ...], ...]
    weights: tuple[int, ...]  # the weights of rows that occur: (0,), or a part of (1, -1, 0)

    @property
    def groups(self) -> tuple[tuple[str, tuple[TaylorRow, ...]], ...]:
        """Return (kind, rows): "row" for the interior, "left" and "right" for the ends."""
        return (("row", self.rows), *zip(("left", "right"), self.ends, strict=False))


def expand_about_base(formulation: Formulation) -> Expansion:
    """Return every row as a Taylor polynomial about the base state, sorted by weight under rotations.

    Raises
    ------
    ProblemError
        A row has no Taylor series at the base state, or is not left alone by rotations about the axis.
    """
    rows = tuple(row for equation in formulation.rows for row in rows_of(formulation, equation, None))
    ends = tuple(
        tuple(row for equation in equations for row in rows_of(formulation, equation, place))
        for place, equations in formulation.boundary
    )
    rows = pure_rows(rows, formulation)
    ends = tuple(pure_rows(end, formulation) for end in ends)
    weights = tuple(sorted({unknown.weight for unknown in formulation.unknowns}, key=lambda m: (-abs(m), -m)))
    return Expansion(formulation=formulation, rows=rows, ends=ends, weights=weights)


def rows_of(formulation: Formulation, equation: tuple[RawRow, ...], place: Expr | None) -> tuple[TaylorRow, ...]:
    """Return the Taylor rows of one equation; a vector equation gives its circular components."""
    cartesian = [taylor(formulation, row, place) for row in equation]
    if len(cartesian) == 1 or formulation.frame is None:
        return tuple(cartesian)
    e1, e2, normal = formulation.frame
    mixes = ((1, [e1[k] + I * e2[k] for k in range(3)]), (-1, [e1[k] - I * e2[k] for k in range(3)]), (0, list(normal)))
    label = equation[0].label.removesuffix("[0]")
    return tuple(mixed(cartesian, factors, weight, label) for weight, factors in mixes)


def mixed(rows: list[TaylorRow], factors: list[Expr], weight: int, label: str) -> TaylorRow:
    """Return the combination of rows with constant factors."""
    terms: dict[tuple[Jet, ...], Expr] = {}
    weak: dict[Jet, Expr] = {}
    for row, factor in zip(rows, factors, strict=True):
        for jets, value in row.terms.items():
            terms[jets] = terms.get(jets, Integer(0)) + factor * value
        for jet, value in row.weak.items():
            weak[jet] = weak.get(jet, Integer(0)) + factor * value
    return TaylorRow(
        terms={jets: expand(terms[jets]) for jets in sorted(terms)}, weak={jet: expand(weak[jet]) for jet in sorted(weak)},
        weight=weight, label=label,
    )


def taylor(formulation: Formulation, row: RawRow, place: Expr | None) -> TaylorRow:
    """Return one row to third order, with exact derivatives (no finite differences, no series in a variable)."""
    base = base_jets(formulation)
    at_place = {formulation.space: place} if place is not None else {}

    def at_base(expression: Expr) -> Expr:
        value = expression.xreplace(base)
        if at_place:
            value = value.subs(at_place)
        value = value.doit() if value.has(nan, zoo, oo) is False else value
        if value.has(nan, zoo, oo) or "Subs" in {type(node).__name__ for node in value.atoms()}:
            raise ProblemError(f"{row.label}: found no Taylor series at the base state; expected a nonlinearity that is smooth there")
        return expand(value)

    symbols = {symbol: jet for jet, symbol in formulation.jets.items()}
    if row.expression.is_polynomial(*(symbol for symbol in sorted(row.expression.free_symbols, key=str) if symbol in symbols or symbol == formulation.weak)):
        found, weakly = by_products(row.expression, {jet: at_base(symbol) for jet, symbol in formulation.jets.items()}, symbols, formulation.weak)
        found, weakly = ({key: at_base(value) for key, value in table.items()} for table in (found, weakly))
    else:
        found, weakly = by_derivatives(formulation, row.expression, symbols, at_base)
    terms = {key: found[key] for key in sorted(found) if key and not formulation.probe.is_zero(found[key])}
    weak = {jet: weakly[jet,] for (jet,) in sorted(key for key in weakly if len(key) == 1) if not formulation.probe.is_zero(weakly[jet,])}
    return TaylorRow(terms=terms, weak=weak, weight=0, label=row.label)


Terms = dict[tuple[Jet, ...], Expr]


def by_products(expression: Expr, base: Mapping[Jet, Expr], symbols: Mapping[Any, Jet], small: Symbol) -> tuple[Terms, Terms]:
    """Return the terms of a polynomial row, and those of first order in `small`: each product of jets (base + disturbance) multiplied out to third order."""
    tables: tuple[Terms, Terms] = ({}, {})
    for term in Add.make_args(expand(expression)):
        powers = term.as_powers_dict()
        level = int(powers.pop(small, 0))
        if level > 1:
            continue
        jets = [(symbols[factor], int(power)) for factor, power in powers.items() if factor in symbols]
        partial: Terms = {(): Mul(*(factor**power for factor, power in powers.items() if factor not in symbols))}
        for jet, power in jets:
            for _ in range(power):
                grown: Terms = {}
                for key, value in partial.items():
                    if base[jet] != 0:
                        grown[key] = grown.get(key, Integer(0)) + value * base[jet]
                    if len(key) < ORDER:
                        longer = tuple(sorted((*key, jet)))
                        grown[longer] = grown.get(longer, Integer(0)) + value
                partial = grown
        for key, value in partial.items():
            tables[level][key] = tables[level].get(key, Integer(0)) + value
    return tables


def by_derivatives(formulation: Formulation, expression: Expr, symbols: Mapping[Any, Jet], at_base: Callable[[Expr], Expr]) -> tuple[Terms, Terms]:
    """Return the terms of any smooth row, and those of first order in epsilon: derivatives at the base state over the factorials."""
    nominal = expression.xreplace({formulation.weak: Integer(0)})

    def used(one: Expr) -> list[Jet]:
        return sorted(symbols[symbol] for symbol in one.free_symbols if symbol in symbols)

    terms: Terms = {}
    derivatives: Terms = {(): nominal}
    for _ in range(ORDER):
        higher: Terms = {}
        for jets, one in derivatives.items():
            for jet in used(one):
                if jets and jet < jets[-1]:
                    continue
                derivative = one.diff(formulation.jets[jet])
                if derivative == 0:
                    continue
                key = (*jets, jet)
                higher[key] = derivative
                repeats = 1
                for each in set(key):
                    repeats *= factorial(key.count(each))
                terms[key] = expand(at_base(derivative) * Rational(1, repeats))
        derivatives = higher
    effect = expression.diff(formulation.weak).xreplace({formulation.weak: Integer(0)})
    return terms, {(jet,): at_base(effect.diff(formulation.jets[jet])) for jet in used(effect)}


def pure_rows(rows: tuple[TaylorRow, ...], formulation: Formulation) -> tuple[TaylorRow, ...]:
    """Return rows of a single weight each that span the same equations, or refuse a symmetry that is not there."""
    if formulation.frame is None:
        return rows
    weight_of = [unknown.weight for unknown in formulation.unknowns]

    def weight(jets: tuple[Jet, ...]) -> int:
        return sum(weight_of[jet[0]] for jet in jets)

    clean = [replace(row, terms={jets: value for jets, value in row.terms.items() if not formulation.probe.is_zero(value)}) for row in rows]
    if all(weight(jets) == row.weight for row in clean for jets in row.terms):
        return tuple(clean)
    weak = [row.label for row in clean if row.weak]
    # The span of the rows is invariant if and only if it holds every piece of pure weight of every row.
    pieces: list[TaylorRow] = []
    for row in clean:
        for own in sorted({weight(jets) for jets in row.terms}):
            part = {jets: value for jets, value in row.terms.items() if weight(jets) == own}
            pieces.append(TaylorRow(terms=part, weak=row.weak if len(part) == len(row.terms) else {}, weight=own, label=row.label))
    if weak and any(abs(piece.weight) > 1 for piece in pieces):
        raise ProblemError(f"rotation_axis: {', '.join(sorted(set(weak)))} is not left alone by rotations; drop rotation_axis")
    independent = independent_rows(pieces, formulation)
    if len(independent) > len(independent_rows(clean, formulation)) or any(abs(row.weight) > 1 for row in independent):
        culprit = next(row.label for row in clean if any(weight(jets) != row.weight for jets in row.terms))
        raise ProblemError(f"rotation_axis: {culprit} changes under rotations about the axis; expected a problem that does not; "
                           "drop rotation_axis or correct the equation")
    # Weak effects written component by component: circular rows are rebuilt from the components they stand in.
    return tuple(rebuilt(independent, clean) if weak else independent)


def independent_rows(rows: list[TaylorRow], formulation: Formulation) -> list[TaylorRow]:
    """Return a maximal subset of rows that is independent over the constants."""
    keys = sorted({key for row in rows for key in row.terms})
    samples = 2
    kept: list[TaylorRow] = []
    reduced: list[tuple[int, list[complex]]] = []
    for row in rows:
        vector: list[complex] = []
        for key in keys:
            for attempt in range(samples):
                value = formulation.probe.value(row.terms[key], attempt) if key in row.terms else 0
                vector.append(0 if value is None else value)
        size = max((abs(entry) for entry in vector), default=0)
        for pivot, other in reduced:
            factor = vector[pivot]
            if factor:
                vector = [a - factor * b for a, b in zip(vector, other, strict=True)]
        if not vector:
            continue
        pivot = max(range(len(vector)), key=lambda k: abs(vector[k]))
        if abs(vector[pivot]) <= 1e-10 * max(size, 1e-300) or size == 0:
            continue
        head = vector[pivot]
        reduced.append((pivot, [entry / head for entry in vector]))
        kept.append(row)
    return kept


def rebuilt(pieces: list[TaylorRow], rows: list[TaylorRow]) -> list[TaylorRow]:
    """Return the independent pieces with the weak parts that belong to them: each piece is a combination of whole rows."""
    keys = sorted({key for row in rows for key in row.terms})
    system = Matrix([[row.terms.get(key, Integer(0)) for row in rows] for key in keys])
    result = []
    for piece in pieces:
        right = Matrix([piece.terms.get(key, Integer(0)) for key in keys])
        solution, free = system.gauss_jordan_solve(right)
        factors = [expand(entry.subs({symbol: 0 for symbol in free})) for entry in solution]
        weak = mixed(rows, factors, piece.weight, piece.label).weak
        result.append(TaylorRow(terms=piece.terms, weak=weak, weight=piece.weight, label=piece.label))
    return result
