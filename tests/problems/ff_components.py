from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# oblique axis, rows by component
F = Symbol("F")
ax = Matrix([2, -1, 2])
n = ax / 3
r, tg, f, m = (vector_field(k, s, t) for k in ("r", "T", "f", "m"))


def comp(v):
    return tuple(v)


v = r.diff(t)
problem = Problem(
    name="ffc",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 60),
    fields=(r, tg, f, m),
    equations=(
        *comp(r.diff(s) - tg),
        *comp(f.diff(s) - (v - tg * tg.dot(v) / 2)),
        *comp(m.diff(s) + tg.cross(f)),
        *comp(m - tg.cross(tg.diff(s))),
        tg.dot(tg) - 1,
    ),
    boundary={0: (*comp(r), *comp(tg - n)), 1: (*comp(f + F * tg), *comp(m))},
    base_state={r: s * n, tg: n, f: -F * n, m: zeros(3, 1)},
    rotation_axis=ax,
    normalisation=(r, 1),
)
