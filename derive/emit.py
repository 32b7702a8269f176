"""The text of `generated/NAME.py`: the amplitude equation's coefficients over an algebra of functions.

The text is the only bridge to the numeric layer. It is the same for every PYTHONHASHSEED: nothing unordered is iterated.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from sympy import Add, Expr, I, Integer, Mul, Pow, Rational, Symbol, pi
from sympy.functions.elementary.exponential import ExpBase

from derive.adjoint import Adjoint
from derive.amplitude import weak_identifier
from derive.operator import OMEGA, FirstOrderOperator
from derive.response import Operator, Response
from derive.statement import ProblemError
from derive.symmetry import amplitude_is_odd

if TYPE_CHECKING:
    from derive.amplitude import Coefficient, Reduction
    from derive.derivation import Derivation
    from derive.onset import Onset

WIDTH = 98
CLOSE = 1e-3
FUNCTIONS = {"exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "log", "asin", "acos", "atan", "asinh", "acosh", "atanh", "erf"}
RECIPROCALS = {"cot": "tan", "sec": "cos", "csc": "sin", "coth": "tanh", "sech": "cosh", "csch": "sinh"}


class Printer:
    """Prints expressions as Python over the algebra `a`."""

    def __init__(self, derivation: Derivation) -> None:
        reduction = derivation.reduction
        self.space = derivation.expansion.formulation.space
        self.control = derivation.expansion.formulation.control
        self.parameters = list(derivation.expansion.formulation.parameters)
        self.definitions = reduction.functions.definitions
        self.stages = {Symbol(one.identifier) for one in reduction.coefficients} | {Symbol("coefficient_A2")} | {Symbol(weak_identifier(one)) for one in reduction.weak}
        self.groups: list[tuple[tuple[Symbol, ...], str]] = [
            (reduction.mode.phi, "mode"), (reduction.mode.phi_bar, "mode_bar"), (reduction.solvability.zeta, "adjoint_mode"),
        ]
        for response in reduction.responses:
            if response.own:
                self.groups.append((response.own, f"response_{response.name}"))

    def text(self, expression: Expr) -> str:
        """Return the expression as Python, terms in a fixed order."""
        return signed_sum(self.terms(expression))

    def terms(self, expression: Expr) -> list[str]:
        """Return the terms of a sum, each as Python."""
        return [self.product(term) for term in terms_of(expression)]

    def product(self, expression: Expr) -> str:
        """Return one term: sign, factors, and a division at the end."""
        coefficient, rest = expression.as_coeff_Mul()
        if not coefficient.is_Rational:
            coefficient, rest = Integer(1), expression
        if rest == 1:
            return self.number(coefficient)
        sign = "-" if coefficient < 0 else ""
        coefficient = abs(coefficient)
        factors = [] if coefficient.p == 1 else [str(coefficient.p)]
        divisors = [] if coefficient.q == 1 else [str(coefficient.q)]
        for factor in sorted(Mul.make_args(rest), key=self.rank):
            if isinstance(factor, Pow) and factor.exp.is_Rational and factor.exp < 0:
                divisors.append(self.factor(1 / factor))
            else:
                factors.append(self.factor(factor))
        top = "*".join(factors)
        if not top:
            top = "a.one"
        return sign + "/".join([top, *divisors])

    def rank(self, factor: Expr) -> tuple[int, str]:
        """Return where a factor stands: numbers, symbols, functions."""
        names = {symbol for group, _ in self.groups for symbol in group}
        symbols = factor.free_symbols
        if factor == I:
            return (0, "")
        if not symbols:
            return (1, str(factor))
        return (3 if symbols & names or symbols & set(self.definitions) or self.space in symbols else 2, str(factor))

    def number(self, value: Rational) -> str:
        """Return a rational number."""
        return str(value.p) if value.q == 1 else f"a.rational({value.p}, {value.q})"

    def factor(self, expression: Expr) -> str:
        """Return a factor, in parentheses where needed."""
        if expression == I:
            return "a.i"
        if expression == pi:
            return "a.pi"
        if expression.is_Rational:
            text = self.number(expression)
            return f"({text})" if text.startswith("-") else text
        if isinstance(expression, Symbol):
            return f"{expression.name}(a)" if expression in self.definitions or expression in self.stages else expression.name
        if isinstance(expression, Add):
            return f"({self.text(expression)})"
        if isinstance(expression, ExpBase) and expression.func.__name__ == "exp":
            return f"a.exp({self.text(expression.args[0])})"
        if expression.is_number and str(expression) == "E":
            return "a.exp(1)"
        if isinstance(expression, Pow):
            base, power = expression.base, expression.exp
            if str(base) == "E":
                return f"a.exp({self.text(power)})"
            if power.is_Integer and power > 0:
                return f"{self.factor(base)}**{power}"
            if power.is_Integer:
                return f"(a.one/{self.factor(base)}**{-power})" if power != -1 else f"(a.one/{self.factor(base)})"
            if power == Rational(1, 2):
                return f"a.sqrt({self.text(base)})"
            if power == Rational(-1, 2):
                return f"(a.one/a.sqrt({self.text(base)}))"
            return f"a.exp({self.factor(power)}*a.log({self.text(base)}))"
        name = expression.func.__name__
        if name in FUNCTIONS and len(expression.args) == 1:
            return f"a.{name}({self.text(expression.args[0])})"
        if name in RECIPROCALS:
            return f"(a.one/a.{RECIPROCALS[name]}({self.text(expression.args[0])}))"
        if isinstance(expression, Mul):
            return f"({self.product(expression)})"
        raise ProblemError(f"equations: found {name}(...) in a coefficient; expected elementary functions: {', '.join(sorted(FUNCTIONS))}, sqrt and powers")

    def bindings(self, expressions: Iterable[Expr]) -> list[str]:
        """Return the lines that bind the names which the expressions use."""
        symbols = set()
        for expression in expressions:
            symbols |= expression.free_symbols
        lines = []
        if OMEGA in symbols:
            lines.append("omega = a.frequency")
        if self.control in symbols:
            lines.append(f"{self.control.name} = a.control")
        lines.extend(f'{symbol.name} = a.parameter("{symbol.name}")' for symbol in self.parameters if symbol in symbols)
        if self.space in symbols:
            lines.append(f"{self.space.name} = a.s")
        for group, name in self.groups:
            if symbols & set(group):
                names = listed(symbol.name if symbol in symbols else f"_{symbol.name}" for symbol in group)
                lines.append(f"{names} = {name}(a)")
        return lines


def quoted(text: str) -> str:
    """Return a string literal in double quotes."""
    return json.dumps(text)


def terms_of(expression: Expr) -> list[Expr]:
    """Return the terms of a sum in SymPy's printing order."""
    return list(expression.as_ordered_terms()) if isinstance(expression, Add) else [expression]


