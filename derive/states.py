r"""Relative equilibria of the amplitude equation and their stability, in closed form in the coefficients.

A relative equilibrium is :math:`A = e^{i\nu t}\bar{A}`. Everything follows from the right-hand side of the amplitude equation by
differentiation: :math:`\dot a = P a + Q a^*` about a state, where P and Q are its Wirtinger derivatives, with :math:`\nu`
eliminated by the steady equation. Weak effects (epsilon) are left out: these are the states of the nominal equation.

Why there are no others. Complex vector: the cross product of the steady equation with :math:`\bar{A}` leaves
:math:`\alpha(\bar{A}\cdot\bar{A})\,\bar{A}\times\bar{A}^* = 0`, so the state is planar or circular; and an ellipse that turns
about the axis has constant :math:`|A|^2` and :math:`B = A^*\times A \neq 0`, whose rates leave :math:`\alpha_r |A\cdot A|^2 = 0`.
Otherwise the right-hand side is a multiple of A by an invariant of A.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sympy import Expr, I, ImmutableMatrix, Integer, Matrix, Poly, Symbol, cancel, expand, eye, factor_list, solve, sqrt, symbols

from derive.statement import DerivationError

if TYPE_CHECKING:
    from derive.derivation import Derivation

MU = Symbol("mu", real=True)
NU = Symbol("nu", real=True)
SIGMA = Symbol("sigma")
MAGNITUDE = Symbol("size", positive=True)  # |A| of the state; of a real scalar A itself
TURN = Symbol("turn")  # e^{i theta}: its conjugate is 1/E
COSINE, SINE = symbols("turn_cos turn_sin", real=True)  # of 2 theta
SQUARE, AREA = symbols("square surface", real=True)  # |A|^2 and |B| = |A* x A|
DOT, DOT_BAR = symbols("dot dot_bar")  # A.A and its conjugate
A1, A2, C1, C2 = symbols("A1 A2 C1 C2")  # components of A and of conj(A), independent as in Wirtinger's calculus

KINDS = {("hopf", True): "complex vector", ("hopf", False): "complex scalar", ("steady", True): "real vector", ("steady", False): "real scalar"}

# A monomial (x . y) z, or x z, or z, as its factors.
FACTORS: Mapping[str, tuple[str, ...]] = {
    "mu*A": ("A",), "A**2": ("A", "A"), "A**3": ("A", "A", "A"), "A**2*conj(A)": ("A", "A*", "A"),
    "dot(A,A)*A": ("A", "A", "A"), "dot(A,A)*conj(A)": ("A", "A", "A*"), "dot(A,conj(A))*A": ("A", "A*", "A"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A monomial with its coefficient: the symbol, that of its conjugate, and its parts."""

    monomial: str
    name: str
    value: Symbol
    conjugate: Symbol
    real: Symbol
    imaginary: Expr

    @property
    def factors(self) -> tuple[str, ...]:
        """Return the vectors that are multiplied."""
        return FACTORS[self.monomial]

    @property
    def scale(self) -> Expr:
        """Return mu for the linear term, else 1."""
        return MU if len(self.factors) == 1 else Integer(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """The amplitude equation as a function of A and conj(A)."""

    kind: str
    terms: tuple[Term, ...]

    @property
    def is_complex(self) -> bool:
        """Tell whether the amplitude is complex."""
        return self.kind.startswith("complex")

    @property
    def dimension(self) -> int:
        """Return the number of components of A."""
        return 2 if self.kind.endswith("vector") else 1

    @property
    def linear(self) -> Term:
        """Return the term mu A."""
        return next(term for term in self.terms if term.monomial == "mu*A")

    @property
    def unknown(self) -> Expr:
        """Return the power of the magnitude that the nonlinear terms hold, next to A itself."""
        return MAGNITUDE ** (max(len(term.factors) for term in self.terms) - 1)

    def rate(self, A: Matrix, C: Matrix) -> Matrix:
        """Return dA/dt."""
        total = Matrix([0] * self.dimension)
        for term in self.terms:
            *scalars, last = (C if factor == "A*" else A for factor in term.factors)
            weight = scalars[0].dot(scalars[1]) if len(scalars) == 2 else scalars[0][0] if scalars else Integer(1)
            total += term.value * term.scale * weight * last
        return total

    def conjugated(self, expression: Expr) -> Expr:
        """Return the conjugate of an expression in the coefficients and e^{i theta}."""
        swaps: dict[Any, Any] = {I: -I, TURN: 1 / TURN, DOT: DOT_BAR, DOT_BAR: DOT}
        for term in self.terms:
            swaps |= {term.value: term.conjugate, term.conjugate: term.value}
        return expression.xreplace(swaps)

    def in_parts(self, expression: Expr) -> Expr:
        """Return an expression in the real and imaginary parts of the coefficients, as a fraction in lowest terms."""
        parts = {term.value: term.real + I * term.imaginary for term in self.terms} | {term.conjugate: term.real - I * term.imaginary for term in self.terms}
        return cancel(expression.xreplace(parts))


@dataclass(frozen=True, slots=True, kw_only=True)
class Eigenvalue:
    """An eigenvalue of the linearisation: by the magnitude of the state, and in the coefficients alone (real and imaginary part)."""

    by_magnitude: Expr
    real: Expr
    imaginary: Expr
    direction: str
    neutral: tuple[str, ...]  # the symmetries whose generators it belongs to

    @property
    def value(self) -> Expr:
        """Return the eigenvalue in the coefficients."""
        return self.real + I * self.imaginary


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A relative equilibrium and its linearisation a' = P a + Q a*, in the components along e and n x e."""

    name: str
    shape: ImmutableMatrix
    condition: Expr  # equals i nu
    nonlinear: Expr  # the coefficient that must balance mu Re gamma: (real part of) kappa in kappa |A|^2 + gamma mu = i nu
    amplitude_squared: Expr
    peak_squared: Expr
    frequency_correction: Expr
    P: ImmutableMatrix
    Q: ImmutableMatrix
    eigenvalues: tuple[Eigenvalue, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """The law at mu = 0 of perturbations of one shape: |A| ~ (-rate t)^exponent if `rate` is negative; if positive, |A| is infinite in finite time."""

    perturbation: str
    rate: Expr
    exponent: Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """The states of one amplitude equation, and what happens at its threshold."""

    equation: Equation
    states: tuple[State, ...]
    thresholds: tuple[Threshold, ...]
    selection: Expr  # of a complex vector: if negative a general perturbation ends as the last threshold, if positive as the first

    def __getitem__(self, name: str) -> State:
        for state in self.states:
            if state.name == name:
                return state
        raise KeyError(f"{name}: expected one of {', '.join(state.name for state in self.states)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class States:
    """The states of a problem; of a real scalar with A**2 (transcritical) and without it (pitchfork)."""

    problem: str
    analyses: tuple[Analysis, ...]
    weak: tuple[str, ...]  # the monomials of weak effects, left out

    def __getitem__(self, name: str) -> State:
        return self.analyses[0][name]

    @property
    def equation(self) -> Equation:
        """Return the (first) amplitude equation."""
        return self.analyses[0].equation

    def latex(self) -> str:
        """Return the states, their stability and the proofs as displays."""
        from derive.states_latex import latex

        return latex(self)

    def emit(self) -> str:
        """Return the text that the numeric layer evaluates."""
        from derive.states_text import emit

        return emit(self)

    def _repr_latex_(self) -> str:
        from derive.states_latex import summary

        return f"$$\n{summary(self)}\n$$"

    def as_dict(self) -> dict[str, Any]:
        """Return the closed forms as text."""
        from derive.states_text import as_dict

        return as_dict(self)

    def __repr__(self) -> str:
        return f"States({self.problem!r}, {self.equation.kind}: {', '.join(state.name for state in self.analyses[0].states)})"


def derive_states(derivation: Derivation) -> States:
    """Return all relative equilibria of the amplitude equation, with their stability.

    Notes
    -----
    Source: labels ``steady amplitude`` to ``nonplanar powerlaws`` of the paper.
    """
    reduction = derivation.reduction
    kind = KINDS[reduction.kind, reduction.vector]
    listed = [(one.monomial, one.name) for one in reduction.coefficients if not one.monomial.startswith("epsilon")]
    weak = tuple(one.monomial for one in reduction.coefficients if one.monomial.startswith("epsilon")) + (("epsilon*dot(A,ej)*ei",) if reduction.weak else ())
    equations = [listed]
    quadratic = reduction.quadratic
    if quadratic is not None and any(value != 0 for value in (quadratic.integrand, quadratic.left, quadratic.right)):
        equations.append([(quadratic.monomial, quadratic.name), *((monomial, name) for monomial, name in listed if monomial == "mu*A")])
    return States(problem=derivation.problem.name, weak=weak, analyses=tuple(analyse(equation_of(kind, terms)) for terms in equations))


def equation_of(kind: str, terms: list[tuple[str, str]]) -> Equation:
    """Return the amplitude equation of given monomials; the coefficients of a steady bifurcation are real."""
    made = []
    for k, (monomial, name) in enumerate(terms, 1):
        real = Symbol(f"c{k}_r", real=True)
        if kind.startswith("complex"):
            made.append(Term(monomial=monomial, name=name, value=Symbol(f"c{k}"), conjugate=Symbol(f"c{k}_bar"), real=real, imaginary=Symbol(f"c{k}_i", real=True)))
        else:
            made.append(Term(monomial=monomial, name=name, value=real, conjugate=real, real=real, imaginary=Integer(0)))
    return Equation(kind=kind, terms=tuple(made))


def amplitudes(equation: Equation) -> tuple[Matrix, Matrix]:
    """Return A and conj(A) as components."""
    A = Matrix([A1, A2][: equation.dimension])
    return A, Matrix([C1, C2][: equation.dimension]) if equation.is_complex else A


def cross(x: Matrix, y: Matrix) -> Expr:
    """Return the component of the cross product along the axis."""
    return x[0] * y[1] - x[1] * y[0]


def families(equation: Equation) -> tuple[tuple[str, Matrix], ...]:
    """Return the shapes of all states but A = 0, in the directions e and n x e.

    Raises
    ------
    DerivationError
        The equation is not of the form for which these are all.
    """
    if equation.dimension == 1:
        return (("cycle", Matrix([MAGNITUDE * TURN])),) if equation.is_complex else (("branch", Matrix([MAGNITUDE])),)
    if not equation.is_complex:
        return (("branch", Matrix([MAGNITUDE, 0])),)
    # A x (steady equation): what is left must be alpha (A.A) (A x A*), of which one factor vanishes
    A, C = amplitudes(equation)
    left = expand(cross(A, equation.rate(A, C)))
    alpha = next(term for term in equation.terms if term.monomial == "dot(A,A)*conj(A)").value
    if expand(left - alpha * A.dot(A) * cross(A, C)) != 0:
        raise DerivationError("states: found a steady equation whose cross product with the amplitude has other factors than A.A and A x A*")
    planar = Matrix([MAGNITUDE * TURN, 0])  # A x A* = 0
    circular = Matrix([MAGNITUDE, I * MAGNITUDE]) / sqrt(2)  # A.A = (A_1 + i A_2)(A_1 - i A_2) = 0; the other sense by reflection
    return ("beating", planar), ("whirling", circular)


def analyse(equation: Equation) -> Analysis:
    """Return the states of an amplitude equation with their linearisation and eigenvalues."""
    states = [trivial_state(equation), *(state_of(equation, name, shape) for name, shape in families(equation))]
    laws = thresholds(equation, tuple(states))
    return Analysis(equation=equation, states=tuple(states), thresholds=laws, selection=selection(equation))


def linearised(equation: Equation, shape: Matrix, rotation: Expr) -> tuple[Matrix, Matrix]:
    """Return P and Q of a' = P a + Q a* about a state, in the frame that turns with it; `rotation` is i nu by the steady equation (0 when steady)."""
    A, C = amplitudes(equation)
    rate = equation.rate(A, C)
    there = dict(zip(A, shape, strict=True))
    if equation.is_complex:
        there |= dict(zip(C, shape.applyfunc(equation.conjugated), strict=True))
    P = rate.jacobian(A).xreplace(there) - rotation * eye(equation.dimension)
    Q = rate.jacobian(C).xreplace(there) if equation.is_complex else Matrix.zeros(equation.dimension)
    return P.applyfunc(expand), Q.applyfunc(expand)


def real_system(equation: Equation, P: Matrix, Q: Matrix) -> Matrix:
    """Return the matrix of the system for the real and imaginary parts, component after component, over |A|^2."""
    def parts(entry: Expr) -> tuple[Expr, Expr]:
        turned = expand(entry / MAGNITUDE**2).xreplace({TURN**2: COSINE + I * SINE, TURN**-2: COSINE - I * SINE})
        return expand(equation.in_parts(turned)).as_real_imag()

    if not equation.is_complex:
        return Matrix(P)
    n = equation.dimension
    result = Matrix.zeros(2 * n)
    for i in range(n):
        for j in range(n):
            (p, p_i), (q, q_i) = parts(P[i, j]), parts(Q[i, j])
            result[2 * i:2 * i + 2, 2 * j:2 * j + 2] = Matrix([[p + q, q_i - p_i], [p_i + q_i, p - q]])
    return result.applyfunc(expand)


def characteristic(equation: Equation, P: Matrix, Q: Matrix) -> Expr:
    """Return the characteristic polynomial of a' = P a + Q a*, as a system for a and a*."""
    n = P.shape[0]
    system = P
    if equation.is_complex:
        system = Matrix.vstack(Matrix.hstack(P, Q), Matrix.hstack(Q.applyfunc(equation.conjugated), P.applyfunc(equation.conjugated)))
        n *= 2
    return expand((SIGMA * eye(n) - system).det(method="laplace"))  # no simplification on the way


def linear_roots(polynomial: Expr) -> list[Expr]:
    """Return the roots of a polynomial in sigma that splits into linear factors over the coefficients."""
    result = []
    for part, count in factor_list(polynomial)[1]:
        if SIGMA not in part.free_symbols:
            continue
        if Poly(part, SIGMA).degree() != 1:
            raise DerivationError("states: found an irreducible factor of the characteristic polynomial; expected linear ones")
        slope, constant = Poly(part, SIGMA).all_coeffs()
        result += [cancel(-constant / slope)] * count
    return result


def trivial_state(equation: Equation) -> State:
    """Return A = 0 with its eigenvalues."""
    P, Q = linearised(equation, Matrix([0] * equation.dimension), Integer(0))
    gamma = equation.linear
    values = [gamma.value * MU, gamma.conjugate * MU] if equation.is_complex else [gamma.value * MU]
    eigenvalues = []
    for direction in ("e1", "e2") if equation.dimension == 2 else ("amplitude",):
        for value in values:
            real, imaginary = equation.in_parts(value).as_real_imag()
            eigenvalues.append(Eigenvalue(by_magnitude=value, real=real, imaginary=imaginary, direction=direction, neutral=()))
    if Counter(linear_roots(characteristic(equation, P, Q))) != Counter(one.by_magnitude for one in eigenvalues):
        raise DerivationError("states: found other eigenvalues of the base state than those of mu A")
    zero = Integer(0)
    return State(name="undeformed" if equation.kind == "complex vector" else "base", shape=ImmutableMatrix([0] * equation.dimension), condition=zero, nonlinear=zero,
                 amplitude_squared=zero, peak_squared=zero, frequency_correction=zero, P=ImmutableMatrix(P), Q=ImmutableMatrix(Q), eigenvalues=tuple(eigenvalues))


def base_eigenvectors(equation: Equation) -> tuple[tuple[Expr, Matrix], ...]:
    """Return the eigenvalues of A = 0 over mu with the eigenvectors (a_r, a_i) of one direction.

    Notes
    -----
    Source: labels ``stability stationary sys`` and ``stationary stability eigenvectors`` of the paper.
    """
    gamma = equation.linear
    system = Matrix([[gamma.real, -gamma.imaginary], [gamma.imaginary, gamma.real]])
    result = []
    for value in (gamma.value, gamma.conjugate):
        parts = equation.in_parts(value)
        vector = (system - parts * eye(2)).nullspace()[0].applyfunc(cancel)
        result.append((value, (vector / vector[0]).applyfunc(cancel)))
    return tuple(result)


def state_of(equation: Equation, name: str, shape: Matrix) -> State:
    """Return a family of states: magnitude, frequency, existence, linearisation and eigenvalues."""
    reflected = shape.applyfunc(equation.conjugated)
    rate = equation.rate(shape, reflected).applyfunc(expand)
    # kappa |A|^2 + gamma mu = i nu, from conj(A) . dA/dt
    condition = expand(cancel(reflected.dot(rate) / MAGNITUDE**2))
    if (rate - condition * shape).applyfunc(expand) != Matrix([0] * equation.dimension):
        raise DerivationError(f"states: found a {name} state that does not meet the steady equation")
    unknown = equation.unknown
    kappa = expand(condition).coeff(unknown)
    parts = equation.in_parts(kappa), equation.in_parts(equation.linear.value)
    (kappa_r, kappa_i), (gamma_r, gamma_i) = (expand(part).as_real_imag() for part in parts)
    size = -MU * gamma_r / kappa_r
    solution = size if unknown == MAGNITUDE**2 else size**2
    S, N = shape.dot(shape), reflected.dot(shape)
    modulus = sqrt(expand(S * equation.conjugated(S)))
    # the largest |A e^{i omega t} + c.c.|^2 = 2 |A|^2 + 2 |A.A|                 [label: axes]
    peak = expand((2 * (N + modulus) if equation.is_complex else N) / MAGNITUDE**2) * solution
    P, Q = linearised(equation, shape, condition)
    return State(
        name=name, shape=ImmutableMatrix(shape), condition=condition, nonlinear=kappa_r, amplitude_squared=solution, peak_squared=peak,
        frequency_correction=MU * gamma_i + kappa_i * size if equation.is_complex else Integer(0), P=ImmutableMatrix(P), Q=ImmutableMatrix(Q),
        eigenvalues=eigenvalues_of(equation, name, shape, P, Q, unknown, size),
    )


def eigenvalues_of(equation: Equation, name: str, shape: Matrix, P: Matrix, Q: Matrix, unknown: Expr, size: Expr) -> tuple[Eigenvalue, ...]:
    """Return the eigenvalues, first those of perturbations along the state (x A with a number x), then the others."""
    reflected = shape.applyfunc(equation.conjugated)
    along_P, along_Q = (expand(cancel(reflected.dot(value) / MAGNITUDE**2)) for value in (P * shape, Q * reflected))
    along = linear_roots(characteristic(equation, Matrix([along_P]), Matrix([along_Q])))
    across = list((Counter(linear_roots(characteristic(equation, P, Q))) - Counter(along)).elements())
    symmetries = neutral_symmetries(equation, shape, P, Q)
    result = []
    for block, values in (("along", along), ("across", across)):
        for value in sorted(values, key=lambda root: (root != 0, str(root))):
            closed = equation.in_parts(value).subs(unknown, size)
            real, imaginary = (cancel(part) for part in expand(closed).as_real_imag())
            neutral = symmetries[block] if value == 0 else ()
            if (value == 0) != bool(neutral):
                raise DerivationError(f"states: found a zero eigenvalue of {name} that no symmetry explains")
            result.append(Eigenvalue(by_magnitude=equation.in_parts(value), real=real, imaginary=imaginary, direction=direction_of(equation, name, block, neutral), neutral=neutral))
    return tuple(result)


def neutral_symmetries(equation: Equation, shape: Matrix, P: Matrix, Q: Matrix) -> dict[str, tuple[str, ...]]:
    """Return the symmetries that move a state, each where its generator lies; the linearisation annihilates the generator."""
    generators = {}
    if equation.is_complex:
        generators["phase"] = I * shape
    if equation.dimension == 2:
        generators["rotation"] = Matrix([-shape[1], shape[0]])
    found: dict[str, tuple[str, ...]] = {"along": (), "across": ()}
    for symmetry, generator in generators.items():
        image = P * generator + Q * generator.applyfunc(equation.conjugated)
        if any(expand(entry) != 0 for entry in image):
            raise DerivationError(f"states: found a {symmetry} that the linearisation does not leave neutral")
        block = "along" if equation.dimension == 1 or expand(cross(shape, generator)) == 0 else "across"
        found[block] += (symmetry,)
    return found


def direction_of(equation: Equation, name: str, block: str, neutral: tuple[str, ...]) -> str:
    """Return the name of a direction in which a state is perturbed."""
    if name == "beating":
        return "parallel" if block == "along" else "perpendicular"
    if neutral:
        return neutral[0]
    return "radial" if block == "along" else "transverse"


def thresholds(equation: Equation, states: tuple[State, ...]) -> tuple[Threshold, ...]:
    r"""Return the laws at mu = 0 of perturbations with the shape of a state.

    Notes
    -----
    :math:`|A|^2 \sim p/t` and :math:`|B| \sim q/t`, with B = A* x A, are put into the rates of both.
    Source: labels ``nonlinear stability planar sol`` and ``nonplanar powerlaws`` of the paper.
    """
    if equation.kind != "complex vector":
        kappa = states[1].nonlinear
        quadratic = equation.unknown == MAGNITUDE
        return (Threshold(perturbation="any", rate=kappa if quadratic else 2 * kappa, exponent=Integer(-1) if quadratic else -Integer(1) / 2),)
    p, q = symbols("p q", positive=True)
    square, area = invariant_rates(equation)
    at_power = {SQUARE: p, AREA: q, MU: Integer(0)}
    first, second = (equation.in_parts(rate).subs(at_power) for rate in (square, area))
    planar = solve(-p - first.subs(q, 0), p, check=False)
    spatial = solve([-p - first, -q - second], [p, q], dict=True, check=False)
    laws = {"planar": [root for root in planar if root != 0], "circular": [root[p] for root in spatial if root.get(q, 0) != 0]}
    return tuple(Threshold(perturbation=name, rate=cancel(-1 / roots[0]), exponent=-Integer(1) / 2) for name, roots in laws.items())


def pair(x: str, y: str) -> Expr:
    """Return a dot product of A and conj(A) by its name."""
    return SQUARE if x != y else DOT if x == "A" else DOT_BAR


def invariant_rates(equation: Equation) -> tuple[Expr, Expr]:
    """Return d|A|^2/dt and d|B|/dt in |A|^2 and |B|, B = A* x A, by the product rule.

    Notes
    -----
    |A.A|^2 = |A|^4 - |B|^2. Source: label ``relations`` of the paper.
    """
    square = dot_rate(equation, "A*")
    square = expand((square + equation.conjugated(square)).subs(DOT * DOT_BAR, SQUARE**2 - AREA**2))
    # A* x dA/dt: the terms along A keep A* x A
    crossed = sum((term.value * term.scale * weight(term) for term in equation.terms if term.factors[-1] == "A"), Integer(0))
    return square, expand((crossed + equation.conjugated(crossed)) * AREA)


def weight(term: Term) -> Expr:
    """Return the scalar that a term multiplies its last factor by."""
    return pair(*term.factors[:2]) if len(term.factors) == 3 else Integer(1)


def dot_rate(equation: Equation, factor: str) -> Expr:
    """Return factor . dA/dt in the dot products of A and conj(A)."""
    return expand(sum((term.value * term.scale * weight(term) * pair(factor, term.factors[-1]) for term in equation.terms), Integer(0)))


def selection(equation: Equation) -> Expr:
    r"""Return what decides the shape in which a general perturbation of a complex vector ends: alpha_r; 0 for the others.

    Notes
    -----
    With :math:`d\theta = |A|^2 dt` the shape :math:`\rho = |B|/|A|^2` obeys :math:`d\rho/d\theta = -2\alpha_r\rho(1 - \rho^2)`.
    """
    if equation.kind != "complex vector":
        return Integer(0)
    square, area = invariant_rates(equation)
    rho = Symbol("rho")
    shape_rate = equation.in_parts(cancel((area / SQUARE - AREA * square / SQUARE**2).subs(AREA, rho * SQUARE) / SQUARE))
    return cancel(-shape_rate / (2 * rho * (1 - rho**2)))
