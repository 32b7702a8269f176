"""The text of `generated/NAME.py`: the amplitude equation's coefficients over an algebra of functions.

The text is the only bridge to the numeric layer. It is the same for every PYTHONHASHSEED: nothing unordered is iterated.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
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
    from derive.amplitude import Coefficient
    from derive.derivation import Derivation
    from derive.onset import Onset

WIDTH = 98
CLOSE = 1e-3
FUNCTIONS = {"exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "log", "asin", "acos", "atan", "asinh", "acosh", "atanh", "erf"}


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
            if owns_states(response):
                self.groups.append((response.states, f"response_{response.name}"))

    def text(self, expression: Expr) -> str:
        """Return the expression as Python."""
        return self.sum(expression)

    def sum(self, expression: Expr) -> str:
        """Return a sum, terms in a fixed order."""
        parts = terms_of(expression)
        pieces = [self.product(term) for term in parts]
        result = pieces[0]
        for piece in pieces[1:]:
            result += f" - {piece[1:]}" if piece.startswith("-") else f" + {piece}"
        return result

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
            return f"({self.sum(expression)})"
        if isinstance(expression, ExpBase) and expression.func.__name__ == "exp":
            return f"a.exp({self.sum(expression.args[0])})"
        if expression.is_number and str(expression) == "E":
            return "a.exp(1)"
        if isinstance(expression, Pow):
            base, power = expression.base, expression.exp
            if str(base) == "E":
                return f"a.exp({self.sum(power)})"
            if power.is_Integer and power > 0:
                return f"{self.factor(base)}**{power}"
            if power.is_Integer:
                return f"(a.one/{self.factor(base)}**{-power})" if power != -1 else f"(a.one/{self.factor(base)})"
            if power == Rational(1, 2):
                return f"a.sqrt({self.sum(base)})"
            if power == Rational(-1, 2):
                return f"(a.one/a.sqrt({self.sum(base)}))"
            return f"a.exp({self.factor(power)}*a.log({self.sum(base)}))"
        name = expression.func.__name__
        if name in FUNCTIONS and len(expression.args) == 1:
            return f"a.{name}({self.sum(expression.args[0])})"
        if name in {"cot", "sec", "csc", "coth", "sech", "csch"}:
            from sympy import cos, cosh, sin, sinh, tan, tanh

            inverse = {"cot": tan, "sec": cos, "csc": sin, "coth": tanh, "sech": cosh, "csch": sinh}[name]
            return f"(a.one/{self.factor(inverse(expression.args[0]))})"
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
                names = ", ".join(symbol.name if symbol in symbols else f"_{symbol.name}" for symbol in group)
                lines.append(f"{names}{',' if len(group) == 1 else ''} = {name}(a)")
        return lines


def quoted(text: str) -> str:
    """Return a string literal in double quotes."""
    return json.dumps(text)


def terms_of(expression: Expr) -> list[Expr]:
    """Return the terms of a sum in SymPy's printing order."""
    return list(expression.as_ordered_terms()) if isinstance(expression, Add) else [expression]


def owns_states(response: Response) -> bool:
    """Tell whether the response defines its states itself (no twin does, and there is something to solve)."""
    return bool(response.states) and all(isinstance(state, Symbol) for state in response.states) and response.states[0].name.startswith(f"w_{response.name}_")