def signed_sum(terms: Sequence[str]) -> str:
    """Return terms with their signs between them."""
    return terms[0] + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in terms[1:])


def wrapped(lead: str, terms: Sequence[str], tail: str = "", indent: str = "    ") -> list[str]:
    """Return `lead` sum `tail` as lines of at most 100 columns, one term a line where it does not fit on one."""
    line = f"{indent}{lead}{signed_sum(terms)}{tail}"
    if len(line) <= WIDTH:
        return [line]
    lines = [f"{indent}{lead}("]
    for k, term in enumerate(terms):
        signed = term if k == 0 else f"- {term[1:]}" if term.startswith("-") else f"+ {term}"
        inner = f"{indent}    "
        while len(inner + signed) > WIDTH:
            cut = breakable(signed, WIDTH - len(inner))
            if cut <= 0:
                break
            lines.append(inner + signed[:cut].rstrip())
            signed = signed[cut:].lstrip()
        lines.append(inner + signed)
    lines.append(f"{indent}){tail}")
    return lines


def breakable(text: str, width: int) -> int:
    """Return the last place before `width` where a line may be broken: before `*` or after `(`, `, `, ` + `."""
    for k in range(min(width, len(text) - 1), 10, -1):
        if text[k] == "*" and text[k - 1] != "*" and text[k + 1] != "*":
            return k
        if text[k] == " " and text[k - 1] not in "+-*/":
            return k
    return 0


