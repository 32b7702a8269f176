from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
F = Symbol("F")
n = Matrix([0, 0, 1])
r, tg, f, m = (vector_field(k, s, t) for k in ("r", "T", "f", "m"))
problem = Problem(
    name="ff_iso",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 60),
    fields=(r, tg, f, m),
    equations=(
        r.diff(s) - tg,
        f.diff(s) - r.diff(t),
        m.diff(s) + tg.cross(f),
        m - tg.cross(tg.diff(s)),
        tg.dot(tg) - 1,
        tg.dot(tg.diff(t)),
        tg.dot(tg.diff(s)),
    ),
    boundary={0: (r, tg - n, r.diff(t)), 1: (f + F * tg, m, f.dot(tg) + F)},
    base_state={r: s * n, tg: n, f: -F * n, m: zeros(3, 1)},
    rotation_axis=n,
    normalisation=(r, 1),
)
