"""Follower-force filament in three dimensions: onset of beating and whirling.

Section II of O. Schnitzer, "Onset of spontaneous beating and whirling in the follower force model of an active filament":
labels eqs, constraint, bcs wall, bcs tip and base state. Dimensionless.
"""

from sympy import Matrix, Symbol, symbols

from derive import Problem, vector_field

s, t = symbols("s t", real=True)
F = Symbol("F", positive=True)
wall_normal = Matrix([0, 0, 1])

r, tangent, force, moment = (vector_field(name, s, t) for name in ("r", "t", "F", "M"))
velocity = r.diff(t)

problem = Problem(
    name="follower_force",
    space=s, interval=(0, 1), time=t,
    control=F, control_range=(0, 60),
    fields=(r, tangent, force, moment),
    equations=(
        r.diff(s) - tangent,
        force.diff(s) - (velocity - tangent * tangent.dot(velocity) / 2),
        moment.diff(s) + tangent.cross(force),
        moment - tangent.cross(tangent.diff(s)),
        tangent.dot(tangent) - 1,
    ),
    boundary={0: (r, tangent - wall_normal), 1: (force + F * tangent, moment)},
    base_state={r: s * wall_normal, tangent: wall_normal, force: -F * wall_normal, moment: 0 * wall_normal},
    rotation_axis=wall_normal,
    normalisation=(r, 1),
    coefficient_names={"dot(A,A)*conj(A)": "alpha", "dot(A,conj(A))*A": "beta", "mu*A": "gamma"},
)