def matrix_lines(name: str, rows: Sequence[Sequence[Expr]], printer: Printer) -> list[str]:
    """Return a keyword argument that is a matrix, one row a line."""
    if not rows:
        return [f"        {name}=(),"]
    lines = [f"        {name}=("]
    for row in rows:
        entries = [printer.text(entry) for entry in row]
        line = f"            ({listed(entries)}),"
        if len(line) <= WIDTH:
            lines.append(line)
            continue
        lines.append("            (")
        for entry in entries:
            while len(entry) > WIDTH - 18:
                cut = breakable(entry, WIDTH - 18)
                if cut <= 0:
                    break
                lines.append(f"                {entry[:cut].rstrip()}")
                entry = entry[cut:].lstrip()
            lines.append(f"                {entry},")
        lines.append("            ),")
    lines.append("        ),")
    return lines


def operator_lines(name: str, operator: Operator | Adjoint, printer: Printer, comment: str) -> list[str]:
    """Return the function that gives an operator."""
    bordered = isinstance(operator, (FirstOrderOperator, Adjoint))
    left: Sequence[Sequence[Expr]] = ()
    right: Sequence[Sequence[Expr]] = ()
    if isinstance(operator, FirstOrderOperator):
        left, right = operator.left.matrix, operator.right.matrix
    elif isinstance(operator, Adjoint):
        left, right = operator.left, operator.right
    used = [entry for rows in (operator.matrix, left, right) for row in rows for entry in row]
    lines = ["", "", "@stage", f"def {name}(a):", f'    """{comment}"""']
    lines += [f"    {line}" for line in printer.bindings(used)]
    lines += ["    return Operator("]
    lines += matrix_lines("matrix", operator.matrix, printer)
    if bordered:
        lines += matrix_lines("left", left, printer) + matrix_lines("right", right, printer)
    return [*lines, "    )"]


def is_constant(operator: Operator, derivation: Derivation) -> bool:
    """Tell whether the linear problem does not depend on s."""
    return not any(derivation.expansion.formulation.space in entry.free_symbols for row in operator.matrix for entry in row)


def pencil_lines(weight: int, operator: Operator, printer: Printer) -> list[str]:
    """Return the functions that give the linear problem of a weight at any growth rate, and what its elimination divided by."""
    name = f"pencil_{weight}"
    divisors: Sequence[Expr] = operator.divisors if isinstance(operator, FirstOrderOperator) else ()
    lines = operator_lines(name, operator, printer, f"The linear problem of weight {weight} at the growth rate lam.")
    lines[lines.index("@stage"):lines.index(f"def {name}(a):") + 1] = [f"def {name}(a, lam):"]
    lines += ["", "", f"def divisors_{weight}(a, lam):", f'    """What was divided by: eigenvalues where one of these vanishes may be missing from `{name}`."""']
    lines += [f"    {line}" for line in printer.bindings(divisors)]
    return [*lines, f"    return ({listed(map(printer.text, divisors))})"]


def read(side: str, expression: Expr, printer: Printer, derivation: Derivation) -> str:
    """Return an expression read at an end; a number stands for itself."""
    if derivation.reduction.functions.is_function(expression):
        return f"a.{side}({printer.text(expression)})"
    return printer.text(expression)


