"""The robot drives within its limits, and stops when it should."""

import dataclasses
import math

import numpy as np
import pytest
from tests.sim.logs import drive, there

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import Arena
from limo_sim.world.robot import integrate
from limo_sim.world.scenario import Person, Robot, Scenario, Wheels
from limo_sim.world.truth import Contacts

EMPTY = dataclasses.replace(Scenario.load("empty"), odometry=Wheels(slip=0.0))


def placed(x: float, y: float, yaw: float = 0.0) -> Scenario:
    return dataclasses.replace(EMPTY, robot=Robot(x=x, y=y, yaw=yaw))


def test_wheels_speed_up_by_a_metre_per_second_squared_and_no_faster() -> None:
    arena = Arena(EMPTY)
    speeds = [drive(arena, 0.02, Twist(0.5, 0.0)).odometry().linear for _ in range(40)]
    assert speeds == pytest.approx([*(0.02 * (step + 1) for step in range(25)), *[0.5] * 15])
    arena = drive(Arena(EMPTY), 0.1, Twist(0.0, 2.0))
    assert arena.odometry().angular == pytest.approx(0.1 * 2 * 1.0 / 0.172)
    assert drive(arena, 0.4, Twist(0.0, 2.0)).odometry().angular == pytest.approx(2.0)


def test_a_command_beyond_the_wheels_keeps_its_curve() -> None:
    odometry = drive(Arena(EMPTY), 1.5, Twist(3.0, 3.0)).odometry()
    assert odometry.linear / odometry.angular == pytest.approx(1.0)
    assert odometry.linear + odometry.angular * 0.086 == pytest.approx(1.0)


def test_the_robot_drives_the_circle_that_the_formula_says() -> None:
    arena = Arena(dataclasses.replace(EMPTY, robot=Robot(wheel_acceleration=10.0)))
    drive(arena, 0.2, Twist(0.4, 0.8))
    x, y, yaw = arena.truth().robot
    drive(arena, 2.0, Twist(0.4, 0.8))
    expected = integrate(x, y, yaw, 0.4 * 2.0, 0.8 * 2.0)
    assert arena.truth().robot == pytest.approx(expected, abs=0.01)


def test_odometry_starts_at_zero_agrees_with_the_truth_and_drifts_with_slip() -> None:
    arena = drive(Arena(EMPTY), 10.0, Twist(0.3, 0.2))
    wheels = arena.odometry()
    assert (wheels.x, wheels.y, wheels.yaw) == pytest.approx(arena.truth().robot, abs=0.02)
    slipping = drive(Arena(dataclasses.replace(EMPTY, odometry=Wheels(slip=0.3))), 10.0, Twist(0.3, 0.2))
    assert slipping.truth().robot == pytest.approx(arena.truth().robot)
    assert slipping.odometry().yaw != pytest.approx(wheels.yaw, abs=1e-3)
    wheels = drive(Arena(placed(2.0, 1.0, 1.0)), 3.0, Twist(0.3, 0.0)).odometry()
    assert wheels.y == pytest.approx(0.0, abs=1e-9)
    assert wheels.x == pytest.approx(0.3 * 3 - 0.5 * 0.3**2, abs=0.01)


def test_the_watchdog_stops_the_robot_after_half_a_second_and_is_armed_again() -> None:
    arena = Arena(EMPTY)
    arena.command(Twist(0.2, 0.0))
    assert drive(arena, 0.5).odometry().linear == pytest.approx(0.2)
    assert drive(arena, 0.3).odometry().linear == 0.0
    assert arena.watchdog_stops == 1
    assert drive(arena, 2.0).watchdog_stops == 1
    arena.command(Twist(0.2, 0.0))
    assert drive(arena, 2.0).watchdog_stops == 2


@pytest.mark.parametrize("bad", [Twist(math.nan, 0.0), Twist(0.1, math.inf), Twist(-math.inf, math.nan)])
def test_a_command_that_is_no_number_stops_the_robot_and_is_counted(bad: Twist) -> None:
    arena = drive(drive(Arena(EMPTY), 1.0, Twist(0.3, 0.0)), 1.0, bad)
    assert arena.rejected_commands == 50
    assert (arena.odometry().linear, arena.odometry().angular) == (0.0, 0.0)
    assert all(math.isfinite(value) for value in arena.truth().robot)


