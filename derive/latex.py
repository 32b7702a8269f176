r"""The derivation in LaTeX: statement, orders, adjoint, solvability, amplitude equation. It compiles inside amsmath.

Vectors of a problem with a rotation axis are written in circular components :math:`v_\pm = v\cdot(e_1 \pm i e_2)` and
:math:`v_n`, in which every term has one azimuthal and one temporal wavenumber.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from sympy import Add, Derivative, Expr, ImmutableMatrix, Integer, Symbol
from sympy import latex as sympy_latex
from sympy.core.function import AppliedUndef

from derive.amplitude import Coefficient
from derive.expansion import TaylorRow
from derive.operator import LAMBDA, OMEGA, FirstOrderOperator
from derive.problem import ProblemError, epsilon
from derive.response import Monomial

if TYPE_CHECKING:
    from derive.derivation import Derivation

PARTS = ("statement", "orders", "adjoint", "solvability", "amplitude")
COMPONENT = {"p": "+", "m": "-", "n": "n", "x": "x", "y": "y", "z": "z", "": ""}


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a derivation; it prints as LaTeX."""

    derivation: Derivation
    part: str

    def latex(self, order: str | None = None) -> str:
        """Return the LaTeX of the part."""
        return latex(self.derivation, self.part, order)

    def __repr__(self) -> str:
        return self.latex()

    def _repr_latex_(self) -> str:
        return f"$$\n{self.latex()}\n$$"

    def as_dict(self) -> dict[str, Any]:
        """Return the part as plain data."""
        return {"problem": self.derivation.problem.name, "part": self.part, "latex": self.latex()}


