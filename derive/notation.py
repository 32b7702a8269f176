r"""How things are written: symbols, derivatives, sums, vectors.

The symbols are the source paper's by default: critical mode :math:`\varphi`, adjoint eigenfunction :math:`\phi`, amplitude :math:`A`,
slow time :math:`T`, scaled distance to the threshold :math:`\chi`. Every one of them, and every name of the statement, can be set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from sympy import Add, Expr, I, Integer, Symbol
from sympy import latex as sympy_latex

from derive.expand import expand
from derive.operator import LAMBDA, OMEGA
from derive.statement import ProblemError, ordered_symbols
from derive.two_times import Factor, Term
from derive.vectors import Product, written

if TYPE_CHECKING:
    from derive.derivation import Derivation

SYMBOLS = {
    "mode": r"\varphi", "adjoint": r"\phi", "amplitude": "A", "frequency": r"\omega", "growth": r"\lambda", "shift": r"\chi", "small": r"\epsilon",
    "weak": r"\kappa", "slow_time": "T", "fast_time": r"\tau", "axis": r"\hat{\mathbf{n}}", "xi": r"\xi",
}
"""What can be set besides the names of the statement, with the defaults."""

I_OMEGA = Symbol("0_i_omega")  # a name that sorts first
COMPONENT = {"p": "+", "m": "-", "n": "n", "x": "x", "y": "y", "z": "z", "": ""}


def primes(k: int, star: bool = False) -> str:
    """Return the superscript of a derivative of order k, of a conjugate where `star`."""
    text = ("*" if star else "") + (r"\prime" * k if k <= 3 else f"({k})")
    return f"^{{{text}}}" if text else ""


def added(terms: Iterable[tuple[str, str]]) -> list[str]:
    """Return terms (sign, body) as text with their signs, the first one without a plus."""
    result: list[str] = []
    for sign, body in terms:
        result.append(f"- {body}" if sign == "-" else f"+ {body}" if result else body)
    return result


def joined(terms: Sequence[str], width: int = 4) -> str:
    """Return a sum, broken into lines of a few terms for an aligned display."""
    if not terms:
        return "0"
    lines = [" ".join(terms[start:start + width]) for start in range(0, len(terms), width)]
    return " \\\\\n&\\quad ".join(lines)


def array(rows: Sequence[Sequence[str]]) -> str:
    """Return a matrix."""
    if not rows:
        return r"\left(\,\right)"
    body = r" \\ ".join(" & ".join(row) for row in rows)
    return rf"\left(\begin{{array}}{{{'c' * len(rows[0])}}} {body} \end{{array}}\right)"


class Notation:
    """Names of symbols in LaTeX for one derivation.

    Parameters
    ----------
    derivation
        What is written.
    symbols
        {name: LaTeX}; names of the statement (fields, control, parameters, space) or keys of `SYMBOLS`.

    Raises
    ------
    ProblemError
        A name is neither.
    """

    def __init__(self, derivation: Derivation, symbols: Mapping[str, str] | None = None) -> None:
        self.derivation = derivation
        self.formulation = formulation = derivation.expansion.formulation
        reduction = derivation.reduction
        given = dict(symbols or {})
        known = {unknown.latex for unknown in formulation.unknowns} | {symbol.name for symbol in formulation.user_symbols}
        for name in given:
            if name not in SYMBOLS and name not in known:
                raise ProblemError(f"symbol: found {name!r}; expected a name of the statement or one of {', '.join(sorted(SYMBOLS))}")
        self.symbol = {key: given.get(key, text) for key, text in SYMBOLS.items()}
        self.given = given
        self.vector = reduction.vector
        self.hopf = reduction.kind == "hopf"
        self.axis = self.symbol["axis"]
        self.amplitude = rf"\mathbf{{{self.symbol['amplitude']}}}" if self.vector else self.symbol["amplitude"]
        self.definitions = reduction.functions.definitions
        self.names: dict[Symbol, str] = {LAMBDA: self.symbol["growth"], OMEGA: self.symbol["frequency"], I_OMEGA: f"i {self.symbol['frequency']}", formulation.weak: self.symbol["small"]}
        for theirs, ours in formulation.user_symbols.items():
            if isinstance(ours, Symbol) and ours != formulation.weak:
                self.names[ours] = given.get(theirs.name, sympy_latex(Symbol(theirs.name)))
        self.space = self.names.get(formulation.space, "s")
        self.control = self.names[formulation.control]
        self.distance = r"\tilde{\mu}" if self.control == r"\mu" else r"\mu"  # of the control from the threshold
        scalar = bool(getattr(reduction.mode.operator, "scalar", False))
        for k, (one, bar) in enumerate(zip(reduction.mode.phi, reduction.mode.phi_bar, strict=True)):
            stem = self.symbol["mode"]
            lower = "" if scalar or len(reduction.mode.phi) == 1 else f"_{{{k + 1}}}"
            self.names[one] = stem + lower + (primes(k) if scalar else "")
            self.names[bar] = stem + lower + primes(k if scalar else 0, star=True)
        size = len(reduction.solvability.zeta)
        for k, zeta in enumerate(reduction.solvability.zeta):
            self.names[zeta] = rf"\zeta_{{{k + 1}}}" if size > 1 else r"\zeta"
        for response in reduction.responses:
            for state, (unknown, order) in zip(response.states, response.operator.names, strict=True):
                if isinstance(state, Symbol) and state not in self.names:
                    marks = r"\prime" * order if order <= 3 else f"({order})"
                    self.names[state] = f"{self.component(unknown)}^{{[{self.response(response.monomial)}]{marks}}}"
        self.at_threshold = {**self.names, formulation.control: f"{{{self.control}}}_{{c}}"}

    def response(self, monomial: tuple[int, ...]) -> str:
        """Return what tells a response apart: its harmonic, or the monomial when steady."""
        amplitudes = self.derivation.reduction.amplitudes
        if self.hopf:
            return str(sum(count * one.harmonic for count, one in zip(monomial, amplitudes, strict=True)))
        return f"{self.symbol['amplitude']}^{{2}}"

    def component(self, index: int) -> str:
        """Return an unknown of the statement: a scalar field, or a component of a vector field."""
        one = self.formulation.unknowns[index]
        stem = self.given.get(one.latex, sympy_latex(Symbol(one.latex)))
        lower = COMPONENT[one.component]
        return f"{{{stem}}}_{{{lower}}}" if lower else stem

    def at_order(self, index: int, half_order: int) -> str:
        """Return an unknown at one order: a vector in bold type, a scalar, or a component."""
        text = self.field(index) if self.formulation.unknowns[index].component in ("p", "m", "n") else self.component(index)
        return f"{text}{'{}' if '_' in text else ''}_{{{half(half_order)}}}"

    def field(self, index: int) -> str:
        """Return the field of an unknown, a vector in bold type."""
        one = self.formulation.unknowns[index]
        stem = self.given.get(one.latex, sympy_latex(Symbol(one.latex)))
        return rf"\mathbf{{{stem}}}" if one.component in ("p", "m", "n") and one.latex not in self.given else stem

    def text(self, expression: Expr, threshold: bool = True) -> str:
        """Return an expression over named functions, the control at the threshold or anywhere."""
        if self.hopf and OMEGA in expression.free_symbols:  # i omega together: 1/(i omega), not -i/omega
            expression = expand(expression.xreplace({OMEGA: -I * I_OMEGA}))
        return sympy_latex(expression, symbol_names=self.at_threshold if threshold else self.names)

    def inlined(self, expression: Expr) -> Expr:
        """Return the expression with named intermediate functions written out; responses keep their names."""
        while True:
            found = [symbol for symbol in ordered_symbols(expression) if symbol in self.definitions]
            if not found:
                return expression.expand()
            expression = expression.xreplace({symbol: self.definitions[symbol].expression for symbol in found})

    def product(self, coefficient: Expr, body: str, threshold: bool = True) -> tuple[str, str]:
        """Return (sign, text) of a coefficient times something already written."""
        coefficient = coefficient.expand()
        if self.hopf and OMEGA in coefficient.free_symbols:
            coefficient = expand(coefficient.xreplace({OMEGA: -I * I_OMEGA}))
        if isinstance(coefficient, Add):
            text = self.text(coefficient, threshold)
            return "+", rf"\left({text}\right) {body}" if body else text
        sign = "+"
        if coefficient.as_ordered_factors()[0].could_extract_minus_sign() or coefficient.could_extract_minus_sign():
            sign, coefficient = "-", -coefficient
        if coefficient == 1:
            return sign, body or "1"
        return sign, f"{self.text(coefficient, threshold)} {body}".strip()

    def sum(self, expression: Expr, threshold: bool = True) -> list[str]:
        """Return the terms of an expression, each with its sign."""
        if self.hopf and OMEGA in expression.free_symbols:
            expression = expand(expression.xreplace({OMEGA: -I * I_OMEGA}))
        parts = expression.as_ordered_terms() if isinstance(expression, Add) else [expression]
        return added(self.product(part, "", threshold) for part in parts) if expression != 0 else []

    def combination(self, coefficients: Sequence[Expr], symbols: Sequence[Expr]) -> list[str]:
        """Return a linear form term by term."""
        return added(self.product(c, self.text(symbol)) for c, symbol in zip(coefficients, symbols, strict=True) if c != 0)

    def matrix(self, rows: Sequence[Sequence[Expr]]) -> str:
        """Return a matrix of expressions."""
        return array([[self.text(entry) for entry in row] for row in rows])

    def at(self, place: str) -> str:
        """Return where a boundary row holds."""
        return rf" \quad \text{{at}} \quad {self.space} = {place}"

    def factor(self, factor: Factor) -> str:
        """Return a derivative of the field of one order (of its whole vector)."""
        operators = (
            (self.symbol["slow_time"], factor.slow),
            (self.symbol["fast_time"] if factor.half_order else self.derivation_time(), factor.fast),
            (self.space, factor.space),
        )
        text = " ".join(rf"\partial_{{{name}}}" + (f"^{{{count}}}" if count > 1 else "") for name, count in operators if count)
        lower = f"_{{{half(factor.half_order)}}}" if factor.half_order else ""
        return f"{text} {self.field(factor.unknown)}{lower}".strip()

    def derivation_time(self) -> str:
        """Return the time of the statement."""
        return sympy_latex(Symbol(self.derivation.problem.time.name))

    def form(self, components: Mapping[str, Mapping[Term, Expr]], threshold: bool = True) -> list[str] | None:
        """Return a scalar or vector equation in the notation of vectors, term by term, or None where it has none."""
        unknowns = self.formulation.unknowns
        vectors = {one.index for one in unknowns if one.component in ("p", "m", "n")}

        def whole(factor: Factor) -> Factor:  # the vector, named by its + component
            one = unknowns[factor.unknown]
            if factor.unknown not in vectors:
                return factor
            return Factor(factor.unknown - ("p", "m", "n").index(one.component), factor.space, factor.fast, factor.slow, factor.half_order)

        groups: dict[tuple[int, int, tuple[Factor, ...]], dict[str, dict[Product, Expr]]] = {}
        for component, terms in components.items():
            for (control, weak, factors), coefficient in terms.items():
                group = (control, weak, tuple(sorted(whole(factor) for factor in factors)))
                slots = [factor for factor in group[2] if factor.unknown in vectors]
                number = {factor: slots.index(factor) for factor in slots}
                product = tuple(sorted((number[whole(factor)], unknowns[factor.unknown].component) for factor in factors if factor.unknown in vectors))
                entry = groups.setdefault(group, {c: {} for c in components})
                entry[component][product] = entry[component].get(product, Integer(0)) + coefficient
        result: list[tuple[str, str]] = []
        for (control, weak, factors), entry in sorted(groups.items(), key=lambda item: order_of(item[0])):
            slots = [factor for factor in factors if factor.unknown in vectors]
            numbers = tuple(slots.index(factor) for factor in slots)
            scalars = [factor for factor in factors if factor.unknown not in vectors]
            found = written(entry, numbers, self.formulation.probe.is_zero)
            if found is None:
                return None
            lead = [f"{self.symbol['shift']}" + (f"^{{{control}}}" if control > 1 else "")] if control else []
            lead += [self.symbol["weak"] if threshold else self.symbol["small"]] if weak else []
            lead += [power(self.factor(factor), scalars.count(factor)) for factor in dict.fromkeys(scalars)]
            for coefficient, one in found:
                body = one.text([self.factor(slot) for slot in slots], self.axis)
                result.append(self.product(coefficient, " ".join([*lead, body] if body else lead), threshold))
        return added(result)


def power(text: str, count: int) -> str:
    """Return a factor to a power."""
    return text if count == 1 else rf"\left({text}\right)^{{{count}}}"


def order_of(group: tuple[int, int, tuple[Factor, ...]]) -> tuple[object, ...]:
    """Return where a term stands: linear ones first, high derivatives in space first, then in time."""
    control, weak, factors = group
    return (len(factors) != 1, len(factors) == 0, weak, control, -max((factor.half_order for factor in factors), default=0),
            [(-factor.space, -factor.fast - factor.slow, factor.unknown) for factor in factors])


def half(half_order: int) -> str:
    """Return half_order/2 as text."""
    return str(half_order // 2) if half_order % 2 == 0 else f"{half_order}/2"


def plain(text: str) -> str:
    """Return text that is safe in LaTeX's text mode."""
    return re.sub(r"([_&%#$])", r"\\\1", text)


def monomial_text(monomial: str, amplitude: str, small: str = r"\epsilon", distance: str = r"\mu") -> str:
    """Return a monomial of the amplitude equation."""
    a = amplitude
    table = {
        "mu*A": f"{distance} {a}", "A**2*conj(A)": rf"\left|{a}\right|^{{2}} {a}", "A**2": f"{a}^{{2}}", "A**3": f"{a}^{{3}}", "epsilon*A": f"{small} {a}",
        "dot(A,A)*conj(A)": rf"\left({a} \cdot {a}\right) {a}^{{*}}", "dot(A,conj(A))*A": rf"\left({a} \cdot {a}^{{*}}\right) {a}", "dot(A,A)*A": rf"\left({a} \cdot {a}\right) {a}",
    }
    return table[monomial]