def integral_lines(name: str, one: Coefficient, derivation: Derivation, printer: Printer, over: str | None) -> list[str]:
    """Return the function of one solvability integral, divided by -xi where `over` is given."""
    spatial = derivation.expansion.formulation.interval is not None
    lines = ["", "", "@stage", f"def {name}(a):", f'    """Solvability integral of {one.monomial}{f", over -{over}" if over else ""}."""']
    lines += [f"    {line}" for line in printer.bindings((one.integrand, one.left, one.right))]
    if one.integrand == 0:
        lines.append("    total = a.zero")
    elif spatial:
        lines += wrapped("total = a.integral(", printer.terms(one.integrand), ")") if len(printer.text(one.integrand)) < 70 else [
            *wrapped("integrand = ", printer.terms(one.integrand)), "    total = a.integral(integrand)"]
    else:
        lines += wrapped("total = ", printer.terms(one.integrand))
    for side, expression in (("left", one.left), ("right", one.right)):
        if expression != 0:
            lines += wrapped("total = total + ", [read(side, expression, printer, derivation)])
    lines.append(f"    return -total/{over}(a)" if over else "    return total")
    return lines


def emit(derivation: Derivation) -> str:
    """Return the module: names, operators, mode, adjoint, responses, coefficients.

    Notes
    -----
    Source: label ``coefficients integrals`` of the paper.
    """
    reduction = derivation.reduction
    printer = Printer(derivation)
    pencils = {weight: operator for weight, operator in sorted(derivation.operators.items()) if weight >= 0}
    if not all(is_constant(operator, derivation) for operator in pencils.values()):
        pencils = {}  # a count of some of the eigenvalues would prove nothing
    lines = [*name_lines(derivation, tuple(pencils)), *value_lines(derivation, printer), *mode_lines(derivation, printer)]
    for weight, operator in pencils.items():
        lines += pencil_lines(weight, operator, printer)
    for name, operator in reduction.operators.items():
        if name != "critical":
            lines += operator_lines(name, operator, printer, f"The linear problem of harmonic {name.removeprefix('operator_')}.")
    for response in reduction.responses:
        if response.own:
            lines += response_lines(response, derivation, printer)
    for definition in reduction.functions.definitions.values():
        lines += ["", "", "@stage", f"def {definition.symbol.name}(a):"]
        lines += [f"    {line}" for line in printer.bindings((definition.expression,))]
        lines += wrapped("return ", printer.terms(definition.expression))
    for name, one, over in integrals_of(reduction):
        lines += integral_lines(name, one, derivation, printer, over)
    lines += fields_lines(derivation, printer)
    lines += consistency_lines("consistency", "What redundant equations demand at mu A, epsilon A and A**2: each must vanish.", reduction.linear_spare, derivation, printer)
    lines += consistency_lines("consistency_cubic", "What redundant equations demand of the responses and at third order: each must vanish.", reduction.spare, derivation, printer)
    return "\n".join([*lines, ""])


def integrals_of(reduction: Reduction) -> Iterator[tuple[str, Coefficient, str | None]]:
    """Yield (name, integral, the integral it is divided by)."""
    yield "xi", reduction.xi, None
    for one in reduction.coefficients:
        yield one.identifier, one, "xi"
    if reduction.quadratic is not None:
        yield "coefficient_A2", reduction.quadratic, "xi"
    if reduction.mirror_xi is not None:
        yield "mirror_xi", reduction.mirror_xi, None
    for identifier, one in reduction.mirror:
        yield mirror_name(identifier), one, "mirror_xi"
    for weak in reduction.weak:
        yield weak_identifier(weak), weak.coefficient, "xi" if weak.row == 0 else "mirror_xi"


def mirror_name(identifier: str) -> str:
    """Return the name of the integral of the other circular component."""
    return f"mirror_{identifier.removeprefix('coefficient_')}"


def table(name: str, entries: Iterable[str], brackets: str = "()") -> list[str]:
    """Return an assignment of a tuple or a dictionary, one entry a line."""
    return [f"{name} = {brackets[0]}", *(f"    {entry}," for entry in entries), brackets[1]]


