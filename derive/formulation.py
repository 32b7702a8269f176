"""From a statement to scalar rows: scalar unknowns, jets in place of derivatives, and symbols whose names cannot clash with ours."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from sympy import Derivative, Expr, I, ImmutableMatrix, Integer, Rational, Symbol, nan, oo, preorder_traversal, sqrt, zoo
from sympy.core.function import AppliedUndef

from derive.expand import expand
from derive.statement import ProblemError, as_tuple, components, epsilon, evaluated, exact, is_vector, ordered_symbols
from derive.zero import Probe

if TYPE_CHECKING:
    from derive.problem import Problem

Frame = tuple[ImmutableMatrix, ImmutableMatrix, ImmutableMatrix]
"""(e1, e2, n), right-handed and orthonormal; n is the rotation axis."""
Jet = tuple[int, int, int]
"""(unknown, order of the space derivative, order of the time derivative)"""

NOT_ANALYTIC = (
    "Abs", "sign", "Max", "Min", "Piecewise", "Heaviside", "DiracDelta", "floor", "ceiling", "re", "im", "conjugate", "arg",
    "Mod", "frac",
)
SCALAR_MONOMIALS = ("mu*A", "A**2*conj(A)", "A**2", "A**3", "epsilon*A")
VECTOR_MONOMIALS = ("mu*A", "dot(A,A)*conj(A)", "dot(A,conj(A))*A", "dot(A,A)*A", "epsilon*A", *(f"epsilon*dot(A,e{j})*e{i}" for i in (1, 2) for j in (1, 2)))
MONOMIALS = frozenset(SCALAR_MONOMIALS + VECTOR_MONOMIALS)
RESERVED = frozenset(
    "a lam omega phi phi_bar zeta xi s i D solve integral kernel Operator stage pi sqrt exp sin cos tan sinh cosh tanh log asin "
    "acos atan asinh acosh atanh erf A T chi mean second lambda None True False and or not if else for in is def return import from as "
    "with while class pass del try except finally raise global nonlocal assert yield break continue elif async await list "
    "mode mode_bar critical adjoint adjoint_mode mirror_xi interval parameters frame base fields_mode fields_responses consistency consistency_cubic total integrand stage".split()
)


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
    user_symbols: Mapping[Symbol, Expr]
    interval: tuple[Expr, Expr] | None
    control_range: tuple[Expr, Expr]
    frame: Frame | None
    normalised: tuple[int, ...]  # the unknowns of the normalised field: one, or its + and - components
    place: Expr | None
    weak: Symbol
    probe: Probe


@dataclass(frozen=True, slots=True, kw_only=True)
class Scalars:
    """The scalar unknowns, and what the user's fields are in them.

    Attributes
    ----------
    numbers
        {field as the user wrote it: its number}.
    combination
        {scalar field, or component of a vector field: ((factor, unknown), ...)}.
    """

    unknowns: tuple[Unknown, ...]
    numbers: Mapping[Any, int]
    combination: Mapping[Any, tuple[tuple[Expr, int], ...]]

    def of_field(self, number: int) -> tuple[Unknown, ...]:
        """Return the unknowns of a field."""
        return tuple(unknown for unknown in self.unknowns if unknown.field == number)


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnSymbols:
    """Symbols under names of our own, so that a user's `omega` or `A` is only a name; `of_user` maps the user's to them, a parameter that is zero to 0."""

    space: Symbol
    control: Symbol
    weak: Symbol
    parameters: Mapping[Symbol, Expr]
    of_user: Mapping[Symbol, Expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class Translation:
    """Puts expressions of the user into jets and symbols of our own; `jets` are those met so far."""

    problem: Problem
    values: Mapping[Symbol, Expr]
    ranges: Mapping[Symbol, tuple[Expr, Expr]]
    scalars: Scalars
    user_symbols: Mapping[Symbol, Expr]
    rotating: bool
    jets: dict[Jet, Symbol]

    def jet(self, unknown: int, ds: int, dt: int) -> Symbol:
        """Return the symbol of a derivative of an unknown."""
        return self.jets.setdefault((unknown, ds, dt), Symbol(f"jet_{unknown}_{ds}_{dt}"))

    def rows(self, equation: Any, label: str) -> tuple[RawRow, ...]:
        """Return the rows of a scalar or vector equation."""
        parts = components(equation, label)
        names = [label] if len(parts) == 1 else [f"{label}[{k}]" for k in range(3)]
        return tuple(RawRow(expression=self.translated(part, name), label=name) for part, name in zip(parts, names, strict=True))

    def translated(self, value: Any, what: str) -> Expr:
        """Return an expression in jets and in symbols of our own, or refuse it."""
        expression = self.in_jets(evaluated(value, what), what)
        self.check_symbols(expression, what)
        symbols = set(self.jets.values())
        for node in preorder_traversal(expression):
            kind = type(node).__name__
            if kind in NOT_ANALYTIC and node.free_symbols & symbols:
                raise ProblemError(f"{what}: found {kind}(...) of a field; expected a nonlinearity with a Taylor series at the base state")
        if expression.has(self.problem.time):
            raise ProblemError(f"{what}: found the time {self.problem.time} explicitly; expected equations that do not depend on time")
        expression = self.smooth(expression, what).xreplace(self.user_symbols)
        if expression.has(I) and not self.rotating:
            raise ProblemError(f"{what}: found I; expected real equations: write real and imaginary parts as two fields")
        return expression

    def in_jets(self, expression: Expr, what: str) -> Expr:
        """Return the expression with jets in place of fields and their derivatives."""
        combination = self.scalars.combination
        strangers = sorted(expression.atoms(AppliedUndef) - set(combination), key=str)
        if strangers:
            raise ProblemError(f"{what}: found {strangers[0]}; expected only the declared fields at ({', '.join(map(str, arguments_of(self.problem)))})")
        replacement: dict[Any, Expr] = {}
        for derivative in sorted(expression.atoms(Derivative), key=str):
            if derivative.expr not in combination:
                raise ProblemError(f"{what}: found {derivative}; expected derivatives of the declared fields")
            ds, dt = self.orders(derivative, what)
            replacement[derivative] = sum((factor * self.jet(index, ds, dt) for factor, index in combination[derivative.expr]), Integer(0))
        for part in sorted(expression.atoms(AppliedUndef), key=str):
            replacement[part] = sum((factor * self.jet(index, 0, 0) for factor, index in combination[part]), Integer(0))
        return expression.xreplace(replacement)

    def orders(self, derivative: Derivative, what: str) -> tuple[int, int]:
        """Return how often a derivative is taken in space and in time."""
        orders = {variable: 0 for variable in (self.problem.space, self.problem.time)}
        for variable, count in derivative.variable_count:
            if variable not in orders:
                raise ProblemError(f"{what}: found {derivative}; expected derivatives in space and time only")
            orders[variable] += int(count)
        dt = orders[self.problem.time]
        if dt > 2:
            raise ProblemError(f"{what}: found the time derivative {derivative} of order {dt}; expected first or second: introduce a field for the first derivative")
        return orders[self.problem.space], dt

    def smooth(self, expression: Expr, what: str) -> Expr:
        """Return the expression with |f| = f or -f where f has one sign in the whole range; refuse what has a kink there."""
        replacement: dict[Expr, Expr] = {}
        for node in preorder_traversal(expression):
            kind = type(node).__name__
            if kind not in NOT_ANALYTIC or not node.free_symbols & set(self.ranges):
                continue
            sign = sign_in(node.args[0].xreplace(self.values), self.ranges) if kind in ("Abs", "sign") else 0
            if sign == 0:
                raise ProblemError(f"{what}: found {node}; expected an expression that is smooth on the interval and in the control range")
            replacement[node] = sign * node.args[0] if kind == "Abs" else Integer(sign)
        return expression.xreplace(replacement)

    def check_symbols(self, expression: Expr, what: str) -> None:
        """Refuse a symbol that is neither declared nor has a value; time is refused with words of its own."""
        allowed = {*self.user_symbols, *self.jets.values(), self.problem.time}
        unset = next((symbol for symbol in ordered_symbols(expression) if symbol not in allowed), None)
        if unset is None:
            return
        if unset.name in {symbol.name for symbol in self.user_symbols}:
            raise ProblemError(f"{what}: found a symbol {unset} that is not the declared {unset} (their assumptions differ); make it once, with Symbol(...), and use that one everywhere")
        raise ProblemError(f"{what}: found the symbol {unset} without a value; add parameters={{{unset}: ...}}")


def formulate(problem: Problem) -> Formulation:
    """Check the statement and return it as scalar rows over jets.

    Raises
    ------
    ProblemError
        Anything in the statement that is not as design section 2 says.
    """
    check_variables(problem)
    values = values_of(problem)
    control_range = range_of(problem.control, problem.control_range, values, "control_range", ("lower", "upper"))
    interval = range_of(problem.space, problem.interval, values, "interval", ("left", "right")) if problem.space is not None else None
    frame = frame_of(problem, values)
    scalars = scalars_of(problem, frame)
    own = own_symbols(problem, values, {unknown.name for unknown in scalars.unknowns})
    ranges = {problem.control: control_range}
    if problem.space is not None and interval is not None:
        ranges[problem.space] = interval
    translation = Translation(problem=problem, values=values, ranges=ranges, scalars=scalars, user_symbols=own.of_user, rotating=frame is not None, jets={})
    equations = as_tuple(problem.equations, "equations")
    if not equations:
        raise ProblemError("equations: found none; expected expressions equal to zero")
    rows = tuple(translation.rows(equation, f"equations[{k}]") for k, equation in enumerate(equations))
    boundary = boundary_of(translation, interval) if interval is not None else ()
    base = base_of(translation, frame)
    normalised = normalised_of(problem, scalars, frame)
    place = place_of(problem, values, interval)
    check_names(problem, VECTOR_MONOMIALS if frame is not None else SCALAR_MONOMIALS)
    for unknown in scalars.unknowns:
        translation.jet(unknown.index, 0, 0)
    probe = Probe(fixed=own.parameters, ranges={own.control: control_range, **({own.space: interval} if interval is not None else {})})
    formulation = Formulation(
        problem=problem, unknowns=scalars.unknowns, rows=rows, boundary=boundary, jets=dict(sorted(translation.jets.items())), base=base, space=own.space, control=own.control,
        parameters=own.parameters, user_symbols=own.of_user, interval=interval, control_range=control_range, frame=frame, normalised=normalised, place=place, weak=own.weak, probe=probe,
    )
    check_base_state(formulation)
    return formulation


def check_variables(problem: Problem) -> None:
    """Check the name, and that space, time and control are different symbols, with interval and boundary where there is space."""
    if not isinstance(problem.name, str) or not re.fullmatch(r"\w[\w .+-]*", problem.name):
        raise ProblemError(f"name: found {problem.name!r}; expected letters, digits, underscores: it names the files")
    for what, symbol in (("time", problem.time), ("control", problem.control), ("space", problem.space)):
        if not isinstance(symbol, Symbol) and not (what == "space" and symbol is None):
            raise ProblemError(f"{what}: found {symbol!r}; expected a SymPy Symbol")
    for what, given in (("interval", problem.interval), ("boundary", problem.boundary)):
        if problem.space is not None and given is None:
            raise ProblemError(f"{what}: found nothing; a problem with space needs it: add {what}=...")
        if problem.space is None and given is not None:
            raise ProblemError(f"{what}: found it without space; leave it out, or add space=...")
    distinct = variables_of(problem)
    if len(set(distinct)) < len(distinct):
        raise ProblemError("space, time, control: found one symbol twice; expected different symbols")


def variables_of(problem: Problem) -> tuple[Symbol, ...]:
    """Return space (where there is), time and control."""
    return (*arguments_of(problem), problem.control)


def arguments_of(problem: Problem) -> tuple[Symbol, ...]:
    """Return what the fields depend on: space, where there is, and time."""
    return (problem.time,) if problem.space is None else (problem.space, problem.time)


def constant(value: Any, what: str, values: Mapping[Symbol, Expr]) -> Expr:
    """Return a finite real number; the parameters may stand in it."""
    expression = exact(value, what)
    if expression.free_symbols - set(values):
        raise ProblemError(f"{what}: found {expression}, which holds {ordered_symbols(expression)[0]}; expected a number")
    expression = expression.subs(values)
    if not expression.is_number or not expression.is_real or not expression.is_finite:
        raise ProblemError(f"{what}: found {expression}; expected a finite real number")
    return expression


def check_assumptions(symbol: Symbol, low: Expr, high: Expr, what: str) -> None:
    """Refuse values that the assumptions of a symbol exclude: SymPy has simplified with them already."""
    if symbol.is_nonnegative and low < 0 or symbol.is_nonpositive and high > 0 or symbol.is_real is False:
        sign = "nonnegative" if symbol.is_nonnegative else "nonpositive" if symbol.is_nonpositive else "not real"
        shown_values = f"{low}" if low == high else f"({low}, {high})"
        raise ProblemError(f"{what}: found {shown_values} for {symbol}, which is declared {sign}; declare it real=True")


def values_of(problem: Problem) -> dict[Symbol, Expr]:
    """Return the values of the parameters."""
    if not isinstance(problem.parameters, Mapping):
        raise ProblemError(f"parameters: found {problem.parameters!r}; expected {{symbol: value}}")
    for symbol in problem.parameters:
        if not isinstance(symbol, Symbol):
            raise ProblemError(f"parameters: found the key {symbol!r}; expected a SymPy Symbol")
        if symbol in variables_of(problem) or symbol == epsilon:
            raise ProblemError(f"parameters: found a value for {symbol}, which is space, time, control or epsilon; leave it out")
    values: dict[Symbol, Expr] = {}
    for symbol, value in problem.parameters.items():
        values[symbol] = constant(value, f"parameter {symbol}", values)
        check_assumptions(symbol, values[symbol], values[symbol], f"parameter {symbol}")
    return values


def range_of(symbol: Symbol, given: Any, values: Mapping[Symbol, Expr], what: str, ends: tuple[str, str]) -> tuple[Expr, Expr]:
    """Return the range of a symbol; `ends` are the words for its ends."""
    pair = as_tuple(given, what)
    if len(pair) != 2:
        raise ProblemError(f"{what}: found {len(pair)} entries; expected ({ends[0]}, {ends[1]})")
    low, high = (constant(value, what, values) for value in pair)
    if not low < high:
        raise ProblemError(f"{what}: found ({low}, {high}); expected the {ends[0]} end first")
    check_assumptions(symbol, low, high, what)
    return low, high


def frame_of(problem: Problem, values: Mapping[Symbol, Expr]) -> Frame | None:
    """Return the frame about the rotation axis, or None without one."""
    if problem.rotation_axis is None:
        return None
    if not is_vector(problem.rotation_axis):
        raise ProblemError(f"rotation_axis: found {problem.rotation_axis!r}; expected a vector of shape (3, 1)")
    axis = ImmutableMatrix([constant(entry, "rotation_axis", values) for entry in components(problem.rotation_axis, "rotation_axis")])
    if all(entry == 0 for entry in axis):
        raise ProblemError("rotation_axis: found the zero vector; expected a direction")
    return frame_about(axis)


def frame_about(axis: ImmutableMatrix) -> Frame:
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


def scalars_of(problem: Problem, frame: Frame | None) -> Scalars:
    """Return the scalar unknowns: scalar fields, and the components of vectors, circular ones about the axis."""
    fields = as_tuple(problem.fields, "fields")
    if not fields:
        raise ProblemError("fields: found none; expected at least one field(...) or vector_field(...)")
    arguments = arguments_of(problem)
    unknowns: list[Unknown] = []
    taken: set[str] = set()
    combination: dict[Any, tuple[tuple[Expr, int], ...]] = {}
    for number, item in enumerate(fields):
        parts = components(item, "fields")
        for part in parts:
            if not isinstance(part, AppliedUndef) or part.args != arguments:
                wanted = ", ".join(map(str, arguments))
                raise ProblemError(f"fields: found {part}; expected a field of ({wanted}): field(name, {wanted})")
        label = parts[0].func.__name__.removesuffix(".x" if len(parts) == 3 else "")
        if label in {unknown.latex for unknown in unknowns}:
            raise ProblemError(f"fields: found {label} twice; expected different names")
        start = len(unknowns)
        for k, (component, weight) in enumerate([("", 0)] if len(parts) == 1 else [("x", 0), ("y", 0), ("z", 0)] if frame is None else [("p", 1), ("m", -1), ("n", 0)]):
            name = identifier(f"{label}_{component}" if component else label, taken)
            unknowns.append(Unknown(index=start + k, name=name, latex=label, field=number, component=component, weight=weight))
        for k, part in enumerate(parts):
            if len(parts) == 1 or frame is None:
                combination[part] = ((Integer(1), start + k),)
            else:  # v = (v_p (e1 - i e2) + v_m (e1 + i e2)) / 2 + v_n n, with v_p = v.(e1 + i e2)
                e1, e2, normal = frame
                combination[part] = ((expand((e1[k] - I * e2[k]) / 2), start), (expand((e1[k] + I * e2[k]) / 2), start + 1), (normal[k], start + 2))
    return Scalars(unknowns=tuple(unknowns), numbers={hashable(item): number for number, item in enumerate(fields)}, combination=combination)


def hashable(item: Any) -> Any:
    """Return a field as the key of a mapping."""
    return ImmutableMatrix(item) if is_vector(item) else item


def title_of(item: Any) -> str:
    """Return a field for a message: a vector by its name."""
    return item[0].func.__name__.removesuffix(".x") if is_vector(item) else str(item)


def identifier(name: str, taken: set[str]) -> str:
    """Return a Python identifier for a user's name that is not taken, and take it."""
    base = re.sub(r"\W", "_", name)
    if not base or not (base[0].isalpha() or base[0] == "_") or not base.isascii():
        base = "p_" + re.sub(r"[^0-9A-Za-z_]", "_", base)
    while base in taken or base in RESERVED or re.fullmatch(r"(phi|phi_bar|zeta|w|f|coefficient|mirror|response|operator|weak)(_.*)?", base) and not base.endswith("_"):
        base += "_"
    taken.add(base)
    return base


