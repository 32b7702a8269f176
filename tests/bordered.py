"""Coefficients by a route of its own: rows of the statement discretised as they stand, and the last order solved with the coefficient as an unknown.

No elimination, no adjoint, no circular amplitudes, no emitted text: every row is enforced at Chebyshev nodes, redundant rows by least
squares, and at third order the system is bordered by dA/dt. Double precision: 1e-6 or better on smooth problems.
"""

from math import factorial

import numpy as np
from numpy.polynomial import chebyshev
from sympy import lambdify

PAIRS = [(a, b) for a in range(8) for b in range(8) if not a & b]


class Nilpotent:
    """Numbers over three units with e1**2 = e2**2 = e3**2 = 0: the coefficient of e1 e2 e3 is an exact third derivative.

    `parts[k]` belongs to the product of the units whose bits are set in k.
    """

    __array_ufunc__ = None

    def __init__(self, parts):
        self.parts = parts

    @staticmethod
    def of(value):
        return value if isinstance(value, Nilpotent) else Nilpotent({0: value})

    def __add__(self, other):
        other = Nilpotent.of(other)
        return Nilpotent({k: self.parts.get(k, 0) + other.parts.get(k, 0) for k in self.parts.keys() | other.parts.keys()})

    def __mul__(self, other):
        other, result = Nilpotent.of(other), {}
        for a, b in PAIRS:
            if a in self.parts and b in other.parts:
                result[a | b] = result.get(a | b, 0) + self.parts[a] * other.parts[b]
        return Nilpotent(result)

    def through(self, taylor):
        """Return f(self) for the values of f and its first three derivatives at the base."""
        small, power, total = Nilpotent({k: v for k, v in self.parts.items() if k}), Nilpotent({0: 1.0}), Nilpotent({})
        for order, value in enumerate(taylor):
            total, power = total + power * (value / factorial(order)), power * small
        return total

    def __pow__(self, exponent):
        x, values, factor = np.asarray(self.parts.get(0, 0), dtype=complex), [], 1.0
        for order in range(4):
            values.append(factor * x ** (exponent - order) if factor else 0 * x)
            factor *= exponent - order
        return self.through(values)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + other * -1

    def __rsub__(self, other):
        return self * -1 + other

    def __truediv__(self, other):
        return self * Nilpotent.of(other) ** -1

    def __rtruediv__(self, other):
        return Nilpotent.of(other) * self**-1


def lifted(*taylor):
    """Return a function of nilpotent numbers from f and its first three derivatives."""
    return lambda x: x.through([f(x.parts.get(0, 0)) for f in taylor]) if isinstance(x, Nilpotent) else taylor[0](x)


FUNCTIONS = {
    "exp": lifted(np.exp, np.exp, np.exp, np.exp), "sin": lifted(np.sin, np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x)),
    "cos": lifted(np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x), np.sin), "sinh": lifted(np.sinh, np.cosh, np.sinh, np.cosh),
    "cosh": lifted(np.cosh, np.sinh, np.cosh, np.sinh), "log": lifted(np.log, lambda x: 1 / x, lambda x: -1 / x**2, lambda x: 2 / x**3),
    "sqrt": lambda x: x**0.5, "atan": lifted(np.arctan, lambda x: 1 / (1 + x**2), lambda x: -2 * x / (1 + x**2) ** 2, lambda x: (6 * x**2 - 2) / (1 + x**2) ** 3),
    "tan": lambda x: FUNCTIONS["sin"](x) / FUNCTIONS["cos"](x), "tanh": lambda x: FUNCTIONS["sinh"](x) / FUNCTIONS["cosh"](x), "pi": np.pi, "E": np.e, "I": 1j,
}


