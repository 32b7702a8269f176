from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c, k = symbols("c k")
x, y = (field(q, t) for q in "xy")
problem = Problem(
    name="sc2",
    time=t,
    control=c,
    control_range=(-Rational(1, 10**11), Rational(1, 10**11)),
    fields=(x, y),
    equations=(x.diff(t) - c * x + k * y + x**3 * k, y.diff(t) - k * x - c * y),
    parameters={k: Rational(1, 10**12)},
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
