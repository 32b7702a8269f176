"""Symbolic layer of Fredholm: from a problem statement to the amplitude equation. Exact and pure."""

from derive.derivation import Derivation, derive_amplitude_equation
from derive.problem import (
    DerivationError,
    Problem,
    ProblemError,
    epsilon,
    field,
    load_problem,
    vector_field,
)

__all__ = ["Derivation", "DerivationError", "Problem", "ProblemError", "derive_amplitude_equation", "epsilon", "field", "load_problem", "vector_field"]
