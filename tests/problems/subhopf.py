from sympy import symbols

from derive import Problem, field

s, t, m = symbols("s t m", real=True)
u, v = field("u", s, t), field("v", s, t)
# subcritical: the unstable cycle turns at a fold and becomes stable
q = u**2 + v**2
problem = Problem(name="subhopf", space=s, interval=(0, 2), time=t, control=m, control_range=(0, 6), fields=(u, v),
    equations=(u.diff(t) - u.diff(s, 2) - (m + s/2) * u + 2*v - q*u + q**2*u,
               v.diff(t) - v.diff(s, 2) - (m + s/2) * v - 2*u - q*v + q**2*v),
    boundary={0: (u, v), 2: (u, v)}, base_state={u: 0, v: 0}, normalisation=(u, 1))
