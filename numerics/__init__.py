"""Numeric layer of Fredholm: digits with an error bound from emitted text. It knows nothing of SymPy."""

from numerics.coefficients import Result, evaluate
from numerics.precision import EvaluationError

__all__ = ["EvaluationError", "Result", "evaluate"]