class Writer:
    """Names of symbols in LaTeX for one derivation; `symbols` overrides the defaults by emitted name."""

    def __init__(self, derivation: Derivation, symbols: Mapping[str, str] | None = None) -> None:
        self.derivation = derivation
        self.formulation = derivation.expansion.formulation
        reduction = derivation.reduction
        names: dict[Symbol, str] = {LAMBDA: r"\lambda", OMEGA: r"\omega"}
        for theirs, ours in self.formulation.user_symbols.items():
            if isinstance(ours, Symbol):
                names[ours] = sympy_latex(theirs)
        names[self.formulation.weak] = r"\epsilon"
        for stem, shown in (("phi", r"\varphi"), ("phi_bar", r"\varphi^{*}"), ("zeta", r"\zeta")):
            for k in range(len(reduction.mode.phi)):
                bare = shown.removesuffix("^{*}")
                star = "*" if shown.endswith("^{*}") else ""
                if reduction.mode.operator.__class__ is FirstOrderOperator and getattr(reduction.mode.operator, "scalar", False) and stem != "zeta":
                    text = bare if not k and not star else f"{bare}^{{{star}{primes(k)}}}"
                else:
                    text = f"{bare}_{{{k + 1}}}" + (f"^{{{star}}}" if star else "")
                names[Symbol(stem if k == 0 else f"{stem}_{k}")] = text
        for response in reduction.responses:
            for state, (unknown, order) in zip(response.states, response.operator.names, strict=True):
                if isinstance(state, Symbol) and state not in names:
                    names[state] = self.superscript(f"{{{self.unknown(unknown)}}}{order * chr(39)}", response.monomial)
        for symbol in reduction.functions.definitions:
            names.setdefault(symbol, self.definition(symbol.name))
        for name, text in (symbols or {}).items():
            names[Symbol(name)] = text
        self.names = names

    def unknown(self, index: int) -> str:
        """Return the LaTeX of an unknown."""
        one = self.formulation.unknowns[index]
        stem = sympy_latex(Symbol(one.latex))
        sub = COMPONENT[one.component]
        return f"{{{stem}}}_{{{sub}}}" if sub else stem

    def superscript(self, stem: str, monomial: Monomial) -> str:
        """Return a function that multiplies a monomial."""
        return f"{stem}^{{[{self.monomial(monomial)}]}}"

    def monomial(self, monomial: Monomial) -> str:
        """Return a monomial of amplitudes."""
        shown = {"A": "A", "Ac": "A^{*}", "Ap": "A_{+}", "Am": "A_{-}", "Cp": "A^{*}_{+}", "Cm": "A^{*}_{-}"}
        parts = []
        for count, amplitude in zip(monomial, self.derivation.reduction.amplitudes, strict=True):
            if count:
                text = shown[amplitude.name]
                parts.append(text if count == 1 else f"({text})^{{{count}}}" if "_" in text or "*" in text else f"{text}^{{{count}}}")
        return " ".join(parts) or "1"

    def definition(self, name: str) -> str:
        """Return the LaTeX of a named function from its emitted name."""
        match = re.fullmatch(r"f_(\w+?)(?:_row)?_(\d+)", name)
        if match:
            stem, row = match.groups()
            known = {"slow": r"\partial_T", "mu": r"\mu", "cubic": "3", "alpha": r"\alpha", "beta": r"\beta", "A2": "A^{2}"}
            return rf"f_{{{int(row) + 1}}}^{{[{known.get(stem, self.from_label(stem))}]}}"
        for response in self.derivation.reduction.responses:
            for unknown in self.formulation.unknowns:
                stem = f"{unknown.name}_{response.name}"
                if name.rstrip("_") == stem or re.fullmatch(re.escape(stem) + r"(_s+)?", name):
                    order = len(name.removeprefix(stem).strip("_"))
                    return self.superscript(f"{{{self.unknown(unknown.index)}}}{order * chr(39)}", response.monomial)
        escaped = name.replace("_", r"\_")
        return rf"\mathrm{{{escaped}}}"

    def from_label(self, label: str) -> str:
        """Return the monomial that an emitted label spells."""
        known = {"A": "A", "Ac": "A^{*}", "Ap": "A_{+}", "Am": "A_{-}", "Cp": "A^{*}_{+}", "Cm": "A^{*}_{-}", "weak": r"\epsilon", "mirror": "-"}
        return " ".join(known.get(part, part) for part in label.split("_"))

    def text(self, expression: Expr) -> str:
        """Return an expression over named functions."""
        return sympy_latex(expression, symbol_names=self.names)

    def terms(self, expression: Expr) -> list[str]:
        """Return the terms of a sum, each with its sign."""
        parts = expression.as_ordered_terms() if isinstance(expression, Add) else [expression]
        return [self.text(part) for part in parts]

    def jets(self, coefficients: Mapping[tuple[int, int, int], Expr], order: str) -> list[str]:
        """Return a linear form in the unknowns of one order, term by term."""
        result = []
        for (unknown, ds, dt), coefficient in coefficients.items():
            space, time = self.names[self.formulation.space] if self.formulation.interval else "s", r"\tau"
            operator = "".join(rf"\partial_{{{name}}}" + (f"^{{{count}}}" if count > 1 else "") + " " for name, count in ((time, dt), (space, ds)) if count)
            body = f"{operator}{self.unknown(unknown)}^{{({order})}}"
            factor = self.text(coefficient)
            if coefficient == 1:
                result.append(body)
            elif coefficient == -1:
                result.append(f"- {body}")
            else:
                result.append(rf"\left({factor}\right) {body}" if isinstance(coefficient, Add) else f"{factor} {body}")
        return result


def primes(k: int) -> str:
    """Return a derivative of order k."""
    return r"\prime" * k if k <= 3 else f"({k})"


def joined(terms: Sequence[str], width: int = 3) -> str:
    """Return a sum, broken into lines of a few terms for an aligned display."""
    if not terms:
        return "0"
    lines: list[str] = []
    for start in range(0, len(terms), width):
        text = ""
        for k, term in enumerate(terms[start:start + width]):
            first = start == 0 and k == 0
            text += term if first else f" {term}" if term.lstrip().startswith("-") else f" + {term}"
        lines.append(text)
    return " \\\\\n&\\quad ".join(lines)


