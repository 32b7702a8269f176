r"""The critical mode: its operator, its functions, and the leading order of the expansion.

With a rotation axis the mode of the - components is that of the + components: a reflection that holds the axis exchanges the two and changes
the sign of pseudovectors. That it does is checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

from sympy import Expr, I, Integer, Symbol

from derive.expansion import Expansion
from derive.functions import Functions, conjugated
from derive.onset import Onset, holds_mode
from derive.operator import LAMBDA, OMEGA, BoundaryRows, FirstOrderOperator, Forcing, coupled_block, reduce_operator
from derive.ordinary import AlgebraicOperator
from derive.response import Amplitude, Contribution, Operator, reduced
from derive.statement import DerivationError, ProblemError
from derive.zero import Probe

AMPLITUDES = {
    ("hopf", True): (
        Amplitude(name="Ap", harmonic=1, weight=1, conjugate=False), Amplitude(name="Am", harmonic=1, weight=-1, conjugate=False),
        Amplitude(name="Cp", harmonic=-1, weight=1, conjugate=True), Amplitude(name="Cm", harmonic=-1, weight=-1, conjugate=True),
    ),
    ("hopf", False): (Amplitude(name="A", harmonic=1, weight=0, conjugate=False), Amplitude(name="Ac", harmonic=-1, weight=0, conjugate=True)),
    ("steady", True): (Amplitude(name="Ap", harmonic=0, weight=1, conjugate=False), Amplitude(name="Am", harmonic=0, weight=-1, conjugate=False)),
    ("steady", False): (Amplitude(name="A", harmonic=0, weight=0, conjugate=False),),
}
"""{(kind of bifurcation, whether there is a rotation axis): amplitudes}; with an axis the circular components, C those of the conjugate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """The critical mode: its operator, its functions, and the unknowns of the statement in terms of them.

    `mirrored` is the operator of the - components in the same functions; None without a rotation axis.
    """

    operator: Operator
    mirrored: Operator | None
    amplitudes: tuple[Amplitude, ...]
    phi: tuple[Symbol, ...]
    phi_bar: tuple[Symbol, ...]
    contributions: tuple[Contribution, ...]
    normalisation: tuple[Expr, ...]
    growth: Expr


def mode_of(expansion: Expansion, onset: Onset, operators: Mapping[int, Operator], functions: Functions) -> Mode:
    """Return the critical mode, and declare its functions."""
    formulation = expansion.formulation
    hopf, vector = onset.kind == "hopf", formulation.frame is not None
    growth: Expr = I * OMEGA if hopf else Integer(0)
    operator = critical_operator(expansion, operators, 1 if vector else 0, growth, onset)
    mirrored = reflected(operator, critical_operator(expansion, operators, -1, growth, onset), expansion) if vector else None
    phi = tuple(Symbol("phi" if k == 0 else f"phi_{k}") for k in range(operator.size))
    bars = {symbol: Symbol(symbol.name.replace("phi", "phi_bar")) for symbol in phi}
    for k, symbol in enumerate(phi):
        slope = over_states(operator.matrix[k], phi) if isinstance(operator, FirstOrderOperator) else Integer(0)
        functions.declare(symbol, slope)
        functions.declare(bars[symbol], conjugated(slope, bars))
    # - is the partner of +; the conjugate of a field's + component is its - component
    partner = {unknown.index: unknown.index + unknown.weight for unknown in formulation.unknowns}
    values = [mode_values(one, phi) for one in (operator, mirrored) if one is not None]
    if hopf:
        values += [{partner[k]: conjugated(value, bars) for k, value in one.items()} for one in reversed(values)]
    amplitudes = AMPLITUDES[onset.kind, vector]
    contributions = tuple(
        Contribution(monomial=tuple(int(k == index) for k in range(len(amplitudes))), order=1, harmonic=amplitude.harmonic, values=own)
        for index, (amplitude, own) in enumerate(zip(amplitudes, values, strict=True))
    )
    return Mode(operator=operator, mirrored=mirrored, amplitudes=amplitudes, phi=phi, phi_bar=tuple(bars.values()), contributions=contributions,
                normalisation=operator.recovery[formulation.normalised[0]][0], growth=growth)


def over_states(row: tuple[Expr, ...], states: tuple[Symbol, ...]) -> Expr:
    """Return a linear form of the states."""
    return sum((coefficient * state for coefficient, state in zip(row, states, strict=True)), Integer(0))


def mode_values(operator: Operator, phi: tuple[Symbol, ...]) -> dict[int, Expr]:
    """Return the unknowns of the statement in the mode."""
    values = {k: over_states(over, phi) for k, (over, _) in operator.recovery.items()}
    return {k: value for k, value in values.items() if value != 0}


