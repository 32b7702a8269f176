from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t = symbols("s t", real=True)

U,beta,mu=symbols("U beta mu")
y=field("y",s,t)
problem=Problem(name="pp",space=s,interval=(0,1),time=t,control=U,control_range=(0,12),fields=(y,),
 equations=(y.diff(t,2)+2*sqrt(beta)*U*y.diff(s,t)+U**2*y.diff(s,2)+y.diff(s,4)+y.diff(s,4)*y.diff(s)**2+4*y.diff(s)*y.diff(s,2)*y.diff(s,3)+y.diff(s,2)**3 + y.diff(t)/10,),
 boundary={0:(y,y.diff(s)),1:(y.diff(s,2),y.diff(s,3)-mu*y.diff(t,2)-mu*y.diff(t)*y**2)},parameters={beta:Rational(1,5),mu:Rational(3,10)},base_state={y:0},normalisation=(y,1))
