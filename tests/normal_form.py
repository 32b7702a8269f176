"""Normal forms of ordinary differential equations by Kuznetsov's projection, in mpmath: it shares no code with the packages.

x' = J(c) x + B(x, x)/2 + C(x, x, x)/6 with J(c) = J_0 + c J_1 + c^2 J_2, and a weak effect epsilon (e + E x).
"""

from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from mpmath import mp


@dataclass(frozen=True, kw_only=True)
class Flow:
    """Exact Taylor coefficients: `linear` is (J_0, J_1, J_2); terms are (row, factors, Fraction)."""

    linear: tuple
    quadratic: tuple = ()
    cubic: tuple = ()
    weak_constant: tuple = ()
    weak_linear: tuple = ()
    normalised: int = 0
    size: int = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "size", len(self.linear[0]))

    def jacobian(self, c):
        """Return J(c) in doubles."""
        return sum(np.array([[float(x) for x in row] for row in m]) * c**k for k, m in enumerate(self.linear))


def exact(x):
    """Return a Fraction as a number of the working precision."""
    return mp.mpf(x.numerator) / x.denominator


def matrix(rows):
    """Return rows of Fractions as a matrix."""
    return mp.matrix([[exact(x) for x in row] for row in rows])


def bilinear(flow, x, y):
    """Return B(x, y)."""
    total = mp.matrix(flow.size, 1)
    for row, (j, k), c in flow.quadratic:
        total[row] += exact(c) * (x[j] * y[k] + x[k] * y[j])
    return total


def trilinear(flow, x, y, z):
    """Return C(x, y, z)."""
    total = mp.matrix(flow.size, 1)
    for row, factors, c in flow.cubic:
        total[row] += exact(c) * sum(x[j] * y[k] * z[l] for j, k, l in permutations(factors))
    return total


def leibniz(rows):
    """Return a determinant by expansion along the first row."""
    if len(rows) == 1:
        return rows[0][0]
    return sum((-1) ** k * x * leibniz([row[:k] + row[k + 1:] for row in rows[1:]]) for k, x in enumerate(rows[0]) if x != 0)


def null_of(m):
    """Return a null vector by inverse iteration."""
    n = m.rows
    shift = mp.mpf(10) ** (-mp.dps // 2) * (mp.mnorm(m, 1) + 1)
    x = mp.matrix([1 + mp.mpf(k) / 7 + mp.mpc(0, 1) * k / 11 for k in range(n)])
    for _ in range(4):
        x = mp.lu_solve(m + shift * mp.eye(n), x)
        x = x / mp.norm(x)
    return x


def normal_form(flow, c, omega, digits):
    """Return threshold, frequency and the coefficients by monomial; c and omega (None when steady) are doubles."""
    with mp.workdps(digits + 30):
        parts = [matrix(m) for m in flow.linear]
        n, i = flow.size, mp.mpc(0, 1)

        def jacobian(c):
            return parts[0] + c * parts[1] + c * c * parts[2]

        size = 1 + mp.mnorm(parts[0], 1)

        def determinant(c, w):
            # by expansion along rows: no pivot to fail at the root
            return leibniz([[entry / size for entry in row] for row in (jacobian(c) - i * w * mp.eye(n)).tolist()])

        if omega is None:
            c = mp.findroot(lambda c: determinant(c, 0).real, (mp.mpf(c), mp.mpf(c) * (1 + mp.mpf("1e-9")) + mp.mpf("1e-13")), tol=mp.mpf(10) ** (-2 * digits - 30), verify=False)
            w = mp.mpf(0)
        else:
            def pair(c, w):
                value = determinant(c, w)
                return [value.real, value.imag]

            c, w = mp.findroot(pair, (mp.mpf(c), mp.mpf(omega)), tol=mp.mpf(10) ** (-2 * digits - 30), verify=False)
        j = jacobian(c)
        q = null_of(j - i * w * mp.eye(n))
        q = q / q[flow.normalised]
        p = null_of(j.T - i * w * mp.eye(n))
        p = p / (p.T * q)[0]

        def project(v):
            return (p.T * v)[0]

        slope = parts[1] + 2 * c * parts[2]
        found = {"mu*A": project(slope * q)}
        if flow.weak_linear:
            weak = matrix(flow.weak_linear) * q
            if any(flow.weak_constant):
                weak = weak + bilinear(flow, q, -mp.lu_solve(j, mp.matrix([exact(x) for x in flow.weak_constant])))
            found["epsilon*A"] = project(weak)
        if omega is None:
            quadratic = project(bilinear(flow, q, q)) / 2
            if abs(quadratic) > mp.mpf(10) ** (-digits - 10):
                found["A**2"] = quadratic
            else:
                forcing = bilinear(flow, q, q)
                # J h = -B(q, q), h without a component along q: bordered system
                bordered = mp.matrix(n + 1, n + 1)
                for a in range(n):
                    for b in range(n):
                        bordered[a, b] = j[a, b]
                    bordered[a, n], bordered[n, a] = mp.conj(p[a]), p[a]
                h = mp.lu_solve(bordered, mp.matrix([*(-forcing), 0]))[:n]
                found["A**3"] = project(trilinear(flow, q, q, q)) / 6 + project(bilinear(flow, q, mp.matrix(h))) / 2
            return c, None, {name: value.real for name, value in found.items()}
        q_bar = q.conjugate()
        mean = -mp.lu_solve(j, bilinear(flow, q, q_bar))
        second = mp.lu_solve(2 * i * w * mp.eye(n) - j, bilinear(flow, q, q))
        found["A**2*conj(A)"] = project(trilinear(flow, q, q, q_bar) + 2 * bilinear(flow, q, mean) + bilinear(flow, q_bar, second)) / 2
        return c, w, found
