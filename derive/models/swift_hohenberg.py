"""Swift-Hohenberg equation on half a wavelength: a supercritical pitchfork, dA/dt = mu A - (3/4) A^3."""

from sympy import pi, symbols

from derive import Problem, field

s, t, r = symbols("s t r", real=True)
u = field("u", s, t)

problem = Problem(
    name="swift_hohenberg",
    space=s, interval=(0, pi), time=t,
    control=r, control_range=(-1, 1),
    fields=(u,),
    equations=(u.diff(t) - r * u + u + 2 * u.diff(s, 2) + u.diff(s, 4) + u**3,),
    boundary={0: (u, u.diff(s, 2)), pi: (u, u.diff(s, 2))},
    base_state={u: 0},
    normalisation=(u, pi / 2),
)
