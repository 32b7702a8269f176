from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m = Symbol("m")
r = vector_field("r", t)
n = Matrix([1, 2, 2])
perp = r - n * n.dot(r) / 9
problem = Problem(
    name="iso",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(r,),
    equations=(r.diff(t, 2) - (m - r.dot(r)) * perp.diff(t) + r + n * n.dot(r.diff(t)) / 9,),
    base_state={r: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, None),
)
