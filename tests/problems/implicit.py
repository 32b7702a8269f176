from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m = Symbol("m")
x, y = (field(n, t) for n in "xy")
problem = Problem(
    name="imp",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(x, y),
    equations=((1 + x**2) * x.diff(t) - m * x + exp(y) - 1 - x * y, y.diff(t) - sin(x) * cos(y)),
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
