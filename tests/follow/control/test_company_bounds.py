"""Which people are given way to, and what a way is worth: plain geometry, and both sides of what is documented."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.follow import TrackingController
from limo_hog.follow.control.backing import Backing, Poses
from limo_hog.follow.control.company import Company, Walker, Way, _outline_gap
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.safety import Guard
from limo_hog.follow.sense.clearance import NO_POINTS

COMPANY, STANDING = Company(), Twist()


def notices(walker: Walker, begun: Way | None = None, wanted: Twist = STANDING) -> bool:
    """Whether a person is given way to."""
    return COMPANY.way_out(wanted, wanted, [walker], NO_POINTS, LIMO, begun) is not None


def ahead(distance: float, speed: float, *, followed: bool) -> Walker:
    return Walker(distance, 0.0, -speed, 0.0, followed)


@pytest.mark.parametrize(("followed", "seconds", "clear"), [(True, 2.8, 0.65), (False, 1.5, 0.35)])
@pytest.mark.parametrize("speed", [0.5, 1.5])
def test_a_person_who_comes_too_near_within_the_time_is_given_way_to(
    followed: bool, seconds: float, clear: float, speed: float
) -> None:
    # To the outline's front, and so much nearer when the time is over; times are steps of .2 s.
    near, far = (LIMO.half_length + clear + speed * time for time in (seconds - 0.2, seconds + 0.2))
    assert notices(ahead(near, speed, followed=followed))
    assert not notices(ahead(far, speed, followed=followed))


@pytest.mark.parametrize(("followed", "clear"), [(True, 0.65), (False, 0.35)])
def test_a_person_who_passes_nearer_than_is_wanted_is_given_way_to(followed: bool, clear: float) -> None:
    for more, given in ((-0.03, True), (0.03, False)):
        for side in (-1, 1):
            beside = Walker(0.5, side * (LIMO.half_width + clear + more), -0.8, 0.0, followed)
            assert notices(beside) == given


def test_people_slower_than_a_standing_persons_estimate_strays_do_not_come() -> None:
    for speed, comes in ((0.29, False), (0.31, True)):
        assert notices(ahead(0.9, speed, followed=True)) == comes


def test_while_it_gives_way_the_error_of_the_velocity_across_counts_too() -> None:
    # Abreast after two seconds: two tenths of a metre a second make .4 m.
    begun = Way(0.0, 0.0, 0.3)
    for beside, now, then in ((0.6, True, True), (1.05, False, True), (1.35, False, False)):
        for side in (-1, 1):
            walker = Walker(1.6, side * (beside + LIMO.half_width), -0.8, 0.0, followed=True)
            assert (notices(walker), notices(walker, begun)) == (now, then)


def test_the_prediction_counts_most_and_its_error_alike_to_either_side() -> None:
    straight, left, right = COMPANY.weights
    assert straight + left + right == pytest.approx(1.0)
    assert straight > 2 * left == 2 * right


def test_the_ways_compared_are_what_the_drive_can_do_alike_to_either_side() -> None:
    assert sorted(-turn for turn in COMPANY.turns) == sorted(COMPANY.turns)
    # After half a metre half a person's width apart; the lidar sees 2 rad to either side.
    assert all(0.24 < 0.5 * gap < 0.31 for gap in np.diff(COMPANY.turns))
    assert COMPANY.half_view == 2.0
    assert max(COMPANY.turns) < math.pi / 2 + 0.1 < COMPANY.half_view
    # As fast back as the safety layer lets it; ahead slower than when following.
    assert min(COMPANY.speeds) == -Guard(TrackingController()).max_backward
    assert -Backing().blind_speed in COMPANY.speeds
    assert 0.0 in COMPANY.speeds
    assert max(COMPANY.speeds) < 0.7


def test_what_is_further_off_than_the_robot_backs_in_two_and_a_half_seconds_is_no_wall() -> None:
    assert COMPANY.near == pytest.approx(-min(COMPANY.speeds) * 2.5)


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


def edge(count: int = 400) -> NDArray[np.float64]:
    """Points all along the robot's outline."""
    along = np.linspace(-1.0, 1.0, count)
    sides = [np.stack([along * LIMO.half_length, np.full(count, side * LIMO.half_width)], axis=1) for side in (-1, 1)]
    ends = [np.stack([np.full(count, end * LIMO.half_length), along * LIMO.half_width], axis=1) for end in (-1, 1)]
    return np.concatenate(sides + ends)


