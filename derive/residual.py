r"""The full nonlinear problem as text: every row, and its exact derivatives with respect to every jet, over NumPy arrays.

Circular components :math:`v_\pm = v_1 \pm i v_2` go back to the real components about the axis, so that everything is real. Common
subexpressions are shared among all rows. Nothing of the expansion is used: the text holds what the user wrote.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sympy import Expr, I, Integer, Symbol, cse, numbered_symbols
from sympy.printing.numpy import SciPyPrinter

from derive.expand import expand
from derive.formulation import Formulation, Jet, RawRow
from derive.problem import Problem
from derive.statement import DerivationError


class Printer(SciPyPrinter):
    """Python text whose integers fit an array."""

    def _print_Integer(self, expression: Integer) -> str:
        return str(expression) if abs(expression) < 2**31 else repr(float(expression))


def emit_residual(problem: Problem) -> str:
    """Return the text of a module with the rows of the full problem and their Jacobian.

    Raises
    ------
    DerivationError
        A row does not become real in the components about the rotation axis.
    """
    formulation = problem.formulation
    jets, replacement = real_jets(formulation)
    names = {formulation.control: Symbol("control", real=True), **{symbol: Symbol(f"p_{symbol.name}", real=True) for symbol in formulation.parameters}}
    interior = [row for equation in formulation.rows for row in equation]
    groups = [("interior", interior)]
    for name, (_, equations) in zip(("left", "right"), formulation.boundary, strict=False):
        groups.append((name, [row for equation in equations for row in equation]))
    number = Printer({"fully_qualified_modules": True, "allow_unknown_functions": False})
    ends = [repr(float(end)) for end in formulation.interval or (0, 1)]
    lines = [
        f'"""Full problem of {problem.name}. Emitted by `fredholm full`; do not edit."""', "", "import numpy", "import scipy.special", "",
        f"NAME = {problem.name!r}", f"LOWEST = {float(formulation.control_range[0])!r}", f"SPATIAL = {formulation.interval is not None}", f"INTERVAL = ({', '.join(ends)})",
        f"UNKNOWNS = {tuple((unknown.name, unknown.field, component_of(unknown.component), unknown.weight) for unknown in formulation.unknowns)!r}",
        f"JETS = {tuple(jets)!r}", f"NORMALISED = {formulation.normalised!r}", f"ROTATION = {formulation.frame is not None}",
        f"PLACE = {float(formulation.place) if formulation.place is not None else 0.0!r}", "",
    ]
    table = {jet: symbol for jet, symbol in jets.items()}
    values = {names[symbol]: value for symbol, value in formulation.parameters.items()}
    lines += function_text("base", [[entry.xreplace(names) for entry in row] for row in base_rows(formulation, table)], values, number, ())
    labels, uses, constants = {}, {}, {}
    for name, rows in groups:
        reals = [real_row(row, replacement, formulation).xreplace(names) for row in rows]
        labels[name] = tuple(row.label for row in rows)
        used = [tuple(k for k, symbol in enumerate(table.values()) if row.has(symbol)) for row in reals]
        symbols = list(table.values())
        outputs = [(row, row.diff(names[formulation.control]), *(row.diff(symbols[k]) for k in which)) for row, which in zip(reals, used, strict=True)]
        uses[name] = tuple(used)
        keys = list(table)
        constants[name] = tuple(
            r for r, (output, which) in enumerate(zip(outputs, used, strict=True))
            if not any(slope.free_symbols - set(values) for slope in output[2:]) and output[1] == 0 and not any(keys[k][2] for k in which)
        )
        lines += function_text(name, outputs, values, number, symbols)
    lines += [f"LABELS = {labels!r}", f"USES = {uses!r}", f"CONSTANT = {constants!r}", ""]
    return "\n".join(lines)


def component_of(component: str) -> str:
    """Return the real component that takes the place of a circular one."""
    return {"p": "1", "m": "2"}.get(component, component)


def real_jets(formulation: Formulation) -> tuple[dict[Jet, Symbol], dict[Symbol, Expr]]:
    """Return the real jets, in order, and each jet of the formulation in terms of them."""
    jets: dict[Jet, Symbol] = {}
    for unknown, ds, dt in sorted(formulation.jets):
        weight = formulation.unknowns[unknown].weight
        for partner in sorted({unknown, unknown + weight}):  # v_p stands just before v_m
            jets[partner, ds, dt] = Symbol(f"z_{partner}_{ds}_{dt}", real=True)
    jets = dict(sorted(jets.items()))
    replacement: dict[Symbol, Expr] = {}
    for (unknown, ds, dt), symbol in formulation.jets.items():
        weight = formulation.unknowns[unknown].weight
        first = unknown if weight >= 0 else unknown - 1
        replacement[symbol] = jets[first, ds, dt] + weight * I * jets[first + 1, ds, dt] if weight else jets[unknown, ds, dt]
    return jets, replacement


def real_row(row: RawRow, replacement: dict[Symbol, Expr], formulation: Formulation) -> Expr:
    """Return a row at epsilon = 0 in real jets."""
    expression = row.expression.xreplace({formulation.weak: Integer(0)}).xreplace(replacement)
    if formulation.frame is not None:
        expression = expand(expression)
        if expression.has(I):
            expression = expand(expression.as_real_imag()[0])
        if expression.has(I):
            raise DerivationError(f"{row.label}: found a row that is not real in the components about rotation_axis; write it with dot and cross products")
    return expression


def base_rows(formulation: Formulation, jets: dict[Jet, Symbol]) -> list[tuple[Expr, Expr]]:
    """Return the value of every jet at the base state, and its derivative with respect to the control."""
    rows = []
    for unknown, ds, dt in jets:
        value = Integer(0) if dt or formulation.unknowns[unknown].weight else formulation.base[unknown]
        value = value.diff(formulation.space, ds) if ds else value
        rows.append((value, value.diff(formulation.control)))
    return rows


def function_text(name: str, outputs: Sequence[Sequence[Expr]], values: Mapping[Symbol, Expr], printer: Printer, symbols: Sequence[Symbol]) -> list[str]:
    """Return the lines of one function of (s, control, jets): common subexpressions first, then one tuple a row."""
    flat = [entry for row in outputs for entry in row]
    shared, results = cse(flat, symbols=numbered_symbols("w"), order="none")
    lines = [f"def {name}(s, control, z):", f'    """Return rows of `{name}`."""']
    used = set().union(*(entry.free_symbols for entry in flat)) if flat else set()
    lines += [f"    {symbol.name} = {printer.doprint(value)}" for symbol, value in values.items() if symbol in used]
    lines += [f"    {symbol.name} = z[{k}]" for k, symbol in enumerate(symbols) if symbol in used]
    lines += [f"    {symbol.name} = {printer.doprint(value)}" for symbol, value in shared]
    lines.append("    return (")
    start = 0
    for row in outputs:
        lines.append(f"        ({', '.join(printer.doprint(entry) for entry in results[start:start + len(row)])},),")
        start += len(row)
    return [*lines, "    )", "", ""]
