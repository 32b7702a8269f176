from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# base depends on control nontrivially: heated slab u_ss = -c, u=c s(1-s)/2 reaction
c = Symbol("c")
u, v = (field(q, s, t) for q in "uv")
problem = Problem(
    name="slab",
    space=s,
    interval=(0, 1),
    time=t,
    control=c,
    control_range=(0, 200),
    fields=(u, v),
    equations=(u.diff(t) - u.diff(s, 2) - c + v**2, v.diff(t) - v.diff(s, 2) - u * v),
    boundary={0: (u, v), 1: (u, v)},
    base_state={u: c * s * (1 - s) / 2, v: 0},
    normalisation=(v, Rational(1, 2)),
)
