from sympy import Rational, cos, sin, symbols

from derive import Problem, field

s, t, P = symbols("s t P", real=True)
th, y, S = field("th", s, t), field("y", s, t), field("S", s, t)
# clamped strut: S holds the constraint that the ends do not shift sideways, and vanishes on the branch
problem = Problem(name="strut", space=s, interval=(0, 1), time=t, control=P, control_range=(0, 60), fields=(th, y, S),
    equations=(th.diff(t) - th.diff(s, 2) - P*sin(th) - S*cos(th), y.diff(s) - sin(th), S.diff(s)),
    boundary={0: (th, y), 1: (th, y)}, base_state={th: 0, y: 0, S: 0}, normalisation=(y, Rational(1, 2)))
