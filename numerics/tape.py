"""Emitted text recorded once: every product once, constants folded, then straight-line NumPy text without stages or checks of types.

Only what needs no linear problem but the two kernels, with coefficients that do not depend on s, can be recorded: products, sums, conjugates and
nested integrals of the mode and the adjoint mode. All else raises `NotRecorded`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from numerics.algebra import Operator, Row

ELEMENTARY = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "erf": special.erf,
              **{name: getattr(np, name) for name in ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt")}}


class NotRecorded(Exception):
    """The text needs what a tape does not hold."""


class Recorded:
    """factor * number * function; the latter two are places on the tape, or None."""

    __slots__ = ("factor", "function", "number", "tape")

    def __init__(self, tape: Tape, factor: complex, number: int | None = None, function: int | None = None) -> None:
        self.tape, self.factor, self.number, self.function = tape, complex(factor), number, function

    def of(self, other: Any) -> Recorded:
        """Return the other operand as a recorded value."""
        return other if isinstance(other, Recorded) else Recorded(self.tape, other)

    def __neg__(self) -> Recorded:
        return Recorded(self.tape, -self.factor, self.number, self.function)

    def __mul__(self, other: Any) -> Recorded:
        other, tape = self.of(other), self.tape
        return Recorded(tape, self.factor * other.factor, tape.product(self.number, other.number), tape.product(self.function, other.function))

    def __add__(self, other: Any) -> Recorded:
        return self.tape.sum(self, self.of(other))

    def __sub__(self, other: Any) -> Recorded:
        return self.tape.sum(self, -self.of(other))

    def __rsub__(self, other: Any) -> Recorded:
        return self.tape.sum(self.of(other), -self)

    def __truediv__(self, other: Any) -> Recorded:
        return self * self.of(other) ** -1

    def __rtruediv__(self, other: Any) -> Recorded:
        return self.of(other) * self**-1

    def __pow__(self, power: int) -> Recorded:
        if not isinstance(power, int):
            raise NotRecorded("a power that is no integer")
        if power < 0:
            number, function = (None if place is None else self.tape.place("1/", place) for place in (self.number, self.function))
            return Recorded(self.tape, 1 / self.factor, number, function) ** -power
        result = Recorded(self.tape, 1)
        for _ in range(power):
            result = result * self
        return result

    __radd__, __rmul__ = __add__, __mul__


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A kernel problem: y' = matrix y, its boundary rows, and where and how the solution is normalised (the adjoint: not)."""

    operator: Operator
    row: Row | None
    place: float


