"""The map of the ground, where a lost person may be, and ways there; compared with geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.views import there

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.space.routes import Router, along

GRID, ROUTER, WANDERING = Grid(), Router(), Wandering()
HERE = Odometry()
ANGLES = np.linspace(-2.0, 2.0, 292)
#: A wall 2 m ahead of the robot's centre, from the far left to y = -0.5.
WALL_X, WALL_END = 2.04, -0.5


def free_scan(stamp: float = 0.0) -> Scan:
    return Scan(stamp, np.full(292, np.inf, np.float32), -2.0, 2.0, 0.12, 8.0)


def wall_scan(pose: Odometry = HERE, stamp: float = 0.0) -> Scan:
    """What the lidar measures of that wall, by geometry."""
    x, y = pose.x + LIMO.lidar_x * math.cos(pose.yaw), pose.y + LIMO.lidar_x * math.sin(pose.yaw)
    ranges = np.full(len(ANGLES), np.inf)
    cos, sin = np.cos(ANGLES + pose.yaw), np.sin(ANGLES + pose.yaw)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (WALL_X - x) / cos
        met = (far > 0) & (y + far * sin > WALL_END)
    ranges[met] = far[met]
    return replace(free_scan(stamp), ranges=ranges.astype(np.float32))


def entered(
    *scans: Scan,
    ground: Ground | None = None,
    pose: Odometry = HERE,
    people: Points = NO_POINTS,
    depths: Points = NO_POINTS,
) -> Ground:
    """The map after scans taken at a pose."""
    for scan in scans:
        ground = GRID.update(ground, scan, pose, people, depths, LIMO)
    return there(ground)


def wall_scans(pose: Odometry = HERE, began: float = 0.0) -> list[Scan]:
    return [wall_scan(pose, began + scan / 8) for scan in range(3)]


def mapped() -> Ground:
    return entered(*wall_scans())


def at(*points: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(points, np.float64)


def test_walls_are_occupied_what_is_before_them_free_and_what_is_behind_unknown() -> None:
    ground = mapped()
    assert GRID.is_blocked(ground, at((WALL_X, 0.5), (WALL_X, 1.0))).all()
    assert not GRID.is_blocked(ground, at((1.5, 0.5), (2.6, 0.5), (2.6, -1.5))).any()
    cells, _ = GRID.flat(ground, at((1.5, 0.5), (2.6, 0.5), (3.0, -2.0)))
    assert np.isfinite(ground.seen.take(cells)).tolist() == [True, False, True]


def test_a_wall_hides_what_is_behind_it() -> None:
    places = at((3.0, 0.5), (3.0, -2.0), (1.5, 0.5))
    assert GRID.sees(mapped(), at((0.0, 0.0)), places).tolist() == [[False, True, True]]


def test_the_map_moves_along_without_moving_what_stands() -> None:
    pose = Odometry(x=1.63, y=-1.21)
    ground = entered(*wall_scans(pose, 1.0), ground=mapped(), pose=pose)
    assert ground.corner != mapped().corner
    assert GRID.is_blocked(ground, at((WALL_X, 0.5))).all()


def test_a_person_is_no_part_of_the_ground_and_what_moved_away_is_forgotten() -> None:
    ground = entered(wall_scan(), wall_scan(), people=at((WALL_X, 0.5)))
    assert GRID.is_blocked(ground, at((WALL_X, 0.5), (WALL_X, 1.5))).tolist() == [False, True]
    assert not GRID.is_blocked(entered(*[free_scan()] * 8, ground=ground), at((WALL_X, 1.5)))[0]


@pytest.mark.parametrize("began", [0.0, 1.7e9])
def test_what_came_in_is_told_from_what_lasts_on_any_clock(began: float) -> None:
    seconds, wall = np.arange(0.5, GRID.lasts_s + 0.5, 0.5).tolist(), at((WALL_X, 0.5))
    ground = entered(free_scan(began), *(wall_scan(stamp=began + one) for one in seconds))
    assert GRID.is_blocked(ground, wall).all()
    assert not GRID.is_blocked(ground, wall, lasting=True).any()
    ground = entered(wall_scan(stamp=began + GRID.lasts_s + 0.5), ground=ground)
    assert GRID.is_blocked(ground, wall, lasting=True).all()


@pytest.mark.parametrize("began", [0.0, 1.7e9])
def test_when_ground_was_free_is_known_to_the_scan_on_any_clock(began: float) -> None:
    ground = entered(*(wall_scan(stamp=began + seconds) for seconds in (0.0, 0.25, 40.0)))
    before, behind = at((1.5, 0.5)), at((2.6, 0.5))
    assert GRID.is_free_since(ground, before, began + 39.75).all()
    assert not GRID.is_free_since(ground, before, began + 40.0).any()
    assert not GRID.is_free_since(ground, behind, -np.inf).any()
    turned = replace(HERE, yaw=math.pi)
    ground = entered(wall_scan(turned, began + 50.0), ground=ground, pose=turned)
    assert GRID.is_free_since(ground, before, began + 39.75).all()
    assert not GRID.is_free_since(ground, before, began + 40.25).any()


def test_depth_fills_what_is_above_or_below_the_lidar() -> None:
    ground = entered(*[wall_scan()] * 3, depths=at((1.0, 0.0), (1.0, 0.05)))
    assert GRID.is_blocked(ground, at((1.0, 0.0)))[0]


def test_a_way_round_a_wall_is_as_long_as_geometry_says_and_keeps_off_it() -> None:
    # What is behind the wall is seen from beside it.
    beside = Odometry(x=2.6, y=-2.4, yaw=math.pi / 2)
    ground = entered(*wall_scans(beside, 1.0), ground=mapped(), pose=beside)
    way = ROUTER.way_towards(GRID, ground, HERE, at((2.9, 0.4))[0])
    assert np.hypot(*(way[-1] - (2.9, 0.4))) < 0.15
    wall = np.stack([np.full(60, WALL_X), np.linspace(WALL_END, 2.5, 60)], axis=1)
    gaps = np.hypot(*(way[:, None] - wall[None]).transpose(2, 0, 1))
    assert gaps.min() > 0.3
    length = np.hypot(*np.diff(way, axis=0).T).sum()
    shortest = math.dist((0, 0), (WALL_X, WALL_END)) + math.dist((WALL_X, WALL_END), (2.9, 0.4))
    assert shortest < length < 1.35 * shortest


def test_no_way_leads_through_a_door_narrower_than_the_robot_needs() -> None:
    ranges = np.full(292, np.inf)
    far = (1.0 - LIMO.lidar_x) / np.cos(ANGLES)
    met = (np.cos(ANGLES) > 0.2) & (np.abs(far * np.sin(ANGLES)) > 0.2)
    ranges[met] = far[met]
    ground = entered(*[replace(free_scan(), ranges=ranges.astype(np.float32))] * 3)
    assert ROUTER.way_towards(GRID, ground, HERE, at((2.5, 0.0))[0])[:, 0].max() < 1.0


def test_places_along_a_way_are_so_far_from_the_robot_and_never_beyond_its_end() -> None:
    way = np.stack([np.arange(0, 2, 0.1), np.zeros(20)], axis=1)
    ahead = along(way, Odometry(x=0.5, y=0.3), np.array([0.0, 0.25, 9.0]))
    assert ahead == pytest.approx(np.array([(0.5, 0.0), (0.75, 0.0), (1.9, 0.0)]))


def lost_at(x: float, y: float, velocity: tuple[float, float]) -> Places:
    return WANDERING.start(0.0, (x, y, *velocity), np.diag([0.01, 0.01, 0.02, 0.02]), 1)


def test_a_person_walks_on_where_they_went_and_not_through_walls() -> None:
    ground, places = mapped(), lost_at(1.2, 0.5, (0.6, 0.0))
    for step in range(1, 31):
        places = WANDERING.walk_on(places, 0.1 * step, GRID, ground)
    assert (places.points[:, 0] > WALL_X + 0.1).mean() < 0.05
    free = lost_at(-3.0, 0.0, (0.6, 0.0))
    for step in range(1, 11):
        free = WANDERING.walk_on(free, 0.1 * step, GRID, ground)
    moving = np.hypot(*free.velocities.T) > 0.2
    assert free.points[moving, 0].mean() == pytest.approx(-2.4, abs=0.25)
    # The same is drawn from the same.
    one, other = (WANDERING.walk_on(lost_at(1.0, 0.0, (0.3, 0.0)), 1.0, GRID, mapped()) for _ in range(2))
    assert np.array_equal(one.points, other.points)


def test_no_person_is_where_beams_pass_which_begin_where_the_robots_lidar_is() -> None:
    points = at((1.0, 0.5), (1.75, 0.5), (1.9, 0.5), (2.5, 0.5), (3.0, -2.0), (-1.0, 0.0))
    passed, hidden = WANDERING.beams_to(points, wall_scan(), HERE, LIMO)
    assert passed.tolist() == [True, True, False, False, True, False]
    assert hidden.tolist() == [False, False, False, True, False, False]
    # A lidar .6 m further ahead measures the same ranges of a wall that is .6 m further away.
    points = at((1.75, 0.5), (2.35, 0.5))
    for ahead, passes in ((0.0, [True, False]), (0.6, [True, True])):
        robot = replace(LIMO, lidar_x=LIMO.lidar_x + ahead)
        assert WANDERING.beams_to(points, wall_scan(), HERE, robot)[0].tolist() == passes


def test_what_is_seen_to_be_empty_leaves_the_other_places() -> None:
    both = Places(0.0, at((1.0, 0.5), (3.0, 0.5)), np.zeros((2, 2)))
    left = there(WANDERING.look(both, wall_scan(), np.zeros(2, bool), np.zeros((0, 4)), HERE, LIMO))
    assert left.points.tolist() == [[3.0, 0.5], [3.0, 0.5]]
    near = Places(0.0, at((1.0, 0.5)), np.zeros((1, 2)))
    assert WANDERING.look(near, wall_scan(), np.zeros(1, bool), np.zeros((0, 4)), HERE, LIMO) is None


def test_whoever_is_not_where_they_were_believed_may_be_what_moves_nearest_to_there() -> None:
    both = Places(0.0, at((1.0, 0.5), (1.0, -0.5), (3.0, 0.5)), np.ones((3, 2)))
    moving = np.array([(1.8, 0.9, 0.1, 0.2), (1.8, -0.9, 0.3, 0.4), (0.0, 5.0, 0.5, 0.6)])
    left = there(WANDERING.look(both, wall_scan(), np.zeros(3, bool), moving, HERE, LIMO))
    assert left.points.tolist() == [[1.8, 0.9], [1.8, -0.9], [3.0, 0.5]]
    assert left.velocities.tolist() == [[0.1, 0.2], [0.3, 0.4], [1.0, 1.0]]
    # What moves further away than beams tell cannot be it.
    far = both.points[:1], both.velocities[:1]
    assert WANDERING.look(Places(0.0, *far), wall_scan(), np.zeros(1, bool), moving[2:], HERE, LIMO) is None
