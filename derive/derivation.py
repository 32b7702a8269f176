"""The map of the symbolic layer.

statement -> rows over jets           (problem, formulation)
          -> Taylor rows              (expansion)
          -> first-order operators    (operator; ordinary, without space)
          -> first loss of stability  (onset)
          -> critical mode            (mode)
          -> adjoint, boundary form   (adjoint)
          -> non-resonant responses   (response)
          -> Fredholm alternative     (solvability)
          -> amplitude equation       (amplitude)
          -> text                     (emit, latex)

`derive_amplitude_equation` calls the stages, each the input of the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from derive.amplitude import Reduction, reduce_to_amplitude
from derive.expansion import Expansion, expand_about_base
from derive.onset import Onset, find_onset
from derive.operator import LAMBDA
from derive.problem import Problem
from derive.response import Operator, reduced


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivation:
    """A weakly nonlinear analysis: the orders, the adjoint, the solvability condition and the amplitude equation."""

    problem: Problem
    expansion: Expansion
    operators: Mapping[int, Operator]  # the linear problem of each weight, for any growth rate
    onset: Onset
    reduction: Reduction

    @property
    def orders(self) -> Any:
        """The orders of the expansion, as the paper writes them."""
        from derive.latex import Part

        return Part(self, "orders")

    @property
    def adjoint(self) -> Any:
        """The adjoint problem."""
        from derive.latex import Part

        return Part(self, "adjoint")

    @property
    def solvability(self) -> Any:
        """The solvability condition."""
        from derive.latex import Part

        return Part(self, "solvability")

    @property
    def amplitude_equation(self) -> Any:
        """The amplitude equation and its coefficients."""
        from derive.latex import Part

        return Part(self, "amplitude")

    def emit(self) -> str:
        """Return the text of the emitted module."""
        from derive.emit import emit

        return emit(self)

    def latex(self, part: str = "all", order: str | None = None, symbols: Mapping[str, str] | None = None) -> str:
        """Return LaTeX of a part: statement, orders, adjoint, solvability, amplitude or all; `symbols` are {name: LaTeX}."""
        from derive.latex import latex

        return latex(self, part, order, symbols)

    def _repr_latex_(self) -> str:
        return f"$$\n{self.amplitude_equation.latex()}\n$$"

    def as_dict(self) -> dict[str, Any]:
        """Return what is known of the amplitude equation, as plain data."""
        return {
            "problem": self.problem.name, "kind": self.onset.kind, "multiplicity": 2 if self.reduction.vector else 1,
            "coefficients": [{"name": one.name, "monomial": one.monomial} for one in self.reduction.coefficients],
        }

    def __repr__(self) -> str:
        terms = ", ".join(f"{one.name} {one.monomial}" if one.name != one.monomial else one.monomial for one in self.reduction.coefficients)
        return f"Derivation({self.problem.name!r}, {self.onset.kind}, {terms})"


def derive_amplitude_equation(problem: Problem) -> Derivation:
    """Return the weakly nonlinear analysis of a problem.

    Raises
    ------
    ProblemError
        The statement is not consistent.
    DerivationError
        Its first loss of stability is not of this class.
    """
    expansion = expand_about_base(problem.formulation)
    operators = {weight: reduced(expansion, weight, LAMBDA) for weight in expansion.weights}
    onset = find_onset(operators, problem.formulation)
    reduction = reduce_to_amplitude(expansion, onset, operators)
    return Derivation(problem=problem, expansion=expansion, operators=operators, onset=onset, reduction=reduction)
