from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="fisher",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(0, 3),
    fields=(u,),
    equations=(u.diff(t) - u.diff(s, 2) - c * u + u**2,),
    boundary={0: (u,), pi: (u,)},
    base_state={u: 0},
    normalisation=(u, pi / 2),
)
