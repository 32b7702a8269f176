r"""The derivation in LaTeX: statement, orders, adjoint, solvability, amplitude equation. It compiles inside amsmath.

A problem with a rotation axis is written in vectors: A, its conjugate, the axis, their dot and cross products, as the paper does. An
equation whose rows are not those of a vector is written in circular components :math:`v_\pm = v\cdot(e_1 \pm i e_2)`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from sympy import Add, Derivative, Expr, I, Integer, Symbol, expand, fraction, lcm, together
from sympy import latex as sympy_latex
from sympy.core.function import AppliedUndef

from derive.amplitude import Coefficient
from derive.harmonics import Harmonics, Monomial
from derive.notation import Notation, added, half, joined, monomial_text, plain, primes
from derive.operator import FirstOrderOperator
from derive.restricted import RestrictedProblem, ScalarAdjoint, conjugate, restricted_problem, scalar_adjoint
from derive.statement import DerivationError, ProblemError, epsilon
from derive.two_times import Equation, Factor, Term, equations_of, stated_terms

if TYPE_CHECKING:
    from derive.derivation import Derivation

PARTS = ("statement", "orders", "adjoint", "solvability", "amplitude")
TITLES = {"statement": "Statement", "orders": "Orders of the expansion", "adjoint": "Adjoint problem", "solvability": "Solvability", "amplitude": "Amplitude equation"}
COMMA = r",\, "
HIGHEST = 8  # half-orders that are written on request


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a derivation; it prints as LaTeX."""

    derivation: Derivation
    part: str

    def latex(self, order: str | None = None, symbols: Mapping[str, str] | None = None) -> str:
        """Return the LaTeX of the part."""
        return latex(self.derivation, self.part, order, symbols)

    def __repr__(self) -> str:
        return self.latex()

    def _repr_latex_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def as_dict(self) -> dict[str, Any]:
        """Return the part as plain data."""
        return {"problem": self.derivation.problem.name, "part": self.part, "latex": self.latex()}


def latex(derivation: Derivation, part: str = "all", order: str | None = None, symbols: Mapping[str, str] | None = None) -> str:
    """Return LaTeX of a part, as displays; `all` is every part with headings.

    Raises
    ------
    ProblemError
        There is no such part, order or symbol.
    """
    if part not in (*PARTS, "all"):
        raise ProblemError(f"part: found {part!r}; expected one of {', '.join((*PARTS, 'all'))}")
    writer = Writer(derivation, symbols)
    if order is not None:
        if part not in ("orders", "all"):
            raise ProblemError(f"order: found it with part {part!r}; expected it with orders")
        return display(writer.order(half_order_of(order)))
    if part != "all":
        return display(writer.rows(part))
    return "\n\n".join(f"% {TITLES[name]}\n\\[\n{display(writer.rows(name))}\n\\]" for name in PARTS)


def half_order_of(order: str) -> int:
    """Return twice an order that is a positive multiple of 1/2."""
    try:
        twice = 2 * Fraction(order)
    except (ValueError, ZeroDivisionError):
        twice = Fraction(0)
    if twice.denominator != 1 or not 1 <= twice <= HIGHEST:
        raise ProblemError(f"order: found {order!r}; expected 1/2, 1, 3/2, ..., {half(HIGHEST)}")
    return int(twice)


def display(rows: Iterable[str]) -> str:
    """Return an aligned display."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"


def document(derivation: Derivation) -> str:
    """Return the derivation as a document that compiles with pdflatex."""
    writer = Writer(derivation)
    lines = [
        "% Emitted by `fredholm derive`; do not edit.", r"\documentclass[a4paper,10pt]{article}", r"\usepackage{amsmath,amssymb}",
        r"\usepackage[margin=12mm,landscape]{geometry}", r"\allowdisplaybreaks", rf"\title{{{plain(derivation.problem.name)}: weakly nonlinear analysis}}", r"\date{}",
        r"\begin{document}", r"\maketitle",
    ]
    for part in PARTS:
        lines.append(rf"\section{{{TITLES[part]}}}")
        if part == "orders":
            for half_order in (1, 2, 3):
                lines += [rf"\subsection{{$O({writer.notation.symbol['small']}^{{{half(half_order)}}})$}}", breakable(writer.order(half_order))]
        else:
            lines.append(breakable(writer.rows(part)))
    return "\n".join([*lines, r"\end{document}", ""])


def breakable(rows: Sequence[str]) -> str:
    """Return rows as a display that may break across pages."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


