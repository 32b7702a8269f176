r"""The problem statement: what section II of a paper says, and the checks that need no mathematics.

A :class:`Problem` is what the user writes. :func:`formulate` turns it into a :class:`Formulation`: scalar unknowns,
scalar rows, jets in place of derivatives, and symbols whose names cannot clash with ours.
"""

from __future__ import annotations

import os
import re
import runpy
import traceback
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from itertools import product
from pathlib import Path
from typing import Any

from sympy import (
    Derivative,
    Dummy,
    Expr,
    Float,
    Function,
    I,
    ImmutableMatrix,
    Integer,
    MatrixBase,
    Rational,
    Symbol,
    expand,
    nan,
    oo,
    preorder_traversal,
    sqrt,
    sympify,
    zoo,
)
from sympy.core.function import AppliedUndef

from derive.zero import Probe

epsilon = Dummy("epsilon", real=True)
"""The size of a weak effect; see design section 2."""

MODELS = Path(__file__).parent / "models"
NOT_ANALYTIC = (
    "Abs", "sign", "Max", "Min", "Piecewise", "Heaviside", "DiracDelta", "floor", "ceiling", "re", "im", "conjugate", "arg",
    "Mod", "frac",
)


SCALAR_MONOMIALS = ("mu*A", "A**2*conj(A)", "A**2", "A**3", "epsilon*A")
VECTOR_MONOMIALS = ("mu*A", "dot(A,A)*conj(A)", "dot(A,conj(A))*A", "dot(A,A)*A", "epsilon*A", *(f"epsilon*dot(A,e{j})*e{i}" for i in (1, 2) for j in (1, 2)))
MONOMIALS = frozenset(SCALAR_MONOMIALS + VECTOR_MONOMIALS)


class ProblemError(ValueError):
    """A mistake in the statement: says what was found, what was expected, what to do."""


class DerivationError(ArithmeticError):
    """The mathematics of the statement does not lead to an amplitude equation of the class."""


def one_line(message: str) -> str:
    """Return a message on one line."""
    return " ".join(message.split())


def field(name: str, *arguments: Symbol) -> Expr:
    """Return a real scalar field `name` of space and time, or of time alone."""
    return Function(name, real=True)(*arguments)


def vector_field(name: str, *arguments: Symbol) -> ImmutableMatrix:
    """Return a real vector field, shape (3, 1), with Cartesian components `name.x, name.y, name.z`."""
    return ImmutableMatrix([field(f"{name}.{axis}", *arguments) for axis in "xyz"])


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """A scalar unknown: a scalar field, or a component of a vector field.

    `weight` is its weight under rotation about the axis: +1 and -1 for the circular components, 0 otherwise.
    """

    index: int
    name: str
    latex: str
    field: int
    component: str
    weight: int


