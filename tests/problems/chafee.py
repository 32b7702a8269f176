from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="chafee",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(0, 3),
    fields=(u,),
    equations=(u.diff(t) - u.diff(s, 2) - c * sin(u),),
    boundary={0: (u,), pi: (u,)},
    base_state={u: 0},
    normalisation=(u, pi / 2),
)
