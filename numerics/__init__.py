"""Numeric layer of Fredholm: digits with an error bound from emitted text. It knows nothing of SymPy."""

from numerics.batch import BatchResult, evaluate_batch
from numerics.coefficients import Result, evaluate
from numerics.precision import EvaluationError

__all__ = ["BatchResult", "EvaluationError", "Result", "evaluate", "evaluate_batch"]
