"""Symbolic layer of Fredholm: from a problem statement to the amplitude equation. Exact and pure."""

from derive.derivation import Derivation, derive_amplitude_equation
from derive.problem import Problem, load_problem
from derive.statement import DerivationError, ProblemError, epsilon, field, vector_field
from derive.states import States, derive_states

__all__ = ["Derivation", "DerivationError", "Problem", "ProblemError", "States", "derive_amplitude_equation", "derive_states", "epsilon", "field", "load_problem", "vector_field"]
