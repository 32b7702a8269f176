from sympy import symbols

from derive import Problem, field

s, t, m = symbols("s t m", real=True)
# a cycle of frequency 2 and radius sqrt(m), uniform in space, and a second pair with the exponents 2 m - 1 +- 5 i / 2 on it: at m = 1/2 it turns into a torus
x, y, u, v = (field(name, s, t) for name in "xyuv")
square = x**2 + y**2
problem = Problem(
    name="torus",
    space=s,
    interval=(0, 1),
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(x, y, u, v),
    equations=(
        x.diff(t) - x.diff(s, 2) - m * x + 2 * y + square * x,
        y.diff(t) - y.diff(s, 2) - m * y - 2 * x + square * y,
        u.diff(t) - u.diff(s, 2) - (2 * square - 1) * u + 5 * v / 2 + u**3,
        v.diff(t) - v.diff(s, 2) - (2 * square - 1) * v - 5 * u / 2 + v**3,
    ),
    boundary={0: (x.diff(s), y.diff(s), u.diff(s), v.diff(s)), 1: (x.diff(s), y.diff(s), u.diff(s), v.diff(s))},
    base_state={x: 0, y: 0, u: 0, v: 0},
    normalisation=(x, 0),
)