def own_symbols(problem: Problem, values: Mapping[Symbol, Expr], taken: set[str]) -> OwnSymbols:
    """Return symbols for space, control, parameters and epsilon whose names are not taken."""
    space, weak = Symbol("s", real=True), Symbol("epsilon_weak", real=True)
    control = Symbol(identifier(problem.control.name, taken), real=True)
    of_user: dict[Symbol, Expr] = {} if problem.space is None else {problem.space: space}
    of_user[problem.control] = control
    parameters: dict[Symbol, Expr] = {}
    for symbol in sorted(values, key=lambda item: item.name):
        if values[symbol] == 0:
            of_user[symbol] = Integer(0)
            continue
        ours = Symbol(identifier(symbol.name, taken), real=True)
        of_user[symbol], parameters[ours] = ours, values[symbol]
    of_user[epsilon] = weak
    return OwnSymbols(space=space, control=control, weak=weak, parameters=parameters, of_user=of_user)


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


def boundary_of(translation: Translation, interval: tuple[Expr, Expr]) -> tuple[tuple[Expr, tuple[tuple[RawRow, ...], ...]], ...]:
    """Return (place, rows of each condition) of both ends, left end first."""
    stated = translation.problem.boundary
    if not isinstance(stated, Mapping):
        raise ProblemError(f"boundary: found {stated!r}; expected {{end: (expressions, ...)}}")
    conditions: dict[Expr, tuple[Any, ...]] = {}
    for key, given in stated.items():
        end = constant(key, "boundary", translation.values)
        at = next((place for place in interval if (place - end).equals(0)), None)
        if at is None:
            raise ProblemError(f"boundary: found the key {key}; expected an end of the interval, {interval[0]} or {interval[1]}")
        if at in conditions:
            raise ProblemError(f"boundary: found the end {key} twice; expected one entry an end")
        conditions[at] = (given,) if is_vector(given) else as_tuple(given, f"boundary[{key}]")
    return tuple((end, tuple(translation.rows(row, f"boundary[{end}][{k}]") for k, row in enumerate(conditions.get(end, ())))) for end in interval)


