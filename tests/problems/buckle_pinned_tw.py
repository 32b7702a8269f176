from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t, m = symbols("s t m", real=True)
x,y,z=(field(n,t) for n in "xyz")
u,v,w=(field(n,s,t) for n in "uvw")
r=vector_field("r",t)
n=Matrix([0,0,1])

P=Symbol("P")
ax=Matrix([2,-1,2]); k=ax/3
d=vector_field("d",s,t); L=field("L",s,t)
problem=Problem(name="bd",space=s,interval=(0,1),time=t,control=P,control_range=(0,20),fields=(d,L),
 equations=(d.diff(t)-d.diff(s,2)+L*d+P*k+epsilon*Matrix([d[1],0,0])-epsilon*k*(k.dot(Matrix([d[1],0,0]))) - epsilon*Matrix([k[1],0,0])+epsilon*k*k[0]*k[1]*1, d.dot(d)-1),
 boundary={0:(d-k,),1:(d.diff(s),)},base_state={d:k,L:-P},rotation_axis=ax,normalisation=(d,1))
