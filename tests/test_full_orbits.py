"""Orbits by collocation in time against harmonic balance, and orders of the residual."""

import numpy as np
import pytest
from conftest import PROBLEMS, derivation_of, result_of

from derive import load_problem
from derive.residual import emit_residual
from numerics import full_orders
from numerics.full import measured_points, solve_state
from numerics.full_orbit import radau
from numerics.full_orders import residual_orders
from numerics.full_rows import Rows
from numerics.full_stability import Class, agreed, settled_exponents
from numerics.full_states import Branch, Full


def local(name):
    return str(PROBLEMS / f"{name}.py")


def full_of(target):
    return Full(rows=Rows(emit_residual(load_problem(target))), result=result_of(target))


def test_the_points_of_radau_integrate_polynomials_of_degree_six():
    c, matrix = radau(4)
    assert all(abs(matrix[-1] @ c**power - 1 / (power + 1)) < 1e-13 for power in range(7))


@pytest.mark.parametrize(("name", "mu"), [("brus_pde", 0.02), ("tipmass", 0.05)])
def test_an_orbit_by_collocation_is_that_of_harmonic_balance(name, mu):
    """The second problem has second derivatives in time, at the boundary too."""
    target = local(name)
    found = solve_state(emit_residual(load_problem(target)), result_of(target), "cycle", mu, 1e-8)
    branch = Branch(full_of(target), "cycle")
    other, _ = branch.refined(branch.start(mu), 1e-8)
    assert abs(found.peak - branch.peak(other)) < 3e-8 * found.peak and abs(found.frequency - other.omega) < 3e-8 * found.frequency
    exponents, _ = settled_exponents(branch, other)
    one, two = (next(one.value for one in group if not one.neutral) for group in (found.exponents, exponents))
    assert abs(one - two) < 1e-5 * found.frequency


@pytest.mark.slow
def test_beating_far_from_onset_is_that_of_the_planar_formulation():
    """The planar cycle knows of no half-turn, no parity and no axis."""
    states = [solve_state(emit_residual(load_problem(target)), result_of(target), state, 20.0, 1e-6) for target, state in (("follower_force", "beating"), ("follower_force_planar", "cycle"))]
    assert abs(states[0].peak - states[1].peak) < 2e-6 and abs(states[0].frequency - states[1].frequency) < 1e-3


@pytest.mark.parametrize("target", ["van_der_pol", local("vec_pitch"), local("fisher"), "follower_force"])
def test_the_residual_of_the_expansion_falls_as_derived(target):
    full = full_of(target)
    orders = residual_orders(full, derivation_of(target).emit(), 1e-3 * max(abs(full.threshold), 1.0))
    assert all(one.agrees for one in orders)
    if target == "follower_force":
        assert [one.measured for one in orders] == pytest.approx([1.0, 1.5], abs=0.02)


def test_missing_responses_show_in_the_order_of_the_residual(monkeypatch):
    shapes_of = full_orders.shapes_of
    monkeypatch.setattr(full_orders, "shapes_of", lambda emitted, result, mu, order, places: shapes_of(emitted, result, mu, "1/2", places))
    target = local("vec_pitch")
    orders = residual_orders(full_of(target), derivation_of(target).emit(), 1e-3)
    assert [one.agrees for one in orders] == [True, False]


def test_a_growing_exponent_found_by_one_resolution_only_is_not_missed():
    fine, coarse = ([Class(kind="", values=np.array(values, dtype=complex), errors=np.zeros(len(values)))] for values in ([-1.0], [2.0, -1.0]))
    assert agreed(fine, coarse, 1.0)[1] == np.inf and agreed(coarse, fine, 1.0)[1] == np.inf
    assert agreed(fine, fine, 1.0)[1] == 0.0


def test_the_leading_exponent_is_not_dropped_where_the_coarser_resolution_misses_it():
    fine, coarse = ([Class(kind="", values=np.array(values, dtype=complex), errors=np.zeros(len(values)))] for values in ([0.0, -1.0, -7.0], [0.0, -7.0]))
    assert agreed(fine, coarse, 1.0)[1] >= 1


def test_points_for_the_diagram_lie_on_the_branch():
    target = local("fisher")
    points = measured_points(emit_residual(load_problem(target)), result_of(target), 0.1, 1)
    controls, peaks = points["branch"]
    assert len(controls) == 2
    branch = Branch(full_of(target), "branch")
    assert peaks[1] == pytest.approx(branch.peak(branch.refined(branch.start(0.1), 1e-10)[0]), rel=1e-4)