def display(rows: Iterable[str]) -> str:
    """Return an aligned display."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"


def latex(derivation: Derivation, part: str = "all", order: str | None = None, symbols: Mapping[str, str] | None = None) -> str:
    """Return LaTeX of a part, as displays; `all` is every part with headings.

    Raises
    ------
    ProblemError
        There is no such part or order.
    """
    if part not in (*PARTS, "all"):
        raise ProblemError(f"part: found {part!r}; expected one of {', '.join((*PARTS, 'all'))}")
    writer = Writer(derivation, symbols)
    if order is not None:
        known = order_names(derivation)
        try:
            wanted = str(Fraction(order))
        except (ValueError, ZeroDivisionError):
            wanted = order
        if wanted not in known:
            raise ProblemError(f"order: found {order!r}; expected one of {', '.join(known)}")
        if part not in ("orders", "all"):
            raise ProblemError(f"order: found it with part {part!r}; expected it with orders")
        return order_display(writer, wanted)
    makers = {"statement": statement, "orders": all_orders, "adjoint": adjoint, "solvability": solvability, "amplitude": amplitude}
    if part != "all":
        return makers[part](writer)
    titles = {"statement": "Statement", "orders": "Orders of the expansion", "adjoint": "Adjoint problem", "solvability": "Solvability", "amplitude": "Amplitude equation"}
    return "\n\n".join(f"% {titles[name]}\n\\[\n{makers[name](writer)}\n\\]" for name in PARTS)


def order_names(derivation: Derivation) -> tuple[str, ...]:
    """Return the orders in the small parameter."""
    return ("1/2", "1", "3/2")


def statement(writer: Writer) -> str:
    """Return the equations, boundary rows and base state as the user wrote them."""
    problem = writer.derivation.problem

    def shown(expression: Any) -> str:
        if isinstance(expression, int):
            return str(expression)
        names: dict[Any, Symbol] = {}
        for derivative in sorted(expression.atoms(Derivative), key=str):
            if isinstance(derivative.expr, AppliedUndef):
                operator = " ".join(rf"\partial_{{{sympy_latex(v)}}}" + (f"^{{{n}}}" if n != 1 else "") for v, n in derivative.variable_count)
                names[derivative] = Symbol(f"{operator} {function_name(derivative.expr)}")
        for applied in sorted(expression.atoms(AppliedUndef), key=str):
            names[applied] = Symbol(function_name(applied))
        names[epsilon] = Symbol(r"\epsilon")
        return sympy_latex(expression.xreplace(names), symbol_names={symbol: symbol.name for symbol in names.values()})

    rows = []
    for equation in problem.equations:
        parts = list(equation) if hasattr(equation, "shape") else [equation]
        rows += [f"{shown(part)} &= 0" for part in parts if part != 0]
    for end, conditions in sorted((problem.boundary or {}).items(), key=lambda item: float(item[0])):
        for condition in conditions if isinstance(conditions, (tuple, list)) else (conditions,):
            parts = list(condition) if hasattr(condition, "shape") else [condition]
            rows += [rf"{shown(part)} &= 0 \quad \text{{at}} \quad {sympy_latex(problem.space)} = {sympy_latex(end)}" for part in parts if part != 0]
    for field, value in problem.base_state.items():
        left = list(field) if hasattr(field, "shape") else [field]
        right = list(ImmutableMatrix(value)) if hasattr(value, "shape") else [value] * len(left)
        rows += [rf"{shown(a)} &= {shown(b)} \quad \text{{(base state)}}" for a, b in zip(left, right, strict=True)]
    return display(rows)


def function_name(applied: AppliedUndef) -> str:
    """Return the LaTeX of a field's name."""
    return sympy_latex(Symbol(applied.func.__name__))


def all_orders(writer: Writer) -> str:
    """Return every order, one after the other."""
    return display(row for name in order_names(writer.derivation) for row in order_rows(writer, name))


def order_display(writer: Writer, name: str) -> str:
    """Return the display of one order."""
    return display(order_rows(writer, name))


def forced_rows(writer: Writer, order: str, forcing: Mapping[tuple[str, int], list[str]]) -> list[str]:
    """Return the rows of an order: linear part = forcing."""
    expansion = writer.derivation.expansion
    rows = []
    for kind, group, place in (("row", expansion.rows, None), *((end, rows, place) for end, rows, place in zip(
            ("left", "right"), expansion.ends, writer.formulation.interval or (), strict=False))):
        for number, row in enumerate(group):
            if not row.linear():
                continue
            where = rf" \quad \text{{at}} \quad {writer.names[writer.formulation.space]} = {sympy_latex(place)}" if place is not None else ""
            left = joined(writer.jets(row.linear(), order), 4)
            rows.append(f"{left} &= {joined(forcing.get((kind, number), ['0']), 2)}{where}")
    return rows


