"""Numeric layer of Fredholm: digits with an error bound from emitted text. It knows nothing of SymPy."""

from numerics.batch import BatchResult, evaluate_batch
from numerics.coefficients import Result, evaluate
from numerics.precision import EvaluationError
from numerics.spectrum import Merging, first_complex_pair, growth_rates
from numerics.states import StatesResult, evaluate_states

__all__ = [
    "BatchResult", "EvaluationError", "Merging", "Result", "StatesResult", "evaluate", "evaluate_batch", "evaluate_states", "first_complex_pair", "growth_rates",
]
