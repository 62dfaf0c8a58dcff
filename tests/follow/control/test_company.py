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


def test_of_two_ways_out_it_takes_one_that_keeps_the_person_followed_in_view() -> None:
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


def way_before(other: Walker, company: Company = COMPANY) -> Way:
    """Return the way out before another person, where the one followed stands two metres ahead."""
    people = [Walker(2.0, 0.0, 0.0, 0.0, followed=True), other]
    way = company.way_out(STANDING, STANDING, people, NO_POINTS, LIMO, may_back=never)
    assert way is not None
    return way


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_of_ways_that_clear_another_it_takes_one_with_the_person_followed_in_view(side: float) -> None:
    across = Walker(1.0, side, -0.5, -0.5 * side)
    assert abs(way_before(across).turn) < LIMO.field_of_view / 2
    assert abs(way_before(across, replace(COMPANY, away=0.0)).turn) > LIMO.field_of_view / 2


def test_to_lose_the_person_followed_costs_less_than_to_be_walked_into() -> None:
    straight = at_the_robot(1.4, 0.7)
    assert abs(way_before(straight).turn) > LIMO.field_of_view / 2
    assert abs(way_before(straight, replace(COMPANY, short=0.0)).turn) < LIMO.field_of_view / 2


def test_a_twist_of_whole_numbers_leads_where_the_same_twist_of_floats_does() -> None:
    walker = Walker(1.6, 0.0, -0.8, 0.1)
    whole, real = Twist(0, 0), Twist(0.0, 0.0)
    ways = [COMPANY.way_out(now, now, [walker], NO_POINTS, LIMO, may_back=never) for now in (whole, real)]
    assert ways[0] == ways[1]
    assert ways[0] is not None


def notices(walker: Walker, begun: Way | None = None, wanted: Twist = STANDING) -> bool:
    """Whether a person is given way to."""
    return COMPANY.way_out(wanted, wanted, [walker], NO_POINTS, LIMO, begun) is not None


@pytest.mark.parametrize(("followed", "seconds", "clear"), [(True, 2.8, 0.65), (False, 1.5, 0.35)])
@pytest.mark.parametrize("speed", [0.5, 1.5])
def test_a_person_who_comes_too_near_within_the_time_is_given_way_to(
    followed: bool, seconds: float, clear: float, speed: float
) -> None:
    # To the outline's front, and so much nearer when the time is over; times are steps of .2 s.
    near, far = (LIMO.half_length + clear + speed * time for time in (seconds - 0.2, seconds + 0.2))
    assert notices(at_the_robot(near, speed, followed=followed))
    assert not notices(at_the_robot(far, speed, followed=followed))


@pytest.mark.parametrize(("followed", "clear"), [(True, 0.65), (False, 0.35)])
def test_a_person_who_passes_nearer_than_is_wanted_is_given_way_to(followed: bool, clear: float) -> None:
    for more, given in ((-0.03, True), (0.03, False)):
        for side in (-1, 1):
            beside = Walker(0.5, side * (LIMO.half_width + clear + more), -0.8, 0.0, followed)
            assert notices(beside) == given


def test_people_slower_than_a_standing_persons_estimate_strays_do_not_come() -> None:
    for speed, comes in ((0.29, False), (0.31, True)):
        assert notices(at_the_robot(0.9, speed, followed=True)) == comes


def test_while_it_gives_way_the_error_of_the_velocity_across_counts_too() -> None:
    # Abreast after two seconds: two tenths of a metre a second make .4 m.
    begun = Way(0.0, 0.0, 0.3)
    for beside, now, then in ((0.6, True, True), (1.05, False, True), (1.35, False, False)):
        for side in (-1, 1):
            walker = Walker(1.6, side * (beside + LIMO.half_width), -0.8, 0.0, followed=True)
            assert (notices(walker), notices(walker, begun)) == (now, then)


@pytest.mark.parametrize("turn", [0.1, -0.1, 0.4, -0.4, 1.5])
def test_it_turns_by_four_times_what_is_left_within_three_radians_a_second(turn: float) -> None:
    rate = math.copysign(min(4.0 * abs(turn), 3.0), turn)
    strong = COMPANY.command(Way(turn, 0.5), 100.0, LIMO)
    assert strong.angular == pytest.approx(rate)
    # Sideways it does not drive, and backwards it does not begin to: the turn comes first.
    assert strong.linear == pytest.approx(0.5 * math.cos(turn) ** 2)
    assert COMPANY.command(Way(2.0, 0.5), 100.0, LIMO).linear == 0.0
    # Weak wheels could not stop in time from more than sqrt(2 · acceleration · angle).
    weak = COMPANY.command(Way(turn, 0.5), 0.01, LIMO)
    assert abs(weak.angular) == pytest.approx(min(abs(rate), math.sqrt(2 * 0.01 / 0.086 * abs(turn))))


