r"""The emitted text in mpmath, as one would write it by hand: two small algebras that share nothing with the other routes.

`Sums` holds :math:`\sum p_k(x) e^{\sigma_k x}` and integrates it exactly; `Nested` holds functions as functions and integrates by nested `quad`.
Neither estimates its error. Responses that need the solution of a linear problem are beyond them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath

from numerics.algebra import Operator, Row
from numerics.coefficients import Module
from numerics.precision import EvaluationError

ELEMENTARY = ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "asin", "acos", "atan", "asinh", "acosh", "atanh", "erf")


class Naive:
    """Numbers of an own mpmath context; the critical mode by characteristic exponents."""

    def __init__(self, *, context: Any, ends: tuple[Any, Any], control: Any, frequency: Any, values: dict[str, Any]) -> None:
        self.context, self.ends, self.control, self.frequency, self.values = context, ends, control, frequency, values
        self.length = ends[1] - ends[0]
        self.store: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.one, self.zero, self.i, self.pi = context.mpf(1), context.mpf(0), context.mpc(0, 1), +context.pi

    def rational(self, p: int, q: int) -> Any:
        """Return p/q."""
        return self.context.mpf(p) / q

    def parameter(self, name: str) -> Any:
        """Return the value of a parameter."""
        return self.values[name]

    def __getattr__(self, name: str) -> Callable[[Any], Any]:
        if name not in ELEMENTARY:
            raise AttributeError(name)
        return lambda value: value.apply(name) if hasattr(value, "apply") else getattr(self.context, name)(value)

    def solve(self, *_: Any, **__: Any) -> Any:
        """Refuse: nothing here solves a forced linear problem."""
        raise EvaluationError("the naive routes solve no forced linear problem")

    solve_singular = solve

    def fundamental(self, operator: Operator) -> list[list[Any]]:
        """Return n independent solutions, each a list of n functions."""
        raise NotImplementedError

    def boundary_matrix(self, operator: Operator, columns: Sequence[Sequence[Any]]) -> Any:
        """Return the boundary rows on each solution."""
        rows = [[sum(c * self.left(y) for c, y in zip(row, column, strict=True)) for column in columns] for row in operator.left]
        rows += [[sum(c * self.right(y) for c, y in zip(row, column, strict=True)) for column in columns] for row in operator.right]
        return self.context.matrix(rows)

    def left(self, value: Any) -> Any:
        """Return the value at the left end."""
        return value.at(self.context.mpf(0)) if hasattr(value, "at") else value

    def right(self, value: Any) -> Any:
        """Return the value at the right end."""
        return value.at(self.length) if hasattr(value, "at") else value

    def determinant(self, operator: Operator) -> Any:
        """Return what vanishes at the threshold."""
        columns = self.fundamental(operator)
        start = self.context.matrix([[self.left(column[i]) for column in columns] for i in range(operator.size)])
        return self.context.det(self.boundary_matrix(operator, columns)) / self.context.det(start)

    def kernel(self, operator: Operator, row: Row | None = None, place: Any = None) -> tuple[Any, ...]:
        """Return y with homogeneous boundary rows and row y = 1 at `place`."""
        columns = self.fundamental(operator)
        n = operator.size
        matrix = self.boundary_matrix(operator, columns)
        system = self.context.zeros(n + 1)
        for i in range(n):
            for j in range(n):
                system[i, j] = matrix[i, j]
            system[i, n], system[n, i] = 1, self.context.mpf(2 + i) / (3 + i)
        weights = self.context.lu_solve(system, self.context.matrix([0] * n + [1]))
        solution = [sum((columns[j][i] * weights[j] for j in range(1, n)), columns[0][i] * weights[0]) for i in range(n)]
        if row is None:
            return tuple(solution)
        x = place - self.ends[0]
        size = sum(c * y.at(x) for c, y in zip(row, solution, strict=True))
        return tuple(y * (1 / size) for y in solution)


class Sum:
    """A sum of exponentials with polynomial factors: {rounded exponent: (exponent, coefficients)}."""

    def __init__(self, context: Any, terms: Sequence[tuple[Any, list[Any]]]) -> None:
        self.context = context
        self.terms: dict[tuple[int, int], tuple[Any, list[Any]]] = {}
        for sigma, coefficients in terms:
            key = (round(float(sigma.real) * 1e8), round(float(sigma.imag) * 1e8))
            known = self.terms.get(key, (sigma, []))[1]
            length = max(len(known), len(coefficients))
            padded = [[*one, *[context.mpc(0)] * (length - len(one))] for one in (known, coefficients)]
            self.terms[key] = (sigma, [a + b for a, b in zip(*padded, strict=True)])

    def listed(self, other: Any) -> list[tuple[Any, list[Any]]]:
        """Return the terms of a function or of a number."""
        return list(other.terms.values()) if isinstance(other, Sum) else [(self.context.mpc(0), [self.context.mpc(other)])]

    def __add__(self, other: Any) -> Sum:
        return Sum(self.context, [*self.listed(self), *self.listed(other)])

    __radd__ = __add__

    def __neg__(self) -> Sum:
        return self * -1

    def __sub__(self, other: Any) -> Sum:
        return self + other * -1

    def __rsub__(self, other: Any) -> Sum:
        return -self + other

    def __mul__(self, other: Any) -> Sum:
        terms = []
        for sigma, a in self.listed(self):
            for tau, b in self.listed(other):
                product = [self.context.mpc(0)] * (len(a) + len(b) - 1)
                for i, x in enumerate(a):
                    for j, y in enumerate(b):
                        product[i + j] += x * y
                terms.append((sigma + tau, product))
        return Sum(self.context, terms)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Sum:
        return self * (1 / self.context.mpc(other))

    def __pow__(self, power: int) -> Sum:
        return self if power == 1 else self * self ** (power - 1)

    def at(self, x: Any) -> Any:
        """Return the value at distance x from the left end."""
        return sum((self.context.exp(sigma * x) * sum(c * x**k for k, c in enumerate(a)) for sigma, a in self.terms.values()), self.context.mpc(0))

    def primitive(self) -> Sum:
        """Return the primitive that vanishes at the left end."""
        terms = []
        for key, (sigma, a) in self.terms.items():
            if key == (0, 0):
                terms.append((sigma * 0, [self.context.mpc(0), *(c / (k + 1) for k, c in enumerate(a))]))
                continue
            b = [self.context.mpc(0)] * len(a)
            for k in range(len(a) - 1, -1, -1):
                b[k] = (a[k] - ((k + 1) * b[k + 1] if k + 1 < len(a) else 0)) / sigma
            terms += [(sigma, b), (sigma * 0, [-b[0]])]
        return Sum(self.context, terms)


class Sums(Naive):
    """Exact integrals of exponential sums."""

    @property
    def s(self) -> Sum:
        """The coordinate."""
        return Sum(self.context, [(self.context.mpc(0), [self.context.mpc(self.ends[0]), self.context.mpc(1)])])

    def reflect(self, value: Any) -> Any:
        """Return the function with conjugate coefficients and exponents."""
        conj = self.context.conj
        return Sum(self.context, [(conj(sigma), [conj(c) for c in a]) for sigma, a in value.terms.values()]) if isinstance(value, Sum) else conj(value)

    def function(self, value: Any) -> Sum:
        """Return a number as a function."""
        return value if isinstance(value, Sum) else Sum(self.context, [(self.context.mpc(0), [self.context.mpc(value)])])

    def integral(self, value: Any) -> Any:
        """Return the integral over the interval."""
        return self.function(value).primitive().at(self.length)

    def integral_from_left(self, value: Any) -> Sum:
        """Return the integral from the left end to s."""
        return self.function(value).primitive()

    def integral_to_right(self, value: Any) -> Sum:
        """Return the integral from s to the right end."""
        primitive = self.function(value).primitive()
        return primitive.at(self.length) - primitive

    def fundamental(self, operator: Operator) -> list[list[Any]]:
        """Return v_j exp(sigma_j x)."""
        if any(isinstance(entry, Sum) for row in operator.matrix for entry in row):
            raise EvaluationError("the coefficients depend on s")
        exponents, vectors = self.context.eig(self.context.matrix([[self.context.mpc(entry) for entry in row] for row in operator.matrix]))
        return [[Sum(self.context, [(sigma, [vectors[i, j]])]) for i in range(operator.size)] for j, sigma in enumerate(exponents)]


class Callable1:
    """A function by a rule, remembered at the points where it was asked for."""

    def __init__(self, rule: Callable[[Any], Any]) -> None:
        self.rule = rule
        self.known: dict[Any, Any] = {}

    def at(self, x: Any) -> Any:
        """Return the value at distance x from the left end."""
        if x not in self.known:
            self.known[x] = self.rule(x)
        return self.known[x]

    def joined(self, other: Any, operation: Callable[[Any, Any], Any]) -> Callable1:
        """Return the function x -> operation(self(x), other(x))."""
        if hasattr(other, "at"):
            return Callable1(lambda x: operation(self.at(x), other.at(x)))
        return Callable1(lambda x: operation(self.at(x), other))

    def __add__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: a + b)

    __radd__ = __add__

    def __neg__(self) -> Callable1:
        return Callable1(lambda x: -self.at(x))

    def __sub__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: b - a)

    def __mul__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: a * b)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: a / b)

    def __rtruediv__(self, other: Any) -> Callable1:
        return self.joined(other, lambda a, b: b / a)

    def __pow__(self, power: int) -> Callable1:
        return Callable1(lambda x: self.at(x) ** power)

    def apply(self, name: str) -> Callable1:
        """Return an elementary function of this one, in the context of its values."""
        return Callable1(lambda x: getattr(self.at(x).context, name)(self.at(x)))


class Nested(Naive):
    """Nested quadrature: an integral in an integrand is worked out anew at every point."""

    degree = 3

    @property
    def s(self) -> Callable1:
        """The coordinate."""
        return Callable1(lambda x: self.ends[0] + x)

    def reflect(self, value: Any) -> Any:
        """Return the conjugate."""
        return Callable1(lambda x: self.context.conj(value.at(x))) if hasattr(value, "at") else self.context.conj(value)

    def quadrature(self, value: Any, low: Any, high: Any) -> Any:
        """Return an integral by Gauss-Legendre quadrature of mpmath."""
        if not hasattr(value, "at"):
            return value * (high - low)
        return self.context.quad(value.at, [low, high], method="gauss-legendre", maxdegree=self.degree)

    def integral(self, value: Any) -> Any:
        """Return the integral over the interval."""
        return self.quadrature(value, self.context.mpf(0), self.length)

    def integral_from_left(self, value: Any) -> Callable1:
        """Return the integral from the left end to s."""
        return Callable1(lambda x: self.quadrature(value, self.context.mpf(0), x))

    def integral_to_right(self, value: Any) -> Callable1:
        """Return the integral from s to the right end."""
        return Callable1(lambda x: self.quadrature(value, x, self.length))

    def fundamental(self, operator: Operator) -> list[list[Any]]:
        """Return v_j exp(sigma_j x), or solutions by Taylor series (`odefun`) where the coefficients depend on s."""
        n, context = operator.size, self.context
        if any(hasattr(entry, "at") for row in operator.matrix for entry in row):
            def slope(x: Any, y: Any) -> list[Any]:
                return [sum((entry.at(x) if hasattr(entry, "at") else entry) * value for entry, value in zip(row, y, strict=True)) for row in operator.matrix]

            solutions = [context.odefun(slope, context.mpf(0), [context.mpf(int(i == j)) for i in range(n)]) for j in range(n)]
            return [[component(solution, i) for i in range(n)] for solution in solutions]
        exponents, vectors = context.eig(context.matrix([[context.mpc(entry) for entry in row] for row in operator.matrix]))
        return [[exponential(context, sigma, vectors[i, j]) for i in range(n)] for j, sigma in enumerate(exponents)]


def component(solution: Callable[[Any], Any], i: int) -> Callable1:
    """Return the i-th component of a vector function."""
    return Callable1(lambda x: solution(x)[i])


def exponential(context: Any, sigma: Any, factor: Any) -> Callable1:
    """Return factor exp(sigma x)."""
    return Callable1(lambda x: factor * context.exp(sigma * x))


class NestedFiner(Nested):
    """With one degree more: twice the nodes in every nested integral."""

    degree = 4


def context_of(digits: int) -> Any:
    """Return a context of mpmath of its own, whose precision disturbs no other."""
    context = mpmath.MPContext()  # type: ignore[attr-defined]
    context.dps = digits
    return context


def evaluate_naively(text: str, kind: type[Naive], digits: int) -> tuple[Any, Any, dict[str, Any]]:
    """Return control, frequency (None when steady) and coefficients by name."""
    module = Module(text)
    context = context_of(digits)
    hopf = module.KIND == "hopf"
    if not module.SPATIAL:
        raise EvaluationError("found no space: without it every route is linear algebra, and there is no naive one")
    probe = Naive(context=context, ends=(0, 1), control=0, frequency=0, values={})
    ends = tuple(context.mpf(end) for end in module.interval(probe))
    values = {name: context.mpf(value) for name, value in module.parameters(probe).items()}

    def algebra(control: Any, frequency: Any) -> Naive:
        return kind(context=context, ends=ends, control=control, frequency=frequency, values=values)  # type: ignore[arg-type]

    def residual(control: Any, frequency: Any = 0) -> Any:
        a = algebra(control, frequency)
        value = a.determinant(module.critical(a))
        return [value.real, value.imag] if hopf else value.real

    if hopf:
        root = context.findroot(residual, (context.mpf(module.ONSET[0]), context.mpf(module.ONSET[1])), tol=context.mpf(10) ** (8 - 2 * digits), verify=False)
        control, frequency = root[0], root[1]
    else:
        start = context.mpf(module.ONSET[0])
        control, frequency = context.findroot(residual, (start, start + context.mpf(10) ** -5), verify=False), None
    a = algebra(control, frequency or 0)
    return control, frequency, {name: module.names[identifier](a) for name, _, identifier in module.COEFFICIENTS}


__all__ = ["Naive", "Nested", "NestedFiner", "Sums", "evaluate_naively"]
