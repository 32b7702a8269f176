"""Random problems of the class, and the verdict on each: right, refused (why) or wrong.

`python -m tests.random_problems --count 10000` prints the counts and exits 1 if any is wrong. The digits claimed at N are compared
with a computation at 2N by another route: ordinary equations with `tests.normal_form` (linear algebra in mpmath that shares no
code), vector oscillators with a formula by hand, boundary-value problems between closed, chebyshev and quadrature. Every third
problem is certified too: the enclosures have to hold the value at 2N digits.
"""

import argparse
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from mpmath import mp
from sympy import Matrix, Rational, Symbol, exp, pi, sin, symbols, tanh, zeros

from derive import Problem, derive_amplitude_equation, epsilon, field, vector_field
from derive.statement import DerivationError, ProblemError
from numerics import EvaluationError, evaluate
from tests.normal_form import Flow, normal_form

s, t = symbols("s t", real=True)
KINDS = ("ordinary", "second_order", "vector", "constant", "polynomial")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem with digits to ask for and, where one exists, its normal form by other means."""

    problem: Problem
    digits: int
    route: str
    other: str
    flow: Flow | None = None
    onset: tuple | None = None
    known: Any = None
    certify: bool = False


def fraction(rng, size=3, parts=(1, 2, 3, 4, 5, 7, 10)):
    """Return a random fraction between -size and size."""
    q = rng.choice(parts)
    return Fraction(rng.randint(-size * q, size * q), q)


def nonzero(rng, size=3):
    """Return a random fraction that is not zero."""
    while True:
        x = fraction(rng, size)
        if x:
            return x


def sym(x):
    """Return a Fraction as SymPy's."""
    return Rational(x.numerator, x.denominator)


def first_loss(jacobian, low, high, count=400):
    """Return (control, frequency or None) of the first loss of stability in doubles, or None when it is not clear-cut."""
    def growth(c):
        return float(np.linalg.eigvals(jacobian(c)).real.max())

    if not growth(low) < -1e-3 * (abs(np.linalg.eigvals(jacobian(low))).max()):
        return None
    grid = np.linspace(low, high, count)
    for a, b in zip(grid, grid[1:], strict=False):
        if growth(b) > 0:
            for _ in range(80):
                middle = (a + b) / 2
                a, b = (middle, b) if growth(middle) < 0 else (a, middle)
            values = np.linalg.eigvals(jacobian(b))
            critical = values[np.argmax(values.real)]
            others = [z for z in values if abs(z - critical) > 1e-6 * abs(values).max() and abs(z - critical.conjugate()) > 1e-6 * abs(values).max()]
            if any(z.real > -1e-4 * abs(values).max() for z in others):
                return None
            if abs(critical.imag) <= 1e-3 * abs(values).max():
                return (b, None) if abs(critical.imag) <= 1e-7 * abs(values).max() else None
            return b, abs(critical.imag)
    return None


def nonlinear_terms(rng, n, even):
    """Return random quadratic and cubic terms; with `even` given, only those that x -> -x of the others leaves unchanged."""
    def allowed(row, factors):
        return even is None or (row in even) == (sum(j not in even for j in factors) % 2 == 0)

    quadratic, cubic = [], []
    for _ in range(rng.randint(0, 2 * n)):
        row, factors = rng.randrange(n), (rng.randrange(n), rng.randrange(n))
        if allowed(row, factors):
            quadratic.append((row, factors, nonzero(rng)))
    for _ in range(rng.randint(1, 2 * n)):
        row, factors = rng.randrange(n), tuple(rng.randrange(n) for _ in range(3))
        if allowed(row, factors):
            cubic.append((row, factors, nonzero(rng)))
    return quadratic, cubic