def at_growth(operator: Operator, growth: Expr) -> Operator:
    """Return the operator with lambda replaced."""
    def value(expression: Expr) -> Expr:
        return expression.subs(LAMBDA, growth) if LAMBDA in expression.free_symbols else expression

    def combination(forcing: Forcing) -> Forcing:
        return {key: value(c) for key, c in forcing.items()}

    def rows(boundary: BoundaryRows) -> BoundaryRows:
        return replace(boundary, matrix=tuple(tuple(map(value, row)) for row in boundary.matrix),
                       forcing=tuple(map(combination, boundary.forcing)), spare=tuple(map(combination, boundary.spare)))

    changed = replace(
        operator, matrix=tuple(tuple(map(value, row)) for row in operator.matrix), forcing=tuple(map(combination, operator.forcing)),
        recovery={k: (tuple(map(value, over)), combination(extra)) for k, (over, extra) in operator.recovery.items()}, spare=tuple(map(combination, operator.spare)),
    )
    return changed if isinstance(changed, AlgebraicOperator) else replace(changed, left=rows(changed.left), right=rows(changed.right))


def critical_operator(expansion: Expansion, operators: Mapping[int, Operator], weight: int, growth: Expr, onset: Onset) -> Operator:
    """Return the operator of the critical mode: of a Hopf bifurcation only the block of fields that the mode holds.

    Raises
    ------
    ProblemError
        The mode does not hold the normalised field.
    """
    if growth == 0:
        return reduced(expansion, weight, Integer(0))
    leading = next(index for index in expansion.formulation.normalised if expansion.formulation.unknowns[index].weight == weight)
    block = coupled_block(expansion, weight, [leading])
    whole = {unknown.index for unknown in expansion.formulation.unknowns if unknown.weight == weight}
    if isinstance(operators[weight], AlgebraicOperator) or block == whole:
        return at_growth(operators[weight], growth)
    operator = reduce_operator(expansion, weight, LAMBDA, block)
    if not holds_mode(operator, expansion, onset):
        name = expansion.formulation.unknowns[leading].latex
        raise ProblemError(f"normalisation: found {name}, which vanishes in the critical mode; expected a field that the mode holds: one of "
                           f"{', '.join(sorted({one.latex for one in expansion.formulation.unknowns if one.weight == weight and one.index not in block}))}")
    return at_growth(operator, growth)


def reflected(plus: Operator, minus: Operator, expansion: Expansion) -> Operator:
    """Return the operator of the - components in the variables of the + components, or refuse.

    A reflection that contains the axis exchanges the circular components and changes the sign of pseudovectors.
    """
    unknowns = expansion.formulation.unknowns
    probe = expansion.formulation.probe
    fields = sorted({unknowns[unknown].field for unknown, _ in minus.names})
    leading = unknowns[expansion.formulation.normalised[0]].field
    if [(unknowns[u].field, k) for u, k in plus.names] == [(unknowns[u].field, k) for u, k in minus.names]:
        for signs in product((1, -1), repeat=len(fields)):
            sign_of = dict(zip(fields, signs, strict=True))
            if sign_of.get(leading, 1) != 1:
                continue
            flip = [sign_of[unknowns[unknown].field] for unknown, _ in minus.names]
            candidate = flipped(minus, flip)
            if same(plus, candidate, probe):
                return candidate
    raise DerivationError("rotation_axis: found linear problems of the two circular components that differ: the problem is not unchanged by reflections, so its critical "
                          "eigenvalue is not the double one of this class; drop rotation_axis")


def flipped(operator: Operator, flip: list[int]) -> Operator:
    """Return the operator in variables whose signs are changed."""
    n = operator.size

    def scaled(forcing: Forcing, sign: int) -> Forcing:
        return {key: sign * value for key, value in forcing.items()}

    def rows(boundary: BoundaryRows) -> BoundaryRows:
        matrix = tuple(tuple(row[j] * flip[j] * flip[pivot] for j in range(n)) for row, pivot in zip(boundary.matrix, boundary.pivots, strict=True))
        return replace(boundary, matrix=matrix, forcing=tuple(scaled(one, flip[pivot]) for one, pivot in zip(boundary.forcing, boundary.pivots, strict=True)))

    # an algebraic row may carry any sign: its diagonal makes it that of the plus operator
    changed = replace(
        operator, matrix=tuple(tuple(flip[i] * flip[j] * operator.matrix[i][j] for j in range(n)) for i in range(n)),
        forcing=tuple(scaled(operator.forcing[i], flip[i]) for i in range(n)),
        recovery={k: (tuple(over[j] * flip[j] for j in range(n)), extra) for k, (over, extra) in operator.recovery.items()},
    )
    return changed if isinstance(changed, AlgebraicOperator) else replace(changed, left=rows(changed.left), right=rows(changed.right))


def same(one: Operator, other: Operator, probe: Probe) -> bool:
    """Tell whether two operators have equal matrices and boundary rows."""
    pairs = [(one.matrix, other.matrix)]
    if isinstance(one, FirstOrderOperator) and isinstance(other, FirstOrderOperator):
        pairs += [(one.left.matrix, other.left.matrix), (one.right.matrix, other.right.matrix)]
    return all(
        len(a) == len(b) and all(probe.is_zero(x - y) for row, line in zip(a, b, strict=True) for x, y in zip(row, line, strict=True)) for a, b in pairs
    )