class Tape:
    """The algebra that records: a place holds an operation and the places of its operands."""

    one, zero, i, pi = 1.0, 0.0, 1j, math.pi

    def __init__(self, ends: tuple[float, float]) -> None:
        self.ends = ends
        self.steps: list[tuple[Any, ...]] = []
        self.known: dict[tuple[Any, ...], int] = {}
        self.store: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.problems: dict[str, Problem] = {}
        self.control, self.frequency = (Recorded(self, 1, self.place(name)) for name in ("control", "frequency"))

    def place(self, *step: Any) -> int:
        """Return the place of a step, the same for the same step."""
        if step not in self.known:
            self.known[step] = len(self.steps)
            self.steps.append(step)
        return self.known[step]

    def product(self, one: int | None, other: int | None) -> int | None:
        """Return the place of a product."""
        if one is None or other is None:
            return other if one is None else one
        return self.place("*", *sorted((one, other)))

    def sum(self, one: Recorded, other: Recorded) -> Recorded:
        """Return a sum, its common factor outside."""
        if one.factor == 0 or other.factor == 0:
            return other if one.factor == 0 else one
        if one.function == other.function:
            if one.number == other.number:
                return Recorded(self, one.factor + other.factor, one.number, one.function)
            if one.function is not None:
                return self.sum(Recorded(self, one.factor, one.number), Recorded(self, other.factor, other.number)) * Recorded(self, 1, None, one.function)
        common = one.number if one.number == other.number and None not in (one.function, other.function) else None
        left, right = (part.function if common is not None else self.product(part.number, part.function) for part in (one, other))
        if left is None or right is not None and left > right:
            left, right, one, other = right, left, other, one
        total = self.place("+", left, right, other.factor / one.factor)
        return Recorded(self, one.factor, common, total) if (one.function, other.function) != (None, None) else Recorded(self, one.factor, total)

    # The algebra of the emitted text

    def rational(self, p: int, q: int) -> float:
        """Return p/q."""
        return p / q

    def parameter(self, name: str) -> Recorded:
        """Return a parameter."""
        return Recorded(self, 1, self.place("parameter", name))

    def conjugate(self, place: int) -> int:
        """Return the place of a conjugate: it is taken of modes only."""
        kind, *parts = self.steps[place]
        if kind in ("control", "frequency", "parameter"):
            return place
        if kind == "conj":
            return int(parts[0])
        if kind == "*":
            return self.place("*", *sorted(self.conjugate(part) for part in parts))
        return self.place("conj", place)

    def reflect(self, value: Any) -> Any:
        """Return the conjugate."""
        if not isinstance(value, Recorded):
            return np.conj(value)
        number, function = (None if place is None else self.conjugate(place) for place in (value.number, value.function))
        return Recorded(self, value.factor.conjugate(), number, function)

    def integrated(self, value: Any, kind: str) -> Recorded:
        """Return an integral: the number stands before it."""
        value = self.control.of(value)
        if value.function is None:
            raise NotRecorded("the integral of a number")
        place = self.place(kind, value.function)
        return Recorded(self, value.factor, value.number, place) if kind != "integral" else Recorded(self, value.factor, self.product(value.number, place))

    def integral(self, value: Any) -> Recorded:
        """Return the integral over the interval."""
        return self.integrated(value, "integral")

    def integral_from_left(self, value: Any) -> Recorded:
        """Return the integral from the left end to s."""
        return self.integrated(value, "before")

    def integral_to_right(self, value: Any) -> Recorded:
        """Return the integral from s to the right end."""
        return self.integrated(value, "after")

    def end_of(self, place: int | None, end: int) -> Recorded:
        """Return the value of what a place holds at an end: that of its operands, down to the modes."""
        if place is None:
            return Recorded(self, 1)
        kind, *parts = self.steps[place]
        if kind == "mode":
            return Recorded(self, 1, self.place("end", *parts, end))
        if kind == "conj":
            return self.reflect(self.end_of(parts[0], end))  # type: ignore[no-any-return]
        if kind == "*":
            return self.end_of(parts[0], end) * self.end_of(parts[1], end)
        if kind == "+":
            first = self.end_of(parts[0], end)
            return first + (Recorded(self, 1) if parts[1] is None else self.end_of(parts[1], end)) * parts[2]
        if kind == "1/":
            return self.end_of(parts[0], end) ** -1
        if kind in ("before", "after"):
            return Recorded(self, 1, self.place("integral", parts[0])) if (kind == "before") == (end == 1) else Recorded(self, 0)
        return Recorded(self, 1, place)

    def end(self, value: Any, end: int) -> Any:
        """Return the value at an end."""
        return value if not isinstance(value, Recorded) else Recorded(self, value.factor, value.number) * self.end_of(value.function, end)

    def left(self, value: Any) -> Any:
        """Return the value at the left end."""
        return self.end(value, 0)

    def right(self, value: Any) -> Any:
        """Return the value at the right end."""
        return self.end(value, 1)

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Recorded, ...]:
        """Return the mode, or without a row the adjoint mode."""
        name = "adjoint" if row is None else "mode"
        for line in (*operator.matrix, *operator.left, *operator.right, row or ()):
            if any(isinstance(entry, Recorded) and entry.function is not None for entry in line) or isinstance(place, Recorded):
                raise NotRecorded("coefficients that depend on s")
        self.problems[name] = Problem(operator=operator, row=row, place=self.ends[0] if place is None else float(np.real(place)))
        return tuple(Recorded(self, 1, None, self.place("mode", name, k)) for k in range(operator.size))

    def __getattr__(self, name: str) -> Callable[[Any], Any]:
        if name not in ELEMENTARY:
            raise NotRecorded(name)

        def apply(value: Any) -> Any:
            if not isinstance(value, Recorded):
                return ELEMENTARY[name](complex(value))
            if value.function is not None:
                raise NotRecorded(f"{name} of a function")
            return Recorded(self, 1, self.place("elementary", name, value.factor, value.number))

        return apply

    # Text

    def compiled(self, outputs: Sequence[Any], parameters: Sequence[str]) -> Compiled:
        """Return the function (control, frequency, parameters, modes, ends, tables, f) that computes the outputs: f holds buffers for functions, used again when what they hold is done with."""
        needed: set[int] = set()
        waiting = [place for one in outputs if isinstance(one, Recorded) for place in (one.number, one.function) if place is not None]
        while waiting:
            place = waiting.pop()
            if place not in needed:
                needed.add(place)
                waiting += operands(self.steps[place])
        order = sorted(needed)
        last = {part: place for place in order for part in operands(self.steps[place])}
        lines = ["def run(control, frequency, parameters, modes=None, ends=None, tables=None, f=None):"]
        held: dict[int, int] = {}
        free: list[int] = []
        functions: set[int] = set()
        count = 0
        for place in order:
            kind, *parts = self.steps[place]
            is_function = kind not in ("integral", "end") and (kind == "mode" or any(part in functions for part in operands(self.steps[place])))
            if is_function:
                functions.add(place)
            if is_function and kind != "mode":
                if not free:
                    free.append(count)
                    count += 1
                held[place] = free.pop()
                lines += [f"    v{place} = {one}" for one in into(kind, parts, f"f[{held[place]}]", place)]
            else:
                lines.append(f"    v{place} = {text(self.steps[place], parameters)}")
            free += [held[part] for part in set(operands(self.steps[place])) if last[part] == place and part in held]
        lines.append(f"    return ({''.join(f'{shown(one)}, ' for one in outputs)})")
        names: dict[str, Any] = {"ELEMENTARY": ELEMENTARY, "add": np.add, "subtract": np.subtract, "multiply": np.multiply, "conjugate": np.conjugate, "reciprocal": np.reciprocal, "matmul": np.matmul}
        exec(compile("\n".join(lines), "<tape>", "exec"), names)  # noqa: S102  (text made above)
        used = [tuple(self.steps[place][1:]) for place in order if self.steps[place][0] == "mode"]
        return Compiled(run=names["run"], buffers=count, used=tuple(used), products=sum(self.steps[place][0] == "*" and place in functions for place in order))


