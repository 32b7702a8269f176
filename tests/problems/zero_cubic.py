from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
m = Symbol("m")
x = field("x", t)
problem = Problem(
    name="zc",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(x,),
    equations=(x.diff(t) - m * x + x**5,),
    base_state={x: 0},
    normalisation=(x, None),
)
