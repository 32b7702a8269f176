from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# Ginzburg-Landau like complex as two real fields, nonlinear time derivative in bc
c = Symbol("c")
u, v = (field(q, s, t) for q in "uv")
problem = Problem(
    name="cgl",
    space=s,
    interval=(0, 2),
    time=t,
    control=c,
    control_range=(0, 12),
    fields=(u, v),
    equations=(
        u.diff(t) - u.diff(s, 2) + v.diff(s, 2) - c * u + 3 * v + (u**2 + v**2) * u,
        v.diff(t) - v.diff(s, 2) - u.diff(s, 2) - c * v - 3 * u + (u**2 + v**2) * v,
    ),
    boundary={0: (u, v), 2: (u.diff(s) + u.diff(t) / 7, v.diff(s) + v.diff(t) / 7)},
    base_state={u: 0, v: 0},
    normalisation=(u, 2),
)
