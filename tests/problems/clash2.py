from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
x_, tau, a = symbols("x tau a")
phi = field("phi", x_, tau)
zeta_1, w_A = symbols("zeta_1 w_A")
problem = Problem(
    name="clash2",
    space=x_,
    interval=(0, pi),
    time=tau,
    control=a,
    control_range=(0, 3),
    fields=(phi,),
    equations=(phi.diff(tau) - phi.diff(x_, 2) - a * zeta_1 * phi + w_A * phi**3,),
    parameters={zeta_1: 1, w_A: Rational(4, 3)},
    boundary={0: (phi,), pi: (phi,)},
    base_state={phi: 0},
    normalisation=(phi, pi / 2),
)
