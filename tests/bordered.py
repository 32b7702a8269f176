"""Coefficients by a route of its own: rows of the statement discretised as they stand, and the last order solved with the coefficient as an unknown.

No elimination, no adjoint, no circular amplitudes, no emitted text: every row is enforced at Chebyshev nodes, redundant rows by least
squares, and at third order the system is bordered by dA/dt. Double precision: 1e-6 or better on smooth problems.
"""

import numpy as np
from numpy.polynomial import chebyshev
from sympy import Integer, lambdify


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
        self.rows = [(self.forms(row), inner) for equation in formulation.rows for row in equation]
        for place, equations in formulation.boundary:
            self.rows += [(self.forms(row), np.array([float(place)])) for equation in equations for row in equation]
        self.scales = None

    def forms(self, row):
        """Return {(jets): derivative} of first to third order, and the derivative in epsilon."""
        values = dict(self.f.parameters)
        nominal, weak = row.expression.xreplace({self.f.weak: Integer(0)}), row.expression.diff(self.f.weak).xreplace({self.f.weak: Integer(0)})
        arguments = (self.f.space, self.f.control, *self.symbols)

        def compiled(expression):
            return lambdify(arguments, expression.subs(values), ["scipy", "numpy"])

        def slopes(expressions, total):
            result = {}
            for jets, expression in expressions.items():
                for k in range(jets[-1] if jets else 0, len(self.symbols)):
                    if self.symbols[k] in expression.free_symbols and expression.diff(self.symbols[k]) != 0:
                        result[*jets, k] = expression.diff(self.symbols[k])
            return [result, *slopes(result, total - 1)] if total > 1 else [result]

        one, two, three = slopes({(): nominal}, 3)
        (weakly,) = slopes({(): weak}, 1)
        return [{jets: compiled(expression) for jets, expression in table.items()} for table in (one, two, three, weakly)]

    def basis(self, s, order):
        if not self.spatial:
            return np.ones((1, 1)) if order == 0 else np.zeros((1, 1))
        x = (2 * s - self.left - self.right) / (self.right - self.left)
        return np.array([chebyshev.chebval(x, chebyshev.chebder(unit, order) if order else unit) for unit in np.eye(self.n)]).T * (2 / (self.right - self.left)) ** order

    def at_base(self, s, control):
        return [np.broadcast_to(np.asarray(self.base[u][ds](s, control + 0j)) if dt == 0 else 0.0, s.shape) for u, ds, dt in self.keys]

    def coefficients(self, level, control):
        """Return, a row at a time, {jets: values at its nodes} of the forms of one level (3: epsilon)."""
        result = []
        for forms, s in self.rows:
            jets = self.at_base(s, control)
            result.append(({key: np.broadcast_to(np.asarray(function(s, control + 0j, *jets), dtype=complex), s.shape) for key, function in forms[level].items()}, s))
        return result

    def matrix(self, control, growth, level=0, slow=False):
        """Return the linear form in the harmonic exp(growth t); with `slow` the factor of dA/dt."""
        blocks = []
        for table, s in self.coefficients(level, control):
            block = np.zeros((len(s), len(self.f.unknowns), self.n), dtype=complex)
            for (k,), values in table.items():
                u, ds, dt = self.keys[k]
                factor = (0 if dt == 0 else dt * growth ** (dt - 1)) if slow else growth**dt
                if factor:
                    block[:, u] += factor * values[:, None] * self.basis(s, ds)
            blocks.append(block.reshape(len(s), self.size))
        return np.concatenate(blocks)

    def form(self, control, level, *states):
        """Return the symmetric multilinear form of states (coefficients, growth) at every row and node."""
        from itertools import permutations

        parts = []
        for table, s in self.coefficients(level, control):
            jets = [[self.basis(s, ds) @ state.reshape(len(self.f.unknowns), self.n)[u] * growth**dt for u, ds, dt in self.keys] for state, growth in states]
            total = np.zeros(len(s), dtype=complex)
            for key, values in table.items():
                for order in set(permutations(key)):
                    product = values
                    for one, k in zip(jets, order, strict=True):
                        product = product * one[k]
                    total = total + product
            parts.append(total)
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
        full = np.hstack([matrix, columns])
        values = right
        scale = np.maximum(np.abs(full).max(axis=1), np.abs(matrix).max() * 1e-12 + 1e-300)
        full, values = full / scale[:, None], values / scale
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
    weak = d.matrix(control, growth, level=3)
    if np.any(weak):
        table = np.array([projected(weak @ unit)[1] for unit in units]).T
        result["weak"] = table

    def cubic(phi):
        """Return dA/dt of third order for u = phi exp(growth t) + c.c., as a vector over the unit modes."""
        phi, bar = (phi, growth), (d.conjugate(phi), -growth)
        if not hopf:
            second, quadratic = (projected(d.form(control, 1, phi, phi) / 2) if not vector else (d.solve(d.matrix(control, 0.0), -d.form(control, 1, phi, phi) / 2)[0], [0.0]))
            if abs(quadratic[0]) > 1e-7:
                return None, quadratic[0]
            return projected(d.form(control, 1, phi, (second, 0.0)) + d.form(control, 2, phi, phi, phi) / 6)[1], quadratic[0]
        double = d.solve(d.matrix(control, 2 * growth), -d.form(control, 1, phi, phi) / 2)[0]
        mean = d.solve(d.matrix(control, 0.0), -d.form(control, 1, phi, bar))[0]
        forcing = d.form(control, 1, phi, (mean, 0.0)) + d.form(control, 1, bar, (double, 2 * growth)) + d.form(control, 2, phi, phi, bar) / 2
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
