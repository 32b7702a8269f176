"""Follower-force filament in a plane, by tangent angle and internal force: a second formulation of the same physics.

The tangent is (sin theta, cos theta), the moment theta'; position (x, z), force (X, Z), drag I - tt/2. Dimensionless.
"""

from sympy import Symbol, cos, sin, symbols

from derive import Problem, field

s, t = symbols("s t", real=True)
F = Symbol("F", positive=True)

x, z, theta, X, Z = (field(name, s, t) for name in ("x", "z", "theta", "X", "Z"))
along = sin(theta) * x.diff(t) + cos(theta) * z.diff(t)

problem = Problem(
    name="follower_force_planar",
    space=s, interval=(0, 1), time=t,
    control=F, control_range=(0, 60),
    fields=(x, z, theta, X, Z),
    equations=(
        x.diff(s) - sin(theta),
        z.diff(s) - cos(theta),
        X.diff(s) - (x.diff(t) - sin(theta) * along / 2),
        Z.diff(s) - (z.diff(t) - cos(theta) * along / 2),
        theta.diff(s, 2) + cos(theta) * X - sin(theta) * Z,
    ),
    boundary={0: (x, z, theta), 1: (X + F * sin(theta), Z + F * cos(theta), theta.diff(s))},
    base_state={x: 0, z: s, theta: 0, X: 0, Z: -F},
    normalisation=(x, 1),
    coefficient_names={"A**2*conj(A)": "alpha_plus_beta", "mu*A": "gamma"},
)
