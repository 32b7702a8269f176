from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t, m = symbols("s t m", real=True)
x,y,z=(field(n,t) for n in "xyz")
u,v,w=(field(n,s,t) for n in "uvw")
r=vector_field("r",t)
n=Matrix([0,0,1])

problem=Problem(name="bc_tds",space=s,interval=(0,1),time=t,control=m,control_range=(0,5),fields=(u,),equations=(u.diff(t)-u.diff(s,2)+u**3,),boundary={(0,1)[0]:(u,),(0,1)[1]:(u.diff(s,t)+u.diff(s)-m*u+u**2*u.diff(s,t),)},base_state={u:0},normalisation=(u,1))