def ordinary_case(rng):
    """Return x' = f(x), one to six unknowns, possibly with a mass matrix, a constraint, weak terms, a base state that moves."""
    while True:
        n = rng.randint(1, 5)
        even = None if rng.random() < 0.5 else tuple(j for j in range(n) if rng.random() < 0.5)
        def linked(i, j, even=even):
            return even is None or ((i in even) == (j in even))
        j0 = [[fraction(rng) if linked(i, j) and rng.random() < 0.7 else Fraction(0) for j in range(n)] for i in range(n)]
        j1 = [[(Fraction(1) if i == j else Fraction(0)) + (fraction(rng, 1) / 5 if linked(i, j) and rng.random() < 0.3 else 0) for j in range(n)] for i in range(n)]
        j2 = [[Fraction(0)] * n for _ in range(n)]
        if rng.random() < 0.2:
            j2[rng.randrange(n)][0 if even is None or 0 in even else n - 1] = Fraction(0)
            k = rng.randrange(n)
            j2[k][k] = fraction(rng, 1) / 50
        scale = Fraction(10) ** rng.choice((0, 0, 0, 0, -2, 3, -6, 6, -12, 12))
        reach = Fraction(3 * n + 3)
        j1 = [[x / scale for x in row] for row in j1]
        j2 = [[x / scale**2 for x in row] for row in j2]
        quadratic, cubic = nonlinear_terms(rng, n, even)
        flow_terms = {"linear": (j0, j1, j2)}
        onset = first_loss(Flow(**flow_terms).jacobian, -float(reach * scale), float(reach * scale))
        if onset is None:
            continue
        return build_ordinary(rng, n, flow_terms, quadratic, cubic, onset, reach * scale, even, second=False)


def second_order_case(rng):
    """Return q'' = f(q, q'), one to three unknowns."""
    while True:
        m = rng.randint(1, 3)
        n = 2 * m
        zero = [[Fraction(0)] * n for _ in range(n)]
        j0, j1 = [list(row) for row in zero], [list(row) for row in zero]
        for i in range(m):
            j0[i][m + i] = Fraction(1)
            for j in range(m):
                j0[m + i][j] = -abs(nonzero(rng, 4)) - 1 if i == j else fraction(rng, 1)
                j0[m + i][m + j] = fraction(rng, 1)
            j1[m + i][m + i] = Fraction(1)
            if rng.random() < 0.3:
                j1[m + i][rng.randrange(m)] += fraction(rng, 1) / 2
        quadratic, cubic = nonlinear_terms(rng, n, None if rng.random() < 0.6 else ())
        quadratic = [(m + row % m, factors, c) for row, factors, c in quadratic]
        cubic = [(m + row % m, factors, c) for row, factors, c in cubic]
        flow_terms = {"linear": (j0, j1, zero)}
        onset = first_loss(Flow(**flow_terms).jacobian, -8.0, 8.0)
        if onset is None:
            continue
        return build_ordinary(rng, n, flow_terms, quadratic, cubic, onset, Fraction(8), None, second=True)


