"""The symbols of a derivation, each with its meaning and the chapter that defines it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from sympy import Symbol

from derive.latex import Writer
from derive.latex_adjoint import coefficient_symbols


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A symbol: LaTeX, meaning, and the chapter where it is defined."""

    identifier: str
    latex: str
    meaning: str
    chapter: str

    def occurs_in(self, text: str) -> bool:
        """Tell whether the symbol stands in a LaTeX text."""
        if r"\math" not in self.latex:
            text = re.sub(r"\\math[a-z]+\{\w+\}|\^\{?T\}?", " ", text)
        text = re.sub(r"\\text\{[^{}]*\}|\\(?:begin|end)\{[a-z]+\}", " ", text)
        return re.search(r"(?<![A-Za-z\\])" + re.escape(self.latex) + r"(?![A-Za-z]|\}_)", text) is not None


def symbols_of(writer: Writer) -> tuple[Entry, ...]:
    """Return the symbols of the statement, of the expansion, of the linear problem and of the amplitude equation."""
    entries = [*of_the_statement(writer), *of_the_expansion(writer), *of_the_linear_problem(writer), *of_the_amplitude_equation(writer)]
    unique = {latex: (latex, meaning, chapter) for latex, meaning, chapter in reversed(entries)}
    return tuple(Entry(identifier=f"symbol-{k}", latex=latex, meaning=meaning, chapter=chapter) for k, (latex, meaning, chapter) in enumerate(reversed(unique.values()), 1))


def of_the_statement(writer: Writer) -> list[tuple[str, str, str]]:
    """Return fields, independent variables, control and parameters."""
    notation, formulation = writer.notation, writer.derivation.expansion.formulation
    entries = []
    for one in formulation.unknowns:
        if one.component in ("", "p"):
            entries.append((notation.field(one.index), f"{'vector field' if one.component else 'field'} {one.latex} of the statement", "statement"))
        elif one.component in ("x", "y", "z"):
            entries.append((notation.component(one.index), f"component {one.component} of the field {one.latex}", "statement"))
    if formulation.interval is not None:
        entries.append((notation.space, "place", "statement"))
    entries.append((notation.derivation_time(), "time", "statement"))
    entries.append((f"{{{notation.control}}}_{{c}}", "control at the threshold, where the base state first loses stability", "coefficients"))
    entries.append((notation.control, "control parameter", "statement"))
    entries += [(notation.names[symbol], f"parameter, {value}", "statement") for symbol, value in formulation.parameters.items()]
    if notation.vector:
        entries.append((notation.axis, "axis of the rotational symmetry", "statement"))
    return entries


def of_the_expansion(writer: Writer) -> list[tuple[str, str, str]]:
    """Return the small parameter, the two times, the amplitude, the mode and the responses."""
    notation, symbol = writer.notation, writer.notation.symbol
    entries = [
        (symbol["small"], "small parameter, of the size of the distance to the threshold", "orders"), (symbol["shift"], "scaled distance to the threshold, of order one", "orders"),
        (symbol["slow_time"], "slow time", "orders"), (notation.amplitude, "amplitude of the critical mode, a function of slow time", "orders"),
        (symbol["mode"], "critical mode; a star is its conjugate, a prime a derivative", "adjoint"),
    ]
    if notation.hopf:
        entries += [(symbol["fast_time"], "fast time", "orders"), (symbol["frequency"], "frequency of the critical mode at the threshold", "coefficients")]
    if writer.derivation.reduction.weak:
        entries.append((symbol["weak"], "scaled size of the weak effects", "orders"))
    for response in writer.derivation.reduction.responses:
        place = "the harmonic in brackets" if notation.hopf else "second order"
        entries += [(notation.names[state], f"response of {notation.component(unknown).replace('{', '').replace('}', '')}, {place}", "orders")
                    for state, (unknown, order) in zip(response.states, response.operator.names, strict=True) if isinstance(state, Symbol) and state in notation.names and not order]
    for equation in writer.orders.numbers:
        kind = {"row": "secular forcing of the equation", "left": "secular data at the left end, row", "right": "secular data at the right end, row"}[equation.side]
        entries.append((writer.orders.forcing_symbol(equation), f"{kind} {writer.orders.numbers[equation]}", "orders"))
    return entries


def of_the_linear_problem(writer: Writer) -> list[tuple[str, str, str]]:
    """Return operators, their adjoints and the adjoint solution."""
    entries = [
        (r"\mathsf{L}", "operator of the linear problem; a dagger is its adjoint", "adjoint"), (r"\mathsf{S}", "boundary conditions at the left end; a dagger is their adjoint", "adjoint"),
        (r"\mathsf{T}", "boundary conditions at the right end; a dagger is their adjoint", "adjoint"), (r"\mathsf{M}", "matrix of the linear problem at the threshold", "adjoint"),
        ("J", "boundary form: what integration by parts leaves at the ends", "adjoint"), (r"\vec{\psi}", "fields of the linear problem", "adjoint"), (r"\vec{y}", "state of the critical mode", "adjoint"),
        (r"\vec{z}", "adjoint state", "adjoint"), (r"\vec{\zeta}", "adjoint solution", "adjoint"), (r"\mathbf{b}", "arbitrary constant vector normal to the axis", "adjoint"),
    ]
    if writer.solvability.scalar is not None:
        entries.append((writer.notation.symbol["adjoint"], "adjoint eigenfunction", "adjoint"))
    return entries + [(writer.notation.names[zeta], "component of the adjoint solution", "adjoint") for zeta in writer.derivation.reduction.solvability.zeta]


def of_the_amplitude_equation(writer: Writer) -> list[tuple[str, str, str]]:
    """Return the coefficients and the symbols of the states."""
    notation = writer.notation
    listed: Any = list(writer.derivation.reduction.coefficients)
    symbols = coefficient_symbols(listed)
    entries = [(symbols[one.identifier], f"coefficient of {one.monomial}", "amplitude") for one in listed]
    entries += [(r"\mu", "distance of the control to the threshold", "amplitude"), (notation.symbol["xi"], "product of mode and adjoint, by which the coefficients are divided", "amplitude")]
    bar = rf"\bar{{{notation.amplitude}}}"
    entries += [(bar, "amplitude of a state", "states"), (r"\nu", "frequency correction of a state", "states"), (r"\sigma", "growth rate of a perturbation of a state", "states"),
                (r"\vartheta", "phase of a state", "states")]
    if notation.vector:
        entries += [(r"\mathbf{e}", "unit vector normal to the axis", "states"), (r"\mathbf{B}", "area vector of the ellipse, A* x A", "states")]
    return entries


__all__ = ["Entry", "symbols_of"]