def wrapped(lead: str, terms: Sequence[str], tail: str = "", indent: str = "    ") -> list[str]:
    """Return `lead` sum `tail` as lines of at most 100 columns, one term a line where it does not fit on one."""
    joined = terms[0] + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in terms[1:])
    line = f"{indent}{lead}{joined}{tail}"
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
        line = f"            ({', '.join(entries)}{',' if len(entries) == 1 else ''}),"
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
    entries = [printer.text(entry) for entry in divisors]
    return [*lines, f"    return ({', '.join(entries)}{',' if len(entries) == 1 else ''})"]


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
    reduction, formulation = derivation.reduction, derivation.expansion.formulation
    printer = Printer(derivation)
    onset = derivation.onset
    spatial = formulation.interval is not None
    frequency = "None" if onset.frequency is None else f'"{onset.frequency:.6g}"'
    names = [(one.name, one.monomial, one.identifier) for one in reduction.coefficients]
    lines = [
        f'"""Amplitude equation of {derivation.problem.name}. Emitted by `fredholm derive`; do not edit."""',
        "", "from numerics.algebra import Operator, stage", "",
        f"NAME = {quoted(derivation.problem.name)}", f'KIND = "{onset.kind}"', f"MULTIPLICITY = {2 if reduction.vector else 1}",
        f"SPATIAL = {spatial}", f'CONTROL = "{formulation.control.name}"',
        f'CONTROL_RANGE = ("{float(formulation.control_range[0])!r}", "{float(formulation.control_range[1])!r}")',
        f'ONSET = ("{onset.control:.8g}", {frequency})',
        f'NEIGHBOUR = "{max((value.real for value in onset.other_eigenvalues), default=0.0):.1e}"  # the growth rate of the next mode there, roughly', "COEFFICIENTS = (",
    ]
    lines += [f'    ({quoted(name)}, "{monomial}", "{identifier}"),' for name, monomial, identifier in names]
    lines += [")"]
    lines += [f'QUADRATIC = ({quoted(reduction.quadratic.name)}, "A**2", "coefficient_A2")' if reduction.quadratic is not None else "QUADRATIC = None"]
    if reduction.quadratic is not None:
        lines += [f"ODD = {amplitude_is_odd(derivation.expansion)}  # a symmetry of the equations changes the sign of A"]
    lines += ["MIRROR = ("] + [f'    ("{identifier}", "mirror_{identifier.removeprefix("coefficient_")}"),' for identifier, _ in reduction.mirror] + [")"]
    weak_names = {(weak.row, weak.column): weak_identifier(weak) for weak in reduction.weak}
    weak_titles = derivation.problem.coefficient_names
    if weak_names:
        lines += ["WEAK = ("] + [f'    ("{name}", {row}, {column}),' for (row, column), name in weak_names.items()] + [")"]
        titles = {text: title for text, title in weak_titles.items() if text.startswith("epsilon")}
        lines += ["WEAK_NAMES = {"] + [f'    "{text}": {quoted(titles[text])},' for text in sorted(titles)] + ["}"]
    else:
        lines += ["WEAK = ()"]
    lines += parameter_lines(derivation)
    close = nearly_critical(onset)
    if close:
        lines += ["NEAR_CRITICAL = ("] + [f'    ("{value}", "{distance}"),' for value, distance in close] + [")"]
    ends = ", ".join(printer.text(end) for end in formulation.interval) if formulation.interval else ""
    lines += ["", "", "def interval(a):", '    """Return the ends of the interval."""', f"    return ({ends})"] if spatial else []
    lines += ["", "", "def parameters(a):", '    """Return the values of the parameters."""', "    return {"]
    lines += [f'        "{symbol.name}": {printer.text(value)},' for symbol, value in formulation.parameters.items()]
    lines += ["    }"]

    critical = reduction.mode.operator
    lines += operator_lines("critical", critical, printer, "The linear problem at the threshold: y' = P y with its boundary rows." if spatial else "The linear problem at the threshold: M y = 0.")
    place = f", {printer.text(formulation.place)}" if spatial else ""
    row = ", ".join(printer.text(entry) for entry in reduction.mode.normalisation)
    single = "," if len(reduction.mode.normalisation) == 1 else ""
    lines += ["", "", "@stage", "def mode(a):", f'    """The critical mode: {", ".join(symbol.name for symbol in reduction.mode.phi)}."""']
    lines += [f"    {line}" for line in printer.bindings(reduction.mode.normalisation)]
    lines += [f"    return a.kernel(critical(a), ({row}{single}){place})"]
    lines += ["", "", "@stage", "def mode_bar(a):", '    """The reflected mode: conjugate coefficients, so that integrands stay analytic."""', "    return tuple(a.reflect(one) for one in mode(a))"]
    if reduction.solvability.adjoint is not None:
        lines += operator_lines("adjoint", reduction.solvability.adjoint, printer, "The adjoint problem: z' = -P^T z with the adjoint boundary rows.")
        lines += ["", "", "@stage", "def adjoint_mode(a):", f'    """The adjoint mode: {", ".join(symbol.name for symbol in reduction.solvability.zeta)}."""', "    return a.kernel(adjoint(a))"]
    else:
        lines += ["", "", "@stage", "def adjoint_mode(a):", f'    """The left null vector: {", ".join(symbol.name for symbol in reduction.solvability.zeta)}."""', "    return a.left_kernel(critical(a))"]
    pencils = {weight: operator for weight, operator in derivation.operators.items() if weight >= 0}
    if not all(is_constant(operator, derivation) for operator in pencils.values()):
        pencils = {}  # a count of some of the eigenvalues would prove nothing
    lines[lines.index("WEAK = ()" if not weak_names else "WEAK = ("):0] = [
        "PENCILS = (" + "".join(f'({weight}, "pencil_{weight}"), ' for weight in sorted(pencils)).rstrip(" ") + ")"]
    for weight, operator in sorted(pencils.items()):
        lines += pencil_lines(weight, operator, printer)
    for name, operator in reduction.operators.items():
        if name != "critical":
            lines += operator_lines(name, operator, printer, f"The linear problem of harmonic {name.removeprefix('operator_')}.")
    for response in reduction.responses:
        if owns_states(response):
            lines += response_lines(response, derivation, printer)
    for definition in reduction.functions.definitions.values():
        lines += ["", "", "@stage", f"def {definition.symbol.name}(a):"]
        lines += [f"    {line}" for line in printer.bindings((definition.expression,))]
        lines += wrapped("return ", printer.terms(definition.expression))
    lines += integral_lines("xi", reduction.xi, derivation, printer, None)
    for one in reduction.coefficients:
        lines += integral_lines(one.identifier, one, derivation, printer, "xi")
    if reduction.quadratic is not None:
        lines += integral_lines("coefficient_A2", reduction.quadratic, derivation, printer, "xi")
    if reduction.mirror_xi is not None:
        lines += integral_lines("mirror_xi", reduction.mirror_xi, derivation, printer, None)
    for identifier, one in reduction.mirror:
        lines += integral_lines(f"mirror_{identifier.removeprefix('coefficient_')}", one, derivation, printer, "mirror_xi")
    for weak in reduction.weak:
        lines += integral_lines(weak_names[weak.row, weak.column], weak.coefficient, derivation, printer, "xi" if weak.row == 0 else "mirror_xi")
    lines += fields_lines(derivation, printer)
    lines += consistency_lines("consistency", "What redundant equations demand at mu A, epsilon A and A**2: each must vanish.", reduction.linear_spare, derivation, printer)
    lines += consistency_lines("consistency_cubic", "What redundant equations demand of the responses and at third order: each must vanish.", reduction.spare, derivation, printer)
    return "\n".join([*lines, ""])


