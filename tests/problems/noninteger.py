from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# exp and sqrt nonlinearity
c = Symbol("c")
x, y = (field(q, t) for q in "xy")
problem = Problem(
    name="nl",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(x, y),
    equations=(x.diff(t) - c * x + (exp(y) - 1) * sqrt(1 + x), y.diff(t) - x * cosh(y) - log(1 + x**2)),
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
