"""Text of the states: the module that the numeric layer evaluates, and closed forms as plain data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy import Expr, Integer, Symbol, preorder_traversal, sstr

from derive.statement import DerivationError

if TYPE_CHECKING:
    from derive.states import Analysis, State, States


def expression(value: Expr) -> str:
    """Return an expression that plain Python evaluates exactly: no fraction but of expressions."""
    if any(node.is_Rational and not node.is_Integer for node in preorder_traversal(value)):
        raise DerivationError(f"states: found the fraction in {value}; expected integer factors")
    return sstr(value)


def state_lines(state: State, index: int, analysis: Analysis) -> list[str]:
    """Return the function of one state."""
    lines = ["", "", f"def {state.name}_{index}(c, mu):", f'    """The state {state.name}: nu, |A|^2 and eigenvalues in the coefficients (real part, imaginary part)."""']
    lines += bindings(analysis)
    lines += ["    return {"]
    for key in ("nonlinear", "amplitude_squared", "peak_squared", "frequency_correction"):
        lines.append(f'        "{key}": {expression(getattr(state, key))},')
    lines += ['        "eigenvalues": (']
    for one in state.eigenvalues:
        lines.append(f'            ({expression(one.real)}, {expression(one.imaginary)}, "{one.direction}", "{" and ".join(one.neutral)}"),')
    return [*lines, "        ),", "    }"]


def bindings(analysis: Analysis) -> list[str]:
    """Return the lines that name the parts of the coefficients."""
    return [f'    c{k}_r, c{k}_i = c["{term.monomial}"]' for k, term in enumerate(analysis.equation.terms, 1)]


def threshold_lines(index: int, analysis: Analysis) -> list[str]:
    """Return the function of the laws at the threshold."""
    lines = ["", "", f"def threshold_{index}(c):", '    """At mu = 0: for each shape of a perturbation (rate, power) of |A| = (-rate t)^(1/power), and what selects the shape of a general one."""']
    lines += [*bindings(analysis), "    return ("]
    lines += [f'        ("{law.perturbation}", {expression(law.rate)}, {expression(Integer(1) / law.exponent)}),' for law in analysis.thresholds]
    return [*lines, f"    ), {expression(analysis.selection)}"]


def emit(states: States) -> str:
    """Return the module: for each amplitude equation its monomials, its states and its laws at the threshold."""
    lines = [f'"""States of the amplitude equation of {states.problem}. Emitted by `fredholm states`; do not edit."""', "", f'KIND = "{states.equation.kind}"']
    table = ["", "", "ANALYSES = ("]
    for index, analysis in enumerate(states.analyses, 1):
        for state in analysis.states:
            lines += state_lines(state, index, analysis)
        lines += threshold_lines(index, analysis)
        monomials = ", ".join(f'"{term.monomial}"' for term in analysis.equation.terms)
        functions = ", ".join(f'("{state.name}", {state.name}_{index})' for state in analysis.states)
        table.append(f"    (({monomials}), ({functions}), threshold_{index}),")
    return "\n".join([*lines, *table, ")", ""])


def as_dict(states: States) -> dict[str, Any]:
    """Return the closed forms as text, with the coefficients by name."""
    result = []
    for analysis in states.analyses:
        names: dict[Any, Any] = {}
        for term in analysis.equation.terms:
            names |= {term.real: Symbol(f"Re({term.name})")}
            if isinstance(term.imaginary, Symbol):
                names |= {term.imaginary: Symbol(f"Im({term.name})")}

        def shown(value: Expr, names: dict[Any, Any] = names) -> str:
            return sstr(value.xreplace(names))

        result.append({
            "monomials": [term.monomial for term in analysis.equation.terms],
            "states": [{
                "name": state.name, "amplitude_squared": shown(state.amplitude_squared), "peak_squared": shown(state.peak_squared), "frequency_correction": shown(state.frequency_correction),
                "supercritical": f"{shown(state.nonlinear)} < 0" if state.nonlinear != 0 else None,
                "eigenvalues": [{"re": shown(one.real), "im": shown(one.imaginary), "direction": one.direction, "neutral": list(one.neutral)} for one in state.eigenvalues],
            } for state in analysis.states],
            "at_threshold": [{"perturbation": law.perturbation, "rate": shown(law.rate), "exponent": sstr(law.exponent)} for law in analysis.thresholds],
        })
    return {"problem": states.problem, "kind": states.equation.kind, "analyses": result, "left_out": list(states.weak)}
