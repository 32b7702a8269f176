from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
L = Symbol("nu")
u = field("u", s, t)
problem = Problem(
    name="ks",
    space=s,
    interval=(0, pi),
    time=t,
    control=L,
    control_range=(0, 3),
    fields=(u,),
    equations=(u.diff(t) + u.diff(s, 4) + L * u.diff(s, 2) + u * u.diff(s),),
    boundary={0: (u, u.diff(s, 2)), pi: (u, u.diff(s, 2))},
    base_state={u: 0},
    normalisation=(u, pi / 2),
)
