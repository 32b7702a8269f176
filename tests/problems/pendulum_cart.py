from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# follower pendulum: constraint
c = Symbol("c")
x, z, T = (field(n, t) for n in ("x", "z", "T"))
problem = Problem(
    name="pend",
    time=t,
    control=c,
    control_range=(-1, 1),
    fields=(x, z, T),
    equations=(
        x.diff(t, 2) - c * x.diff(t) + x.diff(t) * x**2 + T * x,
        z.diff(t, 2) - c * z.diff(t) + x**2 * z.diff(t) + T * z + 1,
        x**2 + z**2 - 1,
    ),
    base_state={x: 0, z: -1, T: 1},
    normalisation=(x, None),
)
