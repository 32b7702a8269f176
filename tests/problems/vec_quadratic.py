from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

m = Symbol("m", real=True)
r = vector_field("r", s, t)
K = Matrix([[m, 2, 0], [-3, -1, 1], [0, 1, -2]])
problem = Problem(name="vec_quadratic", space=s, interval=(0, 1), time=t, control=m, control_range=(0, 40), fields=(r,),
  equations=(r.diff(t) - r.diff(s, 2) - K * r + Matrix([r[0]**3, r[1] * r[0], r[2]**2 + r[0]**2]),),
  boundary={0: (r,), 1: (r[0], r[1].diff(s), r[2].diff(s) + r[2])}, base_state={r: zeros(3, 1)}, normalisation=(r[1], Rational(1, 2)))
