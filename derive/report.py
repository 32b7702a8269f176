"""The main job: derivation, emitted code, coefficients by every route and the comparison, in one folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

from derive.derivation import Derivation, derive_amplitude_equation
from derive.files import write_text
from derive.latex import document
from derive.problem import Problem
from derive.states import derive_states
from numerics.coefficients import Result, evaluate
from numerics.comparison import Comparison, compare, further_values, reference_of
from numerics.precision import EvaluationError


def agreeing_digits(one: Result, other: Result) -> int:
    """Return the digits to which all coefficients and the threshold of two results agree (at most those asked for)."""
    least = min(one.digits, other.digits)
    pairs = [(one.threshold.control, "0", other.threshold.control, "0")]
    pairs += [(a.value.re, a.value.im, b.value.re, b.value.im) for a, b in zip(one.coefficients, other.coefficients, strict=True)]
    digits = least
    with localcontext(prec=least + 40):
        for re_a, im_a, re_b, im_b in pairs:
            difference = max(abs(Decimal(re_a) - Decimal(re_b)), abs(Decimal(im_a) - Decimal(im_b)))
            size = max(abs(Decimal(re_a)), abs(Decimal(im_a)))
            if difference and size:
                digits = min(digits, -(difference / size).adjusted() - 1)
    return digits


def compared(derivation: Derivation, result: Result, reference: Mapping[str, Any]) -> Comparison:
    """Return the comparison with every published number: threshold, coefficients, states and spectrum."""
    if not reference.get("state"):
        return compare(result, reference)
    return compare(result, reference, further_values(reference, derivation.emit(), derive_states(derivation).emit()))


def reproduce(problem: Problem, folder: Path | None, digits: int, say: Callable[[str], None], show: Callable[[str], None]) -> int:
    """Write the folder and print a summary; return 1 if anything disagrees."""
    folder = folder or Path(f"{problem.name}-report")
    say("derivation")
    derivation = derive_amplitude_equation(problem)
    emitted = derivation.emit()
    write_text(folder / f"{problem.name}.py", emitted)
    write_text(folder / f"{problem.name}.tex", document(derivation))
    results: dict[str, Result] = {}
    refused: dict[str, str] = {}
    for route in ("closed", "chebyshev", "quadrature"):
        say(f"coefficients by {route}")
        try:
            results[route] = evaluate(emitted, digits=digits, route=route)
        except EvaluationError as reason:
            refused[route] = " ".join(str(reason).split())
    if not results:
        raise EvaluationError("; ".join(refused.values()))
    best = next(iter(results.values()))
    agreement = {route: agreeing_digits(best, result) for route, result in results.items()}
    reference = reference_of(problem.name)
    comparison = compared(derivation, best, reference) if reference else None
    data = {
        "problem": problem.name, "results": [result.as_dict() for result in results.values()], "agreeing_digits": agreement, "refused": refused,
        "comparison": comparison.as_dict() if comparison else None,
    }
    write_text(folder / "coefficients.json", json.dumps(data, indent=1) + "\n")
    lines = [f"{problem.name}: {best.threshold.kind} bifurcation, multiplicity {best.threshold.multiplicity}", f"  control    {best.threshold.control}"]
    if best.threshold.frequency is not None:
        lines.append(f"  frequency  {best.threshold.frequency}")
    lines += [f"  {one.name} = {one.value!r}   error {one.error}" for one in best.coefficients]
    lines += [f"  route {route}: {count} of {digits} digits agree" for route, count in agreement.items()]
    lines += [f"  route {route}: refused: {reason}" for route, reason in refused.items()]
    lines.append(comparison.text() if comparison else "no published values")
    write_text(folder / "summary.txt", "\n".join(lines) + "\n")
    show("\n".join(lines))
    show(f"written to {folder}")
    agree = all(count >= digits - 1 for count in agreement.values()) and (comparison is None or comparison.agrees)
    return 0 if agree else 1
