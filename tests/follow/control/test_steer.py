"""From an aim to a command: gains, limits, and which mode it is."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from limo_hog.follow import Mode, Twist
from limo_hog.follow.control.steer import Aim, Steering
from limo_hog.follow.robot import LIMO

STEERING = Steering()
#: A person who stands straight ahead at the target distance of 1.5 m from the camera.
THERE = Aim(0.0, 1.5 + LIMO.camera_x, 0.0, 0.0, heading=0.0, hidden=False)


def command(aim: Aim, **other: bool | float) -> tuple[Twist, Mode, str]:
    known = {"confirmed": True, "worth_nearing": False, "in_view": True, "lost_s": 0.0}
    return STEERING.command(aim, 1.5, LIMO, **{**known, **other})  # type: ignore[arg-type]


def at(distance: float, bearing: float = 0.0) -> Aim:
    return replace(THERE, distance=distance + LIMO.camera_x, bearing=bearing, heading=bearing)


def test_a_person_at_the_target_distance_straight_ahead_needs_no_command() -> None:
    assert command(THERE) == (Twist(), Mode.HOLD, "at the target distance")


def test_speed_is_gain_times_error_plus_the_persons_own_speed_within_the_limits() -> None:
    assert command(at(2.0))[0].linear == pytest.approx(0.8 * 0.5)
    assert command(replace(at(2.0), range_rate=0.2))[0].linear == pytest.approx(0.8 * 0.5 + 0.2)
    assert command(at(4.0))[0].linear == 0.7
    assert command(at(0.4))[0].linear == -0.7
    assert command(at(2.0, 0.61))[0].angular == 1.5
    assert command(at(2.0, 2.0))[0].angular == 3.0  # out of the image


def test_the_robot_turns_before_it_drives_to_the_side() -> None:
    assert command(at(2.0, math.pi / 3))[0].linear == pytest.approx(0.8 * 0.5 * 0.25)
    assert command(at(2.0, 2.5))[0].linear == 0


def test_where_no_direction_is_free_it_stands() -> None:
    twist, mode, reason = command(replace(at(3.0), heading=None))
    assert twist.linear == 0
    assert mode is Mode.BLOCKED
    assert reason == "no free way to the person"


def test_a_detour_is_driven_in_its_own_direction() -> None:
    twist, _, reason = command(replace(at(3.0), heading=0.4))
    assert twist.angular == pytest.approx(1.0)
    assert reason == "driving around an obstacle"
    twist, _, reason = command(replace(at(1.0), heading=0.4))
    assert twist.linear < 0 < twist.angular
    assert reason == "backing around an obstacle"


def test_after_coasting_it_turns_and_does_not_drive() -> None:
    assert command(at(3.0, 0.2), in_view=False, lost_s=0.7)[0].linear > 0
    twist, mode, _ = command(at(3.0, 0.2), in_view=False, lost_s=0.9)
    assert (twist.linear, mode) == (0.0, Mode.LOST)
    assert twist.angular == pytest.approx(0.5)


def test_a_possible_person_is_faced_and_driven_to_slowly_where_that_tells() -> None:
    assert command(at(5.0), confirmed=False)[0].linear == 0
    assert command(at(5.0), confirmed=False, worth_nearing=True)[0].linear == 0.35
    assert command(at(1.0), confirmed=False)[0].linear < 0


def test_the_side_is_where_the_person_walks_to_or_else_where_they_are() -> None:
    for rate, side in ((0.049, -1.0), (0.051, 1.0)):
        assert STEERING.side_of(replace(THERE, bearing=-0.2, bearing_rate=rate)) == side
        assert STEERING.side_of(replace(THERE, bearing=0.2, bearing_rate=-rate)) == -side


@pytest.mark.parametrize(
    ("change", "holds", "stands"),
    [
        ({"distance": 1.5 + LIMO.camera_x + 0.07}, True, True),
        ({"distance": 1.5 + LIMO.camera_x - 0.07}, True, True),
        ({"distance": 1.5 + LIMO.camera_x + 0.09}, False, False),
        ({"distance": 1.5 + LIMO.camera_x - 0.09}, False, False),
        ({"range_rate": 0.09}, True, True),
        ({"range_rate": -0.11}, False, False),
        ({"bearing": 0.019}, True, True),
        ({"bearing": -0.021}, True, False),
        ({"bearing_rate": 0.049}, True, True),
        ({"bearing_rate": -0.051}, True, False),
    ],
)
def test_smaller_errors_and_slower_people_are_left_alone(change: dict[str, float], holds: bool, stands: bool) -> None:
    aim = replace(THERE, **change)  # type: ignore[arg-type]
    aim = replace(aim, heading=aim.bearing)
    twist, mode, _ = command(aim)
    assert (mode is Mode.HOLD) == holds
    assert (twist == Twist()) == stands


def test_out_of_the_image_it_turns_faster_and_only_there() -> None:
    half = LIMO.field_of_view / 2
    for bearing, limit in ((half - 0.01, 1.5), (half + 0.6, 3.0), (-half - 0.6, -3.0), (-half + 0.01, -1.5)):
        aim = replace(THERE, distance=3.0, bearing=bearing, heading=bearing)
        twist, _, _ = command(aim)
        assert twist.angular == pytest.approx(limit)
