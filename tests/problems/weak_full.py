from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m = Symbol("m")
r = vector_field("r", t)
n = Matrix([0, 0, 1])
K = Matrix([[1, 2, 0], [3, 5, 0], [0, 0, 0]])
problem = Problem(
    name="weak_full",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(r,),
    equations=(
        r.diff(t, 2)
        - (m - r.dot(r)) * (r.diff(t) - n * n.dot(r.diff(t)))
        + r
        + n * n.dot(r.diff(t))
        + epsilon * K * r,
    ),
    base_state={r: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, None),
)
