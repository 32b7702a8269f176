from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# boundary layer
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="layer",
    space=s,
    interval=(0, 1),
    time=t,
    control=c,
    control_range=(0, 30),
    fields=(u,),
    equations=(u.diff(t) - u.diff(s, 2) - c * u * (1 + tanh((s - Rational(1, 2)) * 20)) / 2 + u**3,),
    boundary={0: (u,), 1: (u.diff(s),)},
    base_state={u: 0},
    normalisation=(u, 1),
)