def parameter_lines(derivation: Derivation) -> list[str]:
    """Return what is to be known of parameters before their values are changed: names that are not the user's, zeros, values that terms vanish at."""
    formulation = derivation.expansion.formulation
    users = {new: old.name for old, new in formulation.user_symbols.items() if new in formulation.parameters}
    renamed = {symbol.name: users[symbol] for symbol in formulation.parameters if symbol in users and users[symbol] != symbol.name}
    zeros = sorted(old.name for old, new in formulation.user_symbols.items() if new == 0)
    held = sorted(users.get(symbol, symbol.name) for symbol in formulation.probe.held)
    lines = []
    if renamed:
        lines += ["PARAMETER_NAMES = {"] + [f'    "{name}": {quoted(title)},' for name, title in renamed.items()] + ["}"]
    if zeros:
        lines += ["PARAMETERS_ZERO = ("] + [f"    {quoted(name)}," for name in zeros] + [")"]
    if held:
        lines += ["PARAMETERS_FIXED = ("] + [f"    {quoted(name)}," for name in held] + [")"]
    return lines


def fields_lines(derivation: Derivation, printer: Printer) -> list[str]:
    """Return how the fields of the statement follow from the amplitudes: base state, mode and second-order responses."""
    reduction, formulation = derivation.reduction, derivation.expansion.formulation
    names = [amplitude.name for amplitude in reduction.amplitudes]
    lines = ["", "", f"AMPLITUDES = ({', '.join(map(quoted, names))}{',' if len(names) == 1 else ''})", "UNKNOWNS = ("]
    lines += [f'    ({quoted(unknown.latex)}, "{unknown.component}"),' for unknown in formulation.unknowns]
    lines += [")", f"NORMALISED = {quoted(formulation.unknowns[formulation.normalised[0]].latex)}"]
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

    The distance is relative to the slowest rate of the problem or the fastest decay: a mode of high frequency is not close because it turns fast.
    """
    others = onset.other_eigenvalues
    slowest = onset.frequency or min((abs(value) for value in others), default=0.0)
    scale = max([slowest, *(abs(value.real) for value in others)])
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
    lines = ["", "", "@stage", f"def response_{response.name}(a):", f'    """Response to {response.name.replace("_", " ")} (harmonic {response.harmonic}): {", ".join(state.name for state in response.states)}."""']
    groups = printer.groups
    own = (response.states, f"response_{response.name}")
    printer.groups = [group for group in groups if group != own]
    normal = derivation.reduction.mode.normalisation if response.singular else ()
    used = [*response.forcing, *response.left, *response.right, *normal]
    if response.explicit is not None:
        used = [entry for _, _, slope, constant in response.explicit for entry in (slope, constant)]
    lines += [f"    {line}" for line in printer.bindings(used)]
    printer.groups = groups
    if response.explicit is not None:
        for state, side, slope, constant in response.explicit:
            name = response.states[state].name
            start = "" if constant == 0 else read(side, constant, printer, derivation)
            integral = "a.integral_from_left" if side == "left" else "a.integral_to_right"
            if slope == 0:
                lines += [f"    {name} = {start or 'a.zero'} + 0*a.s"]
                continue
            sign = "" if side == "left" else "-"
            lead = f"{name} = {start}{' + ' if side == 'left' else ' - '}" if start else f"{name} = {sign}"
            lines += wrapped(f"{lead}{integral}(", printer.terms(slope), ")")
        names = ", ".join(state.name for state in response.states)
        return [*lines, f"    return {names}{',' if len(response.states) == 1 else ''}"]
    method = "solve_singular" if response.singular else "solve"
    lines += [f"    return a.{method}(", f"        {response.operator_name}(a),", "        forcing=("]
    for entry in response.forcing:
        body = wrapped("", printer.terms(entry), ",", indent="            ")
        lines += body
    lines += ["        ),"]
    if isinstance(response.operator, FirstOrderOperator):
        for side, data in (("left", response.left), ("right", response.right)):
            entries = ", ".join(read(side, entry, printer, derivation) for entry in data)
            lines += [f"        {side}=({entries}{',' if len(data) == 1 else ''}),"]
    if response.singular:
        row = ", ".join(printer.text(entry) for entry in normal)
        lines += [f"        row=({row}{',' if len(normal) == 1 else ''}),"]
        if derivation.expansion.formulation.place is not None:
            lines += [f"        place={printer.text(derivation.expansion.formulation.place)},"]
    return [*lines, "    )"]
