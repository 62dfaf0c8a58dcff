"""Commands that the wheels can carry out: the turn first, at an acceleration that is learnt."""

import pytest

from limo_hog.follow.control.wheels import Wheels
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.observation import Odometry
from limo_sim.world.robot import Drive

WHEELS, PERIOD, STEP = Wheels(), 0.1, 0.02


def drive_of(acceleration: float) -> Drive:
    return Drive(LIMO.wheel_separation, 1.0, acceleration, 0.5)


def carried_out(drive: Drive, command: Twist) -> float:
    """Drive for one period; returns how far the robot turned [rad]."""
    drive.command(command, 0.0)
    turned = 0.0
    for _ in range(round(PERIOD / STEP)):
        drive.advance(0.0, STEP)
        turned += drive.twist.angular * STEP
    return turned


def test_told_to_drive_and_turn_at_once_weak_wheels_turn_first() -> None:
    wanted = Twist(0.6, 1.2)
    plain, shaped = drive_of(0.3), drive_of(0.3)

    def turned_in(periods: int) -> float:
        commands = (WHEELS.within_reach(wanted, shaped.twist, 0.3, PERIOD, LIMO) for _ in range(periods))
        return sum(carried_out(shaped, command) for command in commands)

    assert sum(carried_out(plain, wanted) for _ in range(5)) < 0.15
    assert turned_in(5) > 0.3
    turned_in(30)
    assert shaped.twist.linear == pytest.approx(0.6, abs=0.02)
    assert shaped.twist.angular == pytest.approx(1.2, abs=0.05)


@pytest.mark.parametrize("acceleration", [0.3, 0.6, 1.0, 2.0])
def test_the_acceleration_is_learnt_within_two_seconds_of_driving(acceleration: float) -> None:
    drive, believed, before = drive_of(acceleration), WHEELS.acceleration, Odometry()
    for index in range(20):
        wanted = Twist(0.6, 1.5) if index // 5 % 2 == 0 else Twist(-0.2, -1.5)
        sent = WHEELS.within_reach(wanted, drive.twist, believed, PERIOD, LIMO)
        carried_out(drive, sent)
        after = Odometry((index + 1) * PERIOD, linear=drive.twist.linear, angular=drive.twist.angular)
        believed = WHEELS.learn(believed, sent, before, after, LIMO)
        before = after
    assert believed == pytest.approx(acceleration, rel=0.25)


def test_a_robot_that_is_held_and_a_clock_that_stands_tell_nothing_about_the_wheels() -> None:
    held = [(Odometry(index * PERIOD), Odometry((index + 1) * PERIOD)) for index in range(50)]
    believed = 1.0
    for before, after in (*held, (Odometry(1.0), Odometry(1.0, linear=0.5))):
        believed = WHEELS.learn(believed, Twist(0.6, 0.0), before, after, LIMO)
    assert believed == 1.0
