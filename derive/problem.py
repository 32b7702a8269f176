r"""The problem statement: what section II of a paper says.

A :class:`Problem` is what the user writes; :func:`derive.formulation.formulate` checks it and turns it into scalar rows.
"""

from __future__ import annotations

import os
import runpy
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Any

from sympy import Symbol

from derive.formulation import Formulation, formulate
from derive.statement import DerivationError, ProblemError, one_line

MODELS = Path(__file__).parent / "models"


@dataclass(frozen=True, kw_only=True)
class Problem:
    """The governing equations of a system that loses stability; every argument is described in design section 2."""

    name: str
    time: Symbol
    control: Symbol
    control_range: tuple[Any, Any]
    fields: tuple[Any, ...]
    equations: tuple[Any, ...]
    base_state: Mapping[Any, Any]
    normalisation: tuple[Any, Any]
    space: Symbol | None = None
    interval: tuple[Any, Any] | None = None
    boundary: Mapping[Any, tuple[Any, ...]] | None = None
    parameters: Mapping[Symbol, Any] = dataclass_field(default_factory=dict)
    rotation_axis: Any = None
    coefficient_names: Mapping[str, str] = dataclass_field(default_factory=dict)

    formulation: Formulation = dataclass_field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "formulation", formulate(self))

    def __repr__(self) -> str:
        return f"Problem({self.name!r}, {len(self.fields)} fields, control {self.control})"


def load_problem(target: str | Path) -> Problem:
    """Return the bundled model `target`, or the `problem` of the Python file at that path (which is run).

    Raises
    ------
    ProblemError
        The file is missing, does not run, or binds no `problem`.
    """
    path = MODELS / f"{target}.py" if str(target) in bundled_names() else Path(target)
    if not os.path.isfile(path):  # False, too, for what cannot be the name of a file
        names = ", ".join(bundled_names())
        raise ProblemError(f"{target}: found no such file and no such model; expected a path or one of {names}")
    try:
        bound = runpy.run_path(str(path), run_name="fredholm_problem")
    except SyntaxError as mistake:
        raise ProblemError(f"{mistake.filename or path}, line {mistake.lineno or '?'}: SyntaxError: {mistake.msg}") from mistake
    except ProblemError as mistake:
        raise ProblemError(f"{path}, line {line_in(path, mistake)}: {mistake}") from mistake
    except KeyboardInterrupt:
        raise
    except BaseException as mistake:
        said = one_line(str(mistake)) or "no message"
        raise ProblemError(f"{path}, line {line_in(path, mistake)}: {type(mistake).__name__}: {said}") from mistake
    problem = bound.get("problem")
    if not isinstance(problem, Problem):
        found = "no name `problem`" if "problem" not in bound else f"`problem` is a {type(problem).__name__}"
        raise ProblemError(f"{path}: found {found}; expected the file to bind `problem = Problem(...)`")
    return problem


def line_in(path: Path, mistake: BaseException) -> int | str:
    """Return the last line of the problem file on the way to the mistake."""
    lines = [frame.lineno for frame in traceback.extract_tb(mistake.__traceback__) if Path(frame.filename) == path]
    return lines[-1] if lines and lines[-1] is not None else "?"


def bundled_names() -> tuple[str, ...]:
    """Return the names of the bundled models, sorted."""
    return tuple(sorted(path.stem for path in MODELS.glob("*.py") if path.stem != "__init__"))


__all__ = ["MODELS", "DerivationError", "Formulation", "Problem", "ProblemError", "bundled_names", "load_problem"]