def test_the_gap_is_the_distance_to_the_nearest_point_of_the_outline_and_negative_inside() -> None:
    random = np.random.default_rng(3)
    for _ in range(200):
        x, y, yaw = random.uniform((-1, -1, -4), (1, 1, 4))
        place = np.array([x, y]) + random.uniform(-0.5, 0.5, 2)
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        here = turn.T @ (place - (x, y))
        nearest = np.hypot(*(edge() - here).T).min()
        inside = abs(here[0]) < LIMO.half_length and abs(here[1]) < LIMO.half_width
        found = float(_outline_gap(np.array([x, y, yaw]), place, LIMO))
        assert found == pytest.approx(-nearest if inside else nearest, abs=1e-3)


def test_people_are_predicted_straight_on_and_a_fifth_of_a_metre_a_second_to_either_side() -> None:
    people = np.array([(1.0, 2.0, 0.6, -0.8), (-3.0, 0.5, 0.0, 1.2)])
    places = COMPANY._places(people)
    assert places.shape == (20, 3, 2, 2)
    for step in (0, 7, 19):
        time = 0.2 * (step + 1)
        for (x, y, vx, vy), straight, one, other in zip(people, *places[step], strict=True):
            assert straight == pytest.approx((x + time * vx, y + time * vy))
            for aside in (one, other):
                # Across the way, neither on nor back.
                assert np.hypot(*(aside - straight)) == pytest.approx(0.2 * time)
                assert (aside - straight) @ (vx, vy) == pytest.approx(0.0)
            assert (one + other) / 2 == pytest.approx(straight)


def facing(*yaws: float) -> NDArray[np.float64]:
    """One way that stays at (1, 1) and looks in these directions."""
    return np.array([[(1.0, 1.0, yaw) for yaw in yaws]])


def test_out_of_the_lidars_sight_is_what_is_two_radians_off_and_more() -> None:
    poses = facing(0.0, 0.5, 1.0)
    for bearing, unseen in ((1.9, 0.0), (2.1, 1 / 3), (2.9, 2 / 3), (-1.5, 1 / 3), (3.1, 1.0)):
        place = np.array([1.0 + 2 * math.cos(bearing), 1.0 + 2 * math.sin(bearing)])
        places = np.broadcast_to(place, (3, 1, 2))
        off = [abs(math.remainder(bearing - yaw, math.tau)) for yaw in (0.0, 0.5, 1.0)]
        assert unseen == pytest.approx(np.mean([one > 2.0 for one in off]))
        assert COMPANY._unseen(poses, places) == pytest.approx([unseen])


def test_the_person_followed_is_away_while_half_the_field_of_view_off() -> None:
    half = LIMO.field_of_view / 2
    # Standing 2 m off at an angle; then walking through straight ahead to the other side.
    for bearing, away in ((half - 0.02, 0.0), (half + 0.02, 1.0), (-half - 0.02, 1.0), (math.pi, 1.0)):
        goal = np.array([(1.0 + 2 * math.cos(bearing), 1.0 + 2 * math.sin(bearing), 0.0, 0.0)])
        assert COMPANY._away(facing(0.0, 0.0), goal, LIMO) == pytest.approx([away])
    walks = np.array([(2.0, 0.0, 0.0, 1.0)])
    off = [math.atan2(0.2 * step - 1.0, 1.0) for step in (1, 2, 3, 4)]
    share = np.mean([abs(one) > half for one in off])
    assert COMPANY._away(facing(0.0, 0.0, 0.0, 0.0), walks, LIMO) == pytest.approx([share])
    assert 0 < share < 1
    assert COMPANY._away(facing(0.0), np.empty((0, 4)), LIMO).tolist() == [0.0]


def test_the_room_of_a_way_is_the_least_distance_to_what_the_lidar_sees() -> None:
    ways = np.array([[(0.1 * step, 0.0, 0.0) for step in range(10)], [(0.0, 0.1 * step, 0.0) for step in range(10)]])
    points = np.array([(2.0, 0.0), (0.0, 3.0)])
    # Every other step is looked at: from .8 m.
    expected = [2.0 - 0.8 - LIMO.half_length, 2.0 - LIMO.half_length]
    assert COMPANY._room(ways, points, LIMO) == pytest.approx(expected)
    assert COMPANY._room(ways, NO_POINTS, LIMO).tolist() == [math.inf] * 2


def away_from(*walls: tuple[float, float], walker: Walker) -> Way:
    """Return the way out between walls, each a dense patch of returns at a place."""
    patch = [(x + dx, y + dy) for x, y in walls for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]
    way = COMPANY.way_out(STANDING, STANDING, [walker], np.array(patch).reshape(-1, 2), LIMO)
    assert way is not None
    return way


def test_returns_on_the_one_who_comes_and_far_ones_are_no_walls() -> None:
    walker = ahead(1.3, 0.35, followed=True)
    free = away_from(walker=walker)
    assert free == Way(0.0, -0.6)
    # Behind, where it backs to: a decimetre is kept. Beyond a metre and a half nothing is looked at.
    assert away_from((-1.45, 0.0), walker=walker) != free
    assert away_from((-1.56, 0.0), walker=walker) == free


