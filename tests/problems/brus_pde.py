from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
B = Symbol("B", positive=True)
x, y = (field(n, s, t) for n in "xy")
Dx, Dy = symbols("D_x D_y")
problem = Problem(
    name="bpde",
    space=s,
    interval=(0, 1),
    time=t,
    control=B,
    control_range=(1, 5),
    fields=(x, y),
    equations=(
        x.diff(t) - Dx * x.diff(s, 2) - (1 + x**2 * y - (B + 1) * x),
        y.diff(t) - Dy * y.diff(s, 2) - (B * x - x**2 * y),
    ),
    boundary={0: (x - 1, y - B), 1: (x - 1, y - B)},
    parameters={Dx: Rational(1, 20), Dy: Rational(1, 30)},
    base_state={x: 1, y: B},
    normalisation=(x, Rational(1, 2)),
)
