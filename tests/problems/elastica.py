from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
Pp = Symbol("P")
th, x, q = (field(n, s, t) for n in ("theta", "x", "q"))
problem = Problem(
    name="elastica",
    space=s,
    interval=(0, 1),
    time=t,
    control=Pp,
    control_range=(1, 15),
    fields=(th,),
    equations=(th.diff(t) - th.diff(s, 2) - Pp * sin(th),),
    boundary={0: (th.diff(s),), 1: (th,)},
    base_state={th: 0},
    normalisation=(th, 0),
)