def test_it_rolls_forward_over_ground_it_may_not_back_onto() -> None:
    """While it still rolls ahead, what is behind it does not matter; only where it backs must the ground be free."""
    now = Twist(0.4, 0.0)

    def only_while_it_rolls(poses: Poses) -> NDArray[np.bool_]:
        rolls = np.diff(poses[..., 0], axis=-1, prepend=0.0) > 0
        return np.asarray(~rolls)

    walker = ahead(1.6, 0.35, followed=True)
    ways = [COMPANY.way_out(now, now, [walker], NO_POINTS, LIMO, None, 1.0, may) for may in (None, only_while_it_rolls)]
    assert ways[0] is not None
    assert ways[0].speed < 0
    assert ways[1] == ways[0]


def test_it_backs_onto_unknown_ground_no_faster_than_it_may_blindly() -> None:
    def never(poses: Poses) -> NDArray[np.bool_]:
        return np.zeros(poses.shape[:-1], bool)

    walker, speeds = ahead(1.2, 0.31, followed=True), []
    for blind in (0.0, 0.2, 0.6):
        way = COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, may_back=never, blind_speed=blind)
        assert way is not None
        speeds.append(way.speed)
        assert way.speed >= -blind
    assert speeds[-1] == -0.6


def test_a_way_is_kept_for_eight_tenths_of_a_second_and_then_where_it_is_nearly_as_good() -> None:
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


def test_before_a_fast_person_a_way_goes_on_for_eight_tenths_of_a_second_though_the_command_seems_clear() -> None:
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


def test_a_way_is_left_at_once_where_it_leads_into_a_wall() -> None:
    walker = ahead(1.3, 0.35, followed=True)
    back = Way(0.0, -0.4, 0.2)
    wall = np.array([(-0.4, y) for y in np.arange(-0.5, 0.5, 0.05)])
    assert COMPANY.way_out(STANDING, STANDING, [walker], NO_POINTS, LIMO, back) is back
    left = COMPANY.way_out(STANDING, STANDING, [walker], wall, LIMO, back)
    assert left is not None
    # Wherever it leads instead, a decimetre from the wall is kept.
    poses, _ = COMPANY._driven([left, back], STANDING, 1.0, LIMO)
    kept, given_up = COMPANY._room(poses, wall, LIMO)
    assert kept >= COMPANY.walls > given_up


@pytest.mark.parametrize("speed", [0.6, -0.4, 0.3])
def test_from_standing_it_drives_half_the_acceleration_times_the_time_squared(speed: float) -> None:
    times = 0.2 * np.arange(1, 21)
    reached = np.minimum(times, abs(speed))
    expected = np.sign(speed) * (reached**2 / 2 + abs(speed) * (times - reached))
    # Speeds change within a step, not at its end alone: .3 m/s is reached in the middle of one.
    ways, backs = COMPANY._driven([Way(0.0, speed)], STANDING, 1.0, LIMO)
    for poses in (ways[0], COMPANY._driven_on(Twist(speed, 0.0), STANDING, 1.0, LIMO)[0]):
        assert poses[:, 0] == pytest.approx(expected, abs=0.011)
        assert not poses[:, 1:].any()
    assert backs.all() == backs.any() == (speed < 0)


def test_a_command_to_back_is_driven_on_no_faster_than_the_safety_layer_lets_it() -> None:
    fast, slow = (COMPANY._driven_on(Twist(speed, 0.0), STANDING, 1.0, LIMO) for speed in (-0.7, -0.6))
    assert fast == pytest.approx(slow)


@pytest.mark.parametrize("turn", [0.5, -1.6])
def test_a_way_turns_to_its_direction_and_then_goes_straight_along_it(turn: float) -> None:
    (way,), _ = COMPANY._driven([Way(turn, 0.3)], STANDING, 1.0, LIMO)
    assert way[-1, 2] == pytest.approx(turn, abs=0.02)
    # Steps of .2 s overshoot a little.
    assert abs(way[:, 2]).max() < abs(turn) + 0.25
    along = np.diff(way[-5:, :2], axis=0)
    assert np.hypot(*along.T) == pytest.approx(0.3 * 0.2, abs=1e-3)
    assert np.arctan2(along[:, 1], along[:, 0]) == pytest.approx(turn, abs=0.02)


def test_of_ways_that_clear_a_person_alike_it_takes_the_easiest() -> None:
    # One who comes slowly from far on is clear of all ways that leave; it backs as fast as it must and does not turn.
    slow = COMPANY.way_out(STANDING, STANDING, [ahead(1.7, 0.35, followed=True)], NO_POINTS, LIMO)
    assert slow is not None
    assert (slow.turn, slow.speed) in ((0.0, -0.2), (0.0, -0.4))
