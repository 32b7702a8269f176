from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
F = Symbol("F")
u = field("u", s, t)
problem = Problem(
    name="tipmass",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 40),
    fields=(u,),
    equations=(u.diff(s, 4) + F * u.diff(s, 2) + u.diff(t, 2) + u.diff(t) / 2 + u**3,),
    boundary={0: (u, u.diff(s)), 1: (u.diff(s, 2), u.diff(s, 3) - u.diff(t, 2) / 5 - u.diff(t) ** 3)},
    base_state={u: 0},
    normalisation=(u, 1),
)