def carried(writer: Writer, monomial: Monomial, harmonic: int) -> str:
    """Return a monomial with its exponential."""
    factor = "" if abs(harmonic) == 1 else str(abs(harmonic))
    wave = "" if harmonic == 0 else rf" e^{{{'-' if harmonic < 0 else ''}{factor}i\omega\tau}}"
    return writer.monomial(monomial) + wave


def order_rows(writer: Writer, name: str) -> list[str]:
    """Return the rows of one order and its solution."""
    reduction = writer.derivation.reduction
    definitions = reduction.functions.definitions
    if name == "1/2":
        rows = forced_rows(writer, "1/2", {})
        for unknown in writer.formulation.unknowns:
            parts = [rf"\left({writer.text(one.values[unknown.index])}\right) {carried(writer, one.monomial, one.harmonic)}" for one in reduction.mode.contributions if unknown.index in one.values]
            if parts:
                rows.append(f"{writer.unknown(unknown.index)}^{{(1/2)}} &= {joined(parts, 2)}")
        return rows
    if name == "1":
        forcing: dict[tuple[str, int], list[str]] = {}
        rows_by_response = []
        for response in reduction.responses:
            given = given_of(writer, response.monomial)
            for key, value in given.items():
                forcing.setdefault(key, []).append(rf"\left({writer.text(value)}\right) {carried(writer, response.monomial, response.harmonic)}")
            for index, value in response.values.items():
                shown = definitions[value].expression if isinstance(value, Symbol) and value in definitions else value
                rows_by_response.append(f"{writer.superscript(writer.unknown(index), response.monomial)} &= {joined(writer.terms(shown), 3)}")
            if response.explicit is not None and response.states and response.states[0].name.startswith(f"w_{response.name}"):
                s = writer.names[writer.formulation.space]
                left_end, right_end = (sympy_latex(end) for end in writer.formulation.interval or ())
                for state, side, slope, constant in response.explicit:
                    start = "" if constant == 0 else rf"\left[{writer.text(constant)}\right]_{{{s}={left_end if side == 'left' else right_end}}}"
                    bounds = rf"\int_{{{left_end}}}^{{{s}}}" if side == "left" else rf"-\int_{{{s}}}^{{{right_end}}}"
                    rows_by_response.append(rf"{writer.text(response.states[state])} &= {start} {'+' if start and side == 'left' else ''}{bounds} \left({writer.text(slope)}\right) d{s}")
        return forced_rows(writer, "1", forcing) + rows_by_response
    forcing = {}
    slow: list[Coefficient] = [reduction.xi, *reduction.coefficients]
    for one in slow:
        for key, value in one.forcing.items():
            shown = definitions[value].expression if isinstance(value, Symbol) and value in definitions else value
            weight = r"\frac{dA}{dT}" if one.monomial == "dA/dt" else amplitude_term(one.monomial, reduction.vector)
            wave = r" e^{i\omega\tau}" if reduction.kind == "hopf" else ""
            forcing.setdefault(key, []).append(rf"- \left({writer.text(shown)}\right) \left[{weight}\right]{wave}")
    rows = forced_rows(writer, "3/2", forcing)
    return [*rows, r"&\text{with terms that are not secular left out}"]


def given_of(writer: Writer, monomial: Monomial) -> dict[tuple[str, int], Expr]:
    """Return the forcing of each row at a monomial of second order, from the rows' Taylor terms."""
    from derive.response import Orders

    derivation = writer.derivation
    reduction = derivation.reduction
    orders = Orders(derivation.expansion, reduction.amplitudes, reduction.functions, reduction.mode.growth)
    orders.contributions.extend(reduction.mode.contributions)
    result: dict[tuple[str, int], Expr] = {}

    def add(kind: str, rows: Sequence[TaylorRow]) -> None:
        for number, row in enumerate(rows):
            value = -orders.at(row, monomial)
            if value != 0:
                result[kind, number] = value.expand()

    add("row", derivation.expansion.rows)
    for kind, rows in zip(("left", "right"), derivation.expansion.ends, strict=False):
        add(kind, rows)
    return result


def matrix(writer: Writer, rows: Sequence[Sequence[Expr]]) -> str:
    """Return a matrix."""
    body = r" \\ ".join(" & ".join(writer.text(entry) for entry in row) for row in rows)
    columns = "c" * max((len(row) for row in rows), default=1)
    return rf"\left(\begin{{array}}{{{columns}}} {body} \end{{array}}\right)"


