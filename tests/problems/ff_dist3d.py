from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# distributed tangential load on the 3D filament
F = Symbol("F")
n = Matrix([0, 0, 1])
r, tg, f, m = (vector_field(k, s, t) for k in ("r", "T", "f", "m"))
v = r.diff(t)
problem = Problem(
    name="ffdist",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 150),
    fields=(r, tg, f, m),
    equations=(
        r.diff(s) - tg,
        f.diff(s) - F * tg - (v - tg * tg.dot(v) / 2),
        m.diff(s) + tg.cross(f),
        m - tg.cross(tg.diff(s)),
        tg.dot(tg) - 1,
    ),
    boundary={0: (r, tg - n), 1: (f, m)},
    base_state={r: s * n, tg: n, f: -F * (1 - s) * n, m: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, 1),
)
