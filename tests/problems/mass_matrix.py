from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t, m = symbols("s t m", real=True)
x,y,z=(field(n,t) for n in "xyz")
u,v,w=(field(n,s,t) for n in "uvw")
r=vector_field("r",t)
n=Matrix([0,0,1])

problem=Problem(name="mass_matrix",time=t,control=m,control_range=(-1,1),fields=(x,y,),equations=((2+x)*x.diff(t)+y.diff(t)*(1+y**2)-m*x+y, x.diff(t)+3*y.diff(t)-m*y-x,),base_state={x:0,y:0},normalisation=(x,None))
