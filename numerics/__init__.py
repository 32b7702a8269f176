"""Numeric layer of Fredholm: digits with an error bound from emitted text. It knows nothing of SymPy."""

from typing import TYPE_CHECKING, Any

from numerics.coefficients import Result, evaluate
from numerics.precision import EvaluationError
from numerics.spectrum import Merging, first_complex_pair, growth_rates
from numerics.states import StatesResult, evaluate_states

__all__ = [
    "BatchResult", "EvaluationError", "Merging", "Result", "StatesResult", "evaluate", "evaluate_batch", "evaluate_states", "first_complex_pair", "growth_rates",
]

if TYPE_CHECKING:
    from numerics.batch import BatchResult, evaluate_batch


def __getattr__(name: str) -> Any:
    """Load the double route, and SciPy with it, only when it is asked for."""
    if name in {"BatchResult", "evaluate_batch"}:
        from numerics import batch

        return getattr(batch, name)
    raise AttributeError(f"module 'numerics' has no attribute {name!r}")
