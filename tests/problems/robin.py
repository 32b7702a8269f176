from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="robin",
    space=s,
    interval=(-1, 2),
    time=t,
    control=c,
    control_range=(-3, 3),
    fields=(u,),
    equations=(u.diff(t) - u.diff(s, 2) + u,),
    boundary={-1: (u.diff(s) - u,), 2: (u.diff(s) - c * u - u**2,)},
    base_state={u: 0},
    normalisation=(u, 2),
)
