from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c, k = symbols("c k")
x, y = (field(q, t) for q in "xy")
problem = Problem(
    name="sc",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(x, y),
    equations=(x.diff(t) - c * x + k * y + x**3 * k, y.diff(t) - k * x - c * y),
    parameters={k: 10**12},
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
