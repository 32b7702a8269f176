from sympy import Matrix, symbols, zeros

from derive import Problem, vector_field

t, m = symbols("t m", real=True)
axis = Matrix([0, 0, 1])
# A = p + i q, A' = (m + 3 i) A - |A|^2 A + (|A|^2 - 1) (A.A) conj(A) / 2 across the axis. Beating of peak a has m = 3 a^2 / 2 - a^4 / 2 and,
# out of plane, the exponent (1 - a^2) a^2; whirling has |A|^2 = m, A.A = 0 and, for the other sense, the exponent m (m - 1) + 6 i
p, q = vector_field("p", t), vector_field("q", t)
square = p.dot(p) + q.dot(q)
real, imaginary = p.dot(p) - q.dot(q), 2 * p.dot(q)
turn = (square - 1) / 2


def across(vector):
    return vector - axis * axis.dot(vector)


problem = Problem(
    name="exchange",
    time=t,
    control=m,
    control_range=(-1, 1),
    fields=(p, q),
    equations=(
        p.diff(t) - m * p + 3 * across(q) + square * p - turn * (real * across(p) + imaginary * across(q)) + 2 * axis * axis.dot(p),
        q.diff(t) - m * q - 3 * across(p) + square * q - turn * (imaginary * across(p) - real * across(q)) + 2 * axis * axis.dot(q),
    ),
    base_state={p: zeros(3, 1), q: zeros(3, 1)},
    rotation_axis=axis,
    normalisation=(p, None),
)