def name_lines(derivation: Derivation, pencils: Sequence[int]) -> list[str]:
    """Return the header: what the problem is called, where it loses stability, and the names of what follows."""
    reduction, formulation, onset = derivation.reduction, derivation.expansion.formulation, derivation.onset
    frequency = "None" if onset.frequency is None else f'"{onset.frequency:.6g}"'
    lines = [
        f'"""Amplitude equation of {derivation.problem.name}. Emitted by `fredholm derive`; do not edit."""',
        "", "from numerics.algebra import Operator, stage", "",
        f"NAME = {quoted(derivation.problem.name)}", f'KIND = "{onset.kind}"', f"MULTIPLICITY = {2 if reduction.vector else 1}",
        f"SPATIAL = {formulation.interval is not None}", f'CONTROL = "{formulation.control.name}"',
        f'CONTROL_RANGE = ("{float(formulation.control_range[0])!r}", "{float(formulation.control_range[1])!r}")',
        f'ONSET = ("{onset.control:.8g}", {frequency})',
        f'NEIGHBOUR = "{max((value.real for value in onset.other_eigenvalues), default=0.0):.1e}"  # the growth rate of the next mode there, roughly',
        *table("COEFFICIENTS", (f'({quoted(one.name)}, "{one.monomial}", "{one.identifier}")' for one in reduction.coefficients)),
    ]
    if reduction.quadratic is None:
        lines.append("QUADRATIC = None")
    else:
        lines += [f'QUADRATIC = ({quoted(reduction.quadratic.name)}, "A**2", "coefficient_A2")', f"ODD = {amplitude_is_odd(derivation.expansion)}  # a symmetry of the equations changes the sign of A"]
    lines += table("MIRROR", (f'("{identifier}", "{mirror_name(identifier)}")' for identifier, _ in reduction.mirror))
    lines.append("PENCILS = (" + " ".join(f'({weight}, "pencil_{weight}"),' for weight in pencils) + ")")
    if reduction.weak:
        lines += table("WEAK", (f'("{weak_identifier(weak)}", {weak.row}, {weak.column})' for weak in reduction.weak))
        titles = {text: title for text, title in derivation.problem.coefficient_names.items() if text.startswith("epsilon")}
        lines += table("WEAK_NAMES", (f'"{text}": {quoted(titles[text])}' for text in sorted(titles)), "{}")
    else:
        lines.append("WEAK = ()")
    lines += parameter_lines(derivation)
    close = nearly_critical(onset)
    return lines + (table("NEAR_CRITICAL", (f'("{value}", "{distance}")' for value, distance in close)) if close else [])


def value_lines(derivation: Derivation, printer: Printer) -> list[str]:
    """Return the functions that give the interval and the values of the parameters."""
    formulation = derivation.expansion.formulation
    lines = []
    if formulation.interval is not None:
        lines += ["", "", "def interval(a):", '    """Return the ends of the interval."""', f"    return ({', '.join(map(printer.text, formulation.interval))})"]
    lines += ["", "", "def parameters(a):", '    """Return the values of the parameters."""', "    return {"]
    return [*lines, *(f'        "{symbol.name}": {printer.text(value)},' for symbol, value in formulation.parameters.items()), "    }"]


def mode_lines(derivation: Derivation, printer: Printer) -> list[str]:
    """Return the linear problem at the threshold with its mode, and the adjoint problem with its own."""
    mode, solvability, place = derivation.reduction.mode, derivation.reduction.solvability, derivation.expansion.formulation.place
    title = "M y = 0." if place is None else "y' = P y with its boundary rows."
    lines = operator_lines("critical", mode.operator, printer, f"The linear problem at the threshold: {title}")
    lines += ["", "", "@stage", "def mode(a):", f'    """The critical mode: {named(mode.phi)}."""', *(f"    {line}" for line in printer.bindings(mode.normalisation))]
    lines += [f"    return a.kernel(critical(a), ({listed(map(printer.text, mode.normalisation))}){'' if place is None else f', {printer.text(place)}'})"]
    lines += ["", "", "@stage", "def mode_bar(a):", '    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""', "    return tuple(a.reflect(one) for one in mode(a))"]
    if solvability.adjoint is None:
        return [*lines, "", "", "@stage", "def adjoint_mode(a):", f'    """The left null vector: {named(solvability.zeta)}."""', "    return a.left_kernel(critical(a))"]
    lines += operator_lines("adjoint", solvability.adjoint, printer, "The adjoint problem: z' = -P^T z with the adjoint boundary rows.")
    return [*lines, "", "", "@stage", "def adjoint_mode(a):", f'    """The adjoint mode: {named(solvability.zeta)}."""', "    return a.kernel(adjoint(a))"]


