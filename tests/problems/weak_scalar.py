from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m, d = symbols("mu delta")
x = field("A", t)
problem = Problem(
    name="ws",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(x,),
    equations=(x.diff(t, 2) - (m - x**2) * x.diff(t) + (1 + epsilon * d) * x,),
    parameters={d: Rational(1, 3)},
    base_state={x: 0},
    normalisation=(x, None),
)