Jet = tuple[int, int, int]
"""(unknown, order of the space derivative, order of the time derivative)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class RawRow:
    """A scalar row: the expression in jets and, for an error message, where the user wrote it."""

    expression: Expr
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulation:
    """The statement in scalar rows over jets, with internal symbols."""

    problem: Problem
    unknowns: tuple[Unknown, ...]
    rows: tuple[tuple[RawRow, ...], ...]  # one tuple an equation: one row, or three Cartesian ones
    boundary: tuple[tuple[Expr, tuple[tuple[RawRow, ...], ...]], ...]  # (place, equations), left end first
    jets: Mapping[Jet, Symbol]
    base: tuple[Expr, ...]
    space: Symbol
    control: Symbol
    parameters: Mapping[Symbol, Expr]
    user_symbols: Mapping[Symbol, Symbol]
    interval: tuple[Expr, Expr] | None
    control_range: tuple[Expr, Expr]
    frame: tuple[ImmutableMatrix, ImmutableMatrix, ImmutableMatrix] | None
    normalised: tuple[int, ...]  # the unknowns of the normalised field: one, or its + and - components
    place: Expr | None
    weak: Symbol
    probe: Probe


RESERVED = frozenset(
    "a lam omega phi phi_bar zeta xi s i D solve integral kernel Operator stage pi sqrt exp sin cos tan sinh cosh tanh log asin "
    "acos atan asinh acosh atanh erf A T chi mean second lambda None True False and or not if else for in is def return import from as "
    "with while class pass del try except finally raise global nonlocal assert yield break continue elif async await list "
    "mode mode_bar critical adjoint adjoint_mode mirror_xi interval parameters frame base fields_mode fields_responses consistency consistency_cubic total integrand stage".split()
)


def exact(value: Any, what: str) -> Expr:
    """Return `value` as an exact SymPy expression or say what to write instead."""
    if isinstance(value, float):
        advice = "write a finite exact number" if value != value or value in (float("inf"), float("-inf")) else exact_advice(value)
        raise ProblemError(f"{what}: found the float {value!r}; expected an exact number: {advice}")
    try:
        expression = sympify(value, strict=not isinstance(value, int))
    except Exception as problem:
        raise ProblemError(f"{what}: found {value!r}; expected an exact number or a SymPy expression") from problem
    if not isinstance(expression, Expr):
        raise ProblemError(f"{what}: found {value!r}; expected a scalar expression")
    floats = sorted(expression.atoms(Float), key=str)
    if floats:
        raise ProblemError(f"{what}: found the float {floats[0]}; expected an exact number: {exact_advice(floats[0])}")
    if expression.has(nan, zoo, oo, -oo):
        raise ProblemError(f"{what}: found {expression}; expected a finite expression")
    return expression


def exact_advice(value: Any) -> str:
    """Say which exact number to write for a float."""
    ratio = Rational(str(value)).limit_denominator(10**6)
    return f"write Rational({ratio.p}, {ratio.q})" if ratio.q != 1 else f"write {ratio.p}"


def is_vector(value: Any) -> bool:
    """Tell whether `value` is a SymPy matrix."""
    return isinstance(value, MatrixBase)


def components(value: Any, what: str) -> tuple[Any, ...]:
    """Return the entries of a scalar or of a 3-vector."""
    if not is_vector(value):
        return (value,)
    if value.shape != (3, 1):
        raise ProblemError(f"{what}: found a matrix of shape {value.shape}; expected a scalar or a vector of shape (3, 1)")
    return tuple(value)


def as_tuple(value: Any, what: str) -> tuple[Any, ...]:
    """Return a tuple for a tuple or list; a lone expression is a mistake that gets named."""
    if isinstance(value, (tuple, list)):
        return tuple(value)
    raise ProblemError(f"{what}: found {value!r}; expected a tuple; write ({value},) for a single entry")


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


def identifier(name: str, taken: set[str]) -> str:
    """Return a Python identifier for a user's name that is not taken, and take it."""
    base = re.sub(r"\W", "_", name)
    if not base or not (base[0].isalpha() or base[0] == "_") or not base.isascii():
        base = "p_" + re.sub(r"[^0-9A-Za-z_]", "_", base)
    while base in taken or base in RESERVED or re.fullmatch(r"(phi|phi_bar|zeta|w|f|coefficient|mirror|response|operator|weak)(_.*)?", base) and not base.endswith("_"):
        base += "_"
    taken.add(base)
    return base


def frame_about(axis: ImmutableMatrix) -> tuple[ImmutableMatrix, ImmutableMatrix, ImmutableMatrix]:
    """Return (e1, e2, n), right-handed and orthonormal; e1 is the first of x, y, z not parallel to the axis, made normal to it."""
    normal = ImmutableMatrix([expand(entry / sqrt(axis.dot(axis))) for entry in axis])
    for k in range(3):
        unit = ImmutableMatrix([1 if j == k else 0 for j in range(3)])
        if not normal.cross(unit).equals(ImmutableMatrix([0, 0, 0])):
            break
    across = unit - normal * normal.dot(unit)
    first = ImmutableMatrix([expand(entry / sqrt(across.dot(across))) for entry in across])
    second = ImmutableMatrix([expand(entry) for entry in normal.cross(first)])
    return first, second, normal


