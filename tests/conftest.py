"""Shared: derivations and results of the bundled models, made once."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from functools import cache
from pathlib import Path

import pytest

from derive import derive_amplitude_equation, load_problem
from numerics import evaluate

ROOT = Path(__file__).parent.parent
PROBLEMS = Path(__file__).parent / "problems"


@cache
def derivation_of(target):
    return derive_amplitude_equation(load_problem(target))


@cache
def result_of(target, digits=15, route="auto"):
    return evaluate(derivation_of(target).emit(), digits=digits, route=route)


@pytest.fixture
def write_problem(tmp_path):
    """Return a function that writes a problem file and gives its path."""

    def write(text, name="case.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write