class Writer:
    """Writes the stages of one derivation, each as the rows of a display."""

    def __init__(self, derivation: Derivation, symbols: Mapping[str, str] | None = None) -> None:
        self.derivation = derivation
        self.formulation = derivation.expansion.formulation
        self.reduction = derivation.reduction
        self.notation = Notation(derivation, symbols)
        self.equations = equations_of(self.formulation)
        self.harmonics = Harmonics(derivation.expansion, derivation.reduction)
        self.numbers = secular_numbers(self.equations)
        self.ends = tuple(sympy_latex(end) for end in self.formulation.interval or ())

    def rows(self, part: str) -> list[str]:
        """Return the rows of a part."""
        if part == "orders":
            return [row for half_order in (1, 2, 3) for row in self.order(half_order)]
        return {"statement": self.statement, "adjoint": self.adjoint, "solvability": self.solvability, "amplitude": self.amplitude}[part]()

    def where(self, equation: Equation) -> str:
        """Return where a boundary row holds."""
        return "" if equation.place is None else rf" \quad \text{{at}} \quad {self.notation.space} = {sympy_latex(equation.place)}"

    # Statement

    def statement(self) -> list[str]:
        """Return equations, boundary rows and base state (labels ``eqs``, ``constraint``, ``bcs wall``, ``bcs tip``, ``base state``)."""
        notation = self.notation
        rows = []
        for equation in self.equations:
            terms = stated_terms(equation)
            written = notation.form(terms, threshold=False) if terms is not None else None
            zero = self.zero(equation)
            if written is not None:
                rows.append(f"{joined(written, 6)} &= {zero}{self.where(equation)}")
            else:
                rows += [f"{line} &= 0{self.where(equation)}" for line in self.as_stated(equation)]
        unknowns = self.formulation.unknowns
        for unknown in unknowns:
            base = self.formulation.base[unknown.index]
            if unknown.component in ("m", "n"):
                continue
            if unknown.component == "p":
                along = self.formulation.base[unknown.index + 2]
                sign, body = notation.product(along, notation.axis, threshold=False)
                value = r"\mathbf{0}" if along == 0 else ("-" if sign == "-" else "") + body
                rows.append(rf"{notation.field(unknown.index)} &= {value} \quad \text{{(base state)}}")
            else:
                rows.append(rf"{notation.component(unknown.index)} &= {notation.text(base, threshold=False)} \quad \text{{(base state)}}")
        return rows

    def zero(self, equation: Equation) -> str:
        """Return the right side of an equation that vanishes."""
        return "0" if "" in equation.components else r"\mathbf{0}"

    def as_stated(self, equation: Equation) -> list[str]:
        """Return an equation that is no polynomial in the user's own terms."""
        problem = self.derivation.problem
        where = equation.label.replace("]", "").split("[")
        stated = problem.equations[int(where[1])] if where[0] == "equations" else None
        if stated is None:
            conditions = next(value for end, value in (problem.boundary or {}).items() if str(end) == where[1] or str(equation.place) == str(end))
            stated = (conditions if isinstance(conditions, (tuple, list)) else (conditions,))[int(where[2])]
        parts = list(stated) if hasattr(stated, "shape") else [stated]
        if len(where) > (2 if where[0] == "equations" else 3):
            parts = [parts[int(where[-1])]]
        return [self.in_fields(part) for part in parts if part != 0]

    def in_fields(self, expression: Any) -> str:
        """Return an expression in the fields of the statement."""
        names: dict[Any, Symbol] = {}
        texts: dict[Symbol, str] = {}

        def name(text: str) -> Symbol:
            symbol = Symbol(f"field{len(names)}")
            texts[symbol] = text
            return symbol

        for derivative in sorted(expression.atoms(Derivative), key=str):
            operators = " ".join(rf"\partial_{{{sympy_latex(v)}}}" + (f"^{{{n}}}" if n != 1 else "") for v, n in derivative.variable_count)
            names[derivative] = name(f"{operators} {field_name(derivative.expr)}")
        for applied in sorted(expression.atoms(AppliedUndef), key=str):
            names[applied] = name(field_name(applied))
        names[epsilon] = name(self.notation.symbol["small"])
        return sympy_latex(expression.xreplace(names), symbol_names=texts)

    # Orders

    def order(self, half_order: int) -> list[str]:
        """Return the equations of one order, their forcing in harmonics, and the solution where the amplitude equation needs it."""
        rows: list[str] = []
        secular: list[str] = []
        for equation in self.equations:
            terms = equation.at_order(half_order)
            left = {c: {key: value for key, value in one.items() if is_linear(key, half_order)} for c, one in terms.items()}
            right = {c: {key: -value for key, value in one.items() if not is_linear(key, half_order)} for c, one in terms.items()}
            lines = self.sides(left, right)
            if not lines:
                continue
            extra = self.forcing(equation) if half_order == 2 else []
            if half_order == 3 and equation in self.numbers:
                found = self.secular(equation)
                if found:
                    wave = self.wave(1) + (r" + \text{c.c.} + \text{n.s.t.}" if self.notation.hopf else r" + \text{n.s.t.}")
                    symbol = self.forcing_symbol(equation)
                    extra = [rf"{symbol}{' ' + wave if self.notation.hopf else wave}"]
                    secular.append(f"{symbol} &= {joined(found, 3)}")
            for k, (left_text, right_text) in enumerate(lines):
                braces = rf" \\" "\n" rf"&\quad \left\{{ = {joined(extra, 3)} \right\}}" if extra and k == len(lines) - 1 and len(extra) <= 3 else ""
                if extra and len(extra) > 3 and k == len(lines) - 1:
                    braces = rf" \\" "\n" rf"&\quad = {joined(extra, 3)}"
                rows.append(f"{left_text} &= {right_text}{self.where(equation)}{braces}")
        if half_order in (1, 2):
            rows += self.solution(half_order)
        return rows + secular

    def sides(self, left: Mapping[str, Mapping[Term, Expr]], right: Mapping[str, Mapping[Term, Expr]]) -> list[tuple[str, str]]:
        """Return an equation in vectors, or else in components."""
        if not any(left.values()) and not any(right.values()):
            return []
        zero = "0" if "" in left else r"\mathbf{0}"
        one, other = self.notation.form(left), self.notation.form(right)
        if one is not None and other is not None:
            return [(joined(one, 6), joined(other, 5) if other else zero)]
        return [(joined(self.components(left[c]), 6), joined(self.components(right[c]), 4) if right[c] else "0") for c in left if left[c] or right[c]]

    def components(self, terms: Mapping[Term, Expr]) -> list[str]:
        """Return terms in components."""
        notation = self.notation
        result = []
        for (control, weak, factors), coefficient in terms.items():
            lead = [notation.symbol["shift"] + (f"^{{{control}}}" if control > 1 else "")] if control else []
            lead += [notation.symbol["weak"]] if weak else []
            body = " ".join([*lead, *(self.component(factor) for factor in factors)])
            result.append(notation.product(coefficient, body))
        return added(result)

    def component(self, factor: Factor) -> str:
        """Return a derivative of one component."""
        whole = self.notation.field(factor.unknown)
        return self.notation.factor(factor).replace(whole, self.notation.component(factor.unknown) + ("{}" if factor.half_order else ""), 1)

    def wave(self, harmonic: int) -> str:
        """Return the exponential of a harmonic."""
        if harmonic == 0 or not self.notation.hopf:
            return ""
        count = "" if abs(harmonic) == 1 else f"{abs(harmonic)} "
        return rf"e^{{{'-' if harmonic < 0 else ''}{count}i {self.notation.symbol['frequency']} {self.notation.symbol['fast_time']}}}"

    def quadratic(self, values: Mapping[Monomial, Expr]) -> list[tuple[Expr, str, bool]]:
        """Return second-order monomials in the amplitude as (coefficient, text, whether its conjugate is to be added)."""
        a, shift = self.notation.amplitude, self.notation.symbol["shift"]
        result: list[tuple[Expr, str, bool]] = []

        def value(monomial: Monomial) -> Expr:
            return self.notation.inlined(values.get(monomial, Integer(0)))

        chi = value(self.harmonics.shift)
        if self.notation.vector and self.notation.hopf:
            x, y = value((0, 0, 1, 0, 0, 1)), value((0, 0, 0, 1, 1, 0))  # A_+ A*_- and A_- A*_+
            result.append((value((0, 0, 1, 1, 0, 0)), rf"\left({a} \cdot {a}\right) {self.wave(2)}", True))
            result.append((expand(x + y), rf"\left|{a}\right|^{{2}}", False))
            result.append((expand(I * (y - x)), rf"\left({self.notation.axis} \cdot {a} \times {a}^{{*}}\right)", False))
        elif self.notation.vector:
            result.append((value((0, 0, 1, 1)), rf"\left({a} \cdot {a}\right)", False))
        elif self.notation.hopf:
            result.append((value((0, 0, 2, 0)), f"{a}^{{2}} {self.wave(2)}", True))
            result.append((value((0, 0, 1, 1)), rf"\left|{a}\right|^{{2}}", False))
        else:
            result.append((value((0, 0, 2)), f"{a}^{{2}}", False))
        result.append((chi, shift, False))
        return [one for one in result if one[0] != 0]

    def quadratic_text(self, values: Mapping[Monomial, Expr], vector: bool) -> list[str]:
        """Return second-order monomials written out; along the axis where the field is a vector."""
        result: list[tuple[str, str]] = []
        a = self.notation.amplitude
        for coefficient, body, doubled in self.quadratic(values):
            along = self.notation.axis if vector else ""
            if vector and r"\times" in body:  # n (n . A x A*) = A x A*: A is normal to the axis
                body, along = rf"\left({a} \times {a}^{{*}}\right)", ""
            sign, text = self.notation.product(coefficient, " ".join(part for part in (body, along) if part))
            result.append((sign, text + (r" + \text{c.c.}" if doubled else "")))
        return added(result)

    def forcing(self, equation: Equation) -> list[str]:
        """Return the forcing of second order in harmonics: what the braces of the paper hold (label ``eqs 1``)."""
        component = "n" if "n" in equation.components else ""
        values = self.harmonics.forcing(equation, component, 2)
        if not set(values) - {self.harmonics.shift}:
            return []
        return self.quadratic_text(values, component == "n")

    def forcing_symbol(self, equation: Equation) -> str:
        """Return f, g or h with its number."""
        kind = {"row": "f", "left": "g", "right": "h"}[equation.side]
        stem = rf"\mathbf{{{kind}}}" if "p" in equation.components else kind
        return f"{stem}_{{({self.numbers[equation]})}}"

    def secular(self, equation: Equation) -> list[str]:
        """Return the secular forcing of an equation (label ``secular forcing terms``)."""
        notation, a = self.notation, self.notation.amplitude
        slow = rf"\frac{{\mathrm{{d}} {a}}}{{\mathrm{{d}} {notation.symbol['slow_time']}}}"
        shift, weak = notation.symbol["shift"], notation.symbol["weak"]
        if "p" not in equation.components:
            if notation.vector:
                return []
            values = {key: notation.inlined(value) for key, value in self.harmonics.forcing(equation, "", 3).items()}
            cubic = ((0, 0, 2, 1), rf"\left|{a}\right|^{{2}} {a}") if notation.hopf else ((0, 0, 3), f"{a}^{{3}}")
            table = [(self.harmonics.slow(0), slow), cubic, (self.harmonics.shifted(0), f"{shift} {a}"), (self.harmonics.weak(0), f"{weak} {a}")]
            return added(notation.product(values[key], body) for key, body in table if values.get(key, 0) != 0)
        plus = {key: notation.inlined(value) for key, value in self.harmonics.forcing(equation, "p", 3).items()}
        minus = {key: notation.inlined(value) for key, value in self.harmonics.forcing(equation, "m", 3).items()}
        pairs: list[tuple[Expr, Expr, str]] = []

        def both(one: Monomial, other: Monomial, body: str) -> None:
            pairs.append((plus.get(one, Integer(0)), minus.get(other, Integer(0)), body))

        both(self.harmonics.slow(0), self.harmonics.slow(1), slow)
        if notation.hopf:
            # A_+^2 A*_- = X and A_+ A_- A*_+ = Y stand in |A|^2 A + (A.A) A* with 2X and Y - X
            x, y = plus.get((0, 0, 2, 0, 0, 1), Integer(0)), plus.get((0, 0, 1, 1, 1, 0), Integer(0))
            x_minus, y_minus = minus.get((0, 0, 0, 2, 1, 0), Integer(0)), minus.get((0, 0, 1, 1, 0, 1), Integer(0))
            pairs.append((2 * x, 2 * x_minus, rf"\left|{a}\right|^{{2}} {a}"))
            pairs.append((y - x, y_minus - x_minus, rf"\left({a} \cdot {a}\right) {a}^{{*}}"))
        else:
            both((0, 0, 2, 1), (0, 0, 1, 2), rf"\left({a} \cdot {a}\right) {a}")
        both(self.harmonics.shifted(0), self.harmonics.shifted(1), f"{shift} {a}")
        result: list[tuple[str, str]] = []
        for one, other, body in pairs:
            straight, turned = expand((one + other) / 2), expand((one - other) / (2 * I))
            result += [notation.product(part, text) for part, text in ((straight, body), (turned, across(notation.axis, body, a))) if part != 0]
        return added([*result, *self.weak_terms(plus, minus)])

    def weak_terms(self, plus: Mapping[Monomial, Expr], minus: Mapping[Monomial, Expr]) -> list[tuple[str, str]]:
        """Return a weak effect in the directions e_1, e_2 across the axis, or as a multiple of A where it keeps the symmetry."""
        notation, a = self.notation, self.notation.amplitude
        first, second = self.harmonics.weak(0), self.harmonics.weak(1)
        p, q, r, s = (values.get(key, Integer(0)) for values, key in ((plus, first), (plus, second), (minus, first), (minus, second)))
        table = {(1, 1): (p + q + r + s) / 2, (1, 2): I * (p + r - q - s) / 2, (2, 1): (p - r + q - s) / (2 * I), (2, 2): (p - r - q + s) / 2}
        table = {key: expand(value) for key, value in table.items()}
        if table[1, 2] == table[2, 1] == 0 and expand(table[1, 1] - table[2, 2]) == 0:
            return [notation.product(table[1, 1], f"{notation.symbol['weak']} {a}")] if table[1, 1] != 0 else []
        return [notation.product(value, rf"{notation.symbol['weak']} \left({a} \cdot \mathbf{{e}}_{{{j}}}\right) \mathbf{{e}}_{{{i}}}") for (i, j), value in table.items() if value != 0]

    def solution(self, half_order: int) -> list[str]:
        """Return the fields of one order (labels ``sol 1/2``, ``sol 1``)."""
        notation, a = self.notation, self.notation.amplitude
        rows = []
        unknowns = self.formulation.unknowns
        tail = rf" {self.wave(1)} + \text{{c.c.}}" if notation.hopf else ""
        first = {one.monomial: one for one in self.reduction.mode.contributions}
        for unknown in unknowns:
            if half_order == 1:
                if unknown.component == "p":
                    plus = self.harmonics.value(unknown.index, self.harmonics.single(0))
                    minus = self.harmonics.value(unknown.index + 1, self.harmonics.single(1))
                    straight, turned = expand((plus + minus) / 2), expand((plus - minus) / (2 * I))
                    terms = added(notation.product(part, text) for part, text in ((straight, a), (turned, rf"{notation.axis} \times {a}")) if part != 0)
                elif unknown.component in ("m", "n") or notation.vector:
                    continue
                else:
                    value = first[self.reduction.mode.contributions[0].monomial].values.get(unknown.index, Integer(0))
                    terms = added([notation.product(value, a)]) if value != 0 else []
                zero = r"\mathbf{0}" if unknown.component == "p" else "0"
                rows.append(f"{notation.at_order(unknown.index, half_order)} &= {joined(terms, 3) + tail if terms else zero}")
            else:
                if unknown.component in ("p", "m"):
                    continue
                terms = self.quadratic_text(self.harmonics.values(unknown.index), unknown.component == "n")
                zero = r"\mathbf{0}" if unknown.component == "n" else "0"
                rows.append(f"{notation.at_order(unknown.index, half_order)} &= {joined(terms, 3) if terms else zero}")
        return rows + (self.responses() if half_order == 2 else [])

    def responses(self) -> list[str]:
        """Return what defines the response functions: nested quadratures, or a linear problem."""
        notation = self.notation
        s = notation.space
        rows: list[str] = []
        seen: set[Symbol] = set()
        for response in self.reduction.responses:
            states = [state for state in response.states if isinstance(state, Symbol)]
            if not states or states[0] in seen:
                continue
            seen.update(states)
            if response.explicit is not None:
                for state, side, slope, constant in response.explicit:
                    start = notation.sum(notation.inlined(constant))
                    lead = rf"\left[{joined(start, 9)}\right]_{{{s} = {self.ends[0] if side == 'left' else self.ends[1]}}}" if start else ""
                    bounds = rf"\int_{{{self.ends[0]}}}^{{{s}}}" if side == "left" else rf"\int_{{{s}}}^{{{self.ends[1]}}}"
                    body = joined(notation.sum(notation.inlined(slope)), 9)
                    sign = "-" if side == "right" else "+" if lead else ""
                    rows.append(rf"{notation.text(response.states[state])} &= {' '.join(part for part in (lead, sign, bounds) if part)} \left({body}\right) \mathrm{{d}} \tilde{{{s}}}")
                continue
            operator = response.operator
            for i, state in enumerate(response.states):
                terms = [(operator.matrix[i][j], notation.text(other)) for j, other in enumerate(response.states) if operator.matrix[i][j] != 0]
                lines = added([notation.product(c, body) for c, body in terms])
                forcing = notation.sum(notation.inlined(response.forcing[i]))
                if isinstance(operator, FirstOrderOperator):
                    tail = [one if k or one.startswith("-") or not lines else f"+ {one}" for k, one in enumerate(forcing)]
                    rows.append(rf"\frac{{\mathrm{{d}}}}{{\mathrm{{d}} {s}}} {notation.text(state)} &= {joined([*lines, *tail], 5)}")
                else:
                    rows.append(f"{joined(lines, 5)} &= {joined(forcing, 4)}")
            if isinstance(operator, FirstOrderOperator):
                for end, boundary, data in ((self.ends[0], operator.left, response.left), (self.ends[1], operator.right, response.right)):
                    for line, value in zip(boundary.matrix, data, strict=True):
                        left = added([notation.product(c, notation.text(state)) for c, state in zip(line, response.states, strict=True) if c != 0])
                        rows.append(rf"{joined(left, 5)} &= {joined(notation.sum(notation.inlined(value)), 4)} \quad \text{{at}} \quad {s} = {end}")
            if response.singular:
                left = added([notation.product(c, notation.text(state)) for c, state in zip(self.reduction.mode.normalisation, response.states, strict=True) if c != 0])
                place = rf" \quad \text{{at}} \quad {s} = {sympy_latex(self.formulation.place)}" if self.formulation.place is not None else ""
                rows.append(f"{joined(left, 5)} &= 0{place}")
        return rows

    # Adjoint and solvability

    @cached_property
    def restricted(self) -> RestrictedProblem | None:
        """L, S and T in the fields of the statement, where the rows are as many as the fields."""
        if self.formulation.interval is None:
            return None
        try:
            return restricted_problem(self.derivation.expansion, 1 if self.notation.vector else 0, self.reduction.mode.growth)
        except DerivationError:
            return None

    @cached_property
    def scalar(self) -> ScalarAdjoint | None:
        """The adjoint solution by one scalar function, where there is one."""
        operator = self.reduction.mode.operator
        if not isinstance(operator, FirstOrderOperator):
            return None
        rows = self.restricted.rows if self.restricted is not None else tuple(self.reduction.solvability.interior)
        return scalar_adjoint(operator, self.reduction.solvability, self.reduction.functions, rows)

    def adjoint(self) -> list[str]:
        """Return L, S, T, their adjoints, the boundary form, and the homogeneous solutions (labels ``matrix operators`` to ``adjoint bcs``)."""
        notation, reduction = self.notation, self.reduction
        operator = reduction.mode.operator
        if not isinstance(operator, FirstOrderOperator):
            matrix = array([[notation.text(entry) for entry in row] for row in operator.matrix])
            phi, zeta = (COMMA.join(notation.text(symbol) for symbol in group) for group in (reduction.mode.phi, reduction.solvability.zeta))
            return [rf"\mathsf{{M}} &= {matrix}, \quad \mathsf{{M}} \left[{phi}\right]^{{T}} = \vec{{0}}", rf"\left[{zeta}\right] \mathsf{{M}} &= \vec{{0}}"]
        restricted = self.restricted
        rows = self.restricted_rows(restricted) if restricted is not None else []
        rows += self.mode_rows(operator)
        scalar = self.scalar
        if scalar is not None:
            return rows + self.scalar_rows(scalar, restricted)
        adj = reduction.solvability.adjoint
        assert adj is not None
        zeta = COMMA.join(notation.text(symbol) for symbol in reduction.solvability.zeta)
        rows.append(rf"\frac{{\mathrm{{d}} \vec{{z}}}}{{\mathrm{{d}} {notation.space}}} &= {array([[notation.text(e) for e in row] for row in adj.matrix])} \vec{{z}}, \quad \vec{{z}} = \left[{zeta}\right]^{{T}}")
        for end, lines in zip(self.ends, (adj.left, adj.right), strict=True):
            rows.append(rf"{array([[notation.text(e) for e in row] for row in lines])} \vec{{z}} &= \vec{{0}} \quad \text{{at}} \quad {notation.space} = {end}")
        return rows

    def mode_rows(self, operator: FirstOrderOperator) -> list[str]:
        """Return the equation of the critical mode and the fields in terms of it (labels ``ode``, ``ode bcs``, ``general linear``)."""
        notation, phi = self.notation, self.reduction.mode.phi
        n = operator.size
        rows = []
        s = notation.space
        if operator.scalar:
            value = expand(sum((operator.matrix[-1][j] * phi[j] for j in range(n)), Integer(0)))
            mode = self.notation.symbol["mode"]
            rows.append(f"{mode}{primes(n)} &= {joined(notation.sum(value), 6)}")
        else:
            names = COMMA.join(notation.text(symbol) for symbol in phi)
            rows.append(rf"\frac{{\mathrm{{d}} \vec{{y}}}}{{\mathrm{{d}} {s}}} &= {array([[notation.text(e) for e in row] for row in operator.matrix])} \vec{{y}}, \quad \vec{{y}} = \left[{names}\right]^{{T}}")
        for end, boundary in zip(self.ends, (operator.left, operator.right), strict=True):
            for line in boundary.matrix:
                terms = added([notation.product(c, notation.text(one)) for c, one in zip(line, phi, strict=True) if c != 0])
                rows.append(rf"{joined(terms, 6)} &= 0 \quad \text{{at}} \quad {s} = {end}")
        return rows

    def entry(self, coefficients: Mapping[int, Expr], parity: int) -> str:
        """Return an entry of L: a differential operator, with n x where it joins a true vector and a pseudovector."""
        s = self.notation.space
        turn = rf"{self.notation.axis} \times" if parity < 0 else ""
        terms = []
        for k, c in sorted(coefficients.items(), reverse=True):
            slope = rf"\frac{{\mathrm{{d}}{f'^{{{k}}}' if k > 1 else ''}}}{{\mathrm{{d}} {s}{f'^{{{k}}}' if k > 1 else ''}}}" if k else ""
            body = " ".join(part for part in (turn, slope) if part)
            value = expand(c / I) if parity < 0 else c
            terms += [self.notation.product(part, body) for part in (Add.make_args(value) if not body else (value,))]
        return " ".join(added(terms)) if terms else "0"

    def restricted_rows(self, problem: RestrictedProblem) -> list[str]:
        """Return L, S, T and their adjoints, and J."""
        notation = self.notation
        size = range(len(problem.fields))
        fields = [notation.field(index) if notation.vector else notation.component(index) for index in problem.fields]
        rows = [rf"\vec{{\psi}} &= \left[{COMMA.join(fields)}\right]^{{T}}, \quad \mathsf{{L}} \vec{{\psi}} = \vec{{f}}, \quad \mathsf{{S}} \vec{{\psi}} = \vec{{g}}, \quad \mathsf{{T}} \vec{{\psi}} = \vec{{h}}"]
        direct = [[self.entry(problem.operator[i][j], problem.row_parity[i] * problem.parity[j]) for j in size] for i in size]
        rows.append(rf"\mathsf{{L}} &= {array(direct)}")

        def boundary(name: str, lines: Sequence[tuple[Mapping[tuple[int, int], Expr], int]], parities: Sequence[int], place: str) -> str:
            table = []
            for line, parity in lines:
                table.append([self.entry({k: c for (j, k), c in line.items() if j == column}, parity * parities[column]) for column in size])
            return rf"\mathsf{{{name}}} &= {array(table)} \quad \text{{at}} \quad {notation.space} = {place}"

        rows.append(boundary("S", list(zip(problem.left, problem.left_parity, strict=True)), problem.parity, self.ends[0]))
        rows.append(boundary("T", list(zip(problem.right, problem.right_parity, strict=True)), problem.parity, self.ends[1]))
        dual = problem.adjoint()
        rows.append(rf"\mathsf{{L}}^{{\dagger}} &= {array([[self.entry(dual[i][j], problem.parity[i] * problem.row_parity[j]) for j in size] for i in size])}")
        left, right = self.formulation.interval or (Integer(0), Integer(0))
        try:
            rows.append(boundary(r"S}^{\dagger", self.cleared(problem.adjoint_rows("left", left)), problem.row_parity, self.ends[0]))
            rows.append(boundary(r"T}^{\dagger", self.cleared(problem.adjoint_rows("right", right)), problem.row_parity, self.ends[1]))
        except DerivationError:
            pass  # a boundary row beyond the boundary form: the adjoint rows below are those of the first-order system
        terms = []
        for ((j, k), (i, m)), c in problem.boundary_form().items():
            parity = problem.parity[j] * problem.row_parity[i]
            turn = rf"{notation.axis} \times " if parity < 0 else ""
            one = rf"{fields[j]}^{{(1)*}}" + (rf"{{}}{chr(39) * k}" if k else "")
            other = rf"{turn}\vec{{\psi}}^{{(2)}}_{{{i + 1}}}" + (rf"{{}}{chr(39) * m}" if m else "")
            terms.append(notation.product(expand(c / I) if parity < 0 else c, rf"{other} \cdot {one}" if notation.vector else f"{other} {one}"))
        rows.append(rf"J(\vec{{\psi}}^{{(1)}}, \vec{{\psi}}^{{(2)}}) &= \left[{joined(added(terms), 9)}\right]_{{{self.ends[0]}}}^{{{self.ends[1]}}}")
        return rows

    def cleared(self, lines: Sequence[tuple[dict[tuple[int, int], Expr], int]]) -> list[tuple[dict[tuple[int, int], Expr], int]]:
        """Return adjoint rows without denominators."""
        result = []
        for line, parity in lines:
            factor: Expr = Integer(1)
            for value in line.values():
                factor = lcm(factor, fraction(together(value))[1])
            result.append(({key: expand((value * factor).cancel()) for key, value in line.items()}, parity))
        return result

    def adjoint_function(self, order: int, star: bool = False) -> str:
        """Return the adjoint eigenfunction or a derivative."""
        return self.notation.symbol["adjoint"] + primes(order, star)

    def scalar_rows(self, scalar: ScalarAdjoint, restricted: RestrictedProblem | None) -> list[str]:
        """Return the adjoint solution by its scalar function, its equation and its boundary conditions."""
        notation = self.notation
        rows = []
        n = len(scalar.equation)

        def combination(line: Sequence[Expr]) -> list[str]:
            return added([notation.product(c, self.adjoint_function(k)) for k, c in enumerate(line) if c != 0])

        if restricted is not None:
            entries = []
            for row, parity in zip(restricted.rows, restricted.row_parity, strict=True):
                odd = parity < 0 and notation.vector
                line = [expand(c / I) if odd else c for c in scalar.multipliers.get(row, ())]
                body = (rf"{notation.axis} \times \mathbf{{b}}" if odd else r"\mathbf{b}") if notation.vector else ""
                terms = [notation.product(c, f"{self.adjoint_function(k)} {body}".strip()) for k, c in enumerate(line) if c != 0]
                entries.append(" ".join(added(terms)) or "0")
            rows.append(rf"\vec{{\zeta}} &= \left[{COMMA.join(entries)}\right]^{{T}}")
        rows.append(f"{self.adjoint_function(n)} &= {joined(combination(scalar.equation), 6)}")
        for end, lines in zip(self.ends, (scalar.left, scalar.right), strict=True):
            rows += [rf"{joined(combination(line), 6)} &= 0 \quad \text{{at}} \quad {notation.space} = {end}" for line in lines]
        return rows

    def multiplier(self, expression: Expr, scalar: ScalarAdjoint | None) -> Expr:
        """Return a multiplier over the conjugate adjoint eigenfunction and its derivatives."""
        if scalar is None:
            return expression
        table = {}
        for symbol, line in scalar.substitution.items():
            table[symbol] = sum((c * self.star(k) for k, c in enumerate(line)), Integer(0))
        return expand(expression.xreplace(table))

    def reduced_at(self, expression: Expr, scalar: ScalarAdjoint, side: str) -> Expr:
        """Return a multiplier at an end with the adjoint boundary conditions used: highest derivatives are eliminated."""
        rows = scalar.left if side == "left" else scalar.right
        table = {}
        for line in rows:
            lead = max(k for k, c in enumerate(line) if c != 0)
            table[self.star(lead)] = sum((-conjugate(c) * self.star(k) for k, c in enumerate(line) if k != lead), Integer(0))
        return expand(expand(expression.xreplace(table)).xreplace(table))

    def star(self, order: int) -> Symbol:
        """Return a symbol for a derivative of the conjugate adjoint eigenfunction, known to the notation."""
        symbol = Symbol(f"adjoint_star_{order}")
        self.notation.names[symbol] = self.notation.at_threshold[symbol] = self.adjoint_function(order, star=True)
        return symbol

    def solvability(self) -> list[str]:
        """Return the condition for any forcing and any boundary data (label ``general solvability``, conjugated)."""
        notation, condition = self.notation, self.reduction.solvability
        expansion = self.derivation.expansion
        restricted = self.restricted
        scalar = self.scalar
        number = {("row", k): n for n, k in enumerate(restricted.rows, 1)} if restricted is not None else {("row", k): k + 1 for k in range(len(expansion.rows))}
        for side, kept, stated in zip(("left", "right"), (restricted.left_rows, restricted.right_rows) if restricted else ((), ()), expansion.ends, strict=False):
            number.update({(side, k): n for n, k in enumerate(kept or range(len(stated)), 1)})
        parity = {("row", k): p for k, p in zip(restricted.rows, restricted.row_parity, strict=True)} if restricted and notation.vector else {}
        if restricted and notation.vector:
            parity.update({("left", k): p for k, p in zip(restricted.left_rows, restricted.left_parity, strict=True)})
            parity.update({("right", k): p for k, p in zip(restricted.right_rows, restricted.right_parity, strict=True)})

        def term(kind: str, row: int, multiplier: Expr, marks: str = "", at: str = "") -> tuple[str, str]:
            letter = {"row": "f", "left": "g", "right": "h"}[kind]
            stem = rf"\mathbf{{{letter}}}" if notation.vector else letter
            odd = parity.get((kind, row), 1) < 0
            # a row of odd parity: f_+ = i (n x f)_+ / i^2
            value = expand(multiplier * I) if odd else multiplier
            body = rf"{notation.axis} \times {stem}" if odd else stem
            factor = self.multiplier(value, scalar)
            if scalar is not None and (kind != "row" or marks or at):
                factor = self.reduced_at(factor, scalar, at or kind)
            return notation.product(-factor if odd else factor, f"{body}_{{({number.get((kind, row), row + 1)})}}{marks}")

        inner = added([term("row", row, multiplier) for row, multiplier in condition.interior.items()])
        if not self.ends:
            return [f"{joined(inner, 4)} &= 0"]
        rows = [rf"\int_{{{self.ends[0]}}}^{{{self.ends[1]}}} \left\{{ {joined(inner, 9)} \right\}} \mathrm{{d}} {notation.space}"]
        outer = []
        ends = dict(zip(("left", "right"), self.ends, strict=True))
        for (end, row, order), multiplier in condition.boundary.items():
            sign, text = term("row", row, -multiplier, chr(39) * order, end)
            outer.append((sign, rf"\left[{text}\right]_{{{notation.space} = {ends[end]}}}"))
        for (end, row), multiplier in condition.data.items():
            sign, text = term(end, row, -multiplier)
            outer.append((sign, rf"\left[{text}\right]_{{{notation.space} = {ends[end]}}}"))
        return [f"{rows[0]} &= {joined(added(outer), 3)}"]

    # Amplitude equation

    def amplitude(self) -> list[str]:
        """Return the amplitude equation and its coefficients as quadratures (labels ``amplitude primitive``, ``coefficients integrals``)."""
        notation, reduction = self.notation, self.reduction
        listed = list(reduction.coefficients)
        symbols = coefficient_symbols(listed)
        a = notation.amplitude
        terms = added([("+", f"{symbols[one.identifier]} {monomial_text(one.monomial, a, notation.symbol['small'], notation.distance)}") for one in listed])
        rows = [rf"\frac{{\mathrm{{d}} {a}}}{{\mathrm{{d}} t}} &= {joined(terms, 5)}", rf"{notation.distance} &= {notation.control} - {{{notation.control}}}_{{c}}"]
        if reduction.weak:
            rows[0] += rf" + {notation.symbol['small']} \sum_{{i,j}} w_{{ij}} \left({a} \cdot \mathbf{{e}}_{{j}}\right) \mathbf{{e}}_{{i}}"
        xi = notation.symbol["xi"]
        rows.append(f"{xi} &= {self.integral(reduction.xi, 1)}")
        rows += [rf"{symbols[one.identifier]} &= \frac{{1}}{{{xi}}} \left\{{ {self.integral(one, -1)} \right\}}" for one in listed]
        if reduction.quadratic is not None:
            rows.append(rf"c_{{{notation.symbol['amplitude']}^{{2}}}} &= \frac{{1}}{{{xi}}} \left\{{ {self.integral(reduction.quadratic, -1)} \right\}}")
        return rows

    def integral(self, one: Coefficient, sign: int) -> str:
        """Return `sign` times a solvability integral: a multiplier times the forcing of its row in each term."""
        notation, condition = self.notation, self.reduction.solvability
        terms: list[tuple[str, str]] = []
        if not self.ends:
            return joined(notation.sum(notation.inlined(sign * one.integrand)), 99)  # it stands inside braces, which may not be cut
        restricted = self.restricted
        scalar = self.scalar
        odd = {row for row, parity in zip(restricted.rows, restricted.row_parity, strict=True) if parity < 0} if restricted is not None and notation.vector else set()
        inner: list[tuple[str, str]] = []
        for row, multiplier in condition.interior.items():
            value = one.forcing.get(("row", row), Integer(0))
            if value == 0:
                continue
            turn = I if row in odd else Integer(1)  # a row of odd parity carries i, as n x does
            factor, body = expand(turn * self.multiplier(multiplier, scalar)), notation.inlined(sign * value / turn)
            if factor.is_Add or body.is_Add:
                text = joined(notation.sum(body), 99)
                inner.append(notation.product(factor, rf"\left({text}\right)" if body.is_Add or text.startswith("-") else text))
            else:
                inner.append(notation.product(expand(factor * body), ""))
        if inner:
            terms.append(("+", rf"\int_{{{self.ends[0]}}}^{{{self.ends[1]}}} \left[{joined(added(inner), 99)}\right] \mathrm{{d}} {notation.space}"))
        for place, value in zip(self.ends, (one.left, one.right), strict=True):
            body = notation.inlined(self.multiplier(sign * value, scalar))
            if body != 0:
                terms.append(("+", rf"\left[{joined(notation.sum(body), 99)}\right]_{{{notation.space} = {place}}}"))
        return joined(added(terms), 2) if terms else "0"


