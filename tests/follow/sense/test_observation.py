"""Directions, as the scan, the critics and the tracker compare them."""

import numpy as np

from limo_hog.follow.sense.observation import turn_between


def test_a_turn_is_the_angle_between_two_directions_however_often_they_go_round() -> None:
    some, others = np.meshgrid(np.linspace(-20.0, 20.0, 81), np.linspace(-7.0, 7.0, 29))
    between = np.abs(np.angle(np.exp(1j * (some - others))))
    np.testing.assert_allclose(turn_between(some, others), between, atol=1e-12)
