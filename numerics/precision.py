"""The one place that sets a working precision, and puts it back."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import flint

BITS_PER_DIGIT = 3.3219280948873626
LONGEST_SERIES = 1_000_000
_LOCK = threading.RLock()


class EvaluationError(ArithmeticError):
    """The digits asked for cannot be given; the message says why and what to do."""


class NotClosed(EvaluationError):
    """The closed form does not exist (or is 0/0) for this problem; another route is needed."""


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Work with `bits` bits in python-flint; evaluations in other threads wait, so that none sees another's precision."""
    with _LOCK:
        before = flint.ctx.prec, flint.ctx.cap
        flint.ctx.prec = int(bits)
        flint.ctx.cap = LONGEST_SERIES
        try:
            yield
        finally:
            flint.ctx.prec, flint.ctx.cap = before


def bits_of(digits: int) -> int:
    """Return the bits that hold so many decimal digits."""
    return int(digits * BITS_PER_DIGIT) + 1
