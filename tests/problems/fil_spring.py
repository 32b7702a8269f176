from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

F = Symbol("F", positive=True)
axis = Matrix([0,0,1])
n = axis/sqrt(axis.dot(axis))

r, tangent, force, moment = (vector_field(k, s, t) for k in ("r","t","F","M"))
velocity = r.diff(t)
problem = Problem(name="fil_spring", space=s, interval=(0,1), time=t, control=F, control_range=(0,60),
  fields=(r, tangent, force, moment),
  equations=(r.diff(s)-tangent, force.diff(s) - (velocity - tangent*tangent.dot(velocity)/2) - (0*tangent), moment.diff(s)+tangent.cross(force), moment - tangent.cross(tangent.diff(s)), tangent.dot(tangent)-1 ),
  boundary={(0,1)[0]: (r, moment - 50*n.cross(tangent)) , (0,1)[1]: (force + F*tangent, moment)},
  base_state={r: s*n, tangent: n, force: -F*n, moment: 0*n}, rotation_axis=axis, normalisation=(r,1),  )
