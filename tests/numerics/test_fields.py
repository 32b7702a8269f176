"""The reconstructed fields, inserted into the rows as the user wrote them, leave what the next order leaves.

Nothing of the derivation is used but the fields themselves: space derivatives by Chebyshev polynomials, time derivatives of
A(t) e^{i omega t} by the amplitude equation's own motion, rows from the statement in Cartesian components.
"""

import numpy as np
import pytest
from conftest import PROBLEMS, derivation_of, result_of
from numpy.polynomial import chebyshev
from sympy import lambdify

from numerics.motion import Scene, fast_phase, motion_of, shapes_of

NODES = 33


def residual(target, initial, mu, order):
    """Return the largest residual of every row, equation and boundary, in one number."""
    derivation = derivation_of(target)
    formulation, problem = derivation.problem.formulation, derivation.problem
    text = derivation.emit()
    spatial = formulation.interval is not None
    left, right = (float(end) for end in formulation.interval) if spatial else (0.0, 1.0)
    places = left + (right - left) * (1 - np.cos(np.pi * np.arange(NODES) / (NODES - 1))) / 2
    result = result_of(target, 20)
    omega = float(result.threshold.frequency or 0)
    period = 2 * np.pi / omega if omega else 1.0
    step = period / 400 if omega else 0.02 / abs(mu)
    centre = 0.3 * period
    times = centre + step * np.arange(-4, 5)
    motion, _ = motion_of(text, Scene(initial=initial, mu=mu, until=float(times[-1])))
    shapes = shapes_of(text, result, mu, order, places)
    fields = shapes.at(motion.amplitude(times), fast_phase(result.threshold.frequency, times))
    # eighth-order central differences in time
    weights = {0: np.eye(9)[4], 1: np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840 / step,
               2: np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040 / step**2}
    unit = 2 * (places - left) / (right - left) - 1

    def jets(unknown, ds, dt):
        name, component = formulation.unknowns[unknown].latex, formulation.unknowns[unknown].component
        value = fields[name]
        if component in ("p", "m", "n"):
            e1, e2, normal = (np.array([float(entry) for entry in vector]) for vector in formulation.frame)
            value = value @ {"p": e1 + 1j * e2, "m": e1 - 1j * e2, "n": normal}[component]
        elif component:
            value = value[..., "xyz".index(component)]
        value = np.tensordot(weights[dt], value, axes=1)
        if spatial:
            series = chebyshev.chebfit(unit, value, NODES - 1)
            value = chebyshev.chebval(unit, chebyshev.chebder(series, ds)) * (2 / (right - left)) ** ds if ds else value
        return value

    keys = list(formulation.jets)
    table = {key: jets(*key) for key in keys}
    control = float(result.threshold.control) + mu
    arguments = (formulation.space, formulation.control, *(formulation.jets[key] for key in keys))
    worst = 0.0
    groups = [(rows, slice(None)) for rows in formulation.rows]
    groups += [(rows, 0 if place == formulation.interval[0] else -1) for place, equations in formulation.boundary for rows in equations] if spatial else []
    for rows, where in groups:
        for row in rows:
            function = lambdify(arguments, row.expression.subs({formulation.weak: 0}).subs(dict(formulation.parameters)), "numpy")
            worst = max(worst, float(np.abs(function(places[where], control, *(table[key][where] for key in keys))).max()))
    assert problem.name == shapes.problem
    return worst


def slope(target, shape, mu, order, factor):
    """Return the measured power of mu of the residual, with amplitudes of size mu^(1/2)."""
    values = [residual(target, tuple(complex(one) * np.sqrt(abs(m)) for one in shape), m, order) for m in (mu, mu / factor)]
    return np.log(values[0] / values[1]) / np.log(factor)


CASES = [
    ("follower_force", (0.05, 0.03j), 1e-2), ("pend_sph", (0.3, 0.1j), 1e-2),
]
LONG = [
    ("follower_force", (0.05, 0.02 + 0.01j), -1e-2),
    ("cont_ctrl", (0.5,), 1e-2),
    ("brus_pde", (0.4,), 1e-2), ("buckle3d", (0.5, 0.2), 1e-2),
    ("follower_force_planar", (0.06 + 0.01j,), 1e-2), ("ff_gravity", (0.05 + 0.03j,), 1e-2), ("tipmass", (0.03,), 1e-2), ("basedep", (0.5,), 1e-2),
    ("brusselator_ode", (0.4,), 1e-2), ("varcoef", (0.4,), 1e-2), ("vec_pitch", (0.6, 0.2), 1e-2),
]


@pytest.mark.parametrize(("name", "shape", "mu"), [*CASES, *(pytest.param(*case, marks=pytest.mark.slow) for case in LONG)])
def test_the_residual_falls_as_the_order_says(name, shape, mu):
    target = name if name.startswith("follower") else str(PROBLEMS / f"{name}.py")
    assert slope(target, shape, mu, "1/2", 4) > 0.97
    assert slope(target, shape, mu, "1", 4) > 1.46