def sign_in(expression: Expr, ranges: Mapping[Symbol, Any]) -> int:
    """Return the sign of an expression that has one on the whole box of `ranges`, by a grid, else 0."""
    symbols = [symbol for symbol in ranges if symbol in expression.free_symbols]
    signs = set()
    count = 257 if len(symbols) == 1 else 33
    for shares in product(range(count), repeat=len(symbols)):
        point = {symbol: ranges[symbol][0] + (ranges[symbol][1] - ranges[symbol][0]) * Rational(share, count - 1) for symbol, share in zip(symbols, shares, strict=True)}
        value = expression.evalf(15, subs=point)
        if not value.is_real:
            return 0
        signs.add(1 if value > 0 else -1 if value < 0 else 0)
        if len(signs) > 1 or 0 in signs:
            return 0
    return signs.pop() if signs else 0


def ordered_symbols(expressions: Iterable[Expr]) -> list[Symbol]:
    """Return the free symbols, by name."""
    found = set().union(*(expression.free_symbols for expression in expressions)) if expressions else set()
    return sorted(found, key=lambda symbol: (symbol.name, str(symbol.assumptions0)))  # type: ignore[union-attr]


def formulate(problem: Problem) -> Formulation:
    """Check the statement and return it as scalar rows over jets.

    Raises
    ------
    ProblemError
        Anything in the statement that is not as design section 2 says.
    """
    if not isinstance(problem.name, str) or not re.fullmatch(r"\w[\w .+-]*", problem.name):
        raise ProblemError(f"name: found {problem.name!r}; expected letters, digits, underscores: it names the files")
    for what, symbol in (("time", problem.time), ("control", problem.control)):
        if not isinstance(symbol, Symbol):
            raise ProblemError(f"{what}: found {symbol!r}; expected a SymPy Symbol")
    spatial = problem.space is not None
    if spatial and not isinstance(problem.space, Symbol):
        raise ProblemError(f"space: found {problem.space!r}; expected a SymPy Symbol")
    if spatial and (problem.interval is None or problem.boundary is None):
        missing = "interval" if problem.interval is None else "boundary"
        raise ProblemError(f"{missing}: found nothing; a problem with space needs it: add {missing}=...")
    if not spatial and (problem.interval is not None or problem.boundary is not None):
        given = "interval" if problem.interval is not None else "boundary"
        raise ProblemError(f"{given}: found it without space; leave it out, or add space=...")
    distinct = [symbol for symbol in (problem.space, problem.time, problem.control) if symbol is not None]
    if len(set(distinct)) < len(distinct):
        raise ProblemError("space, time, control: found one symbol twice; expected different symbols")

    def agrees(symbol: Symbol, low: Expr, high: Expr, what: str) -> None:
        """Refuse values that the assumptions of a symbol exclude: SymPy has simplified with them already."""
        if symbol.is_nonnegative and low < 0 or symbol.is_nonpositive and high > 0 or symbol.is_real is False:
            sign = "nonnegative" if symbol.is_nonnegative else "nonpositive" if symbol.is_nonpositive else "not real"
            shown_values = f"{low}" if low == high else f"({low}, {high})"
            raise ProblemError(f"{what}: found {shown_values} for {symbol}, which is declared {sign}; declare it real=True")

    def constant(value: Any, what: str) -> Expr:
        expression = exact(value, what)
        if expression.free_symbols - set(values):
            unset = ordered_symbols([expression])
            raise ProblemError(f"{what}: found {expression}, which holds {unset[0]}; expected a number")
        expression = expression.subs(values)
        if not expression.is_number or not expression.is_real or not expression.is_finite:
            raise ProblemError(f"{what}: found {expression}; expected a finite real number")
        return expression

    values: dict[Symbol, Expr] = {}
    if not isinstance(problem.parameters, Mapping):
        raise ProblemError(f"parameters: found {problem.parameters!r}; expected {{symbol: value}}")
    for symbol in problem.parameters:
        if not isinstance(symbol, Symbol):
            raise ProblemError(f"parameters: found the key {symbol!r}; expected a SymPy Symbol")
        if symbol in distinct or symbol == epsilon:
            raise ProblemError(f"parameters: found a value for {symbol}, which is space, time, control or epsilon; leave it out")
    for symbol, value in problem.parameters.items():
        values[symbol] = constant(value, f"parameter {symbol}")
        agrees(symbol, values[symbol], values[symbol], f"parameter {symbol}")
    pair = as_tuple(problem.control_range, "control_range")
    if len(pair) != 2:
        raise ProblemError(f"control_range: found {len(pair)} entries; expected (lower, upper)")
    low, high = (constant(value, "control_range") for value in pair)
    if not low < high:
        raise ProblemError(f"control_range: found ({low}, {high}); expected the lower end first")
    agrees(problem.control, low, high, "control_range")
    interval: tuple[Expr, Expr] | None = None
    if spatial:
        ends = as_tuple(problem.interval, "interval")
        if len(ends) != 2:
            raise ProblemError(f"interval: found {len(ends)} entries; expected (left, right)")
        left, right = (constant(value, "interval") for value in ends)
        if not left < right:
            raise ProblemError(f"interval: found ({left}, {right}); expected the left end first")
        agrees(problem.space, left, right, "interval")  # type: ignore[arg-type]
        interval = (left, right)

    axis = None
    if problem.rotation_axis is not None:
        if not is_vector(problem.rotation_axis):
            raise ProblemError(f"rotation_axis: found {problem.rotation_axis!r}; expected a vector of shape (3, 1)")
        axis = ImmutableMatrix([constant(entry, "rotation_axis") for entry in components(problem.rotation_axis, "rotation_axis")])
        if all(entry == 0 for entry in axis):
            raise ProblemError("rotation_axis: found the zero vector; expected a direction")
    frame = frame_about(axis) if axis is not None else None

    # Unknowns: scalars, and the components of vectors, circular ones about the axis.
    fields = as_tuple(problem.fields, "fields")
    if not fields:
        raise ProblemError("fields: found none; expected at least one field(...) or vector_field(...)")
    arguments = (problem.space, problem.time) if spatial else (problem.time,)
    unknowns: list[Unknown] = []
    taken: set[str] = set()
    seen: set[str] = set()
    combination: dict[Any, tuple[tuple[Expr, int], ...]] = {}
    for number, item in enumerate(fields):
        parts = components(item, "fields")
        for part in parts:
            if not isinstance(part, AppliedUndef) or part.args != arguments:
                wanted = ", ".join(str(argument) for argument in arguments)
                raise ProblemError(f"fields: found {part}; expected a field of ({wanted}): field(name, {wanted})")
        label = parts[0].func.__name__ if len(parts) == 1 else parts[0].func.__name__.removesuffix(".x")
        if label in seen:
            raise ProblemError(f"fields: found {label} twice; expected different names")
        seen.add(label)
        start = len(unknowns)
        if len(parts) == 1:
            kinds = [("", 0)]
        elif frame is None:
            kinds = [("x", 0), ("y", 0), ("z", 0)]
        else:
            kinds = [("p", 1), ("m", -1), ("n", 0)]
        for k, (component, weight) in enumerate(kinds):
            name = identifier(f"{label}_{component}" if component else label, taken)
            unknowns.append(
                Unknown(index=start + k, name=name, latex=label, field=number, component=component, weight=weight)
            )
        for k, part in enumerate(parts):
            if len(parts) == 1 or frame is None:
                combination[part] = ((Integer(1), start + k),)
            else:  # v = (v_p (e1 - i e2) + v_m (e1 + i e2)) / 2 + v_n n, with v_p = v.(e1 + i e2)
                e1, e2, normal = frame
                combination[part] = (
                    (expand((e1[k] - I * e2[k]) / 2), start),
                    (expand((e1[k] + I * e2[k]) / 2), start + 1),
                    (normal[k], start + 2),
                )

    # Symbols under names of our own, so that a user's `omega` or `A` is only a name.
    user_symbols: dict[Symbol, Symbol] = {}
    space = Symbol("s", real=True)
    if spatial:
        user_symbols[problem.space] = space  # type: ignore[index]
    control = Symbol(identifier(problem.control.name, taken), real=True)
    user_symbols[problem.control] = control
    parameters: dict[Symbol, Expr] = {}
    for symbol in sorted(values, key=lambda item: item.name):
        if values[symbol] == 0:
            user_symbols[symbol] = Integer(0)
            continue
        user_symbols[symbol] = Symbol(identifier(symbol.name, taken), real=True)
        parameters[user_symbols[symbol]] = values[symbol]
    weak = Symbol("epsilon_weak", real=True)
    user_symbols[epsilon] = weak

    jets: dict[Jet, Symbol] = {}

    def jet(unknown: int, ds: int, dt: int) -> Symbol:
        key = (unknown, ds, dt)
        return jets.setdefault(key, Symbol(f"jet_{unknown}_{ds}_{dt}"))

    def smooth(expression: Expr, what: str) -> Expr:
        """Return the expression with |f| = f or -f where f has one sign in the whole range; refuse what has a kink there."""
        ranges = {problem.control: (low, high), **({problem.space: interval} if interval is not None else {})}
        replacement: dict[Expr, Expr] = {}
        for node in preorder_traversal(expression):
            kind = type(node).__name__
            if kind not in NOT_ANALYTIC or not node.free_symbols & set(ranges):
                continue
            sign = sign_in(node.args[0].xreplace(values), ranges) if kind in ("Abs", "sign") else 0
            if sign == 0:
                raise ProblemError(f"{what}: found {node}; expected an expression that is smooth on the interval and in the control range")
            replacement[node] = sign * node.args[0] if kind == "Abs" else Integer(sign)
        return expression.xreplace(replacement)

    def translate(value: Any, what: str) -> Expr:
        expression = exact(value, what)
        expression = exact(expression.doit(), what)
        replacement: dict[Any, Expr] = {}
        for derivative in sorted(expression.atoms(Derivative), key=str):
            inner = derivative.expr
            if inner not in combination:
                raise ProblemError(f"{what}: found {derivative}; expected derivatives of the declared fields")
            orders = {problem.space: 0, problem.time: 0}
            for variable, count in derivative.variable_count:
                if variable not in orders:
                    raise ProblemError(f"{what}: found {derivative}; expected derivatives in space and time only")
                orders[variable] += int(count)
            ds, dt = (orders[problem.space] if spatial else 0), orders[problem.time]
            if dt > 2:
                raise ProblemError(f"{what}: found the time derivative {derivative} of order {dt}; expected first or second: introduce a field for the first derivative")
            replacement[derivative] = sum(factor * jet(index, ds, dt) for factor, index in combination[inner])
        for part in sorted(expression.atoms(AppliedUndef), key=str):
            if part in combination:
                replacement[part] = sum(factor * jet(index, 0, 0) for factor, index in combination[part])
        expression = expression.xreplace(replacement)
        strangers = sorted(expression.atoms(AppliedUndef), key=str)
        if strangers:
            raise ProblemError(f"{what}: found {strangers[0]}; expected only the declared fields at ({', '.join(map(str, arguments))})")
        symbols = set(jets.values())
        for node in preorder_traversal(expression):
            kind = type(node).__name__
            if kind in NOT_ANALYTIC and node.free_symbols & symbols:
                raise ProblemError(f"{what}: found {kind}(...) of a field; expected a nonlinearity with a Taylor series at the base state")
        if expression.has(problem.time):
            raise ProblemError(f"{what}: found the time {problem.time} explicitly; expected equations that do not depend on time")
        expression = smooth(expression, what).xreplace(user_symbols)
        allowed = set(user_symbols.values()) | set(jets.values())
        if expression.has(I) and frame is None:
            raise ProblemError(f"{what}: found I; expected real equations: write real and imaginary parts as two fields")
        unset = [symbol for symbol in ordered_symbols([expression]) if symbol not in allowed]
        if unset:
            known_names = {symbol.name: symbol for symbol in user_symbols}
            if unset[0].name in known_names:
                raise ProblemError(f"{what}: found a symbol {unset[0]} that is not the declared {unset[0]} (their assumptions differ); make it once, with Symbol(...), and use that one everywhere")
            raise ProblemError(f"{what}: found the symbol {unset[0]} without a value; add parameters={{{unset[0]}: ...}}")
        return expression

    def raw_rows(equation: Any, label: str) -> tuple[RawRow, ...]:
        parts = components(equation, label)
        names = [label] if len(parts) == 1 else [f"{label}[{k}]" for k in range(3)]
        return tuple(RawRow(expression=translate(part, name), label=name) for part, name in zip(parts, names, strict=True))

    equations = as_tuple(problem.equations, "equations")
    if not equations:
        raise ProblemError("equations: found none; expected expressions equal to zero")
    rows = tuple(raw_rows(equation, f"equations[{k}]") for k, equation in enumerate(equations))
    boundary: list[tuple[Expr, tuple[tuple[RawRow, ...], ...]]] = []
    if spatial:
        if not isinstance(problem.boundary, Mapping):
            raise ProblemError(f"boundary: found {problem.boundary!r}; expected {{end: (expressions, ...)}}")
        conditions_at: dict[Expr, Any] = {}
        for key in problem.boundary:
            end = constant(key, "boundary")
            at = [place for place in interval if (place - end).equals(0)]  # type: ignore[union-attr]
            if not at:
                raise ProblemError(f"boundary: found the key {key}; expected an end of the interval, {interval[0]} or {interval[1]}")  # type: ignore[index]
            if at[0] in conditions_at:
                raise ProblemError(f"boundary: found the end {key} twice; expected one entry an end")
            conditions = problem.boundary[key]
            conditions_at[at[0]] = as_tuple(conditions, f"boundary[{key}]") if not is_vector(conditions) else (conditions,)
        for end in interval:  # type: ignore[union-attr]
            boundary.append((end, tuple(raw_rows(row, f"boundary[{end}][{k}]") for k, row in enumerate(conditions_at.get(end, ())))))

    # Base state.
    base: list[Expr] = [Integer(0)] * len(unknowns)
    if not isinstance(problem.base_state, Mapping):
        raise ProblemError(f"base_state: found {problem.base_state!r}; expected {{field: expression}}")
    stated = {ImmutableMatrix(key) if is_vector(key) else key: value for key, value in problem.base_state.items()}
    known = {ImmutableMatrix(item) if is_vector(item) else item: number for number, item in enumerate(fields)}
    for key in stated:
        if key not in known:
            raise ProblemError(f"base_state: found an entry for {key}; expected one of the fields")
    for key, number in known.items():
        if key not in stated:
            name = key if not is_vector(key) else key[0].func.__name__.removesuffix(".x")
            raise ProblemError(f"base_state: found nothing for {name}; expected the steady state of every field")
        parts = components(stated[key], f"base_state of {key}")
        mine = [unknown for unknown in unknowns if unknown.field == number]
        if len(parts) != len(mine):
            if len(parts) == 1 and parts[0] == 0:
                parts = (0, 0, 0)
            else:
                raise ProblemError(f"base_state: found shape {len(parts)} for {key}; expected {len(mine)}")
        exacts = []
        for part in parts:
            expression = exact(part, "base_state")
            allowed = {problem.control, *values} | ({problem.space} if spatial else set())
            strange = [symbol for symbol in ordered_symbols([expression]) if symbol not in allowed]
            if strange or expression.atoms(AppliedUndef):
                what = strange[0] if strange else sorted(expression.atoms(AppliedUndef), key=str)[0]
                raise ProblemError(f"base_state: found {what} in {expression}; expected an expression in space, control and parameters")
            exacts.append(smooth(expression, f"base_state of {key if not is_vector(key) else key[0].func.__name__.removesuffix('.x')}").xreplace(user_symbols))
        if frame is not None and len(parts) == 3:
            e1, e2, normal = frame
            vector = ImmutableMatrix(exacts)
            plus, along = expand(vector.dot(e1) + I * vector.dot(e2)), expand(vector.dot(normal))
            exacts = [plus, expand(vector.dot(e1) - I * vector.dot(e2)), along]
        for unknown, expression in zip(mine, exacts, strict=True):
            base[unknown.index] = expression

    # Normalisation.
    measure = as_tuple(problem.normalisation, "normalisation")
    if len(measure) != 2:
        raise ProblemError(f"normalisation: found {len(measure)} entries; expected (field, place)")
    what, where = measure
    whole = is_vector(what)
    if whole and frame is None:
        raise ProblemError("normalisation: found a whole vector without rotation_axis; expected a scalar field or a component such as r[0]")
    if frame is not None:
        key = ImmutableMatrix(what) if whole else None
        if key is None or key not in known:
            raise ProblemError(f"normalisation: found {what}; with rotation_axis expected one of the vector fields")
        normalised = tuple(unknown.index for unknown in unknowns if unknown.field == known[key] and unknown.weight != 0)
    else:
        if what not in combination:
            raise ProblemError(f"normalisation: found {what}; expected a scalar field or a component of a vector field")
        normalised = (combination[what][0][1],)
    place: Expr | None = None
    if spatial:
        if where is None:
            raise ProblemError("normalisation: found no place; expected a point of the interval")
        place = constant(where, "normalisation")
        if not (interval[0] <= place <= interval[1]):  # type: ignore[index]
            raise ProblemError(f"normalisation: found the place {place}; expected a point of the interval {interval}")
    elif where is not None:
        raise ProblemError(f"normalisation: found the place {where}; expected None for a problem without space")

    if not isinstance(problem.coefficient_names, Mapping):
        raise ProblemError(f"coefficient_names: found {problem.coefficient_names!r}; expected {{monomial: name}}")
    for key, name in problem.coefficient_names.items():
        if not isinstance(key, str) or not isinstance(name, str) or not name:
            raise ProblemError(f"coefficient_names: found {key!r}: {name!r}; expected two strings")
        if list(problem.coefficient_names.values()).count(name) > 1 or name != key and name in MONOMIALS:
            raise ProblemError(f"coefficient_names: found {name!r} for {key!r}; expected a name that belongs to no other monomial")

    for unknown in unknowns:
        jet(unknown.index, 0, 0)
    probe = Probe(
        fixed={symbol: value for symbol, value in parameters.items()},
        ranges={control: (low, high), **({space: interval} if interval else {})},
    )
    formulation = Formulation(
        problem=problem, unknowns=tuple(unknowns), rows=rows, boundary=tuple(boundary), jets=dict(sorted(jets.items())),
        base=tuple(base), space=space, control=control, parameters=parameters, user_symbols=user_symbols, interval=interval,
        control_range=(low, high), frame=frame, normalised=normalised, place=place, weak=weak, probe=probe,
    )
    check_base_state(formulation)
    return formulation


