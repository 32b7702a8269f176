"""Identities that a derivation must meet, whatever the problem."""

import numpy as np
import pytest
from conftest import derivation_of, result_of
from sympy import Integer

from derive.adjoint import adjoint_of
from derive.onset import Spectrum
from derive.operator import LAMBDA, BoundaryRows, FirstOrderOperator
from derive.problem import bundled_names
from derive.response import reduced


@pytest.mark.parametrize("name", bundled_names())
def test_the_linear_coefficient_is_the_eigenvalue_derivative(name):
    """gamma = d lambda / d control, by central differences of the discretised spectrum: nothing of the adjoint is used."""
    derivation, result = derivation_of(name), result_of(name)
    expansion = derivation.expansion
    spectrum = Spectrum({weight: reduced(expansion, weight, LAMBDA) for weight in expansion.weights}, expansion.formulation)
    threshold = float(result.threshold.control)
    h = 1e-4 * max(1.0, abs(threshold))

    def critical(control):
        values = [value for value, _ in spectrum.rightmost(control)]
        return max(values, key=lambda z: (round(z.real, 6), z.imag))

    measured = (critical(threshold + h) - critical(threshold - h)) / (2 * h)
    gamma = complex(next(one.value for one in result.coefficients if one.monomial == "mu*A"))
    assert abs(measured - gamma) < 1e-6 * max(1.0, abs(gamma))


@pytest.mark.parametrize("name", ["follower_force", "follower_force_planar", "swift_hohenberg"])
def test_adjoint_of_adjoint_is_the_operator(name):
    operator = derivation_of(name).reduction.mode.operator
    adjoint = adjoint_of(operator)

    def rows(lines):
        pivots = tuple(next(j for j in range(len(line)) if line[j] == 1 and all(other[j] == 0 for other in lines if other is not line)) for line in lines)
        return BoundaryRows(matrix=lines, pivots=pivots, forcing=({},) * len(lines), spare=())

    again = adjoint_of(FirstOrderOperator(
        matrix=adjoint.matrix, forcing=({},) * adjoint.size, recovery={}, left=rows(adjoint.left), right=rows(adjoint.right), spare=(), names=operator.names, scalar=False))
    assert again.matrix == operator.matrix
    for mine, theirs in ((again.left, operator.left.matrix), (again.right, operator.right.matrix)):
        together = np.array([[complex(entry.subs({s: 1.3 for s in entry.free_symbols})) if hasattr(entry, "subs") else entry for entry in row] for row in (*mine, *theirs)])
        assert np.linalg.matrix_rank(together) == len(mine) == len(theirs)


@pytest.mark.parametrize("name", ["follower_force", "follower_force_planar", "swift_hohenberg"])
def test_the_boundary_form_vanishes_on_direct_and_adjoint_rows(name):
    operator = derivation_of(name).reduction.mode.operator
    adjoint = adjoint_of(operator)
    for rows, adjoint_rows in ((operator.left.matrix, adjoint.left), (operator.right.matrix, adjoint.right)):
        for row in rows:
            for other in adjoint_rows:
                assert sum((a * b for a, b in zip(row, other, strict=True)), Integer(0)).expand() == 0
        assert len(rows) + len(adjoint_rows) == operator.size


def test_only_the_fields_that_are_coupled_or_driven_are_solved_for():
    """The planar filament: its mode is one scalar function of fourth order, its mean and double-frequency responses are quadratures."""
    reduction = derivation_of("follower_force_planar").reduction
    assert reduction.mode.operator.scalar and reduction.mode.operator.size == 4
    assert all(response.explicit is not None and len(response.states) == 2 for response in reduction.responses)
