"""Giving way: people are predicted, and the robot gets out of their way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.estimates import upper

from limo_hog.follow.control.backing import Poses
from limo_hog.follow.control.company import Company, Walker, Way, walker_of
from limo_hog.follow.control.steer import Wheels
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import NO_POINTS
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import Track

COMPANY, WHEELS, STANDING = Company(), Wheels(), Twist()
PERIOD, STEP = 0.1, 0.02


def never(poses: Poses) -> NDArray[np.bool_]:
    """Nothing is known of the ground behind."""
    return np.zeros(poses.shape[:-1], bool)


def clearance(walker: Walker, seconds: float = 4.0, *, gives_way: bool = True, sway: float = 0.0) -> float:
    """Least gap from the robot's outline to the person's trunk [m], while the robot decides ten times a second.

    Its wheels are moved in small steps here, and the person's velocity is known to within `sway` [m/s] across.
    """
    x = y = yaw = left = right = 0.0
    half, least, random = LIMO.wheel_separation / 2, math.inf, np.random.default_rng(1)
    heading: tuple[float, float, float] | None = None
    for index in range(round(seconds / PERIOD)):
        time = index * PERIOD
        cos, sin = math.cos(yaw), math.sin(yaw)
        dx, dy = walker.x + walker.vx * time - x, walker.y + walker.vy * time - y
        vx, vy = walker.vx + random.normal(0, 1) * sway, walker.vy + random.normal(0, 1) * sway
        seen = Walker(
            cos * dx + sin * dy, cos * dy - sin * dx, cos * vx + sin * vy, cos * vy - sin * vx, walker.followed
        )
        now = Twist((left + right) / 2, (right - left) / (2 * half))
        begun = None if heading is None else Way(heading[0] - yaw, heading[1], time - heading[2])
        way = COMPANY.way_out(STANDING, now, [seen], NO_POINTS, LIMO, begun, 1.0, never)
        way = way if gives_way else None
        heading = None if way is None else (yaw + way.turn, way.speed, time - way.age)
        wanted = STANDING if way is None else COMPANY.command(way, 1.0, LIMO)
        command = WHEELS.within_reach(wanted, now, 1.0, PERIOD, LIMO)
        for small in range(round(PERIOD / STEP)):
            for_left, for_right = command.linear - half * command.angular, command.linear + half * command.angular
            left += min(max(for_left - left, -STEP), STEP)
            right += min(max(for_right - right, -STEP), STEP)
            x += (left + right) / 2 * math.cos(yaw) * STEP
            y += (left + right) / 2 * math.sin(yaw) * STEP
            yaw += (right - left) / (2 * half) * STEP
            then = time + (small + 1) * STEP
            dx, dy = walker.x + walker.vx * then - x, walker.y + walker.vy * then - y
            ahead = max(abs(math.cos(yaw) * dx + math.sin(yaw) * dy) - LIMO.half_length, 0.0)
            beside = max(abs(math.cos(yaw) * dy - math.sin(yaw) * dx) - LIMO.half_width, 0.0)
            least = min(least, math.hypot(ahead, beside) - 0.153)
    return least


def at_the_robot(distance: float, speed: float, bearing: float = 0.0, *, followed: bool = False) -> Walker:
    """A person who walks straight at the robot."""
    cos, sin = math.cos(bearing), math.sin(bearing)
    return Walker(distance * cos, distance * sin, -speed * cos, -speed * sin, followed)


def test_no_person_who_stands_or_leaves_is_given_way_to() -> None:
    for walker in (Walker(1.0, 0, 0, 0), Walker(1.0, 0, 0.8, 0), Walker(1.0, 0.8, 0.1, 0)):
        assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO) is None


def test_no_person_who_passes_at_a_distance_is_given_way_to() -> None:
    assert COMPANY.way_out(STANDING, STANDING, [Walker(2.0, 1.0, -0.8, 0)], NO_POINTS, LIMO) is None


@pytest.mark.parametrize("bearing", [0.0, 0.8, -0.8, 1.6, math.pi])
@pytest.mark.parametrize("distance", [1.7, 2.2])
def test_a_person_who_walks_at_the_robot_passes_at_three_decimetres(distance: float, bearing: float) -> None:
    walker = at_the_robot(distance, 0.8, bearing)
    assert clearance(walker, gives_way=False) < 0
    assert clearance(walker) >= 0.3


def test_another_person_may_pass_nearer_than_the_one_followed() -> None:
    passes = Walker(1.2, -0.6, -0.7, 0.0)
    assert COMPANY.way_out(STANDING, STANDING, [passes], NO_POINTS, LIMO) is None
    assert COMPANY.way_out(STANDING, STANDING, [replace(passes, followed=True)], NO_POINTS, LIMO) is not None


def test_of_two_ways_out_it_takes_the_one_that_keeps_the_person_followed_in_the_image() -> None:
    comes = Walker(0.0, -1.2, 0.0, 0.8)
    for side in (-1.0, 1.0):
        ahead = Walker(2.0, side * 1.2, 0.0, 0.0, followed=True)
        way = COMPANY.way_out(STANDING, STANDING, [comes, ahead], NO_POINTS, LIMO)
        assert way is not None
        assert abs(way.turn - math.atan2(ahead.y, ahead.x)) < LIMO.field_of_view / 2


def test_a_fast_person_who_walks_at_the_robot_passes_clear_of_it() -> None:
    assert clearance(at_the_robot(3.0, 1.5)) >= 0.15


def test_it_does_not_dither_between_the_sides_when_the_velocity_is_uncertain() -> None:
    assert clearance(at_the_robot(2.2, 0.8, followed=True), sway=0.3) >= 0.3


def test_it_backs_only_onto_ground_that_was_seen_to_be_free() -> None:
    walker = Walker(1.3, 0.0, -0.35, 0.0, followed=True)
    known = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO)
    unknown = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, may_back=never)
    assert known is not None and known.speed < 0
    assert unknown is not None and unknown.speed >= 0


def test_it_does_not_get_out_of_the_way_into_a_wall() -> None:
    walker = Walker(1.8, 0.0, -0.8, 0.0, followed=True)
    along = np.arange(-1.5, 1.5, 0.03)
    for side in (-1.0, 1.0):
        wall = np.stack([along, np.full(len(along), side * 0.35)], axis=1)
        way = COMPANY.way_out(STANDING, STANDING, [walker], wall, LIMO, may_back=never)
        assert way is not None
        assert way.turn * side * way.speed < 0


def test_it_stays_with_a_way_while_it_turns_to_it() -> None:
    walker = Walker(1.6, 0.0, -0.8, 0.1)
    fresh = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, may_back=never)
    assert fresh is not None
    begun = Way(-fresh.turn, fresh.speed, 0.3)
    kept = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, begun, may_back=never)
    assert kept is begun


def test_a_command_that_backs_off_fast_enough_is_left_alone() -> None:
    walker = Walker(2.2, 0.0, -0.35, 0.0)
    assert COMPANY.way_out(Twist(-0.4, 0.0), Twist(-0.4, 0.0), [walker], NO_POINTS, LIMO) is None


def test_a_person_who_has_set_out_is_taken_to_walk_as_fast_as_they_are_known_to() -> None:
    starting, standing = Walker(2.0, 0.0, -0.4, 0.3, followed=True), Walker(2.0, 0.0, -0.1, 0.0, followed=True)
    brisk = starting.at_least(1.5, 0.3)
    assert (brisk.vx, brisk.vy) == pytest.approx((-1.2, 0.9))
    assert starting.at_least(0.2, 0.3) == starting
    assert standing.at_least(1.5, 0.3) == standing


def test_it_does_not_stay_standing_once_another_way_is_better() -> None:
    walker, standing = at_the_robot(1.4, 0.8, 0.1, followed=True), Way(0.0, 0.0, 0.3)
    way = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, standing, may_back=never)
    assert way is not None
    assert way.speed != 0.0


def test_a_track_is_carried_into_the_robots_frame_with_its_velocity() -> None:
    track = Track(0.0, (1.0, 3.0, 0.5, -0.25), upper(np.eye(4)))
    # The robot is at (1, 1) and looks along +y, so that ahead is +y and left is -x.
    walker = walker_of(track, Odometry(0.0, 1.0, 1.0, math.pi / 2), followed=True)
    np.testing.assert_allclose((walker.x, walker.y, walker.vx, walker.vy), (2.0, 0.0, -0.25, -0.5), atol=1e-12)
    assert walker.followed


def test_a_command_is_driven_on_in_a_circle_for_half_of_the_time_and_then_straight_on() -> None:
    speed, rate = 0.5, 0.8
    poses = COMPANY._driven_on(Twist(speed, rate), Twist(speed, rate), 100.0, LIMO)[0]
    times = COMPANY.step_s * np.arange(1, len(poses) + 1)
    circle = times <= COMPANY.horizon_s / 2 + 1e-9
    radius, angle = speed / rate, rate * times[circle]
    exact = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle], axis=1)
    np.testing.assert_allclose(poses[circle], exact, atol=2e-3)
    steps = np.diff(poses[~circle], axis=0)
    np.testing.assert_allclose(np.hypot(steps[:, 0], steps[:, 1]), speed * COMPANY.step_s)


@pytest.mark.parametrize("now", [Twist(), Twist(0.4, 0.0), Twist(0.3, -1.0)])
def test_each_step_of_a_way_leads_along_the_chord_half_way_between_its_two_directions(now: Twist) -> None:
    ways = [Way(turn, speed) for turn in COMPANY.turns for speed in COMPANY.speeds]
    for one, back in zip(*COMPANY._driven(ways, now, 1.0, LIMO), strict=True):
        poses = np.concatenate([np.zeros((1, 3)), one])
        middle = (poses[1:, 2] + poses[:-1, 2]) / 2
        dx, dy = np.diff(poses[:, :2], axis=0).T
        np.testing.assert_allclose(dx * np.sin(middle), dy * np.cos(middle), atol=1e-12)
        np.testing.assert_array_equal(dx * np.cos(middle) + dy * np.sin(middle) < 0, back)


def test_it_backs_straight_off_from_a_person_who_comes_straight_at_it_slowly() -> None:
    walker = Walker(1.3, 0.0, -0.35, 0.0, followed=True)
    way = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO)
    assert way is not None
    assert way.turn == 0.0
    assert way.speed < 0


def way_before(other: Walker, company: Company = COMPANY) -> Way:
    """Return the way out before another person, where the one followed stands two metres ahead."""
    people = [Walker(2.0, 0.0, 0.0, 0.0, followed=True), other]
    way = company.way_out(STANDING, STANDING, people, NO_POINTS, LIMO, may_back=never)
    assert way is not None
    return way


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_of_ways_that_clear_another_it_takes_one_that_keeps_the_person_followed_in_the_image(side: float) -> None:
    across = Walker(1.0, side, -0.5, -0.5 * side)
    assert abs(way_before(across).turn) < LIMO.field_of_view / 2
    assert abs(way_before(across, replace(COMPANY, away=0.0)).turn) > LIMO.field_of_view / 2


def test_to_lose_the_person_followed_from_the_image_costs_less_than_to_be_walked_into() -> None:
    straight = at_the_robot(1.4, 0.7)
    assert abs(way_before(straight).turn) > LIMO.field_of_view / 2
    assert abs(way_before(straight, replace(COMPANY, short=0.0)).turn) < LIMO.field_of_view / 2


def test_as_near_as_two_decimetres_to_another_costs_as_much_as_to_lose_the_person_followed() -> None:
    gap = 0.2
    cost = COMPANY.wanted_other - gap + COMPANY.short * (COMPANY.clear_other - gap)
    assert COMPANY.away == pytest.approx(cost)


def test_a_twist_of_whole_numbers_leads_where_the_same_twist_of_floats_does() -> None:
    walker = Walker(1.6, 0.0, -0.8, 0.1)
    whole, real = Twist(0, 0), Twist(0.0, 0.0)
    ways = [COMPANY.way_out(now, now, [walker], NO_POINTS, LIMO, may_back=never) for now in (whole, real)]
    assert ways[0] == ways[1]
    assert ways[0] is not None
