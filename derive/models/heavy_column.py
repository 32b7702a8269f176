"""Self-buckling of a heavy column: a steady onset with coefficients that depend on the place.

A slender column, clamped at the foot and free at the top, bends under its own weight W; angle theta, viscous motion. Dimensionless.
A. G. Greenhill (1881): it buckles at W = (9/4) j^2, j the first zero of the Bessel function J_{-1/3}.
"""

from sympy import Symbol, sin, symbols

from derive import Problem, field

s, t = symbols("s t", real=True)
W = Symbol("W", positive=True)
theta = field("theta", s, t)

problem = Problem(
    name="heavy_column",
    space=s, interval=(0, 1), time=t,
    control=W, control_range=(0, 20),
    fields=(theta,),
    equations=(theta.diff(t) - theta.diff(s, 2) - W * (1 - s) * sin(theta),),
    boundary={0: (theta,), 1: (theta.diff(s),)},
    base_state={theta: 0},
    normalisation=(theta, 1),
)
