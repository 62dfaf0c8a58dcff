"""A robot that lacks or loses a sense stands, in `followable` with two walls; the long form is in `tests/hardening`."""

from __future__ import annotations

import pytest
from tests.hardening.lost_senses import Ride, Row, judged


@pytest.mark.parametrize(
    "row",
    [
        Row(3, ("scan",), 0.0),
        Row(0, ("depth", "camera_info"), 0.0),
        Row(1, ("scan", "odometry"), 2.0),
        Row(2, ("depth",), 2.0),
        Row(0, ("camera",), 2.0, "odometry", 100.0),
        Row(1, ("scan",), 2.0, "camera", -0.3),
    ],
    ids=str,
)
def test_without_a_sense_the_robot_stands_and_says_which(row: Row) -> None:
    ride = Ride(row.seed, row.shifted, row.shift)
    ride.until(row.at)
    assert judged(ride, row).wrong == []
