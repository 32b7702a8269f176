from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
U = Symbol("U")
u = field("u", s, t)
problem = Problem(
    name="pipe",
    space=s,
    interval=(0, 1),
    time=t,
    control=U,
    control_range=(0, 12),
    fields=(u,),
    equations=(
        u.diff(s, 4)
        + U**2 * u.diff(s, 2)
        + 2 * sqrt(Rational(1, 5)) * U * u.diff(s).diff(t)
        + u.diff(t, 2)
        + u.diff(t) / 10
        + u.diff(s) ** 2 * u.diff(s, 2),
    ),
    boundary={0: (u, u.diff(s)), 1: (u.diff(s, 2), u.diff(s, 3))},
    base_state={u: 0},
    normalisation=(u, 1),
)
