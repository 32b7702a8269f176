from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

D = Symbol("D", positive=True)
mumax, Ks, Sin, Y = symbols("mumax Ks Sin Y", positive=True)
S, B = field("S", t), field("B", t)
k = Symbol("k")
problem = Problem(name="slow_washout", time=t, control=k, control_range=(-20, 0), fields=(S, B),
  equations=(S.diff(t) + k * (Sin - S) + mumax * S / (Ks + S) * B / Y, B.diff(t) - (mumax * S / (Ks + S) + k) * B),
  base_state={S: Sin, B: 0}, parameters={mumax: Rational(1, 1000000), Ks: Rational(1, 1000000), Sin: Rational(1, 1000000), Y: Rational(3, 7)}, normalisation=(B, None))