def base_of(translation: Translation, frame: Frame | None) -> tuple[Expr, ...]:
    """Return the base state of every unknown."""
    problem, scalars = translation.problem, translation.scalars
    if not isinstance(problem.base_state, Mapping):
        raise ProblemError(f"base_state: found {problem.base_state!r}; expected {{field: expression}}")
    stated = {hashable(key): value for key, value in problem.base_state.items()}
    for key in stated:
        if key not in scalars.numbers:
            raise ProblemError(f"base_state: found an entry for {key}; expected one of the fields")
    base: list[Expr] = []
    for key, number in scalars.numbers.items():
        if key not in stated:
            raise ProblemError(f"base_state: found nothing for {title_of(key)}; expected the steady state of every field")
        parts = components(stated[key], f"base_state of {title_of(key)}")
        size = len(scalars.of_field(number))
        if len(parts) == 1 and size == 3 and parts[0] == 0:
            parts = (0, 0, 0)
        if len(parts) != size:
            raise ProblemError(f"base_state: found {len(parts)} component{'s' * (len(parts) > 1)} for {title_of(key)}; expected {size}")
        found = [steady(translation, part, f"base_state of {title_of(key)}") for part in parts]
        if frame is not None and size == 3:
            e1, e2, normal = frame
            vector = ImmutableMatrix(found)
            found = [expand(vector.dot(e1) + I * vector.dot(e2)), expand(vector.dot(e1) - I * vector.dot(e2)), expand(vector.dot(normal))]
        base += found
    return tuple(base)


