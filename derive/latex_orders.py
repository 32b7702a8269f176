r"""The statement and the orders of the expansion in LaTeX.

A problem with a rotation axis is written in vectors: A, its conjugate, the axis, their dot and cross products, as the paper does. An
equation whose rows are not those of a vector is written in circular components :math:`v_\pm = v\cdot(e_1 \pm i e_2)`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sympy import Derivative, Expr, I, Integer, Symbol
from sympy import latex as sympy_latex
from sympy.core.function import AppliedUndef

from derive.expand import expand
from derive.harmonics import Harmonics, Monomial
from derive.notation import Notation, added, joined
from derive.operator import FirstOrderOperator
from derive.response import Response
from derive.statement import epsilon
from derive.two_times import Equation, Factor, Term, equations_of, stated_terms

if TYPE_CHECKING:
    from derive.derivation import Derivation


class OrderWriter:
    """Writes the statement and the orders of one derivation, each as the rows of a display."""

    def __init__(self, derivation: Derivation, notation: Notation) -> None:
        self.derivation = derivation
        self.notation = notation
        self.formulation = derivation.expansion.formulation
        self.reduction = derivation.reduction
        self.equations = equations_of(self.formulation)
        self.harmonics = Harmonics(derivation.expansion, derivation.reduction)
        self.numbers = secular_numbers(self.equations)
        self.ends = tuple(sympy_latex(end) for end in self.formulation.interval or ())

    def where(self, equation: Equation) -> str:
        """Return where a boundary row holds."""
        return "" if equation.place is None else self.notation.at(sympy_latex(equation.place))

    def statement(self) -> list[str]:
        """Return equations, boundary rows and base state (labels ``eqs``, ``constraint``, ``bcs wall``, ``bcs tip``, ``base state``)."""
        notation = self.notation
        rows = []
        for equation in self.equations:
            terms = stated_terms(equation)
            written = notation.form(terms, threshold=False) if terms is not None else None
            zero = zero_of(equation.components)
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
            rows += [f"{left_text} &= {right_text}{self.where(equation)}" for left_text, right_text in lines]
            if extra:
                body = f"= {joined(extra, 3)}"
                rows[-1] += " \\\\\n&\\quad " + (rf"\left\{{ {body} \right\}}" if len(extra) <= 3 else body)
        rows += self.leading_fields() if half_order == 1 else self.second_fields() if half_order == 2 else []
        return rows + secular

    def sides(self, left: Mapping[str, Mapping[Term, Expr]], right: Mapping[str, Mapping[Term, Expr]]) -> list[tuple[str, str]]:
        """Return an equation in vectors, or else in components."""
        if not any(left.values()) and not any(right.values()):
            return []
        zero = zero_of(left)
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

    def leading_fields(self) -> list[str]:
        """Return the fields of order 1/2 (label ``sol 1/2``)."""
        notation, a = self.notation, self.notation.amplitude
        tail = rf" {self.wave(1)} + \text{{c.c.}}" if notation.hopf else ""
        rows = []
        for unknown in self.formulation.unknowns:
            if unknown.component == "p":
                plus = self.harmonics.value(unknown.index, self.harmonics.single(0))
                minus = self.harmonics.value(unknown.index + 1, self.harmonics.single(1))
                straight, turned = expand((plus + minus) / 2), expand((plus - minus) / (2 * I))
                parts = [(straight, a), (turned, rf"{notation.axis} \times {a}")]
            elif unknown.component in ("m", "n") or notation.vector:
                continue
            else:
                parts = [(self.harmonics.value(unknown.index, self.harmonics.single(0)), a)]
            terms = added(notation.product(part, text) for part, text in parts if part != 0)
            zero = r"\mathbf{0}" if unknown.component == "p" else "0"
            rows.append(f"{notation.at_order(unknown.index, 1)} &= {joined(terms, 3) + tail if terms else zero}")
        return rows

    def second_fields(self) -> list[str]:
        """Return the fields of order 1 (label ``sol 1``), with what defines the response functions."""
        notation = self.notation
        rows = []
        for unknown in self.formulation.unknowns:
            if unknown.component in ("p", "m"):
                continue
            terms = self.quadratic_text(self.harmonics.values(unknown.index), unknown.component == "n")
            zero = r"\mathbf{0}" if unknown.component == "n" else "0"
            rows.append(f"{notation.at_order(unknown.index, 2)} &= {joined(terms, 3) if terms else zero}")
        return rows + self.responses()

    def responses(self) -> list[str]:
        """Return what defines the response functions: nested quadratures, or a linear problem."""
        return [row for response in self.reduction.responses if response.own for row in (self.quadratures(response) if response.explicit is not None else self.linear_problem(response))]

    def quadratures(self, response: Response) -> list[str]:
        """Return a response as nested quadratures."""
        notation, s = self.notation, self.notation.space
        rows = []
        for state, side, slope, constant in response.explicit or ():
            start = notation.sum(notation.inlined(constant))
            lead = rf"\left[{joined(start, 9)}\right]_{{{s} = {self.ends[0] if side == 'left' else self.ends[1]}}}" if start else ""
            bounds = rf"\int_{{{self.ends[0]}}}^{{{s}}}" if side == "left" else rf"\int_{{{s}}}^{{{self.ends[1]}}}"
            body = joined(notation.sum(notation.inlined(slope)), 9)
            sign = "-" if side == "right" else "+" if lead else ""
            rows.append(rf"{notation.text(response.states[state])} &= {' '.join(part for part in (lead, sign, bounds) if part)} \left({body}\right) \mathrm{{d}} \tilde{{{s}}}")
        return rows

    def linear_problem(self, response: Response) -> list[str]:
        """Return the linear problem that a response solves."""
        notation, operator, states = self.notation, response.operator, response.states
        rows = []
        for line, state, value in zip(operator.matrix, states, response.forcing, strict=True):
            left, forcing = notation.combination(line, states), notation.sum(notation.inlined(value))
            if isinstance(operator, FirstOrderOperator):
                tail = [one if k or one.startswith("-") or not left else f"+ {one}" for k, one in enumerate(forcing)]
                rows.append(rf"\frac{{\mathrm{{d}}}}{{\mathrm{{d}} {notation.space}}} {notation.text(state)} &= {joined([*left, *tail], 5)}")
            else:
                rows.append(f"{joined(left, 5)} &= {joined(forcing, 4)}")
        if isinstance(operator, FirstOrderOperator):
            for end, boundary, data in zip(self.ends, (operator.left, operator.right), (response.left, response.right), strict=True):
                for line, value in zip(boundary.matrix, data, strict=True):
                    rows.append(f"{joined(notation.combination(line, states), 5)} &= {joined(notation.sum(notation.inlined(value)), 4)}{notation.at(end)}")
        if response.singular:
            place = notation.at(sympy_latex(self.formulation.place)) if self.formulation.place is not None else ""
            rows.append(f"{joined(notation.combination(self.reduction.mode.normalisation, states), 5)} &= 0{place}")
        return rows


def zero_of(components: Mapping[str, object]) -> str:
    """Return the zero of a scalar or vector equation."""
    return "0" if "" in components else r"\mathbf{0}"


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


def field_name(applied: AppliedUndef) -> str:
    """Return the LaTeX of a field's name, a component of a vector with its letter below."""
    name, _, component = applied.func.__name__.partition(".")
    stem = sympy_latex(Symbol(name))
    return f"{{{stem}}}_{{{component}}}" if component else stem
