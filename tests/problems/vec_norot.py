from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
r = vector_field("r", t)
problem = Problem(
    name="vn",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(r,),
    equations=(r.diff(t) - Matrix([c * r[0] - r[1] - r[0] * r[2], r[0] + c * r[1], -r[2] + r[0] ** 2]),),
    base_state={r: zeros(3, 1)},
    normalisation=(r[0], None),
)
