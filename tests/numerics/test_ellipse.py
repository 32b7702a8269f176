"""The ellipse against the orbit itself, sampled, and against the paper's invariants (label axes)."""

import numpy as np
import pytest

from numerics.ellipse import cartesian_components, circular_components, ellipse_of

ANGLES = 2 * np.pi * np.arange(20000) / 20000
RANDOM = [tuple(vector) for vector in np.random.default_rng(7).normal(size=(6, 2)) + 1j * np.random.default_rng(8).normal(size=(6, 2))]


def orbit_of(amplitude):
    return 2 * np.real(np.array(amplitude)[:, None] * np.exp(1j * ANGLES))


@pytest.mark.parametrize("amplitude", RANDOM)
def test_axes_orientation_sense_area_and_phase_are_those_of_the_orbit(amplitude):
    ellipse, (x, y) = ellipse_of(amplitude), orbit_of(amplitude)
    radius = np.hypot(x, y)
    assert abs(ellipse.semi_major - radius.max()) < 1e-5 and abs(ellipse.semi_minor - radius.min()) < 1e-5
    far = int(radius.argmax())
    assert abs(np.sin(ellipse.orientation - np.arctan2(y[far], x[far]))) < 1e-3
    swept = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2
    assert np.sign(swept) == ellipse.sense and abs(abs(swept) - ellipse.area) < 1e-6
    assert abs(np.sin(ellipse.phase - ANGLES[far])) < 1e-3


@pytest.mark.parametrize("amplitude", RANDOM)
def test_the_formulae_of_the_paper_hold(amplitude):
    vector = np.array(amplitude)
    size, cross = np.sum(np.abs(vector) ** 2), vector[0] * np.conj(vector[1]) - vector[1] * np.conj(vector[0])
    ellipse = ellipse_of(vector)
    axes = np.sqrt(size + abs(cross)), np.sqrt(size - abs(cross))
    assert ellipse.semi_major == pytest.approx(axes[0] + axes[1], rel=1e-12)
    assert ellipse.semi_minor == pytest.approx(axes[0] - axes[1], rel=1e-12)
    assert ellipse.area == pytest.approx(2 * np.pi * abs(cross), rel=1e-12)
    assert ellipse.sense == np.sign(cross.imag)
    major = (vector / np.sqrt(np.sum(vector * vector))).real
    assert abs(np.sin(ellipse.orientation - np.arctan2(major[1], major[0]))) < 1e-12


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.9])
@pytest.mark.parametrize("phase", [1, np.exp(0.7j)])
def test_a_line_is_a_line(angle, phase):
    ellipse = ellipse_of(np.array([np.cos(angle), np.sin(angle)]) * 0.1 * phase)
    assert ellipse.semi_major == pytest.approx(0.2, rel=1e-15) and ellipse.semi_minor == 0 and ellipse.sense == 0
    assert ellipse.orientation == pytest.approx(angle, abs=1e-15)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("phase", [1, np.exp(0.7j)])
def test_a_circle_is_a_circle(sense, phase):
    ellipse = ellipse_of(np.array([1, -1j * sense]) * phase)
    assert ellipse.semi_major == ellipse.semi_minor == pytest.approx(2, rel=1e-15)
    assert ellipse.sense == sense and ellipse.orientation == 0


def test_a_thin_ellipse_keeps_its_digits():
    ellipse = ellipse_of((0.3, 1e-30j))
    assert ellipse.semi_minor == pytest.approx(2e-30, rel=1e-12) and ellipse.sense == -1


def test_no_motion_and_many_amplitudes_at_once():
    ellipse = ellipse_of(np.zeros((3, 2)))
    assert not ellipse.semi_major.any() and not ellipse.sense.any() and not ellipse.orientation.any() and not ellipse.area.any()
    many = ellipse_of(np.array(RANDOM))
    assert many.semi_minor.shape == (6,) and many.semi_minor[2] == ellipse_of(RANDOM[2]).semi_minor


def test_circular_components_go_back_and_forth():
    assert np.allclose(cartesian_components(*circular_components(np.array(RANDOM))), np.array(RANDOM), rtol=0, atol=1e-15)
