"""Looking for a lost person: when a place is driven to, how the way is driven, and where the person can be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.control.test_lookout import BLIND, GRID, HERE, LOOKOUT, NOW, free_ground, hunt_for
from tests.follow.estimates import upper

from limo_hog.follow.control.lookout import Hunt, Lookout
from limo_hog.follow.control.steer import Detour
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise

TURN = Twist(0.0, 0.7)


def ground_of(cells: dict[tuple[int, int], tuple[float, float]]) -> Ground:
    """Ground of which these cells alone were ever seen: how they are occupied [log-odds], and when seen [s]."""
    ground = GRID.start(HERE)
    occupied, seen = ground.occupied.copy(), ground.seen.copy()
    for at, (log_odds, stamp) in cells.items():
        occupied[at], seen[at] = log_odds, stamp
    return replace(ground, occupied=occupied, seen=seen)


def test_anywhere_is_ground_that_was_free_and_not_seen_for_two_seconds_within_a_walk() -> None:
    free, unclear, blocked, lately, never, far = (52, 50), (50, 52), (48, 50), (50, 48), (54, 54), (50, 90)
    ground = ground_of(
        {
            free: (-1.0, NOW - 2.1),
            unclear: (0.0, NOW - 9.0),
            blocked: (0.1, NOW - 2.1),
            lately: (-1.0, NOW - 1.9),
            never: (-1.0, -math.inf),
            far: (-1.0, NOW - 9.0),
        }
    )
    hunt = hunt_for(np.zeros((3, 2)), NOW)
    hunt = replace(hunt, track=replace(hunt.track, stamp=NOW - 4.0, mean=(0.0, 0.0, 0.0, 0.0)))
    places = LOOKOUT._anywhere(hunt, NOW, GRID, ground)
    assert places is not None
    expected = {tuple(one) for one in GRID.middle_of(ground, np.array([free, unclear])).tolist()}
    assert {tuple(one) for one in places.points.tolist()} == expected
    assert places.points.shape == places.velocities.shape == (150, 2)
    assert not places.velocities.any()
    assert (places.stamp, places.seed) == (NOW, hunt.places.seed + 1)


@pytest.mark.parametrize("lost_s", [2.0, 8.0])
def test_a_person_can_be_a_metre_and_half_a_metre_for_each_second_from_where_they_were(lost_s: float) -> None:
    row = GRID.cells // 2
    ground = ground_of({(row, column): (-1.0, NOW - 3.0) for column in range(GRID.cells)})
    hunt = hunt_for(np.zeros((3, 2)), NOW)
    hunt = replace(hunt, track=replace(hunt.track, stamp=NOW - lost_s, mean=(0.0, 0.0, 0.0, 0.0)))
    places = LOOKOUT._anywhere(hunt, NOW, GRID, ground)
    assert places is not None
    far = np.hypot(*places.points.T).max()
    assert 1.0 + 0.5 * lost_s - GRID.cell < far < 1.0 + 0.5 * lost_s
    assert LOOKOUT._anywhere(hunt, NOW, GRID, ground_of({})) is None


def command(
    way: list[tuple[float, float]], facing: tuple[float, float] | None = None, points: Points = NO_POINTS
) -> tuple[Twist, str]:
    """Return the command of a robot at the origin that looks along x."""
    hunt = replace(hunt_for(np.zeros((3, 2)), NOW), way=np.array(way).reshape(-1, 2), facing=facing)
    return LOOKOUT.command(hunt, Odometry(), points, Detour(), LIMO, TURN)


def test_a_way_ends_two_cells_before_its_last_point() -> None:
    assert command([(0.0, 0.0), (0.21, 0.0)])[0].linear > 0
    assert command([(0.0, 0.0), (0.19, 0.0)]) == (TURN, "searching for the lost person")
    assert command([], (0.0, 1.0)) == (Twist(0.0, 1.2), "turning to where the lost person may be")
    assert command([(0.1, 0.0)], (1.0, -0.1))[0].angular == pytest.approx(-2.0 * math.atan(0.1))


def test_the_point_half_a_metre_ahead_on_the_way_is_driven_to_at_six_tenths() -> None:
    # The way bends to the left; (.3, .4) is the first point that is half a metre off.
    along = [(0.1 * step, 0.0) for step in range(4)]
    bend = [(0.3, 0.1 * step) for step in range(1, 20)]
    off = math.atan2(0.4, 0.3)
    twist, reason = command(along + bend)
    assert off > LOOKOUT.aside
    assert (twist.linear, reason) == (0.0, "looking round for the lost person")
    assert twist.angular == pytest.approx(min(2.0 * off, 1.2))
    straight, _ = command([(0.1 * step, 0.0) for step in range(20)])
    assert straight == Twist(0.6, 0.0)


@pytest.mark.parametrize("side", [-1, 1])
def test_it_turns_to_the_way_before_it_drives_where_that_is_half_a_right_angle_aside(side: int) -> None:
    for off, drives in ((0.75, True), (0.85, False)):
        place = (2.0 * math.cos(off), side * 2.0 * math.sin(off))
        twist, _ = command([place])
        assert twist.linear == (pytest.approx(0.6 * math.cos(off) ** 2) if drives else 0.0)
        assert twist.angular == pytest.approx(side * 1.2)


def test_it_drives_around_what_stands_on_the_way_and_turns_where_nothing_is_free() -> None:
    post = np.array([(0.5, 0.0), (0.5, 0.03), (0.5, -0.03)])
    around, _ = command([(2.0, 0.0)], points=post)
    assert around.linear > 0
    assert abs(around.angular) > 0.3
    angles = np.arange(-3.2, 3.2, 0.02)
    walls = 0.4 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert command([(2.0, 0.0)], points=walls)[0] == Twist(0.0, 0.0)


def planned(points: list[tuple[float, float]], lookout: Lookout = LOOKOUT, at: float = -math.inf) -> Hunt:
    return lookout.step(hunt_for(np.array(points), at), BLIND, NOW, HERE, GRID, free_ground(), LIMO)


def test_where_all_the_places_are_in_sight_it_turns_to_their_middle_and_stays() -> None:
    hunt = planned([(1.0, 1.0), (2.0, 1.0)])
    assert len(hunt.way) == 0
    assert hunt.facing == pytest.approx((1.5, 1.0))
    assert hunt.planned == NOW


def test_a_way_is_chosen_anew_after_eight_tenths_of_a_second() -> None:
    for ago, anew in ((0.75, False), (0.85, True)):
        assert (planned([(1.0, 1.0)], at=NOW - ago).planned == NOW) == anew


def test_a_place_is_not_worth_driving_to_that_shows_less_than_one_twentieth_of_where_the_person_may_be() -> None:
    # All but a few are 20 m off, where no place in the map shows them.
    for few, worth in ((2, False), (4, True)):
        hunt = planned([(1.0, 1.0)] * few + [(20.0, 0.0)] * (50 - few))
        assert (hunt.facing is not None) == worth
        assert len(hunt.way) == 0


def test_from_further_than_three_and_a_half_metres_a_person_is_not_seen() -> None:
    for far, in_place in ((3.4, True), (3.6, False)):
        hunt = planned([(far, 0.1)] * 10)
        assert (len(hunt.way) == 0) == in_place
        assert hunt.facing == pytest.approx((far, 0.1))


def test_a_second_and_a_half_of_looking_is_worth_as_much_as_driving_that_long() -> None:
    # From here a part of the places is seen at once, from about 1.5 m further on all of them: .6 m/s take 2.5 s more.
    for here, stays in ((0.5, True), (0.2, False)):
        near, far = round(50 * here), 50 - round(50 * here)
        hunt = planned([(3.0, 0.0)] * near + [(5.0, 0.0)] * far, Lookout(candidates=10_000))
        assert (len(hunt.way) == 0) == stays


@pytest.mark.parametrize("place", [(2.0, 0.0), (3.0, -2.0)])
def test_where_no_place_is_left_it_begins_anywhere_or_turns_on(place: tuple[float, float]) -> None:
    # The beams pass there: the person is not there.
    clear = replace(BLIND, ranges=np.full(292, 8.0, np.float32))
    hunt = hunt_for(np.full((150, 2), place), -np.inf)
    after = LOOKOUT.step(hunt, clear, NOW, HERE, GRID, free_ground(), LIMO)
    assert after.planned == NOW
    assert len(after.places.points) == 150
    assert not np.array_equal(after.places.points, hunt.places.points)
    nowhere = replace(GRID.start(HERE), stamp=NOW)
    turned = LOOKOUT.step(replace(hunt, facing=(1.0, 1.0)), clear, NOW, HERE, GRID, nowhere, LIMO)
    assert (turned.facing, len(turned.way), turned.planned) == (None, 0, NOW)
    assert turned.places is hunt.places


def test_no_place_begins_on_the_other_side_of_a_wall() -> None:
    ground = ground_of({(row, 60): (2.0, NOW) for row in range(100)})
    track = kalman.initiate(NOW, 0.0, 0.5, HERE, Noise())
    track = replace(track, mean=(0.0, 0.9, 0.0, 0.0), covariance=upper(np.diag([0.04, 0.04, 0.01, 0.01])))
    places = LOOKOUT.begin(track, 1, GRID, ground).places
    assert places.points.shape == (150, 2)
    behind = places.points[:, 1] > 1.1
    assert not behind.any()
    moved = (places.points == track.mean[:2]).all(axis=1)
    # Of a normal distribution of .2 m about .9, a sixth and less lies beyond 1.1 m, and some of it within the wall.
    assert 0.05 < moved.mean() < 0.4


def test_the_places_walk_on_to_the_present_in_steps_of_a_fifth_of_a_second() -> None:
    steps: list[float] = []

    class Noted(Wandering):
        """Notes to which stamps it walks."""

        def walk_on(self, places: Places, stamp: float, grid: Grid, ground: Ground) -> Places:
            steps.append(stamp)
            return Wandering.walk_on(self, places, stamp, grid, ground)

    hunt = hunt_for(np.full((10, 2), (1.0, 1.0)), NOW)
    hunt = replace(hunt, places=replace(hunt.places, stamp=NOW - 0.5))
    after = Lookout(wandering=Noted()).step(hunt, BLIND, NOW, HERE, GRID, free_ground(), LIMO)
    assert steps == pytest.approx([NOW - 0.3, NOW - 0.1, NOW])
    assert after.places.stamp == NOW


def test_those_who_watch_see_places_and_way_from_the_robot() -> None:
    hunt = replace(hunt_for(np.array([(1.0, 3.0)]), NOW), way=np.array([(1.0, 1.0), (0.0, 1.0)]))
    # The robot is at (1, 1) and looks along +y.
    places, way = LOOKOUT.ways(hunt, Odometry(0.0, 1.0, 1.0, math.pi / 2))
    assert np.array(places) == pytest.approx(np.array([(2.0, 0.0)]))
    assert np.array(way) == pytest.approx(np.array([(0.0, 0.0), (0.0, 1.0)]), abs=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_way_is_driven_from_wherever_the_robot_stands(yaw: float) -> None:
    pose = Odometry(0.0, 1.0, -2.0, yaw)
    for off in (0.3, -0.6, 3.0):
        goal: NDArray[np.float64] = np.array([1.0 + 2 * math.cos(yaw + off), -2.0 + 2 * math.sin(yaw + off)])
        assert LOOKOUT._off(goal, pose) == pytest.approx(off)