def adjoint(writer: Writer) -> str:
    """Return the operator, the adjoint operator, both sets of boundary rows and the boundary form."""
    reduction = writer.derivation.reduction
    operator = reduction.mode.operator
    phi = r"\vec{\varphi}"
    n = operator.size
    states = ",\\, ".join(writer.names[symbol] for symbol in reduction.mode.phi)
    zetas = ",\\, ".join(writer.names[symbol] for symbol in reduction.solvability.zeta)
    if not isinstance(operator, FirstOrderOperator) or reduction.solvability.adjoint is None:
        return display([rf"{matrix(writer, operator.matrix)} {phi} &= \vec{{0}}, \quad {phi} = ({states})^{{T}}",
                        rf"\vec{{\zeta}}^{{T}} {matrix(writer, operator.matrix)} &= \vec{{0}}, \quad \vec{{\zeta}} = ({zetas})^{{T}}"])
    s = writer.names.get(writer.formulation.space, "s")
    left, right = (sympy_latex(end) for end in writer.formulation.interval or ())
    adj = reduction.solvability.adjoint
    rows = [
        rf"\frac{{d{phi}}}{{d{s}}} &= {matrix(writer, operator.matrix)} {phi}, \quad {phi} = ({states})^{{T}}",
        rf"\mathsf{{S}} &= {matrix(writer, operator.left.matrix)} \text{{ at }} {s}={left}, \quad \mathsf{{T}} = {matrix(writer, operator.right.matrix)} \text{{ at }} {s}={right}",
        rf"\frac{{d\vec{{\zeta}}}}{{d{s}}} &= {matrix(writer, adj.matrix)} \vec{{\zeta}}, \quad \vec{{\zeta}} = ({zetas})^{{T}}",
        rf"\mathsf{{S}}^{{\dagger}} &= {matrix(writer, adj.left)} \text{{ at }} {s}={left}, \quad \mathsf{{T}}^{{\dagger}} = {matrix(writer, adj.right)} \text{{ at }} {s}={right}",
        rf"J &= \left[\vec{{\zeta}}^{{T}} {phi}\right]_{{{left}}}^{{{right}}} = \int_{{{left}}}^{{{right}}} \vec{{\zeta}}^{{T}} \vec{{f}} \, d{s}",
    ]
    if operator.scalar:
        top = rf"\varphi^{{({n})}}"
        value = writer.text(sum((operator.matrix[-1][j] * reduction.mode.phi[j] for j in range(n)), Integer(0)))
        rows.append(rf"{top} &= {value}")
        for unknown in writer.formulation.unknowns:
            over = operator.recovery.get(unknown.index)
            if over is not None:
                rows.append(rf"{writer.unknown(unknown.index)} &= {writer.text(sum((over[0][j] * reduction.mode.phi[j] for j in range(n)), Integer(0)))}")
    return display(rows)


def solvability(writer: Writer) -> str:
    """Return the general condition, for any forcing f of the rows and any boundary data g, h."""
    condition = writer.derivation.reduction.solvability
    s = writer.names.get(writer.formulation.space, "s")
    terms = [rf"\left({writer.text(multiplier)}\right) f_{{{row + 1}}}" for row, multiplier in condition.interior.items()]
    ends = dict(zip(("left", "right"), (sympy_latex(end) for end in writer.formulation.interval or ()), strict=False))
    if not ends:
        return display([f"{joined(terms)} &= 0"])
    parts = [rf"\int_{{{ends['left']}}}^{{{ends['right']}}} \left[{' + '.join(terms)}\right] d{s}"]
    for (end, row, order), multiplier in condition.boundary.items():
        parts.append(rf"\left[\left({writer.text(multiplier)}\right) f_{{{row + 1}}}{chr(39) * order}\right]_{{{s}={ends[end]}}}")
    for (end, row), multiplier in condition.data.items():
        parts.append(rf"\left[{writer.text(multiplier)}\right]_{{{s}={ends[end]}}} {'g' if end == 'left' else 'h'}_{{{row + 1}}}")
    return display([f"{joined(parts, 2)} &= 0"])


