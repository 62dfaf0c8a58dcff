"""Free space: what is counted as an obstacle, how far the robot may drive, and how fast."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.views import flat, scan

from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.clearance import (
    DepthGrid,
    Margin,
    Points,
    beam_directions,
    from_odometry,
    rooms_ahead,
    scan_points,
    speed_within,
    to_odometry,
)
from limo_hog.follow.sense.observation import Odometry

MARGIN = Margin(0.5, 0.2)
#: Posts of a door 2 m wide.
POSTS = np.array([[1.0, 1.0], [1.0, -1.0]])


def room_ahead(points: Points, margin: Margin = MARGIN, robot: RobotGeometry = LIMO) -> float:
    return float(rooms_ahead(points, np.zeros(1), margin, robot)[0])


def test_an_obstacle_beside_the_way_is_passed_and_one_in_it_is_not() -> None:
    assert room_ahead(np.array([[1.0, 0.4]])) == math.inf
    assert room_ahead(np.array([[1.0, 0.0]])) == pytest.approx(1.0 - 0.145 - 0.5)
    # Towards the side the margin is an ellipse: half of it aside, cos of 30 degrees of the margin ahead.
    assert room_ahead(np.array([[1.0, 0.11 + 0.1]])) == pytest.approx(0.855 - 0.5 * math.sqrt(0.75))


def test_a_door_of_80_cm_is_passed_and_one_of_60_cm_is_not() -> None:
    assert room_ahead(POSTS * (1.0, 0.4), Margin()) == math.inf
    assert room_ahead(POSTS * (1.0, 0.3), Margin()) < 1.0 - 0.145
    # What touches the ellipse only from the side is passed.
    robot, margin = RobotGeometry(half_width=0.125), Margin(0.5, 0.25)
    assert room_ahead(POSTS * (1.0, 0.375), margin, robot) == math.inf
    assert room_ahead(POSTS * (1.0, 0.374), margin, robot) < math.inf


def test_what_is_behind_is_not_in_the_way_ahead_nor_the_other_way_round() -> None:
    assert room_ahead(np.array([[-0.3, 0.0]])) == room_ahead(-np.array([[0.3, 0.0]])) == math.inf
    assert room_ahead(-np.array([[-1.0, 0.0]])) == pytest.approx(0.355)


def test_the_room_ahead_of_a_turned_robot_is_that_of_points_turned_the_other_way() -> None:
    points = np.random.default_rng(3).uniform(-2, 2, (60, 2))
    headings = np.array([-2.0, -0.4, 0.0, 0.3, 1.5, 3.0])
    cos, sin = np.cos(headings), np.sin(headings)
    turned = [points @ np.array([[c, -s], [s, c]]) for c, s in zip(cos, sin, strict=True)]
    expected = [room_ahead(one) for one in turned]
    assert rooms_ahead(points, headings, MARGIN, LIMO) == pytest.approx(expected)
    assert rooms_ahead(points[:0], headings, MARGIN, LIMO).tolist() == [math.inf] * 6


@pytest.mark.parametrize("speed", [0.05, 0.3, 0.7, 1.4])
@pytest.mark.parametrize("braking", [0.3, 0.5, 2.0])
def test_at_the_allowed_speed_the_robot_stops_within_its_room(speed: float, braking: float) -> None:
    stopping = speed * 0.25 + speed**2 / (2 * braking)
    assert speed_within(stopping, braking, 0.25) == pytest.approx(speed)


def test_without_room_the_robot_stands_and_without_obstacle_nothing_limits_it() -> None:
    assert speed_within(0.0, 0.5, 0.25) == speed_within(-0.2, 0.5, 0.25) == 0.0
    assert speed_within(math.inf, 0.5, 0.25) == math.inf


def test_a_scan_becomes_points_counter_clockwise_from_the_first_beam() -> None:
    (point,) = scan_points(scan(np.array([np.inf, np.inf, 1.0], np.float32)), LIMO)
    assert point == pytest.approx([0.103 + np.cos(2.0), np.sin(2.0)])


def test_what_every_scan_shares_cannot_be_changed() -> None:
    seen = scan(np.ones(5, np.float32))
    for shared in (beam_directions(-1.0, 1.0, 5), scan_points(seen, LIMO)):
        with pytest.raises(ValueError, match="read-only"):
            shared[0, 0] = 9.0
    assert scan_points(seen, LIMO) is scan_points(seen, LIMO)


def test_ranges_within_the_lidars_limits_are_points() -> None:
    # sensor_msgs/LaserScan: what is beyond range_max is to be discarded.
    least, most = np.float32(0.125), np.float32(8.0)
    beyond = [np.nextafter(least, np.float32(0)), np.nextafter(most, np.float32(9)), 0.05, 9.0, np.nan, np.inf]
    for ranges, points in (([least, most], 2), (beyond, 0)):
        assert len(scan_points(replace(scan(np.array(ranges, np.float32)), range_min=0.125), LIMO)) == points


@pytest.mark.parametrize(("height", "seen"), [(0.0, False), (0.03, False), (0.08, True)])
def test_what_is_higher_than_5_cm_is_an_obstacle(height: float, seen: bool) -> None:
    # At 1 m, a pixel is 1 / 448.6 m high; the camera is 0.175 m above the floor.
    row = round(239.5 + (0.175 - height) * 448.6)
    depth = flat(np.nan)
    depth[row] = 1.0
    assert len(DepthGrid(step=1).points(depth, 448.6, 1.8, LIMO)) == (640 if seen else 0)


def test_a_pixels_height_is_that_of_its_middle_and_depth_ends_at_the_reach() -> None:
    depth, height = flat(np.nan), 0.175 - 60.5 / 448.6
    depth[300, 5] = 1.0
    for floor, points in ((height - 2e-4, 1), (height + 2e-4, 0)):
        assert len(DepthGrid(step=1, floor=floor).points(depth, 448.6, 1.8, LIMO)) == points
    assert len(DepthGrid().points(flat(1.5), 448.6, 1.5, LIMO)) == 0
    assert len(DepthGrid().points(flat(0.0), 448.6, 1.5, LIMO)) == 0


def test_the_pixels_looked_at_lie_8_apart_as_far_from_either_edge() -> None:
    sideways = DepthGrid().points(flat(1.0), 448.6, 1.8, LIMO)[:, 1] * 448.6
    columns = np.unique(np.round(sideways, 3))
    assert np.diff(columns) == pytest.approx(8.0)
    assert columns.max() == pytest.approx(-columns.min(), abs=1.01)
    assert 320 - columns.max() < 8
    # Rows too: the upper edge is as near to a row looked at as the left edge to a column.
    edge = flat(np.nan)
    edge[:5] = 1.0
    assert len(DepthGrid().points(edge, 448.6, 1.8, LIMO)) == 80
    assert len(DepthGrid().points(np.where(np.arange(480)[:, None] < 4, edge, np.nan), 448.6, 1.8, LIMO)) == 0


def test_every_pixel_looked_at_has_the_depth_of_its_own_row_and_column() -> None:
    rows, columns = np.mgrid[0:480, 0:640]
    depth = (1.0 + rows / 4800 + columns / 64000).astype(np.float32)
    found = DepthGrid().points(depth, 448.6, 1.8, LIMO)
    # From the fifth row and column on, every eighth, as far as it lies 5 cm above the floor.
    for row, column in ((4, 4), (100, 316), (236, 636)):
        z = float(depth[row, column])
        wanted = (0.084 + z, (320 - column - 0.5) / 448.6 * z)
        assert np.abs(found - wanted).max(axis=1).min() < 1e-6


def test_points_go_to_the_odometry_frame_and_back() -> None:
    pose = Odometry(x=1.0, y=2.0, yaw=math.radians(30))
    ahead, left = to_odometry(np.array([[1.0, 0.0], [0.0, 1.0]]), pose)
    assert ahead == pytest.approx([1 + math.cos(math.radians(30)), 2.5])
    assert left == pytest.approx([0.5, 2 + math.cos(math.radians(30))])
    assert from_odometry(np.stack([ahead, left]), pose) == pytest.approx(np.eye(2))
