r"""The amplitude equation: which monomials symmetry allows, and the solvability integral of each.

Kinds: complex scalar (Hopf), complex vector (double Hopf by rotation), real scalar (transcritical or pitchfork), real vector
(steady with rotation). In circular components :math:`A_\pm = A_1 \pm i A_2` the vector equation

.. math:: \dot{A} = \gamma\mu A + \alpha\,(A\cdot A)A^* + \beta\,(A\cdot A^*)A

has in its + component :math:`X A_+|A_+|^2 + Y A_+|A_-|^2` with :math:`\beta = 2X`, :math:`\alpha = Y - X`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from sympy import Expr, Integer, Symbol

from derive.expand import expand
from derive.expansion import Expansion, TaylorRow
from derive.formulation import SCALAR_MONOMIALS, VECTOR_MONOMIALS
from derive.functions import Functions
from derive.mode import Mode, at_growth, mode_of
from derive.onset import Onset
from derive.operator import LAMBDA, FirstOrderOperator, coupled_block, reduce_operator
from derive.response import Amplitude, Monomial, Operator, Orders, Response, forced, labels_of, reduced, respond, right_hand_sides
from derive.solvability import Solvability, solvability_of

Given = dict[tuple[str, int], Expr]
Demand = tuple[str, str, Expr]
"""(end or "", the rows, what must vanish)"""

SECOND_ORDER: Mapping[tuple[str, bool], tuple[Monomial, ...]] = {
    ("hopf", True): ((1, 0, 0, 1), (0, 1, 1, 0), (1, 1, 0, 0)), ("hopf", False): ((2, 0), (1, 1)), ("steady", True): ((1, 1),), ("steady", False): ((2,),),
}
"""The non-resonant monomials of second order that the cubic terms need, by kind and rotation axis; that of a real scalar is the resonant one."""

CUBIC: Mapping[tuple[str, bool], tuple[tuple[str, str, Mapping[Monomial, int]], ...]] = {
    ("hopf", True): (  # X A_+|A_+|^2 + Y A_+|A_-|^2: alpha = Y - X, beta = 2 X
        ("dot(A,A)*conj(A)", "f_alpha", {(1, 1, 1, 0): 1, (2, 0, 0, 1): -1}),
        ("dot(A,conj(A))*A", "f_beta", {(2, 0, 0, 1): 2}),
    ),
    ("hopf", False): (("A**2*conj(A)", "f_cubic", {(2, 1): 1}),),
    ("steady", True): (("dot(A,A)*A", "f_cubic", {(2, 1): 1}),),
    ("steady", False): (("A**3", "f_cubic", {(3,): 1}),),
}
"""(monomial, stem of the names, what it is in the monomials of the amplitudes) of every cubic term, by kind and rotation axis."""


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
    spare: tuple[Demand, ...]
    linear_spare: tuple[Demand, ...]  # the same of mu A, the weak effects and A**2
    functions: Functions
    operators: Mapping[str, Operator]


@dataclass(frozen=True, slots=True, kw_only=True)
class Integrals:
    """Makes the solvability integrals of one row of the amplitude equation: of a scalar, or of a circular component, `suffix` "_mirror" for the - one."""

    orders: Orders
    weight: int
    condition: Solvability
    suffix: str

    def forcing(self, stem: str, make: Callable[[TaylorRow], Expr]) -> Given:
        """Return what `make` gives for each row, the functions of s by name."""
        result: Given = {}
        for kind, rows in self.orders.expansion.groups:
            for number, row in enumerate(rows):
                if row.weight == self.weight:
                    value = make(row)
                    if value != 0:
                        result[kind, number] = self.orders.functions.named(f"{stem}_{number}", value) if kind == "row" else value
        return result

    def of(self, monomial: str, forcing: Given) -> Coefficient:
        """Return the integral of a forcing."""
        integrand, ends = self.condition.applied(forcing, self.orders.functions)
        name = self.orders.expansion.formulation.problem.coefficient_names.get(monomial, monomial)
        return Coefficient(monomial=monomial, name=name, identifier=identifier_of(monomial, name), integrand=integrand, left=ends["left"], right=ends["right"], forcing=forcing)

    def slow(self) -> Coefficient:
        """Return xi, the integral that belongs to the slow derivative."""
        own = self.orders.contributions[1 if self.suffix else 0]
        return self.of("dA/dt", self.forcing(f"f_slow{self.suffix}", lambda row: self.orders.slow(row.linear(), own)))

    def shifted(self) -> Coefficient:
        """Return the integral that belongs to mu A."""
        control, own = self.orders.expansion.formulation.control, self.orders.contributions[0]
        return self.of("mu*A", self.forcing("f_mu", lambda row: self.orders.linear({jet: value.diff(control) for jet, value in row.linear().items()}, own)))

    def nonlinear(self, monomial: str, stem: str, terms: Mapping[Monomial, int]) -> Coefficient:
        """Return the integral of a sum of monomials of the amplitudes, mirrored for the - component: + and - change places."""
        own = {tuple(one[k ^ 1] for k in range(len(one))): factor for one, factor in terms.items()} if self.suffix else terms
        return self.of(monomial, self.forcing(f"{stem}{self.suffix}", lambda row: sum((factor * self.orders.at(row, one) for one, factor in own.items()), Integer(0))))


def reduce_to_amplitude(expansion: Expansion, onset: Onset, operators: Mapping[int, Operator]) -> Reduction:
    """Return the amplitude equation with its coefficients as solvability integrals."""
    formulation = expansion.formulation
    vector = formulation.frame is not None
    functions = Functions(space=formulation.space, reserved=frozenset(symbol.name for symbol in (formulation.control, *formulation.parameters)))
    mode = mode_of(expansion, onset, operators, functions)
    orders = Orders(expansion, mode.amplitudes, functions, mode.growth, mode.contributions)
    plus = Integrals(orders=orders, weight=int(vector), condition=solvability_of(mode.operator, functions, formulation), suffix="")
    minus = Integrals(orders=orders, weight=-1, condition=solvability_of(mode.mirrored, functions, formulation), suffix="_mirror") if mode.mirrored is not None else None
    scalar_steady = onset.kind == "steady" and not vector
    quadratic = plus.nonlinear("A**2", "f_A2", {(2,): 1}) if scalar_steady else None
    named: dict[str, Operator] = {"critical": mode.operator}
    responses = tuple(responses_of(orders, SECOND_ORDER[onset.kind, vector], operators, named, singular=scalar_steady))
    xi = plus.slow()
    cubic = CUBIC[onset.kind, vector]
    coefficients = [plus.shifted(), *(plus.nonlinear(*term) for term in cubic)]
    mirror: list[tuple[str, Coefficient]] = []
    weak: list[Weak] = []
    mirror_xi = None
    if minus is not None:
        mirror = [(one.identifier, other) for one, other in zip(coefficients[1:], [minus.nonlinear(*term) for term in cubic], strict=True) if differ(one, other)]
        mirror_xi = minus.slow()
        weak = weak_effects(plus, minus)
        mirror_xi = mirror_xi if mirror or any(one.row for one in weak) else None
    else:
        forcing = plus.forcing("f_weak", lambda row: orders.linear(row.weak, orders.contributions[0]))
        if forcing:
            coefficients.append(plus.of("epsilon*A", forcing))
    listed = VECTOR_MONOMIALS if vector else SCALAR_MONOMIALS
    coefficients.sort(key=lambda one: (one.monomial.startswith("epsilon"), one.monomial == "mu*A", listed.index(one.monomial)))
    demanded = [(one.monomial, one.identifier, one.forcing) for one in (*coefficients, *([quadratic] if quadratic is not None else []))]
    demanded += [("epsilon", weak_identifier(one), one.coefficient.forcing) for one in weak if one.row == 0]
    spare = [(side, ", ".join(labels), condition) for response in responses for side, labels, condition in response.spare]
    linear_spare: list[Demand] = []
    for text, demand in demands(mode.operator, orders, xi, demanded):
        (linear_spare if text == "A**2" or text.startswith(("epsilon", "mu")) else spare).append(demand)
    return Reduction(
        kind=onset.kind, vector=vector, amplitudes=mode.amplitudes, mode=mode, responses=responses, solvability=plus.condition, xi=xi, coefficients=tuple(coefficients),
        quadratic=quadratic, mirror=tuple(mirror), mirror_xi=mirror_xi, weak=tuple(weak), spare=tuple(spare), linear_spare=tuple(linear_spare), functions=functions, operators=named,
    )


def responses_of(orders: Orders, monomials: Iterable[Monomial], operators: Mapping[int, Operator], named: dict[str, Operator], singular: bool) -> Iterator[Response]:
    """Yield the responses of second order; operators that are met get a name in `named`."""
    expansion, growth = orders.expansion, orders.growth
    blocks: dict[str, frozenset[int] | None] = {}
    for monomial in monomials:
        harmonic, weight = orders.harmonic(monomial), orders.weight(monomial)
        if weight not in expansion.weights:
            continue
        block = None if singular else driven_block(orders, monomial)
        name = "critical" if singular else f"operator_{harmonic}"
        while blocks.setdefault(name, block) != block:
            name += "_"
        if name not in named:
            named[name] = response_operator(expansion, operators[weight], weight, harmonic * growth, block)
        response = respond(orders, monomial, named[name], name, singular)
        if response is not None:
            yield response


def driven_block(orders: Orders, monomial: tuple[int, ...]) -> frozenset[int] | None:
    """Return the fields that the forcing at a monomial reaches, or None where it reaches all of its weight, or none, or there is no space."""
    expansion = orders.expansion
    if expansion.formulation.interval is None:
        return None
    weight = orders.weight(monomial)
    rows = dict(expansion.groups)
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


def differ(one: Coefficient, other: Coefficient) -> bool:
    """Tell whether the integrals of the two circular components are written differently."""
    return any(expand(a - b) != 0 for a, b in ((one.integrand, other.integrand), (one.left, other.left), (one.right, other.right)))


def weak_effects(plus: Integrals, minus: Integrals) -> list[Weak]:
    """Return the weak effects of each amplitude component on each."""
    orders = plus.orders
    result = []
    for row, integrals in enumerate((plus, minus)):
        for column, contribution in enumerate(orders.contributions[:2]):
            forcing = integrals.forcing(f"f_weak_{'pm'[row]}{'pm'[column]}", lambda one: orders.linear(one.weak, contribution))
            if forcing:
                result.append(Weak(row=row, column=column, coefficient=integrals.of("epsilon", forcing)))
    return result


def demands(operator: Operator, orders: Orders, xi: Coefficient, demanded: Sequence[tuple[str, str, Mapping[tuple[str, int], Expr]]]) -> Iterator[tuple[str, Demand]]:
    """Yield (monomial, demand) of redundant rows at third order: with dA/dt from the amplitude equation each must hold at each monomial."""
    functions = orders.functions
    third = [("", operator.spare)]
    if isinstance(operator, FirstOrderOperator):
        third += [("left", operator.left.spare), ("right", operator.right.spare)]
    for side, rows in third:
        for row in rows:
            slow = forced(row, {key: -value for key, value in xi.forcing.items()}, functions)
            for text, identifier, terms in demanded:
                condition = forced(row, {key: -value for key, value in terms.items()}, functions) + Symbol(identifier) * slow
                if condition != 0:
                    yield text, (side, ", ".join(labels_of(row, orders.expansion)), condition)


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