@pytest.mark.parametrize(("yaw", "sign"), [(0.0, 1), (math.pi, 1), (math.pi / 2, 1), (-math.pi / 2, 1), (0.3, -1)])
def test_walls_stop_the_robot_and_count_as_one_contact(yaw: float, sign: int) -> None:
    arena = drive(Arena(placed(0.0, 0.0, yaw)), 12.0, Twist(sign * 1.0, 0.0))
    assert 4.9 - 0.20 < max(map(abs, arena.truth().robot[:2])) < 4.9 - 0.10
    assert (arena.contacts.wall, arena.contacts.person) == (1, 0)


def test_driving_into_a_standing_person_is_a_contact_and_moves_nobody() -> None:
    standing = Person(route=((1.5, 0.0, 0.0),))
    arena = drive(Arena(dataclasses.replace(EMPTY, people=(standing,))), 6.0, Twist(0.5, 0.0))
    truth, stands = arena.truth(), there(arena.truth().people[0])
    assert truth.contacts == arena.contacts == Contacts(1, 0)
    assert (stands.x, stands.y) == (1.5, 0.0)
    assert truth.robot[0] == pytest.approx(1.5 - standing.radius - 0.145, abs=0.01)


def test_a_person_who_walks_into_the_robot_pushes_it_aside() -> None:
    walker = Person(route=((2.0, 0.02, 0.0), (-2.0, 0.02, 0.0)), speed=0.5)
    arena = drive(Arena(dataclasses.replace(EMPTY, people=(walker,))), 6.0, Twist())
    truth = arena.truth()
    pushing = there(truth.people[0])
    assert pushing.x == pytest.approx(-1.0)
    assert arena.contacts.person >= 1
    assert math.dist(truth.robot[:2], (pushing.x, pushing.y)) > walker.radius + 0.1


def test_the_imu_feels_gravity_turns_and_speeding_up() -> None:
    arena = drive(Arena(EMPTY), 0.2, Twist(0.5, 0.0))
    early, late = arena.imu()
    assert (early.stamp, late.stamp) == pytest.approx((0.19, 0.2))
    assert late.acceleration[0] == pytest.approx(1.0, abs=0.3)
    assert late.acceleration[2] == pytest.approx(9.81, abs=0.3)
    drive(arena, 2.0, Twist(0.4, 1.0))
    reading = arena.imu()[1]
    assert reading.angular_velocity[2] == pytest.approx(1.0, abs=0.05)
    assert reading.acceleration[1] == pytest.approx(0.4, abs=0.3)


@pytest.mark.parametrize(("speed", "turn"), [(0.3, 0.0), (0.3, 0.5), (0.0, 1.0)])
def test_the_yaw_of_slipping_wheels_strays_as_independent_noise_on_each_wheel_does(speed: float, turn: float) -> None:
    slip, seconds, runs = 0.5, 2.0, 150
    scenario = dataclasses.replace(EMPTY, odometry=Wheels(slip=slip), robot=Robot(wheel_acceleration=10.0))

    def yaw(slipping: Scenario, seed: int) -> float:
        return drive(Arena(slipping, seed), seconds, Twist(speed, turn)).odometry().yaw

    exact = yaw(dataclasses.replace(scenario, odometry=Wheels(slip=0.0)), 0)
    errors = [yaw(scenario, seed) - exact for seed in range(runs)]
    # Each step a wheel that rolled d [m] is read as d (1 + slip n), n standard normal: the variances of the steps add
    # up, and yaw is the difference of the wheels over their separation.
    left, right = speed - turn * 0.172 / 2, speed + turn * 0.172 / 2
    variance = seconds * 50 * (slip / 50) ** 2 * (left**2 + right**2) / 0.172**2
    # 99.9 % of a chi-squared variable of 150 degrees of freedom lie within 0.66 … 1.43 of its mean; the wheels reach
    # full speed within 0.04 s.
    assert 0.66 < np.mean(np.square(errors)) / variance < 1.43