def named(symbols: Iterable[Symbol]) -> str:
    """Return the names of symbols."""
    return ", ".join(symbol.name for symbol in symbols)


def listed(entries: Iterable[str]) -> str:
    """Return what stands in the parentheses of a tuple: one entry has a comma too."""
    texts = list(entries)
    return f"{texts[0]}," if len(texts) == 1 else ", ".join(texts)


def parameter_lines(derivation: Derivation) -> list[str]:
    """Return what is to be known of parameters before their values are changed: names that are not the user's, zeros, values that terms vanish at."""
    formulation = derivation.expansion.formulation
    users = {new: old.name for old, new in formulation.user_symbols.items() if new in formulation.parameters}
    renamed = {symbol.name: users[symbol] for symbol in formulation.parameters if symbol in users and users[symbol] != symbol.name}
    zeros = sorted(old.name for old, new in formulation.user_symbols.items() if new == 0)
    held = sorted(users.get(symbol, symbol.name) for symbol in formulation.probe.held)
    lines = []
    if renamed:
        lines += table("PARAMETER_NAMES", (f'"{name}": {quoted(title)}' for name, title in renamed.items()), "{}")
    if zeros:
        lines += table("PARAMETERS_ZERO", map(quoted, zeros))
    if held:
        lines += table("PARAMETERS_FIXED", map(quoted, held))
    return lines


def fields_lines(derivation: Derivation, printer: Printer) -> list[str]:
    """Return how the fields of the statement follow from the amplitudes: base state, mode and second-order responses."""
    reduction, formulation = derivation.reduction, derivation.expansion.formulation
    lines = ["", "", f"AMPLITUDES = ({listed(quoted(amplitude.name) for amplitude in reduction.amplitudes)})"]
    lines += table("UNKNOWNS", (f'({quoted(unknown.latex)}, "{unknown.component}")' for unknown in formulation.unknowns))
    lines += [f"NORMALISED = {quoted(formulation.unknowns[formulation.normalised[0]].latex)}"]
    if formulation.frame is not None:
        lines += ["", "", "def frame(a):", '    """Return e1, e2 and the rotation axis."""', "    return ("]
        lines += [f"        ({', '.join(printer.text(entry) for entry in vector)})," for vector in formulation.frame] + ["    )"]
    lines += ["", "", "@stage", "def base(a):", '    """The base state, unknown by unknown."""', *(f"    {line}" for line in printer.bindings(formulation.base)), "    return ("]
    for value in formulation.base:
        lines += wrapped("", printer.terms(value), ",", indent="        ")
    lines += ["    )"]
    growing = [one for one, amplitude in zip(reduction.mode.contributions, reduction.amplitudes, strict=True) if not amplitude.conjugate]
    for title, described, terms in (("mode", "The mode", growing), ("responses", "The responses of second order", reduction.responses)):
        lines += ["", "", "@stage", f"def fields_{title}(a):", f'    """{described}: exponents over AMPLITUDES, harmonic, and {{unknown: function of s}}."""']
        lines += [f"    {line}" for line in printer.bindings(value for one in terms for value in one.values.values())]
        lines += ["    return ("] if terms else ["    return ()"]
        for one in terms:
            lines += [f"        ({one.monomial}, {one.harmonic}, {{"]
            for unknown, value in sorted(one.values.items()):
                lines += wrapped(f"{unknown}: ", printer.terms(value), ",", indent="            ")
            lines += ["        }),"]
        lines += ["    )"] if terms else []
    return lines


