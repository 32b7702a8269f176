from sympy import Rational, symbols

from derive import Problem, field

t, F = symbols("t F", real=True)
# two oscillators under a circulatory load: their frequencies meet at F = 1/2, close below the threshold that light damping sets
x, y = field("x", t), field("y", t)
damping = Rational(1, 100)
problem = Problem(
    name="near_defect",
    time=t,
    control=F,
    control_range=(0, 1),
    fields=(x, y),
    equations=(
        x.diff(t, 2) + damping * x.diff(t) + x + F * y + x**3,
        y.diff(t, 2) + damping * y.diff(t) + 2 * y - F * x + y.diff(t) ** 3,
    ),
    base_state={x: 0, y: 0},
    normalisation=(x, None),
)