def is_linear(key: Term, half_order: int) -> bool:
    """Tell whether a term belongs to the linear problem of its own order."""
    control, weak, factors = key
    return control == weak == 0 and len(factors) == 1 and factors[0].half_order == half_order and factors[0].slow == 0


def secular_numbers(equations: Sequence[Equation]) -> dict[Equation, int]:
    """Return the number of f, g or h of each equation: vector ones where there are vectors, all where there are none."""
    rotating = any("p" in equation.components for equation in equations)
    counts = {"row": 0, "left": 0, "right": 0}
    result = {}
    for equation in equations:
        if not rotating or "p" in equation.components:
            counts[equation.side] += 1
            result[equation] = counts[equation.side]
    return result


def across(axis: str, body: str, amplitude: str) -> str:
    """Return n x (what `body` holds): a scalar times A, A* or dA/dT."""
    for tail in (f"{amplitude}^{{*}}", amplitude):
        if body.endswith(tail) and not body.startswith(r"\frac"):
            lead = body.removesuffix(tail).strip()
            return f"{lead} {axis} \\times {tail}".strip()
    return rf"{axis} \times {body}"


def coefficient_symbols(listed: Sequence[Coefficient]) -> dict[str, str]:
    """Return the symbol of each coefficient: its name, or c with an index."""
    result = {}
    for k, one in enumerate(listed, 1):
        result[one.identifier] = sympy_latex(Symbol(one.name)) if one.name.isidentifier() else f"c_{{{k}}}"
    return result


def array(rows: Sequence[Sequence[str]]) -> str:
    """Return a matrix."""
    if not rows:
        return r"\left(\,\right)"
    body = r" \\ ".join(" & ".join(row) for row in rows)
    return rf"\left(\begin{{array}}{{{'c' * len(rows[0])}}} {body} \end{{array}}\right)"


def field_name(applied: AppliedUndef) -> str:
    """Return the LaTeX of a field's name, a component of a vector with its letter below."""
    name, _, component = applied.func.__name__.partition(".")
    stem = sympy_latex(Symbol(name))
    return f"{{{stem}}}_{{{component}}}" if component else stem


__all__ = ["PARTS", "Part", "document", "latex"]
