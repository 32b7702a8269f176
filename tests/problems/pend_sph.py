from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# spherical double? spherical pendulum with follower-like negative damping, constraint, axis z
c = Symbol("c")
r = vector_field("r", t)
T = field("T", t)
n = Matrix([0, 0, 1])
problem = Problem(
    name="sph",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(r, T),
    equations=(r.diff(t, 2) - c * r.diff(t) + r.diff(t) * r.diff(t).dot(r.diff(t)) + T * r + n, r.dot(r) - 1),
    base_state={r: -n, T: 1},
    rotation_axis=n,
    normalisation=(r, None),
)
