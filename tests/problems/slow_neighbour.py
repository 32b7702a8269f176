from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

c = Symbol("c", real=True)
k, e, nu = symbols("k e nu", positive=True)
x, z = field("x", t), field("z", t)
problem = Problem(name="slow_neighbour", time=t, control=c, control_range=(-1, 1), fields=(x, z),
  equations=(x.diff(t, 2) - c * x.diff(t) + k * x + e * x**3 + x**2 * x.diff(t) * nu + z * x, z.diff(t) + z * Rational(1, 1000) - x**2),
  base_state={x: 0, z: 0}, parameters={k: 1000003, e: Rational(1, 1000000), nu: Rational(7, 300)}, normalisation=(x, None))