class Discretised:
    """The multilinear forms of all rows about the base state, over Chebyshev coefficients of the unknowns."""

    def __init__(self, formulation, nodes=32):
        self.f = formulation
        self.spatial = formulation.interval is not None
        self.n = nodes if self.spatial else 1
        self.size = len(formulation.unknowns) * self.n
        self.keys = list(formulation.jets)
        self.symbols = [formulation.jets[key] for key in self.keys]
        self.left, self.right = (float(end) for end in formulation.interval) if self.spatial else (0.0, 1.0)
        inner = (self.left + self.right) / 2 - (self.right - self.left) / 2 * np.cos((2 * np.arange(self.n) + 1) * np.pi / (2 * self.n)) if self.spatial else np.zeros(1)
        base = [expression.subs(formulation.parameters) for expression in formulation.base]
        top = max(key[1] for key in self.keys)
        self.base = [[lambdify((formulation.space, formulation.control), one.diff(formulation.space, d), ["scipy", "numpy"]) for d in range(top + 1)] for one in base]
        self.rows = [(self.compiled(row), inner) for equation in formulation.rows for row in equation]
        for place, equations in formulation.boundary:
            self.rows += [(self.compiled(row), np.array([float(place)])) for equation in equations for row in equation]
        self.scales = None
        self.known = {}

    def compiled(self, row):
        """Return a row as a function of (s, control, epsilon, jets), and the jets that occur in it."""
        expression = row.expression.subs(self.f.parameters)
        function = lambdify((self.f.space, self.f.control, self.f.weak, *self.symbols), expression, [FUNCTIONS, "scipy", "numpy"], cse=True)
        return function, [k for k, symbol in enumerate(self.symbols) if symbol in expression.free_symbols]

    def basis(self, s, order):
        if not self.spatial:
            return np.ones((1, 1)) if order == 0 else np.zeros((1, 1))
        x = (2 * s - self.left - self.right) / (self.right - self.left)
        return np.array([chebyshev.chebval(x, chebyshev.chebder(unit, order) if order else unit) for unit in np.eye(self.n)]).T * (2 / (self.right - self.left)) ** order

    def at_base(self, s, control):
        return [np.broadcast_to(np.asarray(self.base[u][ds](s, control + 0j)) if dt == 0 else 0.0, s.shape) for u, ds, dt in self.keys]

    def derivative(self, row, control, directions, weak=False):
        """Return the derivative of a row about the base state in one to three directions over its jets; with `weak` in epsilon too."""
        (function, _), s = row
        units = [1 << k for k in range(len(directions) + weak)]
        jets = [Nilpotent({0: base, **{unit: one[k] for unit, one in zip(units, directions, strict=False) if one[k] is not None}}) for k, base in enumerate(self.at_base(s, control))]
        value = Nilpotent.of(function(s, control + 0j, Nilpotent({0: 0.0, units[-1]: 1.0}) if weak else 0.0, *jets))
        return np.broadcast_to(np.asarray(value.parts.get(sum(units), 0), dtype=complex), s.shape)

    def linear(self, control, weak):
        """Return, a row at a time, the derivative in each of its jets."""
        if (control, weak) not in self.known:
            self.known[control, weak] = [
                [(k, self.derivative(row, control, [[1.0 if j == k else None for j in range(len(self.keys))]], weak)) for k in row[0][1]] for row in self.rows
            ]
        return self.known[control, weak]

    def matrix(self, control, growth, weak=False, slow=False):
        """Return the linear form in the harmonic exp(growth t); with `slow` the factor of dA/dt, with `weak` the part of epsilon."""
        blocks = []
        for (_, s), slopes in zip(self.rows, self.linear(control, weak), strict=True):
            block = np.zeros((len(s), len(self.f.unknowns), self.n), dtype=complex)
            for k, slope in slopes:
                u, ds, dt = self.keys[k]
                factor = (0 if dt == 0 else dt * growth ** (dt - 1)) if slow else growth**dt
                if factor:
                    block[:, u] += factor * slope[:, None] * self.basis(s, ds)
            blocks.append(block.reshape(len(s), self.size))
        return np.concatenate(blocks)

    def form(self, control, *states):
        """Return the symmetric multilinear form of states (coefficients, growth) at every row and node."""
        parts = []
        for row in self.rows:
            _, s = row
            directions = [[self.basis(s, ds) @ state.reshape(len(self.f.unknowns), self.n)[u] * growth**dt for u, ds, dt in self.keys] for state, growth in states]
            parts.append(self.derivative(row, control, directions))
        return np.concatenate(parts)

    def conjugate(self, state):
        """Return the complex conjugate: circular components exchange."""
        parts = np.conj(state.reshape(len(self.f.unknowns), self.n))
        partner = [unknown.index + unknown.weight for unknown in self.f.unknowns]
        return parts[partner].ravel()

    def normal(self):
        """Return rows that read the normalised field at its place."""
        rows = []
        for unknown in self.f.normalised:
            row = np.zeros((len(self.f.unknowns), self.n))
            row[unknown] = self.basis(np.array([float(self.f.place)]), 0)[0] if self.spatial else 1
            rows.append(row.ravel())
        return np.array(rows, dtype=complex)

    def solve(self, matrix, right, border=None, data=None):
        """Return the least-squares solution of matrix v + border c = right with the normalisation rows at `data`; and c."""
        columns = np.zeros((len(matrix), 0)) if border is None else border
        full, values = np.hstack([matrix, columns]) / self.scales[:, None], right / self.scales
        if data is not None:
            rows = self.normal()
            full = np.vstack([full, np.hstack([rows, np.zeros((len(rows), columns.shape[1]))])])
            values = np.concatenate([values, data])
        size = np.maximum(np.linalg.norm(full, axis=0), 1e-300)
        solution = np.linalg.lstsq(full / size, values, rcond=1e-14)[0] / size
        self.misfit = float(np.abs(full @ solution - values).max() / max(np.abs(values).max(), 1e-300))
        return solution[:self.size], solution[self.size:]


