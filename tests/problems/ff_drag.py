from sympy import *
from derive import Problem, vector_field

s, t = symbols("s t", real=True)
# follower-force filament: drag anisotropy delta (1/2: slender body), a share kappa of the load at the tip follows it, the rest keeps its direction
F, delta, kappa = symbols("F delta kappa", positive=True)
wall_normal = Matrix([0, 0, 1])

r, tangent, force, moment = (vector_field(name, s, t) for name in ("r", "t", "F", "M"))
velocity = r.diff(t)

problem = Problem(
    name="ff_drag",
    space=s,
    interval=(0, 1),
    time=t,
    control=F,
    control_range=(0, 60),
    fields=(r, tangent, force, moment),
    equations=(
        r.diff(s) - tangent,
        force.diff(s) - (velocity - delta * tangent * tangent.dot(velocity)),
        moment.diff(s) + tangent.cross(force),
        moment - tangent.cross(tangent.diff(s)),
        tangent.dot(tangent) - 1,
    ),
    boundary={0: (r, tangent - wall_normal), 1: (force + F * (kappa * tangent + (1 - kappa) * wall_normal), moment)},
    base_state={r: s * wall_normal, tangent: wall_normal, force: -F * wall_normal, moment: 0 * wall_normal},
    parameters={delta: Rational(1, 2), kappa: Rational(9, 10)},
    rotation_axis=wall_normal,
    normalisation=(r, 1),
    coefficient_names={"dot(A,A)*conj(A)": "alpha", "dot(A,conj(A))*A": "beta", "mu*A": "gamma"},
)
