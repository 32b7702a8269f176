r"""States, stability and laws at the threshold as LaTeX displays, with the proof that there are no other states."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from sympy import Add, Expr, Integer, Matrix, Mul, Poly, Symbol, expand, factor, factor_list, im, symbols
from sympy import latex as sympy_latex

from derive.latex import display
from derive.notation import monomial_text
from derive.states import AREA, COSINE, DOT, MAGNITUDE, MU, NU, SIGMA, SINE, SQUARE, TURN, base_eigenvectors, characteristic, cross, dot_rate, invariant_rates, real_system

if TYPE_CHECKING:
    from derive.states import Analysis, State, States, Term

SIZE, DOUBLE, DOUBLE_BAR = symbols("size_A turn2 turn2_bar")
COMMA = r", \quad "


class Writer:
    """Names of the symbols of one analysis in LaTeX."""

    def __init__(self, analysis: Analysis) -> None:
        self.analysis, self.equation = analysis, analysis.equation
        self.vector = self.equation.dimension == 2
        self.amplitude = r"\mathbf{A}" if self.vector else "A"
        self.bar = rf"\bar{{{self.amplitude}}}"
        size = self.bar if self.equation.unknown == MAGNITUDE else rf"|{self.bar}|"
        self.names: dict[Symbol, str] = {MU: r"\mu", NU: r"\nu", SIGMA: r"\sigma", MAGNITUDE: size, TURN: r"e^{i\vartheta}", DOUBLE: r"e^{2i\vartheta}", DOUBLE_BAR: r"e^{-2i\vartheta}",
                                         COSINE: r"\cos 2\vartheta", SINE: r"\sin 2\vartheta", SIZE: rf"|{self.amplitude}|", AREA: r"|\mathbf{B}|", DOT: r"\mathbf{A}\cdot\mathbf{A}"}
        for k, term in enumerate(self.equation.terms, 1):
            base = sympy_latex(Symbol(term.name)) if re.fullmatch(r"[A-Za-z]\w*", term.name) else f"c_{{{k}}}"
            plain = "_" not in base and "^" not in base
            self.names[term.value] = base
            if self.equation.is_complex:
                self.names |= {term.conjugate: f"{base}^{{*}}", term.real: f"{base}_{{r}}" if plain else rf"\operatorname{{Re}} {base}"}
                if isinstance(term.imaginary, Symbol):
                    self.names |= {term.imaginary: f"{base}_{{i}}" if plain else rf"\operatorname{{Im}} {base}"}

    def text(self, value: Expr) -> str:
        """Return an expression."""
        value = value.xreplace({TURN**2: DOUBLE, TURN**-2: DOUBLE_BAR, SQUARE**2: SIZE**4, SQUARE: SIZE**2})
        return sympy_latex(value, symbol_names=self.names)

    def factored(self, value: Expr) -> str:
        """Return an expression as a product."""
        return self.text(factor(value))

    def matrix(self, value: Matrix) -> str:
        """Return a matrix."""
        body = r" \\ ".join(" & ".join(self.text(entry) for entry in value.row(k)) for k in range(value.rows))
        return rf"\begin{{pmatrix}} {body} \end{{pmatrix}}"

    def vector_text(self, factor_name: str) -> str:
        """Return the LaTeX of a factor: A, A*, a or a*, the first two of the state."""
        small = r"\mathbf{a}" if self.vector else "a"
        return {"A": self.bar, "A*": f"{self.bar}^{{*}}", "a": small, "a*": f"{small}^{{*}}"}[factor_name]

    def product(self, factors: Sequence[str]) -> str:
        """Return (x . y) z, x z or z."""
        texts = [self.vector_text(one) for one in factors]
        if len(texts) == 3 and self.vector:
            return rf"({texts[0]}\cdot {texts[1]})\, {texts[2]}"
        return r"\, ".join(texts)

    def with_coefficient(self, term: Term, factors: Sequence[str], count: int = 1) -> str:
        """Return a term of a sum."""
        scale = r"\mu " if term.scale == MU else ""
        return f"{count if count > 1 else ''}{self.names[term.value]} {scale}{self.product(factors)}"


def equation_rows(writer: Writer) -> list[str]:
    """Return the amplitude equation and the steady equation.          [label: steady amplitude]"""
    equation = writer.equation
    dynamic = " + ".join(f"{writer.names[term.value]} {monomial_text(term.monomial, writer.amplitude)}" for term in equation.terms)
    rows = [rf"\frac{{d{writer.amplitude}}}{{dt}} &= {dynamic}"]
    steady = " + ".join(writer.with_coefficient(term, term.factors) for term in equation.terms)
    if equation.is_complex:
        rows.append(rf"{writer.amplitude} = e^{{i\nu t}} {writer.bar}: \qquad {steady} - i\nu {writer.bar} &= 0")
    else:
        rows.append(f"{steady} &= 0")
    return rows


def proof_rows(writer: Writer) -> list[str]:
    """Return why there are no other relative equilibria."""
    equation, bar = writer.equation, writer.bar
    if equation.kind == "complex vector":
        square, area = invariant_rates(equation)
        alpha = next(term for term in equation.terms if term.monomial == "dot(A,A)*conj(A)")
        rows = [
            rf"&\text{{No others: the cross product of }} {bar} \text{{ with the steady equation leaves}}",
            rf"{writer.names[alpha.value]}\, ({bar}\cdot {bar})\, {bar}\times {bar}^{{*}} &= 0,",
            rf"&\text{{so that }} {bar}\times {bar}^{{*}} = 0 \text{{ (planar) or }} {bar}\cdot {bar} = 0 \text{{ (circular).}}",
            rf"\frac{{d}}{{dt}}(\mathbf{{A}}^{{*}}\times\mathbf{{A}}) &= \left({writer.text(collected(equation, area / AREA))}\right) \mathbf{{A}}^{{*}}\times\mathbf{{A}}",
            rf"\frac{{d}}{{dt}}(\mathbf{{A}}\cdot\mathbf{{A}}) &= \left({writer.text(2 * (dot_rate(equation, 'A') / DOT).expand())}\right) \mathbf{{A}}\cdot\mathbf{{A}}",
            rf"\frac{{d}}{{dt}}|\mathbf{{A}}|^{{2}} &= {writer.text(collected(equation, square))},",
            r"|\mathbf{B}| &= |\mathbf{A}^{*}\times\mathbf{A}|, \quad |\mathbf{A}\cdot\mathbf{A}|^{2} = |\mathbf{A}|^{4} - |\mathbf{B}|^{2}",
            r"&\text{An ellipse that also turns about the axis has constant } |\mathbf{A}|,\ |\mathbf{B}| \neq 0;"
            rf"\text{{ both rates vanish only if }} {writer.names[alpha.real]}\, |\mathbf{{A}}\cdot\mathbf{{A}}|^{{2}} = 0\text{{: it is circular, unless }} {writer.names[alpha.real]} = 0.",
        ]
        return rows
    if writer.vector:
        return [rf"&\text{{No others: the right-hand side is parallel to }} {writer.amplitude}\text{{, whose direction is therefore kept and arbitrary.}}"]
    invariant = "|A|^{2}" if equation.is_complex else "A"
    return [rf"&\text{{No others: the right-hand side is }} A \text{{ times a polynomial in }} {invariant} \text{{ whose roots are those below.}}"]


def collected(equation: Any, value: Expr) -> Expr:
    """Return a rate in the real parts of the coefficients, each once."""
    parts = equation.in_parts(value)
    return Add(*(parts.expand().coeff(term.real) * term.real for term in equation.terms))


def form_of(writer: Writer, state: State) -> str:
    """Return the form of a state and what is free in it.          [labels: beating form, cw form]"""
    size, bar = f"|{writer.bar}|", writer.bar
    forms = {
        "beating": (rf"{size} e^{{i\vartheta}} \mathbf{{e}}", r"direction } \mathbf{e} \text{ and phase } \vartheta \text{ arbitrary"),
        "whirling": (rf"\tfrac{{1}}{{\sqrt{{2}}}} {size} (\mathbf{{e}} \pm i\, \mathbf{{n}}\times\mathbf{{e}})",
                     rf"phase vector }} \mathbf{{e}} \text{{ arbitrary; with the plus sign it turns {sense(writer, state)}, seen with }} \mathbf{{n}} \text{{ towards the eye"),
        "cycle": (rf"{size} e^{{i\vartheta}}", r"phase } \vartheta \text{ arbitrary"),
        "branch": (rf"{size} \mathbf{{e}}" if writer.vector else rf"\pm {size}", r"direction } \mathbf{e} \text{ arbitrary" if writer.vector else "both signs"),
    }
    shape, free = forms[state.name]
    return rf"&\text{{{state.name}: }} {bar} = {shape}, \quad \text{{{free}}}"


def sense(writer: Writer, state: State) -> str:
    """Return the sense of rotation: Im(A x A*) along the axis is that of the right hand."""
    if state.name != "whirling":
        return ""
    shape = Matrix(state.shape)
    return "clockwise" if im(expand(cross(shape, shape.applyfunc(writer.equation.conjugated)) / MAGNITUDE**2)) < 0 else "counterclockwise"


def state_rows(writer: Writer, state: State) -> list[str]:
    """Return form, magnitude, frequency and existence of a state.          [labels: beating eq/sol, cw eq/sol]"""
    condition = writer.text(state.condition)
    if writer.equation.unknown == MAGNITUDE:
        size = writer.text(-MU * writer.equation.linear.real / state.nonlinear)
        return [rf"&\text{{{state.name}}}", f"{condition} &= 0", rf"{writer.bar} &= {size}, \quad \text{{for both signs of }} \mu \text{{ (transcritical)}}"]
    shown, size, square = writer.text(state.nonlinear), writer.text(peak(state)), writer.text(state.amplitude_squared)
    turning, frequency = (r" - i\nu", COMMA + rf"\nu = {writer.text(state.frequency_correction)}") if writer.equation.is_complex else ("", "")
    return [
        form_of(writer, state), f"{condition}{turning} &= 0", f"{writer.text(MAGNITUDE**2)} &= {square}{frequency}",
        rf"&\text{{exists for }} \mu > 0 \text{{ if }} {shown} < 0 \text{{ (supercritical), for }} \mu < 0 \text{{ if }} {shown} > 0 \text{{ (subcritical); largest displacement }} {size}",
    ]


def peak(state: State) -> Expr:
    """Return the largest displacement as a multiple of the magnitude."""
    return MAGNITUDE * (state.peak_squared / state.amplitude_squared).cancel() ** (Integer(1) / 2)


def linear_amplitude_row(writer: Writer) -> str:
    """Return the linearised amplitude equation, by the product rule.          [label: linear amplitude]"""
    parts = []
    for term in writer.equation.terms:
        counts: Counter[tuple[str, ...]] = Counter()
        for k, one in enumerate(term.factors):
            factors = [*term.factors[:k], "a*" if one == "A*" else "a", *term.factors[k + 1:]]
            counts[(*sorted(factors[:-1]), factors[-1]) if writer.vector else tuple(sorted(factors))] += 1
        parts += [writer.with_coefficient(term, factors, count) for factors, count in counts.items()]
    small = writer.vector_text("a")
    turning = rf" - i\nu {small}" if writer.equation.is_complex else ""
    return rf"\frac{{d{small}}}{{dt}} &= {' + '.join(parts)}{turning}"


def part_of(name: str, part: str) -> str:
    """Return the symbol of the real or imaginary part of a component."""
    return f"{name[:-1]} {part}}}" if name.endswith("}") else f"{name}_{{{part}}}"


def components(writer: Writer, state: State) -> list[str]:
    """Return the symbols of the perturbation along e and n x e."""
    if not writer.vector:
        return ["a"]
    return [r"a_{\parallel}", r"a_{\perp}"] if state.name == "beating" else ["a_{1}", "a_{2}"]


def system_rows(writer: Writer, state: State, names: list[str]) -> list[str]:
    """Return the real systems.          [labels: beating stability parallel/perpendicular system, cw stability perpendicular system]"""
    system = real_system(writer.equation, Matrix(state.P), Matrix(state.Q))
    blocks = [(system[:2, :2], names[:1]), (system[2:, 2:], names[1:])] if state.name == "beating" else [(system, names)]
    rows = []
    for block, over in blocks:
        column = r" \\ ".join(part_of(name, part) for name in over for part in "ri")
        vector = rf"\begin{{pmatrix}} {column} \end{{pmatrix}}"
        rows.append(rf"\frac{{d}}{{dt}} {vector} &= {writer.text(MAGNITUDE**2)} {writer.matrix(block)} {vector}")
    return rows


def stability_rows(writer: Writer, state: State) -> list[str]:
    """Return the linearisation about a state, its real systems and its eigenvalues."""
    names = components(writer, state)
    along = rf"\mathbf{{a}} = {names[0]} \mathbf{{e}} + {names[1]} \mathbf{{n}}\times\mathbf{{e}}" if writer.vector else ""
    rows = [rf"&\text{{{state.name}: }} {along}"]
    for k, name in enumerate(names):
        pieces = [(entry, f"{other}{star}") for table, star in ((state.P, ""), (state.Q, "^{*}")) for entry, other in zip(table.row(k), names, strict=True) if entry != 0]
        rows.append(rf"\frac{{d{name}}}{{dt}} &= " + (" + ".join(rf"\left({writer.factored(entry)}\right) {other}" for entry, other in pieces) or "0"))
    if writer.equation.is_complex:
        rows += [*system_rows(writer, state, names), rf"{writer.text(dispersion(writer, state))} &= 0"]
    generator = {"phase": rf"i{writer.bar}", "rotation": rf"\mathbf{{n}}\times{writer.bar}"}
    for one in state.eigenvalues:
        reason = COMMA + r"\text{neutral by }" + r"\text{ and }".join(rf"\text{{{name}, }} {generator[name]}" for name in one.neutral) if one.neutral else ""
        rows.append(rf"\sigma_{{\text{{{one.direction}}}}} &= {writer.text(one.value)}{reason}")
    return rows


def dispersion(writer: Writer, state: State) -> Expr:
    """Return the characteristic polynomial with real coefficients, factored.          [label: cw dispersion]"""
    polynomial = characteristic(writer.equation, Matrix(state.P), Matrix(state.Q))
    parts = [(one, count) for one, count in factor_list(writer.equation.in_parts(polynomial))[1] if SIGMA in one.free_symbols]
    return Mul(*((one / Poly(one, SIGMA).LC()).expand() ** count for one, count in parts))


def base_rows(writer: Writer, state: State) -> list[str]:
    """Return the linearisation about A = 0.          [labels: stability stationary sys, stationary eigenvalues]"""
    small, gamma = writer.vector_text("a"), writer.equation.linear
    rows = [rf"&\text{{{state.name}: }} {writer.bar} = 0", rf"\frac{{d{small}}}{{dt}} &= {writer.text(gamma.value * MU)} {small}"]
    if writer.equation.is_complex:
        system = Matrix([[gamma.real, -gamma.imaginary], [gamma.imaginary, gamma.real]])
        column = rf"\begin{{pmatrix}} {small}_{{r}} \\ {small}_{{i}} \end{{pmatrix}}"
        rows.append(rf"\frac{{d}}{{dt}} {column} &= \mu {writer.matrix(system)} {column}")
        for value, vector in base_eigenvectors(writer.equation):
            rows.append(rf"\sigma = {writer.text(value * MU)}: \quad {column} &= {writer.matrix(vector)} \mathbf{{e}}_{{1}},\ {writer.matrix(vector)} \mathbf{{e}}_{{2}}" if writer.vector
                        else rf"\sigma = {writer.text(value * MU)}: \quad {column} &= {writer.matrix(vector)}")
        return rows
    values = sorted({writer.text(one.by_magnitude) for one in state.eigenvalues}, key=len)
    count = len(state.eigenvalues) // len(values)
    rows.append(rf"\sigma &= {COMMA.join(values)}" + (rf" \quad \text{{({count} each)}}" if count > 1 else ""))
    return rows


def threshold_rows(writer: Writer) -> list[str]:
    """Return what becomes of perturbations at mu = 0.          [labels: nonlinear stability AB eqs, planar sol, nonplanar powerlaws]"""
    analysis, equation = writer.analysis, writer.equation
    rows = [r"&\text{At the threshold, } \mu = 0:"]
    start, size = rf"|{writer.amplitude}(0)|", rf"|{writer.amplitude}|"
    if equation.unknown == MAGNITUDE:
        rate = writer.text(analysis.thresholds[0].rate)
        return [*rows, rf"A(t) &= \frac{{A(0)}}{{1 - {rate} A(0) t}}, \quad \text{{which decays if }} {rate} A(0) < 0 \text{{ and is infinite in a finite time if }} {rate} A(0) > 0"]
    if equation.kind == "complex vector":
        square, area = (collected(equation, value.subs(MU, 0)) for value in invariant_rates(equation))
        rows.append(rf"\frac{{d|\mathbf{{A}}|}}{{dt}} &= {writer.text((square / (2 * SQUARE)).expand().subs(SQUARE, SIZE**2) * SIZE)}, \quad \frac{{d|\mathbf{{B}}|}}{{dt}} = {writer.text(area)}")
    for law in analysis.thresholds:
        rate = writer.text(law.rate.expand())
        minus = writer.text((-law.rate).factor())
        rows.append(rf"{size} &= \frac{{{start}}}{{\sqrt{{1 - \left({rate}\right) {start}^{{2}} t}}}} \sim \frac{{1}}{{\sqrt{{{minus} t}}}} \quad \text{{as }} t\to\infty"
                    + (rf" \quad \text{{({law.perturbation})}}" if len(analysis.thresholds) > 1 else "") + rf" \text{{ if }} {rate} < 0\text{{; infinite in a finite time if it is positive}}")
    if equation.kind == "complex vector":
        chosen = writer.text(analysis.selection)
        circular = writer.text((-analysis.thresholds[1].rate).factor())
        rows += [rf"\frac{{d\rho}}{{d\theta}} &= -2 {chosen}\, \rho (1 - \rho^{{2}}), \quad \rho = |\mathbf{{B}}|/|\mathbf{{A}}|^{{2}}, \quad d\theta = |\mathbf{{A}}|^{{2}} dt",
                 rf"&\text{{so that a perturbation that is not planar becomes circular if }} {chosen} < 0,\ |\mathbf{{A}}| \sim 1/\sqrt{{{circular} t}},\ |\mathbf{{B}}| \sim 1/({circular} t),"
                 rf"\text{{ and planar if }} {chosen} > 0"]
    return rows


def parts_of(states: States) -> list[tuple[str, list[str]]]:
    """Return the displays with their titles."""
    result = []
    for analysis in states.analyses:
        writer = Writer(analysis)
        suffix = ""
        if len(states.analyses) > 1:
            suffix = " (the coefficient of A**2 does not vanish)" if writer.equation.unknown == MAGNITUDE else " (the coefficient of A**2 vanishes)"
        base, *others = analysis.states
        result.append((f"States{suffix}", [*equation_rows(writer), *proof_rows(writer)]))
        result += [(f"State: {state.name}{suffix}", state_rows(writer, state)) for state in others]
        result.append((f"Stability: {base.name}{suffix}", base_rows(writer, base)))
        result.append((f"Linearisation{suffix}", [linear_amplitude_row(writer)]))
        result += [(f"Stability: {state.name}{suffix}", stability_rows(writer, state)) for state in others]
        result.append((f"At the threshold{suffix}", threshold_rows(writer)))
    if states.weak:
        result[0][1].append(r"&\text{Weak effects are left out: the states are those at } \epsilon = 0.")
    return result


def latex(states: States) -> str:
    """Return all displays; they compile inside amsmath."""
    return "\n\n".join(f"% {title}\n\\[\n{display(rows)}\n\\]" for title, rows in parts_of(states))


def summary(states: States) -> str:
    """Return magnitude, frequency and eigenvalues of every state as one array."""
    rows = []
    for analysis in states.analyses:
        writer = Writer(analysis)
        for state in analysis.states:
            values = r",\ ".join(writer.text(one.value) for one in state.eigenvalues)
            rows.append(rf"\text{{{state.name}}} & {writer.text(state.amplitude_squared)} & {writer.text(state.frequency_correction)} & {values}")
    amplitude = r"\mathbf{A}" if states.equation.dimension == 2 else "A"
    body = " \\\\\n".join([rf" & |{amplitude}|^{{2}} & \nu & \sigma", *rows])
    return f"\\begin{{array}}{{llll}}\n{body}\n\\end{{array}}"


__all__ = ["latex", "summary"]
