from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
r = Symbol("r")
x, y, z = (field(n, t) for n in "xyz")
sg, b = symbols("sigma beta")
q = sqrt(b * (r - 1))
problem = Problem(
    name="lorenz_hopf",
    time=t,
    control=r,
    control_range=(2, 40),
    fields=(x, y, z),
    equations=(x.diff(t) - sg * (y - x), y.diff(t) - (r * x - y - x * z), z.diff(t) - (x * y - b * z)),
    base_state={x: q, y: q, z: r - 1},
    parameters={sg: 10, b: Rational(8, 3)},
    normalisation=(x, None),
)
