from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
v, w = (field(n, s, t) for n in "vw")
problem = Problem(
    name="fhn",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(-1, 3),
    fields=(v, w),
    equations=(v.diff(t) - v.diff(s, 2) - c * v + v**3 + w, w.diff(t) - 2 * v + w),
    boundary={0: (v,), pi: (v,)},
    base_state={v: 0, w: 0},
    normalisation=(v, pi / 2),
)
