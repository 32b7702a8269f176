from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# s-dependent coefficients: distributed follower load
F = Symbol("F")
u = field("u", s, t)
problem = Problem(
    name="leipholz",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 120),
    fields=(u,),
    equations=(
        u.diff(s, 4)
        + F * (1 - s) * u.diff(s, 2)
        + u.diff(t, 2)
        + u.diff(t)
        + u.diff(s) ** 2 * u.diff(s, 4)
        + u**2 * u.diff(t),
    ),
    boundary={0: (u, u.diff(s)), 1: (u.diff(s, 2), u.diff(s, 3))},
    base_state={u: 0},
    normalisation=(u, 1),
)
