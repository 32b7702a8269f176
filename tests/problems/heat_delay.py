from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# KdV-Burgers like third order, Hopf?
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="third",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(0, 6),
    fields=(u,),
    equations=(u.diff(t) + u.diff(s, 4) + c * u.diff(s, 2) + u.diff(s, 3) + u * u.diff(s) + u.diff(s) ** 3,),
    boundary={0: (u, u.diff(s)), pi: (u, u.diff(s))},
    base_state={u: 0},
    normalisation=(u, pi / 2),
)