@dataclass(frozen=True, slots=True, kw_only=True)
class Compiled:
    """A function made of a tape, how many buffers and which modes it needs, and its products of functions."""

    run: Callable[..., tuple[Any, ...]]
    buffers: int
    used: tuple[tuple[str, int], ...]
    products: int


def into(kind: str, parts: Sequence[Any], out: str, place: int) -> list[str]:
    """Return a step that gives a function as expressions, written to a buffer."""
    if kind == "*":
        return [f"multiply(v{parts[0]}, v{parts[1]}, {out})"]
    if kind == "+":
        if parts[1] is None:
            return [f"add(v{parts[0]}, {constant(parts[2])}, {out})"]
        if parts[2] in (1, -1):
            return [f"{'add' if parts[2] == 1 else 'subtract'}(v{parts[0]}, v{parts[1]}, {out})"]
        return [f"multiply({constant(parts[2])}, v{parts[1]}, {out})", f"add(v{parts[0]}, v{place}, {out})"]
    if kind in ("before", "after"):
        return [f"matmul(tables[{kind!r}], v{parts[0]}.view(float), {out}.view(float)).view(complex)"]
    return [f"{ {'conj': 'conjugate', '1/': 'reciprocal'}[kind]}(v{parts[0]}, {out})"]


def operands(step: tuple[Any, ...]) -> list[int]:
    """Return the places a step reads."""
    kind, *parts = step
    if kind in ("*", "1/", "conj", "integral", "before", "after"):
        return list(parts)
    if kind == "+":
        return [part for part in parts[:2] if part is not None]
    return [parts[2]] if kind == "elementary" and parts[2] is not None else []


def constant(value: complex) -> str:
    """Return a constant as text, real where it is."""
    return repr(value.real) if value.imag == 0 else repr(value)


def text(step: tuple[Any, ...], parameters: Sequence[str]) -> str:
    """Return a step as Python text."""
    kind, *parts = step
    if kind == "parameter":
        return f"parameters[{list(parameters).index(parts[0])}]"
    if kind == "mode":
        return f"modes[{parts[0]!r}][{parts[1]}]"
    if kind == "end":
        return f"ends[{parts[0]!r}][{parts[1]}][{parts[2]}]"
    if kind == "elementary":
        return f"ELEMENTARY[{parts[0]!r}]({constant(parts[1])} * v{parts[2]})"
    if kind == "+":
        if parts[1] is None:
            return f"v{parts[0]} + {constant(parts[2])}"
        return f"v{parts[0]} {'+' if parts[2] == 1 else '-' if parts[2] == -1 else f'+ {constant(parts[2])} *'} v{parts[1]}"
    return {"control": "control", "frequency": "frequency", "*": "v{0} * v{1}", "1/": "1 / v{0}", "conj": "v{0}.conj()",
            "integral": "(tables['integral'] @ v{0}.view(float)).view(complex)"}[kind].format(*parts)


def shown(value: Any) -> str:
    """Return an output as Python text."""
    if not isinstance(value, Recorded):
        return repr(value)
    places = [f"v{place}" for place in (value.number, value.function) if place is not None]
    return " * ".join([constant(value.factor)] * (value.factor != 1 or not places) + places)


__all__ = ["ELEMENTARY", "NotRecorded", "Recorded", "Tape"]
