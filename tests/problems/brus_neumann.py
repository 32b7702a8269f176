from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
B = Symbol("B", positive=True)
x, y = (field(n, s, t) for n in "xy")
problem = Problem(
    name="bneu",
    space=s,
    interval=(0, 1),
    time=t,
    control=B,
    control_range=(1, 5),
    fields=(x, y),
    equations=(
        x.diff(t) - x.diff(s, 2) - (1 + x**2 * y - (B + 1) * x),
        y.diff(t) - y.diff(s, 2) - (B * x - x**2 * y),
    ),
    boundary={0: (x.diff(s), y.diff(s)), 1: (x.diff(s), y.diff(s))},
    base_state={x: 1, y: B},
    normalisation=(x, 0),
)