def base_jets(formulation: Formulation) -> dict[Symbol, Expr]:
    """Return the value of every jet at the base state."""
    table: dict[Symbol, Expr] = {}
    for (unknown, ds, dt), symbol in formulation.jets.items():
        base = formulation.base[unknown]
        table[symbol] = Integer(0) if dt else (base.diff(formulation.space, ds) if ds else base)
    return table


def check_base_state(formulation: Formulation) -> None:
    """Insert the base state into every equation and boundary row, for every control and every epsilon."""
    table = base_jets(formulation)
    probe = formulation.probe
    user = formulation.problem
    for unknown in formulation.unknowns:
        if unknown.weight != 0 and not probe.is_zero(formulation.base[unknown.index]):
            raise ProblemError(f"base_state of {unknown.latex}: found a part across the rotation axis; expected a state that rotations about it leave alone")
    for rows in formulation.rows:
        for row in rows:
            residual = row.expression.xreplace(table)
            if residual.has(nan, zoo, oo):
                raise ProblemError(f"{row.label}: found no finite value at the base state; expected a nonlinearity with a Taylor series there")
            if not probe.is_zero(residual, extra=(formulation.weak,)):
                raise ProblemError(f"base_state: found the residual {shown(residual, formulation)} in {row.label}; expected 0 for every {user.control}; correct base_state or the equation")
    for end, equations in formulation.boundary:
        for rows in equations:
            for row in rows:
                residual = row.expression.xreplace(table).subs(formulation.space, end)
                if residual.has(nan, zoo, oo) or not probe.is_zero(residual, extra=(formulation.weak,)):
                    raise ProblemError(f"base_state: found the residual {shown(residual, formulation)} in {row.label}; expected 0 for every {user.control}; correct base_state or the boundary row")


def shown(expression: Expr, formulation: Formulation) -> str:
    """Return an expression in the user's own symbols, for a message."""
    back = {ours: theirs for theirs, ours in formulation.user_symbols.items() if isinstance(ours, Symbol)}
    text = str(expression.xreplace(back)).replace("_epsilon", "epsilon")
    return text if len(text) < 120 else text[:117] + "..."

