"""Where the robot was, or will be, at an instant between two odometry readings."""

import math

import pytest

from limo_hog.follow.sense.observation import Odometry, pose_at


@pytest.mark.parametrize("yaw", [0.0, 0.6, 2.0, -2.5])
def test_after_the_last_reading_the_speeds_last(yaw: float) -> None:
    last = Odometry(10.0, 1.0, -2.0, yaw, linear=0.5, angular=0.3)
    found = pose_at((Odometry(9.0), last), 10.4)
    assert (found.x, found.y) == pytest.approx((1.0 + 0.2 * math.cos(yaw), -2.0 + 0.2 * math.sin(yaw)))
    assert found.yaw == pytest.approx(yaw + 0.12)
    assert found.stamp == 10.4
    assert (found.linear, found.angular) == (0.5, 0.3)


def test_between_two_readings_the_pose_is_between_them_the_short_way_round() -> None:
    found = pose_at((Odometry(1.0, 0.0, 4.0, 3.0, 0.2, 1.0), Odometry(2.0, 2.0, 0.0, -3.0, 0.6, -1.0)), 1.25)
    assert (found.linear, found.angular) == pytest.approx((0.3, 0.5))
    assert (found.x, found.y) == pytest.approx((0.5, 3.0))
    assert found.yaw == pytest.approx(3.0 + 0.25 * (math.tau - 6.0))


def test_before_the_first_reading_the_robot_stood() -> None:
    found = pose_at((Odometry(1.0, 0.5, 4.0, 3.0, 0.5, 0.2), Odometry(2.0)), 0.2)
    assert (found.x, found.y, found.yaw, found.stamp) == (0.5, 4.0, 3.0, 0.2)
