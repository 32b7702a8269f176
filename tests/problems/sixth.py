from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="sixth",
    space=s,
    interval=(0, 1),
    time=t,
    control=c,
    control_range=(0, 100),
    fields=(u,),
    equations=(u.diff(t) - u.diff(s, 6) - c * u.diff(s, 4) * 10 + u.diff(s, 2) ** 3,),
    boundary={0: (u, u.diff(s), u.diff(s, 2)), 1: (u, u.diff(s), u.diff(s, 2))},
    base_state={u: 0},
    normalisation=(u, Rational(1, 2)),
)
