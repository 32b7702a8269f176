from sympy import *
from derive import Problem, field, vector_field, epsilon
s, t, m = symbols("s t m", real=True)
x,y,z=(field(n,t) for n in "xyz")
u,v,w=(field(n,s,t) for n in "uvw")
r=vector_field("r",t)
n=Matrix([0,0,1])

problem=Problem(name="turing_brus",space=s,interval=(0,pi),time=t,control=m,control_range=(1,6),fields=(u,v,),equations=(u.diff(t)-u.diff(s,2)/10-2-u**2*v+(m+1)*u, v.diff(t)-v.diff(s,2)-m*u+u**2*v,),boundary={(0,pi)[0]:(u.diff(s),v.diff(s)),(0,pi)[1]:(u.diff(s),v.diff(s))},base_state={u:2,v:m/2},normalisation=(u,0))
