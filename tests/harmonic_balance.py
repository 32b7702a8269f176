"""The full nonlinear problem by harmonic balance in time and Chebyshev polynomials in space, by least squares.

It shares nothing with the derivation but the rows that the user wrote: no linearisation, no adjoint, no expansion. At a given
small amplitude it finds control and frequency of the periodic (or steady) state; their dependence on the amplitude squared gives the
cubic coefficient: gamma mu + kappa a^2 - i (Omega - omega) = O(a^4).
"""

import numpy as np
from numpy.polynomial import chebyshev
from sympy import lambdify


class Balance:
    """Residual and Jacobian of all rows for Fourier-Chebyshev coefficients of every Cartesian or circular unknown."""

    def __init__(self, formulation, nodes, harmonics, direction=None):
        self.f, self.nodes, self.harmonics = formulation, nodes, harmonics
        self.spatial = formulation.interval is not None
        self.times = 2 * np.pi * np.arange(2 * harmonics + 3) / (2 * harmonics + 3) if harmonics else np.zeros(1)
        self.count = nodes if self.spatial else 1
        self.waves = 2 * harmonics + 1
        self.size = len(formulation.unknowns) * self.count * self.waves
        self.direction = direction
        values = dict(formulation.parameters)
        keys = list(formulation.jets)
        symbols = [formulation.jets[key] for key in keys]
        base = [expression.subs(values) for expression in formulation.base]
        self.base = [[lambdify((formulation.space, formulation.control), base[k].diff(formulation.space, d), "numpy") for d in range(9)] for k in range(len(base))]
        self.keys = keys
        arguments = (formulation.space, formulation.control, *symbols)

        def compiled(row):
            expression = row.expression.subs({formulation.weak: 0}).subs(values)
            return lambdify(arguments, [expression, *(expression.diff(symbol) for symbol in symbols)], "numpy", cse=True)

        left, right = (float(end) for end in formulation.interval) if self.spatial else (0.0, 1.0)
        inner = left + (right - left) * (1 - np.cos((2 * np.arange(self.count) + 1) * np.pi / (2 * self.count))) / 2 if self.spatial else np.zeros(1)
        self.ends = (left, right)
        self.groups = [(compiled(row), inner) for equation in formulation.rows for row in equation]
        for place, equations in formulation.boundary:
            self.groups += [(compiled(row), np.array([float(place)])) for equation in equations for row in equation]

    def space_basis(self, s, order):
        if not self.spatial:
            return np.ones((1, 1)) if order == 0 else np.zeros((1, 1))
        left, right = self.ends
        x = (2 * s - left - right) / (right - left)
        columns = [chebyshev.chebval(x, chebyshev.chebder(np.eye(self.count)[k], order) if order else np.eye(self.count)[k]) for k in range(self.count)]
        return np.array(columns).T * (2 / (right - left)) ** order

    def time_basis(self, order, omega):
        columns = [np.ones_like(self.times) if order == 0 else np.zeros_like(self.times)]
        for h in range(1, self.harmonics + 1):
            columns.append((h * omega) ** order * np.cos(h * self.times + order * np.pi / 2))
            columns.append((h * omega) ** order * np.sin(h * self.times + order * np.pi / 2))
        return np.array(columns).T

    def evaluate(self, unknowns, control, omega):
        """Return residual and Jacobian in the coefficients."""
        coefficients = unknowns.reshape(len(self.f.unknowns), self.count, self.waves)
        residuals, jacobians = [], []
        for function, s in self.groups:
            jets, bases = [], []
            for unknown, ds, dt in self.keys:
                space, time = self.space_basis(s, ds), self.time_basis(dt, omega)
                bases.append((unknown, space, time))
                value = space @ coefficients[unknown] @ time.T
                if dt == 0:
                    value = value + np.asarray(self.base[unknown][ds](s, control))[..., None] * np.ones((len(s), len(self.times)))
                jets.append(value)
            value, *slopes = function(s[:, None], control, *jets)
            shape = (len(s), len(self.times))
            residuals.append(np.broadcast_to(value, shape).ravel())
            jacobian = np.zeros((shape[0] * shape[1], len(self.f.unknowns), self.count, self.waves), dtype=complex)
            for (unknown, space, time), slope in zip(bases, slopes, strict=True):
                slope = np.broadcast_to(slope, shape)
                if np.any(slope):
                    jacobian[:, unknown] += np.einsum("ij,ik,jl->ijkl", slope, space, time).reshape(-1, self.count, self.waves)
            jacobians.append(jacobian.reshape(-1, self.size))
        return np.concatenate(residuals), np.concatenate(jacobians)

    def normal(self, amplitude):
        """Return rows and data that fix amplitude and phase of the normalised field: u = 2 a cos(t) (a when steady)."""
        rows, data = [], []
        place = np.array([float(self.f.place)]) if self.spatial else np.zeros(1)
        space = self.space_basis(place, 0)[0]
        for k, unknown in enumerate(self.f.normalised):
            for wave in (1, 2) if self.harmonics else (0,):
                row = np.zeros((len(self.f.unknowns), self.count, self.waves))
                row[unknown, :, wave] = space
                rows.append(row.ravel())
                target = (2 * amplitude if wave == 1 else 0) if self.harmonics else amplitude
                if self.direction == "whirling":  # v_+ = 2 a exp(it), v_- = 2 a exp(-it)
                    target = 2 * amplitude * (1 if wave == 1 else (1j if k == 0 else -1j))
                data.append(target)
        return np.array(rows), np.array(data)

    def solve(self, amplitude, control, omega, steps=14):
        """Return (control, omega) of the state of a given amplitude."""
        unknowns = np.zeros(self.size, dtype=complex)
        rows, data = self.normal(amplitude)
        weight = 1.0
        free = 2 if self.harmonics else 1
        for _ in range(steps):
            residual, jacobian = self.evaluate(unknowns, control, omega)
            h = 1e-7
            columns = [(self.evaluate(unknowns, control + h * (1 + abs(control)), omega)[0] - residual) / (h * (1 + abs(control)))]
            if self.harmonics:
                columns.append((self.evaluate(unknowns, control, omega * (1 + h))[0] - residual) / (h * omega))
            top = np.hstack([jacobian, np.array(columns).T])
            scale = np.maximum(np.abs(top[:, :self.size]).max(axis=1), 1e-30)
            matrix = np.vstack([top / scale[:, None], np.hstack([weight * rows, np.zeros((len(rows), free))])])
            right = np.concatenate([residual / scale, weight * (rows @ unknowns - data)])
            size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-30)
            step = np.linalg.lstsq(matrix / size, -right, rcond=1e-13)[0] / size
            unknowns = unknowns + step[:self.size]
            control += float(step[self.size].real)
            if self.harmonics:
                omega += float(step[self.size + 1].real)
            if np.abs(step).max() < 1e-11 * (1 + abs(control)):
                break
        self.misfit = float(np.abs(right).max())
        return control, omega


def cubic_coefficient(formulation, threshold, frequency, gamma, amplitude, nodes=16, harmonics=3, direction=None):
    """Return kappa by Richardson extrapolation from two amplitudes."""
    balance = Balance(formulation, nodes, harmonics if frequency else 0, direction)
    found = []
    for a in (amplitude, 2 * amplitude):
        control, omega = balance.solve(a, threshold, frequency or 1.0)
        found.append((-gamma * (control - threshold) + 1j * ((omega - frequency) if frequency else 0)) / a**2)
    return (4 * found[0] - found[1]) / 3, balance.misfit
