from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
c = Symbol("c")
u = field("u", s, t)
problem = Problem(
    name="basedep",
    space=s,
    interval=(0, pi),
    time=t,
    control=c,
    control_range=(0, 2),
    fields=(u,),
    equations=(
        u.diff(t) - (u - c * s).diff(s, 2) - u * (u - c * s) + c * s * 0 + (u - c * s) ** 3 + (u - c * s) ** 2,
    ),
    boundary={0: (u,), pi: (u - c * pi,)},
    base_state={u: c * s},
    normalisation=(u, pi / 2),
)