def steady(translation: Translation, part: Any, what: str) -> Expr:
    """Return one component of the base state in symbols of our own."""
    expression = evaluated(part, "base_state")
    allowed = {*translation.ranges, *translation.values}
    strange = [*(symbol for symbol in ordered_symbols(expression) if symbol not in allowed), *sorted(expression.atoms(AppliedUndef), key=str)]
    if strange:
        raise ProblemError(f"base_state: found {strange[0]} in {expression}; expected an expression in space, control and parameters")
    return translation.smooth(expression, what).xreplace(translation.user_symbols)


def normalised_of(problem: Problem, scalars: Scalars, frame: Frame | None) -> tuple[int, ...]:
    """Return the unknowns of the normalised field: one, or with a rotation axis its + and - components."""
    measure = as_tuple(problem.normalisation, "normalisation")
    if len(measure) != 2:
        raise ProblemError(f"normalisation: found {len(measure)} entries; expected (field, place)")
    what = measure[0]
    if frame is not None:
        number = scalars.numbers.get(hashable(what)) if is_vector(what) else None
        if number is None:
            raise ProblemError(f"normalisation: found {what}; with rotation_axis expected one of the vector fields")
        return tuple(unknown.index for unknown in scalars.of_field(number) if unknown.weight != 0)
    if is_vector(what):
        raise ProblemError("normalisation: found a whole vector without rotation_axis; expected a scalar field or a component such as r[0]")
    if what not in scalars.combination:
        raise ProblemError(f"normalisation: found {what}; expected a scalar field or a component of a vector field")
    return (scalars.combination[what][0][1],)


