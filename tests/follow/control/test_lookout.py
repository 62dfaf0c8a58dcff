"""Looking for a lost person: where they can be, what shows that they are not, and the place to look from."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.estimates import upper
from tests.follow.views import scan, scan_of, there

from limo_hog.follow.control.lookout import Hunt, Lookout
from limo_hog.follow.control.situation import Goal, Situation
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise

LOOKOUT, GRID, HERE, NOW = Lookout(), Grid(), Odometry(10.0), 10.0
#: A scan whose beams tell nothing.
BLIND = scan(np.full(292, np.nan, np.float32), NOW)


def free_ground() -> Ground:
    """Ground that nothing stands on, seen by a robot that turned once about itself."""
    ground = GRID.start(HERE)
    for turn in (0.0, 1.5, 3.0, 4.5):
        ground = GRID.update(ground, scan(stamp=NOW - 5 + turn), replace(HERE, yaw=turn), NO_POINTS, NO_POINTS, LIMO)
    return ground


def situated(ground: Ground, pose: Odometry = HERE, grid: Grid = GRID) -> Situation:
    """The situation of a robot that stands among nobody."""
    nobody = np.empty((0, 4))
    return Situation(pose.stamp, pose, Twist(), LIMO, 1.0, 0.1, 0.1, nobody, None, NO_POINTS, grid, ground, nobody)


#: What moves in the scan and may be the person.
NOTHING = np.zeros((0, 4))


def hunt_for(points: Points, planned: float) -> Hunt:
    """Return the hunt for a person who may be at each of (N, 2) places."""
    track = kalman.initiate(NOW - 1.0, 0.0, 2.0, HERE, Noise())
    return Hunt(track, Places(NOW, points, np.zeros(points.shape)), planned=planned)


def test_no_person_is_where_the_camera_shows_none() -> None:
    sure = Lookout(wandering=Wandering(found=1.0))
    around = np.array([(r * np.cos(a), r * np.sin(a)) for r in (1.0, 3.3, 5.8, 6.2) for a in np.arange(-3, 3.1, 0.3)])
    after = sure.step(hunt_for(around, NOW), BLIND, NOTHING, situated(free_ground()))
    shown = (np.abs(np.arctan2(around[:, 1], around[:, 0])) < 0.5) & (np.hypot(*around.T) < 6.0)
    assert shown.any()
    np.testing.assert_array_equal(np.unique(after.places.points, axis=0), np.unique(around[~shown], axis=0))


#: A scan of somebody who stands a metre ahead.
SOMEBODY_AHEAD = scan_of([(1.0, 0.05 * step) for step in range(-3, 4)], NOW)


def test_the_camera_does_not_show_who_stands_behind_another() -> None:
    sure = Lookout(wandering=Wandering(found=1.0))
    behind, beside = (4.5, 0.0), (4.5, 1.5)
    after = sure.step(hunt_for(np.array([behind, beside]), NOW), SOMEBODY_AHEAD, NOTHING, situated(free_ground()))
    assert np.unique(after.places.points, axis=0).tolist() == [list(behind)]


def test_places_behind_somebody_who_walks_count_half_and_behind_what_stands_nothing() -> None:
    hidden, beside = (4.5, 0.0), (0.0, 4.5)
    # To turn costs time: 6 places straight ahead, or 12 that count half, are worth as much as 10 to one side.
    walks = situated(free_ground())
    # What stands there is among the situation's points; who walks is not.
    stands = replace(walks, points=np.array([(1.0, 0.0)]))
    for ahead, faced in ((8, beside), (14, hidden)):
        hunt = hunt_for(np.array([beside] * 10 + [hidden] * ahead), -math.inf)
        for seen, about, place in (
            (BLIND, walks, hidden), (SOMEBODY_AHEAD, walks, faced), (SOMEBODY_AHEAD, stands, beside)
        ):  # fmt: skip
            after = LOOKOUT.step(hunt, seen, NOTHING, about)
            assert len(after.way) == 0
            assert after.facing == pytest.approx(place)


def test_a_direction_that_is_turned_to_is_kept_until_another_is_half_as_good_again() -> None:
    for more, kept in ((1.3, True), (2.0, False)):
        few, many = np.full((24, 2), (0.0, 3.0)), np.full((round(24 * more), 2), (0.0, -3.0))
        hunt = hunt_for(np.concatenate([few, many]), -np.inf)
        assert there(LOOKOUT.step(hunt, BLIND, NOTHING, situated(free_ground())).facing)[1] < 0
        after = LOOKOUT.step(replace(hunt, facing=(0.0, 3.0)), BLIND, NOTHING, situated(free_ground()))
        assert (there(after.facing)[1] > 0) == kept


def test_a_place_that_is_faced_and_still_may_hide_the_person_is_driven_to() -> None:
    drives, reason = goal([], (4.0, 1.0))
    assert (there(drives).speed, there(drives).keeps) == (LOOKOUT.speed, LOOKOUT.near)
    assert there(drives).places == pytest.approx(np.array([(4.0, 1.0)] * 2))
    assert reason == "driving to where the lost person may be"
    assert there(goal([], (2.3, 0.0))[0]).speed == pytest.approx(0.3)
    # From near by, and while it is yet to be faced, the robot only turns.
    for facing in ((1.9, 0.0), (2.0, 2.0), (-4.0, 0.0)):
        turns, reason = goal([], facing)
        assert (there(turns).speed, there(turns).places) == (0.0, None)
        assert reason == "turning to where the lost person may be"


@dataclass(frozen=True, slots=True)
class Counted(Grid):
    asked: list[tuple[int, int]] = field(default_factory=list)

    def sees(self, ground: Ground, origins: Points, places: Points, *, lasting: bool = False) -> NDArray[np.bool_]:
        self.asked.append((len(origins), len(places)))
        return Grid.sees(self, ground, origins, places, lasting=lasting)


@pytest.mark.parametrize("count", [1, 40, 150, 1000])
def test_as_many_places_are_compared_however_large_the_room_and_many_the_guesses(count: int) -> None:
    grid = Counted()
    hunt = LOOKOUT.step(hunt_for(np.full((count, 2), 1.5), -np.inf), BLIND, NOTHING, situated(free_ground(), grid=grid))
    origins, places = grid.asked[-1]
    assert hunt.planned == NOW
    assert LOOKOUT.candidates <= origins <= 2 * LOOKOUT.candidates + 1
    assert min(count, 50) <= places < 100


def test_a_place_that_is_driven_to_is_kept_until_another_is_half_as_good_again() -> None:
    lookout = Lookout(candidates=10_000)
    for more, kept in ((1.3, True), (2.0, False)):
        few, many = np.full((24, 2), (0.0, 7.0)), np.full((round(24 * more), 2), (0.0, -7.0))
        hunt = hunt_for(np.concatenate([few, many]), -np.inf)
        fresh = lookout.step(hunt, BLIND, NOTHING, situated(free_ground()))
        assert fresh.way[-1, 1] < 0
        mirrored = fresh.way * (1.0, -1.0)
        after = lookout.step(replace(hunt, way=mirrored), BLIND, NOTHING, situated(free_ground()))
        assert (after.way[-1, 1] > 0) == kept


def ground_of(cells: dict[tuple[int, int], tuple[float, float]]) -> Ground:
    """Ground of which these cells alone were ever seen: how they are occupied [log-odds], and when seen [s]."""
    ground = GRID.start(HERE)
    occupied, seen = ground.occupied.copy(), ground.seen.copy()
    for at, (log_odds, stamp) in cells.items():
        occupied[at], seen[at] = log_odds, stamp
    return replace(ground, occupied=occupied, seen=seen)


def goal(way: list[tuple[float, float]], facing: tuple[float, float] | None = None) -> tuple[Goal | None, str]:
    """Return the goal of a robot at the origin that looks along x."""
    hunt = replace(hunt_for(np.zeros((3, 2)), NOW), way=np.array(way).reshape(-1, 2), facing=facing)
    return LOOKOUT.goal(hunt, situated(GRID.start(HERE), Odometry()), np.array([0.5, 1.0]))


def test_a_way_ends_two_cells_before_its_last_point() -> None:
    drives, reason = goal([(0.0, 0.0), (0.21, 0.0)])
    assert (there(drives).speed, reason) == (LOOKOUT.speed, "looking round for the lost person")
    assert goal([(0.0, 0.0), (0.19, 0.0)]) == (None, "searching for the lost person")
    for facing, off in (((-1.0, 0.1), math.pi - math.atan(0.1)), ((1.0, -0.1), -math.atan(0.1))):
        turns, reason = goal([(0.1, 0.0)], facing)
        assert there(turns).heading == pytest.approx(off)
        assert there(turns).turn_limit == LOOKOUT.facing_rate
        assert (there(turns).places, reason) == (None, "turning to where the lost person may be")


def test_a_way_is_faced_half_a_metre_on_and_driven_at_six_tenths() -> None:
    # The way bends to the left after .3 m.
    bend = [(0.1 * step, 0.0) for step in range(4)] + [(0.3, 0.1 * step) for step in range(1, 20)]
    drives = there(goal(bend)[0])
    assert drives.heading == pytest.approx(math.atan2(0.2, 0.3))
    assert drives.places == pytest.approx(np.array([(0.3, 0.0), (0.3, 0.3)]))


def planned(points: list[tuple[float, float]], lookout: Lookout = LOOKOUT, at: float = -math.inf) -> Hunt:
    return lookout.step(hunt_for(np.array(points), at), BLIND, NOTHING, situated(free_ground()))


def test_where_all_places_are_in_sight_it_turns_to_them_and_chooses_anew_in_time() -> None:
    hunt = planned([(1.0, 1.0), (2.0, 1.0)])
    assert (len(hunt.way), hunt.planned) == (0, NOW)
    assert hunt.facing == pytest.approx((1.5, 1.0))
    for ago, anew in ((0.75, False), (0.85, True)):
        assert (planned([(1.0, 1.0)], at=NOW - ago).planned == NOW) == anew


def test_a_place_is_worth_driving_to_that_shows_a_twentieth_of_the_places() -> None:
    # All but a few are 20 m off, where no place in the map shows them.
    for few, worth in ((2, False), (4, True)):
        hunt = planned([(1.0, 1.0)] * few + [(20.0, 0.0)] * (50 - few))
        assert (hunt.facing is not None, len(hunt.way)) == (worth, 0)


def test_of_places_to_either_side_those_are_faced_that_the_camera_shows_at_once() -> None:
    # Their middle, straight ahead, shows nothing.
    for left, right, side in ((6, 4, 1), (4, 6, -1)):
        hunt = planned([(1.0, 3.0)] * left + [(1.0, -3.0)] * right)
        assert len(hunt.way) == 0
        assert hunt.facing == pytest.approx((1.0, side * 3.0))


def test_of_as_many_places_the_nearer_to_turn_to_are_faced() -> None:
    assert planned([(2.0, 2.0)] * 5 + [(-2.0, -0.5)] * 5).facing == pytest.approx((2.0, 2.0))


def test_from_further_than_six_metres_a_person_is_not_seen() -> None:
    for far, in_place in ((5.9, True), (6.1, False)):
        hunt = planned([(far, 0.1)] * 10)
        assert (len(hunt.way) == 0) == in_place
        assert hunt.facing == pytest.approx((far, 0.1))


def test_a_second_and_a_half_of_looking_is_worth_as_much_as_driving_that_long() -> None:
    # From here a part of the places is seen at once, from about 1.5 m further on all of them: .6 m/s take 2.5 s more.
    for here, stays in ((0.5, True), (0.2, False)):
        near, far = round(50 * here), 50 - round(50 * here)
        hunt = planned([(5.5, 0.0)] * near + [(7.5, 0.0)] * far, Lookout(candidates=10_000))
        assert (len(hunt.way) == 0) == stays


def test_no_place_begins_on_the_other_side_of_a_wall() -> None:
    ground = ground_of({(row, 60): (2.0, NOW) for row in range(100)})
    track = kalman.initiate(NOW, 0.0, 0.5, HERE, Noise())
    track = replace(track, mean=(0.0, 0.9, 0.0, 0.0), covariance=upper(np.diag([0.04, 0.04, 0.01, 0.01])))
    points = LOOKOUT.begin(track, 1, situated(ground)).places.points
    assert points.shape == (150, 2)
    assert points[:, 1].max() <= 1.1
    moved = (points == track.mean[:2]).all(axis=1)
    # Of a normal distribution of .2 m about .9, a sixth and less lies beyond 1.1 m, and some of it within the wall.
    assert 0.05 < moved.mean() < 0.4


def test_those_who_watch_see_places_and_way_from_the_robot() -> None:
    hunt = replace(hunt_for(np.array([(1.0, 3.0)]), NOW), way=np.array([(1.0, 1.0), (0.0, 1.0)]))
    # The robot is at (1, 1) and looks along +y.
    places, way = LOOKOUT.ways(hunt, situated(GRID.start(HERE), Odometry(0.0, 1.0, 1.0, math.pi / 2)))
    assert np.array(places) == pytest.approx(np.array([(2.0, 0.0)]))
    assert np.array(way) == pytest.approx(np.array([(0.0, 0.0), (0.0, 1.0)]), abs=1e-12)


def emptied(ground: Ground, lost_s: float = 4.0) -> Hunt:
    """The hunt for a person lost here so long ago [s] after beams have passed all the places where they might be."""
    clear = replace(BLIND, ranges=np.full(292, 8.0, np.float32))
    hunt = hunt_for(np.full((150, 2), (2.0, 0.0)), -math.inf)
    track = replace(hunt.track, stamp=NOW - lost_s, mean=(0.0, 0.0, 0.0, 0.0))
    return LOOKOUT.step(replace(hunt, track=track, facing=(1.0, 1.0)), clear, NOTHING, situated(ground))


def test_where_no_place_is_left_it_begins_on_free_ground_not_seen_for_two_seconds() -> None:
    free, unclear, blocked, lately, never, far = (52, 50), (50, 52), (48, 50), (50, 48), (54, 54), (50, 90)
    stale = NOW - 2.1
    cells = {free: (-1.0, stale), unclear: (0.0, NOW - 9.0), blocked: (0.1, stale), lately: (-1.0, NOW - 1.9)}
    ground = ground_of({**cells, never: (-1.0, -math.inf), far: (-1.0, NOW - 9.0)})
    hunt = emptied(ground)
    left = np.unique(GRID.middle_of(ground, np.array([free, unclear])), axis=0)
    np.testing.assert_array_equal(np.unique(hunt.places.points, axis=0), left)
    assert hunt.places.points.shape == (150, 2)
    # Where there is none it turns on.
    nowhere = emptied(ground_of({}))
    assert (nowhere.facing, len(nowhere.way), nowhere.planned) == (None, 0, NOW)


@pytest.mark.parametrize("lost_s", [2.0, 8.0])
def test_a_person_can_be_a_metre_off_and_half_a_metre_more_for_each_second(lost_s: float) -> None:
    row = GRID.cells // 2
    ground = ground_of({(row, column): (-1.0, NOW - 3.0) for column in range(GRID.cells)})
    far = np.hypot(*emptied(ground, lost_s).places.points.T).max()
    assert 1.0 + 0.5 * lost_s - GRID.cell < far < 1.0 + 0.5 * lost_s
