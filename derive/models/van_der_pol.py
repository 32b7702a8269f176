"""Van der Pol's oscillator: the textbook Hopf bifurcation, dA/dt = mu A/2 - |A|^2 A/2."""

from sympy import Symbol

from derive import Problem, field

t = Symbol("t", real=True)
mu = Symbol("mu", real=True)
x = field("x", t)

problem = Problem(
    name="van_der_pol",
    time=t,
    control=mu, control_range=(-1, 1),
    fields=(x,),
    equations=(x.diff(t, 2) - (mu - x**2) * x.diff(t) + x,),
    base_state={x: 0},
    normalisation=(x, None),
)
