r"""The amplitude equation: which monomials symmetry allows, and the solvability integral of each.

Kinds: complex scalar (Hopf), complex vector (double Hopf by rotation), real scalar (transcritical or pitchfork), real vector
(steady with rotation). In circular components :math:`A_\pm = A_1 \pm i A_2` the vector equation

.. math:: \dot{A} = \gamma\mu A + \alpha\,(A\cdot A)A^* + \beta\,(A\cdot A^*)A

has in its + component :math:`X A_+|A_+|^2 + Y A_+|A_-|^2` with :math:`\beta = 2X`, :math:`\alpha = Y - X`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

from sympy import Expr, I, Integer, Symbol, expand

from derive.expansion import Expansion
from derive.formulation import SCALAR_MONOMIALS, VECTOR_MONOMIALS
from derive.functions import Functions, conjugated
from derive.onset import Onset, holds_mode
from derive.operator import LAMBDA, OMEGA, BoundaryRows, FirstOrderOperator, Forcing, coupled_block, reduce_operator
from derive.ordinary import AlgebraicOperator
from derive.response import Amplitude, Contribution, Operator, Orders, Response, forced, labels_of, reduced, respond, right_hand_sides
from derive.solvability import Solvability, solvability_of
from derive.statement import DerivationError, ProblemError

Given = dict[tuple[str, int], Expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    r"""A coefficient of the amplitude equation, as solvability integrals over the integral that belongs to dA/dt.

    The coefficient is :math:`-(\int integrand\,ds + left + right)/\xi`; `left` and `right` are read at the ends.
    """

    monomial: str
    name: str
    identifier: str
    integrand: Expr
    left: Expr
    right: Expr
    forcing: Mapping[tuple[str, int], Expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """The critical mode: its operator, its functions, and the unknowns of the statement in terms of them."""

    operator: Operator
    phi: tuple[Symbol, ...]
    phi_bar: tuple[Symbol, ...]
    contributions: tuple[Contribution, ...]
    normalisation: tuple[Expr, ...]
    growth: Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class Weak:
    """A weak effect on a vector amplitude: the coefficient of epsilon in row `row` of amplitude component `column` (+, -)."""

    row: int
    column: int
    coefficient: Coefficient


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction:
    """Everything the orders up to solvability give."""

    kind: str  # "hopf" or "steady"
    vector: bool
    amplitudes: tuple[Amplitude, ...]
    mode: Mode
    responses: tuple[Response, ...]
    solvability: Solvability
    xi: Coefficient
    coefficients: tuple[Coefficient, ...]
    quadratic: Coefficient | None  # the A**2 of a real scalar: if it is not zero the equation ends there
    mirror: tuple[tuple[str, Coefficient], ...]  # (identifier, the same from the other circular component)
    mirror_xi: Coefficient | None
    weak: tuple[Weak, ...]
    spare: tuple[tuple[str, str, Expr], ...]  # (end or "", the rows, what must vanish)
    linear_spare: tuple[tuple[str, str, Expr], ...]  # the same of mu A, the weak effects and A**2
    functions: Functions
    operators: Mapping[str, Operator]


def at_growth(operator: Operator, growth: Expr) -> Operator:
    """Return the operator with lambda replaced."""
    def value(expression: Expr) -> Expr:
        return expression.subs(LAMBDA, growth) if LAMBDA in expression.free_symbols else expression

    def combination(forcing: Forcing) -> Forcing:
        return {key: value(c) for key, c in forcing.items()}

    def rows(boundary: BoundaryRows) -> BoundaryRows:
        return replace(boundary, matrix=tuple(tuple(map(value, row)) for row in boundary.matrix),
                       forcing=tuple(map(combination, boundary.forcing)), spare=tuple(map(combination, boundary.spare)))

    common = {
        "matrix": tuple(tuple(map(value, row)) for row in operator.matrix),
        "forcing": tuple(map(combination, operator.forcing)),
        "recovery": {k: (tuple(map(value, over)), combination(extra)) for k, (over, extra) in operator.recovery.items()},
        "spare": tuple(map(combination, operator.spare)),
    }
    if isinstance(operator, AlgebraicOperator):
        return replace(operator, **common)  # type: ignore[arg-type]
    return replace(operator, left=rows(operator.left), right=rows(operator.right), **common)  # type: ignore[arg-type]


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


def driven_block(orders: Orders, monomial: tuple[int, ...]) -> frozenset[int] | None:
    """Return the fields that the forcing at a monomial reaches, or None where it reaches all of its weight, or none, or there is no space."""
    expansion = orders.expansion
    if expansion.formulation.interval is None:
        return None
    weight = orders.weight(monomial)
    rows = {"row": expansion.rows, **dict(zip(("left", "right"), expansion.ends, strict=False))}
    given = [rows[kind][number].linear() for kind, number in right_hand_sides(orders, monomial, weight)]
    if not given or not all(given):
        return None
    block = coupled_block(expansion, weight, {jet[0] for linear in given for jet in linear})
    whole = {unknown.index for unknown in expansion.formulation.unknowns if unknown.weight == weight}
    return None if block == whole else block


def response_operator(expansion: Expansion, operator: Operator, weight: int, growth: Expr, block: frozenset[int] | None) -> Operator:
    """Return the operator of a response: of all fields of its weight, or of those that are driven."""
    if growth == 0:
        return reduced(expansion, weight, growth) if block is None else reduce_operator(expansion, weight, growth, block)
    return at_growth(operator if block is None else reduce_operator(expansion, weight, LAMBDA, block), growth)


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
    recovery = {k: (tuple(over[j] * flip[j] for j in range(n)), extra) for k, (over, extra) in operator.recovery.items()}

    def scaled(forcing: Forcing, sign: int) -> Forcing:
        return {key: sign * value for key, value in forcing.items()}

    if isinstance(operator, AlgebraicOperator):
        # an algebraic row may carry any sign: make it that of the plus operator by its diagonal
        return replace(operator, matrix=tuple(tuple(flip[i] * flip[j] * operator.matrix[i][j] for j in range(n)) for i in range(n)),
                       forcing=tuple(scaled(operator.forcing[i], flip[i]) for i in range(n)), recovery=recovery)

    def rows(boundary: BoundaryRows) -> BoundaryRows:
        matrix = tuple(tuple(row[j] * flip[j] * flip[pivot] for j in range(n)) for row, pivot in zip(boundary.matrix, boundary.pivots, strict=True))
        return replace(boundary, matrix=matrix, forcing=tuple(scaled(one, flip[pivot]) for one, pivot in zip(boundary.forcing, boundary.pivots, strict=True)))

    return replace(operator, matrix=tuple(tuple(flip[i] * flip[j] * operator.matrix[i][j] for j in range(n)) for i in range(n)),
                   forcing=tuple(scaled(operator.forcing[i], flip[i]) for i in range(n)), recovery=recovery, left=rows(operator.left), right=rows(operator.right))


def same(one: Operator, other: Operator, probe) -> bool:  # type: ignore[no-untyped-def]
    """Tell whether two operators have equal matrices and boundary rows."""
    pairs = [(one.matrix, other.matrix)]
    if isinstance(one, FirstOrderOperator) and isinstance(other, FirstOrderOperator):
        pairs += [(one.left.matrix, other.left.matrix), (one.right.matrix, other.right.matrix)]
    return all(
        len(a) == len(b) and all(probe.is_zero(x - y) for row, line in zip(a, b, strict=True) for x, y in zip(row, line, strict=True)) for a, b in pairs
    )


def reduce_to_amplitude(expansion: Expansion, onset: Onset, operators: Mapping[int, Operator]) -> Reduction:
    """Return the amplitude equation with its coefficients as solvability integrals."""
    formulation = expansion.formulation
    hopf = onset.kind == "hopf"
    vector = formulation.frame is not None
    growth: Expr = I * OMEGA if hopf else Integer(0)
    weight = 1 if vector else 0
    functions = Functions(space=formulation.space, reserved=frozenset(symbol.name for symbol in (formulation.control, *formulation.parameters)))
    critical = critical_operator(expansion, operators, weight, growth, onset)
    unknowns = formulation.unknowns
    phi = tuple(Symbol("phi" if k == 0 else f"phi_{k}") for k in range(critical.size))
    bars = {symbol: Symbol(symbol.name.replace("phi", "phi_bar")) for symbol in phi}
    for k, symbol in enumerate(phi):
        slope = sum((critical.matrix[k][j] * phi[j] for j in range(critical.size)), Integer(0)) if isinstance(critical, FirstOrderOperator) else Integer(0)
        functions.declare(symbol, slope)
        functions.declare(bars[symbol], conjugated(slope, bars))

    def mode_values(operator: Operator) -> dict[int, Expr]:
        values = {k: sum((over[j] * phi[j] for j in range(len(phi))), Integer(0)) for k, (over, _) in operator.recovery.items()}
        return {k: value for k, value in values.items() if value != 0}

    plus_values = mode_values(critical)
    minus: Operator | None = None
    if vector:
        raw_minus = critical_operator(expansion, operators, -1, growth, onset)
        minus = reflected(critical, raw_minus, expansion)
        minus_values = mode_values(minus)
        amplitudes: tuple[Amplitude, ...]
        partner = {unknown.index: unknown.index + 1 if unknown.weight == 1 else unknown.index - 1 for unknown in unknowns if unknown.weight}
        if hopf:
            amplitudes = (Amplitude(name="Ap", harmonic=1, weight=1, conjugate=False), Amplitude(name="Am", harmonic=1, weight=-1, conjugate=False),
                          Amplitude(name="Cp", harmonic=-1, weight=1, conjugate=True), Amplitude(name="Cm", harmonic=-1, weight=-1, conjugate=True))
            values = [plus_values, minus_values, {partner[k]: conjugated(v, bars) for k, v in minus_values.items()},
                      {partner[k]: conjugated(v, bars) for k, v in plus_values.items()}]
        else:
            amplitudes = (Amplitude(name="Ap", harmonic=0, weight=1, conjugate=False), Amplitude(name="Am", harmonic=0, weight=-1, conjugate=False))
            values = [plus_values, minus_values]
    elif hopf:
        amplitudes = (Amplitude(name="A", harmonic=1, weight=0, conjugate=False), Amplitude(name="Ac", harmonic=-1, weight=0, conjugate=True))
        values = [plus_values, {k: conjugated(v, bars) for k, v in plus_values.items()}]
    else:
        amplitudes = (Amplitude(name="A", harmonic=0, weight=0, conjugate=False),)
        values = [plus_values]
    orders = Orders(expansion, amplitudes, functions, growth)
    for index, value in enumerate(values):
        orders.contributions.append(Contribution(monomial=orders.unit(index), order=1, harmonic=amplitudes[index].harmonic, values=value))
    leading = critical.recovery[formulation.normalised[0]][0]
    mode = Mode(operator=critical, phi=phi, phi_bar=tuple(bars[symbol] for symbol in phi), contributions=tuple(orders.contributions), normalisation=leading, growth=growth)
    solvability = solvability_of(critical, functions, formulation)
    mirrored = solvability_of(minus, functions, formulation) if minus is not None else None
    named_operators: dict[str, Operator] = {"critical": critical}

    # Responses: the non-resonant monomials of second order that the cubic terms need.
    needed: tuple[tuple[int, ...], ...]
    if vector:
        needed = ((1, 0, 0, 1), (0, 1, 1, 0), (1, 1, 0, 0)) if hopf else ((1, 1),)
    else:
        needed = ((2, 0), (1, 1)) if hopf else ((2,),)
    quadratic: Coefficient | None = None
    rows_of_kind = (("row", expansion.rows), *zip(("left", "right"), expansion.ends, strict=False))

    def given(make, weight_wanted: int, stem: str) -> Given:  # type: ignore[no-untyped-def]
        result: Given = {}
        for kind, rows in rows_of_kind:
            for number, row in enumerate(rows):
                if row.weight == weight_wanted:
                    value = make(row)
                    if value != 0:
                        result[kind, number] = functions.named(f"{stem}_{number}", value) if kind == "row" else value
        return result

    def coefficient(monomial: str, forcing: Given, condition: Solvability) -> Coefficient:
        integrand, ends = condition.applied(forcing, functions)
        names = formulation.problem.coefficient_names
        name = names.get(monomial, monomial)
        return Coefficient(monomial=monomial, name=name, identifier=identifier_of(monomial, name), integrand=integrand, left=ends["left"], right=ends["right"], forcing=forcing)

    if not vector and not hopf:
        quadratic = coefficient("A**2", given(lambda row: orders.at(row, (2,)), weight, "f_A2"), solvability)
    responses: list[Response] = []
    blocks: dict[str, frozenset[int] | None] = {}
    for monomial in needed:
        harmonic, own_weight = orders.harmonic(monomial), orders.weight(monomial)
        if own_weight not in expansion.weights:
            continue
        singular = not vector and not hopf
        block = None if singular else driven_block(orders, monomial)
        name = "critical" if singular else f"operator_{harmonic}"
        while blocks.setdefault(name, block) != block:
            name += "_"
        if name not in named_operators:
            named_operators[name] = response_operator(expansion, operators[own_weight], own_weight, harmonic * growth, block)
        response = respond(orders, monomial, named_operators[name], name, singular)
        if response is not None:
            responses.append(response)

    first = orders.contributions[0]
    xi = coefficient("dA/dt", given(lambda row: orders.slow(row.linear(), first), weight, "f_slow"), solvability)
    control = formulation.control

    def shifted(row) -> Expr:  # type: ignore[no-untyped-def]
        return orders.linear({jet: value.diff(control) for jet, value in row.linear().items()}, first)

    coefficients = [coefficient("mu*A", given(shifted, weight, "f_mu"), solvability)]
    mirror: list[tuple[str, Coefficient]] = []
    mirror_xi: Coefficient | None = None
    if not vector:
        target, text = ((2, 1), "A**2*conj(A)") if hopf else ((3,), "A**3")
        coefficients.append(coefficient(text, given(lambda row: orders.at(row, target), weight, "f_cubic"), solvability))
    elif hopf:
        x, y = (2, 0, 0, 1), (1, 1, 1, 0)
        coefficients.append(coefficient("dot(A,A)*conj(A)", given(lambda row: orders.at(row, y) - orders.at(row, x), weight, "f_alpha"), solvability))
        coefficients.append(coefficient("dot(A,conj(A))*A", given(lambda row: 2 * orders.at(row, x), weight, "f_beta"), solvability))
        x, y = (0, 2, 1, 0), (1, 1, 0, 1)
        assert mirrored is not None
        mirror.append((coefficients[1].identifier, coefficient("dot(A,A)*conj(A)", given(lambda row: orders.at(row, y) - orders.at(row, x), -1, "f_alpha_mirror"), mirrored)))
        mirror.append((coefficients[2].identifier, coefficient("dot(A,conj(A))*A", given(lambda row: 2 * orders.at(row, x), -1, "f_beta_mirror"), mirrored)))
    else:
        coefficients.append(coefficient("dot(A,A)*A", given(lambda row: orders.at(row, (2, 1)), weight, "f_cubic"), solvability))
        assert mirrored is not None
        mirror.append((coefficients[1].identifier, coefficient("dot(A,A)*A", given(lambda row: orders.at(row, (1, 2)), -1, "f_cubic_mirror"), mirrored)))
    by_identifier = {one.identifier: one for one in coefficients}
    mirror = [(identifier, one) for identifier, one in mirror if not all(
        expand(getattr(one, part) - getattr(by_identifier[identifier], part)) == 0 for part in ("integrand", "left", "right"))]
    weak: list[Weak] = []
    if vector:
        second = orders.contributions[1]
        assert mirrored is not None
        mirror_xi = coefficient("dA/dt", given(lambda row: orders.slow(row.linear(), second), -1, "f_slow_mirror"), mirrored)
        for r, (row_weight, condition) in enumerate(((1, solvability), (-1, mirrored))):
            for c, contribution in enumerate((first, second)):
                forcing = given(lambda row, one=contribution: orders.linear(row.weak, one), row_weight, f"f_weak_{'pm'[r]}{'pm'[c]}")
                if forcing:
                    weak.append(Weak(row=r, column=c, coefficient=coefficient("epsilon", forcing, condition)))
    else:
        forcing = given(lambda row: orders.linear(row.weak, first), weight, "f_weak")
        if forcing:
            coefficients.append(coefficient("epsilon*A", forcing, solvability))
    order_of = {text: k for k, text in enumerate(VECTOR_MONOMIALS[1:4] if vector else SCALAR_MONOMIALS[1:4])}
    coefficients.sort(key=lambda one: (one.monomial.startswith("epsilon"), one.monomial == "mu*A", order_of.get(one.monomial, 0)))
    spare = [(side, ", ".join(labels), condition) for response in responses for side, labels, condition in response.spare]
    linear_spare: list[tuple[str, str, Expr]] = []
    third = {"": critical.spare, **({"left": critical.left.spare, "right": critical.right.spare} if isinstance(critical, FirstOrderOperator) else {})}
    demanded = [(one.monomial, one.identifier, one.forcing) for one in (*coefficients, *([quadratic] if quadratic is not None else []))]
    demanded += [("epsilon", weak_identifier(one), one.coefficient.forcing) for one in weak if one.row == 0]
    for side, rows in third.items():
        for row in rows:
            slow = forced(row, {key: -value for key, value in xi.forcing.items()}, functions)
            for text, identifier, terms in demanded:  # with dA/dt from the amplitude equation, the row must hold at each monomial
                condition = forced(row, {key: -value for key, value in terms.items()}, functions) + Symbol(identifier) * slow
                if condition != 0:
                    kept = linear_spare if text == "A**2" or text.startswith(("epsilon", "mu")) else spare
                    kept.append((side, ", ".join(labels_of(row, expansion)), condition))
    return Reduction(
        kind=onset.kind, vector=vector, amplitudes=amplitudes, mode=mode, responses=tuple(responses), solvability=solvability, xi=xi, coefficients=tuple(coefficients),
        quadratic=quadratic, mirror=tuple(mirror), mirror_xi=mirror_xi if mirror or any(one.row for one in weak) else None, weak=tuple(weak), spare=tuple(spare),
        linear_spare=tuple(linear_spare), functions=functions, operators=named_operators,
    )


def weak_identifier(weak: Weak) -> str:
    """Return the name of the integral of a weak effect on a vector amplitude."""
    return f"weak_{'pm'[weak.row]}{'pm'[weak.column]}"


def identifier_of(monomial: str, name: str) -> str:
    """Return a Python identifier for a coefficient."""
    if name.isidentifier() and name.isascii():
        return f"coefficient_{name}"
    table = {"mu*A": "mu_A", "A**2*conj(A)": "A2_conj_A", "A**2": "A2", "A**3": "A3", "epsilon*A": "epsilon_A", "dot(A,A)*conj(A)": "dot_A_A_conj_A",
             "dot(A,conj(A))*A": "dot_A_conj_A_A", "dot(A,A)*A": "dot_A_A_A", "dA/dt": "xi", "epsilon": "epsilon"}
    return f"coefficient_{table[monomial]}"