def place_of(problem: Problem, values: Mapping[Symbol, Expr], interval: tuple[Expr, Expr] | None) -> Expr | None:
    """Return the place of the normalisation, or None without space."""
    where = problem.normalisation[1]
    if interval is None:
        if where is not None:
            raise ProblemError(f"normalisation: found the place {where}; expected None for a problem without space")
        return None
    if where is None:
        raise ProblemError("normalisation: found no place; expected a point of the interval")
    place = constant(where, "normalisation", values)
    if not interval[0] <= place <= interval[1]:
        raise ProblemError(f"normalisation: found the place {place}; expected a point of the interval {interval}")
    return place


def check_names(problem: Problem, monomials: tuple[str, ...]) -> None:
    """Check the names of the coefficients; `monomials` are those of this kind of amplitude."""
    names = problem.coefficient_names
    if not isinstance(names, Mapping):
        raise ProblemError(f"coefficient_names: found {names!r}; expected {{monomial: name}}")
    for key, name in names.items():
        if not isinstance(key, str) or not isinstance(name, str) or not name:
            raise ProblemError(f"coefficient_names: found {key!r}: {name!r}; expected two strings")
        if list(names.values()).count(name) > 1 or name != key and name in MONOMIALS:
            raise ProblemError(f"coefficient_names: found {name!r} for {key!r}; expected a name that belongs to no other monomial")
        if key not in MONOMIALS:
            raise ProblemError(f"coefficient_names: found the monomial {key!r}; expected one of {', '.join(monomials)}")


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
            if not probe.is_zero(residual):
                raise ProblemError(f"base_state: found the residual {shown(residual, formulation)} in {row.label}; expected 0 for every {user.control}; correct base_state or the equation")
    for end, equations in formulation.boundary:
        for row in (row for rows in equations for row in rows):
            residual = row.expression.xreplace(table).subs(formulation.space, end)
            if residual.has(nan, zoo, oo) or not probe.is_zero(residual):
                raise ProblemError(f"base_state: found the residual {shown(residual, formulation)} in {row.label}; expected 0 for every {user.control}; correct base_state or the boundary row")


def shown(expression: Expr, formulation: Formulation) -> str:
    """Return an expression in the user's own symbols, for a message."""
    back = {ours: theirs for theirs, ours in formulation.user_symbols.items() if isinstance(ours, Symbol)}
    text = str(expression.xreplace(back)).replace("_epsilon", "epsilon")
    return text if len(text) < 120 else text[:117] + "..."