def amplitude_term(monomial: str, vector: bool) -> str:
    """Return a monomial of the amplitude equation."""
    bold = r"\mathbf{A}" if vector else "A"
    table = {
        "mu*A": rf"\mu {bold}", "A**2*conj(A)": r"|A|^{2} A", "A**2": "A^{2}", "A**3": "A^{3}", "epsilon*A": rf"\epsilon {bold}",
        "dot(A,A)*conj(A)": rf"({bold}\cdot{bold}) {bold}^{{*}}", "dot(A,conj(A))*A": rf"({bold}\cdot{bold}^{{*}}) {bold}", "dot(A,A)*A": rf"({bold}\cdot{bold}) {bold}",
        "epsilon": r"\epsilon",
    }
    return table.get(monomial, monomial)


def coefficient_symbol(one: Coefficient, index: int) -> str:
    """Return the symbol of a coefficient: its name, or c with an index."""
    return sympy_latex(Symbol(one.name)) if re.fullmatch(r"[A-Za-z]\w*", one.name) else f"c_{{{index}}}"


def amplitude(writer: Writer) -> str:
    """Return the amplitude equation and every coefficient as quadratures, with the functions that they name."""
    reduction = writer.derivation.reduction
    bold = r"\mathbf{A}" if reduction.vector else "A"
    listed = [*reduction.coefficients]
    terms = [f"{coefficient_symbol(one, k + 1)} {amplitude_term(one.monomial, reduction.vector)}" for k, one in enumerate(listed)]
    rows = [rf"\frac{{d{bold}}}{{dt}} &= {joined(terms, 4)}"]
    s = writer.names.get(writer.formulation.space, "s")
    ends = tuple(sympy_latex(end) for end in writer.formulation.interval or ())

    def integral(one: Coefficient) -> str:
        parts = []
        if one.integrand != 0:
            body = writer.text(one.integrand)
            parts.append(rf"\int_{{{ends[0]}}}^{{{ends[1]}}} \left[{body}\right] d{s}" if ends else body)
        for place, value in zip(ends, (one.left, one.right), strict=False):
            if value != 0:
                parts.append(rf"\left[{writer.text(value)}\right]_{{{s}={place}}}")
        return joined(parts, 1)

    rows.append(rf"\xi &= {integral(reduction.xi)}")
    rows += [rf"-\xi\, {coefficient_symbol(one, k + 1)} &= {integral(one)}" for k, one in enumerate(listed)]
    if reduction.quadratic is not None:
        rows.append(rf"-\xi\, c_{{A^{{2}}}} &= {integral(reduction.quadratic)}")
    for definition in reduction.functions.definitions.values():
        if not definition.symbol.name.count("mirror"):
            rows.append(f"{writer.names[definition.symbol]} &= {joined(writer.terms(definition.expression))}")
    return display(rows)


def document(derivation: Derivation) -> str:
    """Return the derivation as a document that compiles with pdflatex."""
    writer = Writer(derivation)
    name = derivation.problem.name.replace("_", r"\_")
    titles = {"statement": "Statement", "orders": "Orders of the expansion", "adjoint": "Adjoint problem", "solvability": "Solvability", "amplitude": "Amplitude equation"}
    makers = {"statement": statement, "adjoint": adjoint, "solvability": solvability, "amplitude": amplitude}
    lines = [
        "% Emitted by `fredholm derive`; do not edit.", r"\documentclass[a4paper,10pt]{article}", r"\usepackage{amsmath,amssymb}",
        r"\usepackage[margin=15mm,landscape]{geometry}", r"\allowdisplaybreaks", rf"\title{{{name}: weakly nonlinear analysis}}", r"\date{}", r"\begin{document}", r"\maketitle",
    ]
    for part in PARTS:
        lines.append(rf"\section{{{titles[part]}}}")
        if part == "orders":
            for order in order_names(derivation):
                lines += [rf"\subsection{{$O(\epsilon^{{{order}}})$}}", breakable(order_rows(writer, order))]
        else:
            lines.append(breakable(undisplayed(makers[part](writer))))
    return "\n".join([*lines, r"\end{document}", ""])


def undisplayed(text: str) -> list[str]:
    """Return the rows of a display."""
    return text.removeprefix("\\begin{aligned}\n").removesuffix("\n\\end{aligned}").split(" \\\\\n")


def breakable(rows: Sequence[str]) -> str:
    """Return rows as a display that may break across pages."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"
