from sympy import *
from derive import Problem, field, vector_field, epsilon

s, t = symbols("s t", real=True)
# every name clashes
A, mu, omega, phi, eps = symbols("A mu omega phi epsilon")
x, y = (field(k, t) for k in ("s", "lam"))
problem = Problem(
    name="clash",
    time=t,
    control=A,
    control_range=(-1, 1),
    fields=(x, y),
    equations=(
        x.diff(t) - A * x + omega * y + mu * x * (x**2 + y**2),
        y.diff(t) - A * y - omega * x + mu * y * (x**2 + y**2) + phi * x**2 * eps,
    ),
    parameters={mu: 1, omega: 3, phi: 0, eps: 5},
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