def build_ordinary(rng, n, flow_terms, quadratic, cubic, onset, reach, even, second):
    """Return the case: the same terms as a statement for the program and as arrays for the normal form."""
    c = Symbol("c", real=True)
    m = n // 2 if second else n
    fields = [field(f"x{k}", t) for k in range(m)]
    shift = [sym(fraction(rng)) + c * sym(fraction(rng)) / sym(Fraction(reach)) if rng.random() < 0.25 and not second else Rational(0) for _ in range(m)]
    moved = [x - b for x, b in zip(fields, shift, strict=True)]
    states = moved + [x.diff(t) for x in fields] if second else moved
    parameters = {}

    def coefficient(x):
        if rng.random() < 0.1 and len(parameters) < 2:
            p = Symbol(f"p{len(parameters)}", real=True)
            parameters[p] = sym(x)
            return p
        return sym(x)

    linear = flow_terms["linear"]
    right = [sum((sum(sym(part[i][j]) * c**k for k, part in enumerate(linear)) * states[j] for j in range(n)), Rational(0)) for i in range(n)]
    quadratic, cubic = list(quadratic), list(cubic)
    for row, (j, k), x in quadratic:
        right[row] += coefficient(x) * states[j] * states[k]
    for row, (j, k, l), x in cubic:
        right[row] += coefficient(x) * states[j] * states[k] * states[l]
    allowed = [(i, j) for i in range(n // 2 if second else 0, n) for j in range(n) if even is None]
    if allowed and rng.random() < 0.2:  # a nonlinearity with a Taylor series
        (row, j), x = rng.choice(allowed), nonzero(rng)
        right[row] += sym(x) * (exp(states[j]) - 1 - states[j])
        quadratic.append((row, (j, j), x / 2))
        cubic.append((row, (j, j, j), x / 6))
    if allowed and rng.random() < 0.2:
        (row, j), x = rng.choice(allowed), nonzero(rng)
        right[row] += sym(x) * (sin(states[j]) - states[j])
        cubic.append((row, (j, j, j), -x / 6))
    equations_extra, base_extra, fields_extra = [], {}, []
    if allowed and rng.random() < 0.2:  # an algebraic constraint w = x_j x_k used in a cubic term
        w = field("w", t)
        (row, j), (k, l), x = rng.choice(allowed), (rng.randrange(n), rng.randrange(n)), nonzero(rng)
        fields_extra, equations_extra, base_extra = [w], [w - states[k] * states[l]], {w: Rational(0)}
        right[row] += sym(x) * w * states[j]
        cubic.append((row, (j, k, l), x))
    weak_constant, weak_linear = (), ()
    if even is None and rng.random() < 0.2:
        weak_linear = [[fraction(rng, 1) if i >= n - m and rng.random() < 0.5 else Fraction(0) for _ in range(n)] for i in range(n)]
        weak_constant = [fraction(rng, 1) if i >= n - m and onset[1] is not None and rng.random() < 0.3 and not any(shift) else Fraction(0) for i in range(n)]
        weak_constant = [Fraction(0)] * n  # the base state has to hold for every epsilon
        for i in range(n):
            right[i] += epsilon * sum((sym(weak_linear[i][j]) * states[j] for j in range(n)), Rational(0))
    rows = [x.diff(t, 2 if second else 1) - right[n - m + k] for k, x in enumerate(fields)]
    if m > 1 and rng.random() < 0.3:  # an invertible combination of the rows
        for k in range(1, m):
            rows[k] = rows[k] + sym(fraction(rng)) * rows[k - 1]
    k = int(np.argmax(abs(critical_vector(Flow(linear=linear), *onset)[:m])))
    flow = Flow(linear=linear, quadratic=tuple(quadratic), cubic=tuple(cubic), weak_constant=tuple(weak_constant), weak_linear=tuple(weak_linear), normalised=k)
    problem = Problem(
        name="random", time=t, control=c, control_range=(-sym(Fraction(reach)), sym(Fraction(reach))), fields=(*fields, *fields_extra), equations=(*rows, *equations_extra),
        base_state={**dict(zip(fields, shift, strict=True)), **base_extra}, parameters=parameters, normalisation=(fields[k], None))
    return Case(problem=problem, digits=rng.choice((5, 8, 12, 15, 16, 17, 20, 30)), route="auto", other="normal form", flow=flow, onset=onset)


def critical_vector(flow, control, frequency):
    """Return the critical eigenvector in doubles."""
    values, vectors = np.linalg.eig(flow.jacobian(control))
    return vectors[:, np.argmin(abs(values - 1j * (frequency or 0)))]


def vector_case(rng):
    """Return r'' = -k r + (c - ...) r' + cubic terms about an axis, or r' = c r + ...; the coefficients follow by hand."""
    c = Symbol("c", real=True)
    axis = Matrix([rng.randint(-2, 2), rng.randint(-2, 2), rng.randint(1, 3)])
    r = vector_field("r", t)
    along = axis * axis.dot(r) / axis.dot(axis)
    across = r - along
    k, shift = abs(nonzero(rng, 4)) + Fraction(1, 2), fraction(rng, 1)
    a, b, d, e, g = (fraction(rng) for _ in range(5))
    if rng.random() < 0.3:  # steady: A' = c A + (a) (A.A) A
        a = nonzero(rng)
        equations = (r.diff(t) - (c - sym(shift)) * across + sym(k) * along - sym(a) * r.dot(r) * r,)
        known = {"kind": "steady", "control": shift, "dot(A,A)*A": (a, 0), "mu*A": (1, 0)}
    else:
        if a == 0 and b == 0 and d == 0:
            a = Fraction(1)
        v = r.diff(t)
        equations = (r.diff(t, 2) + sym(k) * r - (c - sym(shift)) * across.diff(t) + along.diff(t)
                     - sym(a) * r.dot(r) * v - sym(b) * r.dot(v) * r - sym(d) * v.dot(v) * v - sym(e) * r.dot(r) * r - sym(g) * v.dot(v) * r,)
        # harmonic 1 of each cubic term over 2 i omega: r = A z + conj, v = i omega (A z - conj)
        # (r.r) v: i w (2 S - P); (r.v) r: i w P; (v.v) v: i w^3 (2 S + P)... with P = (A.A) A*, S = (A.A*) A
        known = {"kind": "hopf", "control": shift, "k": k, "terms": (a, b, d, e, g)}
    problem = Problem(name="random", time=t, control=c, control_range=(sym(shift) - 2, sym(shift) + 2), fields=(r,), equations=equations,
                      base_state={r: zeros(3, 1)}, rotation_axis=axis, normalisation=(r, None))
    return Case(problem=problem, digits=rng.choice((5, 12, 16, 20)), route="auto", other="by hand", known=known)


def vector_coefficients(known):
    """Return (control, frequency, coefficients) of a vector case.

    With r = A z + c.c., v = i w (A z - c.c.), P = (A.A) conj(A) and S = (A.conj(A)) A, the terms of harmonic 1 are
    (r.r) v: i w (2 S - P); (r.v) r: i w P; (v.v) v: i w^3 (2 S + P); (r.r) r: P + 2 S; (v.v) r: w^2 (2 S - P).
    """
    if known["kind"] == "steady":
        return exact_fraction(known["control"]), None, {name: mp.mpc(exact_fraction(known[name][0])) for name in ("dot(A,A)*A",)} | {"mu*A": mp.mpc(1)}
    w = mp.sqrt(exact_fraction(known["k"]))
    a, b, d, e, g = map(exact_fraction, known["terms"])
    i = mp.mpc(0, 1)
    p = -i * w * a + i * w * b + i * w**3 * d + e - w**2 * g
    q = 2 * i * w * a + 2 * i * w**3 * d + 2 * e + 2 * w**2 * g
    return exact_fraction(known["control"]), w, {"dot(A,A)*conj(A)": p / (2 * i * w), "dot(A,conj(A))*A": q / (2 * i * w), "mu*A": mp.mpf("0.5") * mp.mpc(1)}


def exact_fraction(x):
    """Return a Fraction as a number of the working precision."""
    return mp.mpf(x.numerator) / x.denominator


def partial_case(rng, variable):
    """Return one to three fields, orders 2 to 6 in space; Hopf by a skew coupling of two fields."""
    c = Symbol("c", real=True)
    n = rng.choice((1, 1, 2, 2, 3)) if not variable else rng.choice((1, 1, 2))
    length = rng.choice((Rational(1), Rational(2), pi, Rational(1, 2)))
    orders = [rng.choice((2, 2, 4, 6) if not variable else (2, 2, 4)) for _ in range(n)]
    if sum(orders) > 8:
        orders = [2] * n
    fields = [field(f"u{k}", s, t) for k in range(n)]

    def weight(size=1):
        if variable and rng.random() < 0.6:
            return 1 + sym(fraction(rng, 1)) / 4 * s / length + (sym(fraction(rng, 1)) / 6 * (s / length) ** 2 if rng.random() < 0.5 else 0)
        return Rational(size)

    left, right = [], []
    equations = []
    skew = nonzero(rng, 6)
    stiffness = [sym(abs(nonzero(rng, 2)) + Fraction(1, 4)) for _ in range(n)]
    if n > 1 and rng.random() < 0.7:
        orders[1], stiffness[1] = orders[0], stiffness[0] * rng.choice((1, 1, Rational(11, 10)))
    odd = rng.random() < 0.5
    ends = [rng.random() for _ in range(n)]
    if n > 1:
        ends[1] = ends[0]
    for k, u in enumerate(fields):
        p = orders[k]
        high = stiffness[k] * (-1) ** (p // 2 + 1) * (weight() * u.diff(s, p // 2)).diff(s, p // 2)
        row = u.diff(t) - high - (c * weight() if k < 2 else -1) * u
        if rng.random() < 0.4:
            row += sym(fraction(rng, 2)) * u.diff(s)
        if p >= 4 and rng.random() < 0.4:
            row += sym(fraction(rng, 2)) * u.diff(s, 2)
        if n > 1 and k < 2:
            row += sym(skew) * fields[1 - k] * (1 if k == 0 else -1) * weight()
        if n == 3:
            other = fields[rng.randrange(3)]
            row += sym(fraction(rng, 1)) * other * fields[2] if not odd else sym(fraction(rng, 1)) / 2 * fields[2 - k if k != 1 else 2]
        v = fields[rng.randrange(n)]
        row += sym(nonzero(rng)) * rng.choice((u**3, u * v**2, u**2 * u.diff(s), v**3, tanh(u) - u, sin(u) - u))
        if not odd:
            row += sym(nonzero(rng)) * rng.choice((u**2, u * v, u * u.diff(s), v * u.diff(s)))
        equations.append(row)
        # hinged (u, u'', u'''') or clamped (u, u', u'') at each end; free second-order ends with a Robin row
        for rows in (left, right):
            if p == 2:
                robin = ends[k] > 0.6 and rows is right
                rows.append(u.diff(s) + sym(abs(fraction(rng, 2))) * u + (u**3 if rng.random() < 0.3 else 0) if robin else u)
            elif ends[k] < 0.6:
                rows.extend(u.diff(s, 2 * m) for m in range(p // 2))
            else:
                rows.extend(u.diff(s, m) for m in range(p // 2))
    problem = Problem(
        name="random", space=s, interval=(0, length), time=t, control=c, control_range=(-30, rng.choice((400, 2000))), fields=tuple(fields), equations=tuple(equations),
        boundary={0: tuple(left), length: tuple(right)}, base_state={u: 0 for u in fields}, normalisation=(fields[0], length * rng.choice((Rational(1, 2), Rational(2, 5), Rational(1, 3)))))
    digits = rng.choice((5, 8, 12, 16, 20) if not variable else (5, 8, 12))
    pair = rng.choice((("chebyshev", "quadrature"), ("quadrature", "chebyshev"))) if variable else rng.choice((("closed", "chebyshev"), ("chebyshev", "closed"), ("closed", "quadrature")))
    return Case(problem=problem, digits=digits, route=pair[0], other=pair[1])


def make_case(seed, kind):
    """Return the case of a seed."""
    rng = random.Random(f"{kind}-{seed}")
    makers = {"ordinary": ordinary_case, "second_order": second_order_case, "vector": vector_case}
    case = makers[kind](rng) if kind in makers else partial_case(rng, kind == "polynomial")
    return replace(case, certify=rng.random() < 1 / 3)


def true_values(case, text, result):
    """Return (control, frequency, {monomial: value}) at twice the digits by other means."""
    digits = 2 * case.digits
    if case.flow is not None:
        return normal_form(case.flow, *case.onset, digits)
    if case.known is not None:
        return vector_coefficients(case.known)
    other = evaluate(text, digits=digits, route=case.other)
    frequency = mp.mpf(other.threshold.frequency) if other.threshold.frequency else None
    return mp.mpf(other.threshold.control), frequency, {one.monomial: mp.mpc(one.value.re, one.value.im) for one in other.coefficients}


def mistakes(result, case, truth):
    """Return what is wrong with a result, as lines; none when every digit and every error bound holds."""
    control, frequency, values = truth
    found = []
    allowed = mp.mpf(10) ** -case.digits

    def compare(name, claimed, true, error):
        difference = abs(claimed - true)
        if difference > allowed * max(abs(true), allowed if claimed == 0 or abs(true) < allowed else 0):
            found.append(f"{name}: {mp.nstr(claimed, case.digits + 3)}, true {mp.nstr(true, case.digits + 5)}")
        elif difference > mp.mpf(error) * (1 + mp.mpf("1e-6")) + allowed**2 * (1 + abs(true)):  # the truth has 2N digits
            found.append(f"{name}: claimed error {error}, true error {mp.nstr(difference, 3)}")

    compare("control", mp.mpf(result.threshold.control), control, result.threshold.error)
    if (frequency is None) != (result.threshold.frequency is None):
        return [*found, f"kind {result.threshold.kind}"]
    if frequency is not None:
        compare("frequency", mp.mpf(result.threshold.frequency), frequency, "inf")
    given = {one.monomial: one.value for one in result.coefficients}
    for name in sorted({*given, *values}):
        true = values.get(name, mp.mpf(0))
        if name not in given:
            if abs(true) > allowed:
                found.append(f"{name} is missing; true {mp.nstr(true, 10)}")
            continue
        compare(name, mp.mpc(given[name].re, given[name].im), true, given[name].error)
    return found


def verdict(seed, kind):
    """Return ("right" | "refused" | "wrong", reason) of one random problem; "certified" when the enclosures are right too."""
    case = make_case(seed, kind)
    try:
        text = derive_amplitude_equation(case.problem).emit()
        result = evaluate(text, digits=case.digits, route=case.route)
    except (ProblemError, DerivationError, EvaluationError) as refusal:
        return "refused", str(refusal)
    try:
        with mp.workdps(2 * case.digits + 20):
            truth = true_values(case, text, result)
            found = mistakes(result, case, truth)
    except EvaluationError as refusal:
        return "refused", f"no second route: {refusal}"
    if found or not case.certify:
        return ("wrong", "; ".join(found)) if found else ("right", "")
    try:
        proved = evaluate(text, digits=case.digits, certify=True, count=False)
    except EvaluationError as refusal:
        return "right", f"certify: {refusal}"
    with mp.workdps(2 * case.digits + 20):
        found = mistakes(proved, case, truth)
    return ("wrong", f"certified: {'; '.join(found)}") if found else ("certified", "")


def shortened(reason):
    """Return the reason of a refusal without its numbers, for counting."""
    import re

    return re.sub(r"[-+]?\d[\d.e+-]*i?", "#", reason)[:90]


def main(arguments=None):
    """Print counts of right, refused and wrong; exit 1 if any is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--show", action="store_true", help="print every refusal")
    options = parser.parse_args(arguments)
    kinds = options.kinds.split(",")
    counts, kinds_of, reasons = Counter(), Counter(), Counter()
    started = time.perf_counter()
    for number in range(options.count):
        seed, kind = options.seed + number, kinds[number % len(kinds)]
        try:
            outcome, reason = verdict(seed, kind)
        except Exception as crash:  # noqa: BLE001  (a crash is counted as wrong, and shown)
            outcome, reason = "wrong", f"{type(crash).__name__}: {crash}"
        counts[outcome] += 1
        kinds_of[kind, outcome] += 1
        if reason and outcome != "wrong":
            reasons[kind, shortened(reason)] += 1
        if outcome == "wrong":
            print(f"wrong: {kind} {seed}: {reason}", flush=True)
        if outcome == "refused" and options.show:
            print(f"refused: {kind} {seed}: {reason}", flush=True)
        if (number + 1) % 100 == 0:
            print(f"{number + 1}: {dict(counts)} after {time.perf_counter() - started:.0f} s", flush=True)
    for (kind, reason), count in reasons.most_common():
        print(f"refused {count:6}  {kind}: {reason}")
    for kind in dict.fromkeys(kinds):
        print(f"{kind}: " + ", ".join(f"{outcome} {kinds_of[kind, outcome]}" for outcome in ("right", "certified", "refused", "wrong")))
    print(f"right {counts['right'] + counts['certified']} (of these {counts['certified']} certified too), refused {counts['refused']}, wrong {counts['wrong']} of {options.count} "
          f"in {time.perf_counter() - started:.0f} s")
    return 1 if counts["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())
