from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("F")
n = Matrix([1, 1, 1])
r, tg, f, m = (vector_field(k, s, t) for k in ("r", "T", "f", "m"))
nn = n / sqrt(3)
problem = Problem(
    name="buckle3d",
    space=s,
    interval=(0, 1),
    time=t,
    control=c,
    control_range=(0, 6),
    fields=(r, tg, f, m),
    equations=(
        r.diff(s) - tg,
        f.diff(s) - r.diff(t),
        m.diff(s) + tg.cross(f),
        m - tg.cross(tg.diff(s)),
        tg.dot(tg) - 1,
    ),
    boundary={0: (r, tg - nn), 1: (f + c * nn, m)},
    base_state={r: s * nn, tg: nn, f: -c * nn, m: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, 1),
)
