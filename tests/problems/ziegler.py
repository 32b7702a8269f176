from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

P=Symbol("P")
a,b=field("a",t),field("b",t)
problem=Problem(name="zg",time=t,control=P,control_range=(0,5),fields=(a,b),
 equations=(3*a.diff(t,2)+b.diff(t,2)*cos(a-b)+b.diff(t)**2*sin(a-b)+Rational(1,10)*(2*a.diff(t)-b.diff(t))+2*a-b-P*sin(a-b),
            b.diff(t,2)+a.diff(t,2)*cos(a-b)-a.diff(t)**2*sin(a-b)+Rational(1,10)*(b.diff(t)-a.diff(t))+b-a),
 base_state={a:0,b:0},normalisation=(a,None))
