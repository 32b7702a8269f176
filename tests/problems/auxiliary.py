from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u, w = (field(n, s, t) for n in ("phi", "omega"))
problem = Problem(
    name="aux",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(0, 3),
    fields=(u, w),
    equations=(u.diff(t) - u.diff(s, 2) - c * u + u * w, w - u**2, w.diff(s) - 2 * u * u.diff(s)),
    boundary={0: (u, w), pi: (u,)},
    base_state={u: 0, w: 0},
    normalisation=(u, pi / 2),
)
