from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m = Symbol("m")
r = vector_field("r", t)
n = Matrix([0, 3, 4])
problem = Problem(
    name="vp",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(r,),
    equations=(r.diff(t) - m * r + n * n.dot(r) * 2 / 25 + r * r.dot(r) - n * r.dot(r) / 5,),
    base_state={r: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, None),
)
