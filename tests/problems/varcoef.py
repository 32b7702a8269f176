from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="varcoef",
    space=s,
    interval=(0, 1),
    time=t,
    control=c,
    control_range=(0, 30),
    fields=(u,),
    equations=(exp(s) * u.diff(t) - (sqrt(1 + s) * u.diff(s)).diff(s) - c * u + (1 + s) * u**3,),
    boundary={0: (u,), 1: (u.diff(s) + u**3,)},
    base_state={u: 0},
    normalisation=(u, 1),
)
