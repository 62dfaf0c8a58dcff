"""Giving way: people are predicted, and the robot gets out of their way."""

from __future__ import annotations

import math

import numpy as np

from limo_hog.follow.control.company import Company, Walker
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import NO_POINTS
from limo_hog.follow.twist import Twist

COMPANY, STANDING = Company(), Twist()


def nearest(command: Twist, walker: Walker, seconds: float = 3.0, step: float = 0.02) -> float:
    """Least distance of the centres while the robot drives a command [m], by small steps of its wheels."""
    x = y = yaw = left = right = 0.0
    half, least = LIMO.wheel_separation / 2, math.inf
    for index in range(round(seconds / step)):
        time = index * step
        turn = command.angular if time < COMPANY.horizon_s / 2 else 0.0
        for_left, for_right = command.linear - half * turn, command.linear + half * turn
        left += min(max(for_left - left, -step), step)
        right += min(max(for_right - right, -step), step)
        yaw = min(max(yaw + (right - left) / LIMO.wheel_separation * step, -math.pi / 2), math.pi / 2)
        x += (left + right) / 2 * math.cos(yaw) * step
        y += (left + right) / 2 * math.sin(yaw) * step
        least = min(least, math.hypot(walker.x + walker.vx * time - x, walker.y + walker.vy * time - y))
    return least


def test_nobody_who_stands_or_leaves_is_given_way_to() -> None:
    for walker in (Walker(1.0, 0, 0, 0), Walker(1.0, 0, 0.8, 0), Walker(1.0, 0.8, 0.1, 0)):
        assert COMPANY.command(STANDING, STANDING, [walker], NO_POINTS, LIMO) is None


def test_nobody_who_passes_at_a_distance_is_given_way_to() -> None:
    assert COMPANY.command(STANDING, STANDING, [Walker(2.0, 1.0, -0.8, 0)], NO_POINTS, LIMO) is None


def test_a_person_who_walks_at_the_robot_finds_it_out_of_the_way() -> None:
    for bearing in (0.0, 0.6, -0.6, 2.0, math.pi):
        walker = Walker(
            1.8 * math.cos(bearing), 1.8 * math.sin(bearing), -0.8 * math.cos(bearing), -0.8 * math.sin(bearing)
        )
        command = COMPANY.command(STANDING, STANDING, [walker], NO_POINTS, LIMO)
        assert command is not None
        assert nearest(STANDING, walker) < 0.1
        assert nearest(command, walker) > 0.4


def test_it_does_not_back_fast_where_it_has_not_looked() -> None:
    walker = Walker(1.5, 0.0, -0.8, 0.0)
    command = COMPANY.command(STANDING, STANDING, [walker], NO_POINTS, LIMO, may_back=False)
    assert command is not None
    assert command.linear >= COMPANY.unseen


def test_it_does_not_get_out_of_the_way_into_a_wall() -> None:
    walker = Walker(1.8, 0.0, -0.8, 0.0)
    along = np.arange(-1.5, 1.5, 0.03)
    left = np.stack([along, np.full(len(along), 0.35)], axis=1)
    command = COMPANY.command(STANDING, STANDING, [walker], left, LIMO)
    assert command is not None
    # Forward and to the left, or back and to the right, would end in the wall.
    assert command.linear * command.angular <= 0


def test_a_command_that_backs_off_fast_enough_is_left_alone() -> None:
    walker = Walker(2.2, 0.0, -0.35, 0.0)
    assert COMPANY.command(Twist(-0.4, 0.0), Twist(-0.4, 0.0), [walker], NO_POINTS, LIMO) is None
