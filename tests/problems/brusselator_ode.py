from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
B = Symbol("B", positive=True)
x, y = (field(n, t) for n in "xy")
problem = Problem(
    name="brus",
    time=t,
    control=B,
    control_range=(1, 3),
    fields=(x, y),
    equations=(x.diff(t) - (1 + x**2 * y - (B + 1) * x), y.diff(t) - (B * x - x**2 * y)),
    base_state={x: 1, y: B},
    normalisation=(x, None),
)
