from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
r = vector_field("r", t)
T = field("T", t)
n = Matrix([1, 0, 0])
q = field("q", t)
perp = r - n * r[0]
problem = Problem(
    name="rs",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(r, T, q),
    equations=(
        perp.diff(t, 2) - c * perp.diff(t) + perp * (1 + T) + n * (r[0].diff(t) + r[0] - T * r[0]),
        T.diff(t) + 2 * T - r.dot(r),
        q - T**2 - r.dot(r.diff(t)),
    ),
    base_state={r: zeros(3, 1), T: 0, q: 0},
    rotation_axis=n,
    normalisation=(r, None),
)