def test_it_rolls_forward_over_ground_it_may_not_back_onto() -> None:
    """While it still rolls ahead, what is behind it does not matter; only where it backs must the ground be free."""
    now = Twist(0.4, 0.0)

    def only_while_it_rolls(poses: Poses) -> NDArray[np.bool_]:
        rolls = np.diff(poses[..., 0], axis=-1, prepend=0.0) > 0
        return np.asarray(~rolls)

    walker = at_the_robot(1.6, 0.35, followed=True)
    ways = [COMPANY.way_out(now, now, [walker], NO_POINTS, LIMO, None, 1.0, may) for may in (None, only_while_it_rolls)]
    assert ways[0] is not None
    assert ways[0].speed < 0
    assert ways[1] == ways[0]


def test_it_backs_onto_unknown_ground_no_faster_than_it_may_blindly() -> None:
    walker, speeds = at_the_robot(1.2, 0.31, followed=True), []
    for blind in (0.0, 0.2, 0.6):
        way = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, may_back=never, blind_speed=blind)
        assert way is not None
        speeds.append(way.speed)
        assert way.speed >= -blind
    assert speeds[-1] == -0.6


def test_a_way_is_kept_for_a_while_and_then_where_it_is_nearly_as_good() -> None:
    walker = Walker(1.6, 0.0, -0.8, 0.1, followed=True)
    fresh = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO)
    assert fresh is not None
    # Ahead to where the person comes is far worse.
    for age, kept in ((0.7, True), (0.9, False)):
        worse = Way(0.0, 0.3, age)
        way = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, worse)
        assert (way is worse) == kept
    mirrored = replace(fresh, turn=-fresh.turn, age=5.0)
    assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, mirrored) is mirrored


def test_a_way_into_another_person_is_left_at_once_and_one_beside_them_is_not() -> None:
    walker = Walker(1.6, 0.0, -0.8, 0.1)
    into, beside = Way(0.0, 0.3, 0.3), Way(-1.1, 0.3, 0.3)
    assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, into) is not into
    assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, beside) is beside


def test_before_a_fast_person_a_way_goes_on_though_the_command_seems_clear() -> None:
    # The estimate strays while the robot turns: a moment later the person may seem to come again.
    passing = Walker(1.6, 2.0, -0.8, 0.0, followed=True)
    assert not notices(passing)
    for age, goes_on in ((0.7, True), (0.9, False)):
        assert notices(passing, Way(-0.5, -0.4, age)) == goes_on
    # A robot that stands leaves that at once; and one before a person no faster than it drives.
    assert not notices(passing, Way(0.0, 0.0, 0.3))
    for speed, goes_on in ((0.59, False), (0.61, True)):
        assert notices(replace(passing, vx=-speed), Way(-0.5, -0.4, 0.3)) == goes_on
    # While they are not measured, it is not known that the way is clear.
    assert notices(replace(passing, measured=False), Way(-0.5, -0.4, 2.0))
    assert not notices(replace(passing, measured=False))


def test_of_ways_that_clear_a_person_alike_it_takes_the_easiest() -> None:
    # One who comes slowly from far on is clear of all ways that leave; it backs as fast as it must and does not turn.
    slow = COMPANY.way_out(STANDING, STANDING, [at_the_robot(1.7, 0.35, followed=True)], NO_POINTS, LIMO)
    assert slow is not None
    assert (slow.turn, slow.speed) in ((0.0, -0.2), (0.0, -0.4))


def test_a_wall_behind_turns_it_elsewhere_and_one_far_off_does_not() -> None:
    walker = at_the_robot(1.3, 0.35, followed=True)
    patch = np.array([(dx, dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.5, -0.02, 0.0, 0.02, 0.5)])
    # Free it backs straight off; a decimetre is kept from what is behind, a metre and a half is looked at.
    free = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO)
    assert free == Way(0.0, -0.6)
    for x, turns in ((-1.45, True), (-1.56, False)):
        way = COMPANY.way_out(STANDING, STANDING, [walker], patch - (-x, 0.0), LIMO)
        assert (way != free) == turns
    # A way begun is left at once where it leads into a wall.
    back = Way(0.0, -0.4, 0.2)
    assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, back) is back
    left = COMPANY.way_out(STANDING, STANDING, [walker], patch - (0.4, 0.0), LIMO, back)
    assert left is not None
    assert left.speed >= 0 or abs(left.turn) > 0.4
