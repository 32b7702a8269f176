"""The derivation in LaTeX: statement, orders, adjoint, solvability, amplitude equation. It compiles inside amsmath."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from derive.latex_adjoint import SolvabilityWriter
from derive.latex_orders import OrderWriter
from derive.notation import Notation, half, plain
from derive.statement import ProblemError

if TYPE_CHECKING:
    from derive.derivation import Derivation

PARTS = ("statement", "orders", "adjoint", "solvability", "amplitude")
TITLES = {"statement": "Statement", "orders": "Orders of the expansion", "adjoint": "Adjoint problem", "solvability": "Solvability", "amplitude": "Amplitude equation"}
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
        self.notation = Notation(derivation, symbols)
        self.orders = OrderWriter(derivation, self.notation)
        self.solvability = SolvabilityWriter(derivation, self.notation)

    def rows(self, part: str) -> list[str]:
        """Return the rows of a part."""
        orders, solvability = self.orders, self.solvability
        if part == "orders":
            return [row for half_order in (1, 2, 3) for row in self.order(half_order)]
        return {"statement": orders.statement, "adjoint": solvability.adjoint, "solvability": solvability.solvability, "amplitude": solvability.amplitude}[part]()

    def order(self, half_order: int) -> list[str]:
        """Return the rows of one order."""
        return self.orders.order(half_order)


__all__ = ["PARTS", "Part", "Writer", "document", "latex"]
