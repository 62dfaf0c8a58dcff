"""Commands that the wheels can carry out: the turn first, at an acceleration that is learnt."""

from __future__ import annotations

import pytest

from limo_hog.follow.control.wheels import Wheels
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.observation import Odometry

WHEELS, PERIOD, STEP = Wheels(), 0.1, 0.02


class Drive:
    """A differential drive, each of whose wheels changes its speed at a limited acceleration [m/s²]."""

    def __init__(self, acceleration: float) -> None:
        self.left = self.right = self.turned = 0.0
        self.acceleration = acceleration

    @property
    def twist(self) -> Twist:
        return Twist((self.left + self.right) / 2, (self.right - self.left) / LIMO.wheel_separation)

    def carry_out(self, command: Twist) -> None:
        """Drive for one period."""
        half, most = LIMO.wheel_separation / 2, self.acceleration * STEP
        for _ in range(round(PERIOD / STEP)):
            self.left += min(max(command.linear - half * command.angular - self.left, -most), most)
            self.right += min(max(command.linear + half * command.angular - self.right, -most), most)
            self.turned += self.twist.angular * STEP


def test_told_to_drive_and_turn_at_once_weak_wheels_turn_first() -> None:
    wanted = Twist(0.6, 1.2)
    plain, shaped = Drive(0.3), Drive(0.3)
    for _ in range(5):
        plain.carry_out(wanted)
        shaped.carry_out(WHEELS.within_reach(wanted, shaped.twist, 0.3, PERIOD, LIMO))
    assert plain.turned < 0.15
    assert shaped.turned > 0.3
    for _ in range(30):
        shaped.carry_out(WHEELS.within_reach(wanted, shaped.twist, 0.3, PERIOD, LIMO))
    assert shaped.twist.linear == pytest.approx(0.6, abs=0.02)
    assert shaped.twist.angular == pytest.approx(1.2, abs=0.05)


@pytest.mark.parametrize("acceleration", [0.3, 0.6, 1.0, 2.0])
def test_the_acceleration_is_learnt_within_two_seconds_of_driving(acceleration: float) -> None:
    drive, believed, before = Drive(acceleration), WHEELS.acceleration, Odometry()
    for index in range(20):
        wanted = Twist(0.6, 1.5) if index // 5 % 2 == 0 else Twist(-0.2, -1.5)
        sent = WHEELS.within_reach(wanted, drive.twist, believed, PERIOD, LIMO)
        drive.carry_out(sent)
        after = Odometry((index + 1) * PERIOD, linear=drive.twist.linear, angular=drive.twist.angular)
        believed = WHEELS.learn(believed, sent, before, after, LIMO)
        before = after
    assert believed == pytest.approx(acceleration, rel=0.25)


def test_a_robot_that_is_held_tells_nothing_about_its_wheels() -> None:
    believed = 1.0
    for index in range(50):
        before, after = Odometry(index * PERIOD), Odometry((index + 1) * PERIOD)
        believed = WHEELS.learn(believed, Twist(0.6, 0.0), before, after, LIMO)
    assert believed == 1.0


def test_a_clock_that_stands_tells_nothing() -> None:
    assert WHEELS.learn(1.0, Twist(0.6, 0.0), Odometry(1.0), Odometry(1.0, linear=0.5), LIMO) == 1.0