def nearly_critical(onset: Onset) -> list[tuple[str, str]]:
    """Return the other eigenvalues that are nearly on the imaginary axis, with their relative distance from it; to two digits, which rounding leaves alone.

    The distance is relative to the slowest rate of the problem or the second slowest decay: a mode of high frequency is not close because it turns
    fast, nor one because others decay much faster.
    """
    others = onset.other_eigenvalues
    slowest = onset.frequency or min((abs(value) for value in others), default=0.0)
    scale = max([slowest, *sorted(abs(value.real) for value in others if value.imag >= 0)[:2]])
    found = []
    for value in others:
        distance = abs(value.real) / scale
        if distance < CLOSE and value.imag >= -1e-9 * scale:
            text = f"{value.real:.2g}" if abs(value.imag) <= 1e-9 * scale else f"{value.real:.2g} + {value.imag:.4g}i"
            found.append((text, f"{distance:.2g}"))
    return found


def consistency_lines(name: str, title: str, spare: Sequence[tuple[str, str, Expr]], derivation: Derivation, printer: Printer) -> list[str]:
    """Return the function that lists what redundant rows demand."""
    lines = ["", "", f"def {name}(a):", f'    """{title}"""']
    if not spare:
        return [*lines, "    return ()"]
    lines += [f"    {line}" for line in printer.bindings([condition for _, _, condition in spare])]
    lines += ["    return ("]
    for side, text, condition in dict.fromkeys(spare):
        shown = read(side, condition, printer, derivation) if side else printer.text(condition)
        body = wrapped("", [shown], ",", indent="            ")
        lines += [f'        ("{text}",', *body[:-1], body[-1].rstrip(",") + "),"]
    return [*lines, "    )"]


def response_lines(response: Response, derivation: Derivation, printer: Printer) -> list[str]:
    """Return the function of one response: nested quadratures where they solve it, else a linear problem."""
    lines = ["", "", "@stage", f"def response_{response.name}(a):", f'    """Response to {response.name.replace("_", " ")} (harmonic {response.harmonic}): {named(response.own)}."""']
    groups = printer.groups
    own = (response.own, f"response_{response.name}")
    printer.groups = [group for group in groups if group != own]
    normal = derivation.reduction.mode.normalisation if response.singular else ()
    used = [*response.forcing, *response.left, *response.right, *normal]
    if response.explicit is not None:
        used = [entry for _, _, slope, constant in response.explicit for entry in (slope, constant)]
    lines += [f"    {line}" for line in printer.bindings(used)]
    printer.groups = groups
    if response.explicit is not None:
        for state, side, slope, constant in response.explicit:
            name = response.own[state].name
            start = "" if constant == 0 else read(side, constant, printer, derivation)
            integral = "a.integral_from_left" if side == "left" else "a.integral_to_right"
            if slope == 0:
                lines += [f"    {name} = {start or 'a.zero'} + 0*a.s"]
                continue
            sign = "" if side == "left" else "-"
            lead = f"{name} = {start}{' + ' if side == 'left' else ' - '}" if start else f"{name} = {sign}"
            lines += wrapped(f"{lead}{integral}(", printer.terms(slope), ")")
        return [*lines, f"    return {listed(state.name for state in response.own)}"]
    method = "solve_singular" if response.singular else "solve"
    lines += [f"    return a.{method}(", f"        {response.operator_name}(a),", "        forcing=("]
    for entry in response.forcing:
        lines += wrapped("", printer.terms(entry), ",", indent="            ")
    lines += ["        ),"]
    if isinstance(response.operator, FirstOrderOperator):
        for side, data in (("left", response.left), ("right", response.right)):
            lines += [f"        {side}=({listed(read(side, entry, printer, derivation) for entry in data)}),"]
    if response.singular:
        lines += [f"        row=({listed(map(printer.text, normal))}),"]
        if derivation.expansion.formulation.place is not None:
            lines += [f"        place={printer.text(derivation.expansion.formulation.place)},"]
    return [*lines, "    )"]
