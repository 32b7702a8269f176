from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
r = Symbol("r")
x, y, z = (field(n, t) for n in "xyz")
sg, b = symbols("sigma beta")
problem = Problem(
    name="lorenz_pitch",
    time=t,
    control=r,
    control_range=(0, 5),
    fields=(x, y, z),
    equations=(x.diff(t) - sg * (y - x), y.diff(t) - (r * x - y - x * z), z.diff(t) - (x * y - b * z)),
    base_state={x: 0, y: 0, z: 0},
    parameters={sg: 10, b: Rational(8, 3)},
    normalisation=(x, None),
)