def bordered_coefficients(formulation, control, frequency, nodes=32):
    """Return {monomial: coefficient} by bordered systems, and the largest misfit met on the way."""
    d = Discretised(formulation, nodes)
    hopf, vector = frequency is not None, formulation.frame is not None
    growth = 1j * frequency if hopf else 0.0
    linear = d.matrix(control, growth)
    d.scales = np.maximum(np.abs(linear).max(axis=1), np.abs(d.matrix(control, growth + 1)).max(axis=1))
    d.scales = np.where(d.scales > 0, d.scales, 1)
    zero = np.zeros(len(linear), dtype=complex)
    misfits = []

    def mode(direction):
        data = np.array([direction[0] + 1j * direction[1], direction[0] - 1j * direction[1]] if vector else [1.0], dtype=complex)
        state, _ = d.solve(linear, zero, data=data)
        misfits.append(d.misfit)
        return state

    units = [mode((1, 0)), mode((0, 1))] if vector else [mode((1, 0))]
    border = np.array([d.matrix(control, growth, slow=True) @ unit for unit in units]).T
    homogeneous = np.zeros(len(d.normal()), dtype=complex)

    def projected(forcing):
        state, found = d.solve(linear, -forcing, border, homogeneous)
        misfits.append(d.misfit)
        return state, found

    h = 1e-4 * (1e-3 * float(formulation.control_range[1] - formulation.control_range[0]) + abs(control))
    shift = (8 * (d.matrix(control + h, growth) - d.matrix(control - h, growth)) - (d.matrix(control + 2 * h, growth) - d.matrix(control - 2 * h, growth))) / (12 * h)
    result = {"mu*A": projected(shift @ units[0])[1][0]}
    weak = d.matrix(control, growth, weak=True)
    if np.any(weak):
        table = np.array([projected(weak @ unit)[1] for unit in units]).T
        result["weak"] = table

    def cubic(phi):
        """Return dA/dt of third order for u = phi exp(growth t) + c.c., as a vector over the unit modes."""
        phi, bar = (phi, growth), (d.conjugate(phi), -growth)
        if not hopf:
            second, quadratic = (projected(d.form(control, phi, phi) / 2) if not vector else (d.solve(d.matrix(control, 0.0), -d.form(control, phi, phi) / 2)[0], [0.0]))
            if abs(quadratic[0]) > 1e-7:
                return None, quadratic[0]
            return projected(d.form(control, phi, (second, 0.0)) + d.form(control, phi, phi, phi) / 6)[1], quadratic[0]
        double = d.solve(d.matrix(control, 2 * growth), -d.form(control, phi, phi) / 2)[0]
        mean = d.solve(d.matrix(control, 0.0), -d.form(control, phi, bar))[0]
        forcing = d.form(control, phi, (mean, 0.0)) + d.form(control, bar, (double, 2 * growth)) + d.form(control, phi, phi, bar) / 2
        return projected(forcing)[1], 0.0

    if not vector:
        found, quadratic = cubic(units[0])
        if found is None:
            result["A**2"] = quadratic
        else:
            result["A**2*conj(A)" if hopf else "A**3"] = found[0]
    elif hopf:
        planar = cubic(units[0])[0][0]
        whirling = cubic(units[0] + 1j * units[1])[0][0] / 2
        result["dot(A,A)*conj(A)"], result["dot(A,conj(A))*A"] = planar - whirling, whirling
    else:
        result["dot(A,A)*A"] = cubic(units[0])[0][0]
    return result, max(misfits)


def compressed_spectrum(formulation, control, nodes=24, reach=None):
    """Return eigenvalues that two random compressions of the rectangular pencil share: no row is eliminated or dropped."""
    from scipy.linalg import eig

    d = Discretised(formulation, nodes)
    k0, k1, k2 = d.matrix(control, 0.0), d.matrix(control, 0.0, slow=True), None
    at_one, at_minus = d.matrix(control, 1.0), d.matrix(control, -1.0)
    k2 = (at_one + at_minus) / 2 - k0
    scale = np.maximum(np.abs(k0).max(axis=1), np.abs(k1).max(axis=1))
    scale = np.where(scale > 0, scale, 1)
    k0, k1, k2 = (k / scale[:, None] for k in (k0, k1, k2))
    found = []
    for seed in (1, 2):
        compress = np.random.default_rng(seed).standard_normal((d.size, len(k0))) / np.sqrt(len(k0))
        a, b, c = compress @ k0, compress @ k1, compress @ k2
        if np.any(k2):
            zero, one = np.zeros_like(a), np.eye(d.size)
            values = eig(np.block([[zero, one], [-a, -b]]), np.block([[one, zero], [zero, c]]), right=False)
        else:
            values = eig(-a, b, right=False)
        found.append(values[np.isfinite(values)])
    return np.array([value for value in found[0] if np.abs(found[1] - value).min() < 1e-5 * (1 + abs(value))])
