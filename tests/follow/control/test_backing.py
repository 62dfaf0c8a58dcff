"""Backing off: only onto ground that was seen to be free, and that nobody can have come to since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from limo_hog.follow.control.backing import Backing, Other
from limo_hog.follow.control.steer import Aim
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.space.grid import Grid, Ground

BACKING, GRID = Backing(), Grid()
NEAR = Aim(bearing=-0.1, distance=1.0, bearing_rate=0.0, range_rate=0.0, heading=-0.1, hidden=False)


def looked(yaws: tuple[float, ...], *, until: float) -> Ground:
    """The ground after scans at directions [rad], one a second, and then one straight ahead; the last is at `until`."""
    ground = None
    for index, yaw in enumerate((*yaws, 0.0)):
        stamp = until if index == len(yaws) else float(index)
        scan = Scan(stamp, np.full(292, np.inf, np.float32), -2.0, 2.0, 0.12, 8.0)
        ground = GRID.update(ground, scan, Odometry(stamp, yaw=yaw), NO_POINTS, NO_POINTS)
    assert ground is not None
    return ground


HERE, AHEAD = Odometry(), np.zeros(3)
BESIDE = Other(0.0, 2.0, at=0.0)


def is_free_behind(ground: Ground, *others: Other) -> bool:
    return bool(BACKING.is_free_behind(AHEAD, HERE, GRID, ground, others, LIMO))


def places(*points: tuple[float, float]) -> Points:
    return np.array(points).reshape(-1, 2)


def test_ground_behind_is_known_for_a_while_after_the_robot_looked_round() -> None:
    assert not is_free_behind(looked((), until=0.0))
    assert [is_free_behind(looked((1.5, -1.5), until=until)) for until in (2.0, 58.0, 70.0)] == [True, True, False]


def test_where_a_person_out_of_sight_can_be_ground_is_known_for_a_shorter_time() -> None:
    grounds = [looked((1.5, -1.5), until=until) for until in (2.0, 8.0)]
    assert [is_free_behind(one, BESIDE) for one in grounds] == [True, False]
    # One who was 20 m away cannot have come so soon; one who is in sight is given way to.
    assert is_free_behind(grounds[1], Other(0.0, 20.0, at=0.0))
    assert is_free_behind(grounds[1], Other(0.0, 2.0, at=7.5))


def test_each_pose_has_its_own_ground_behind_it() -> None:
    poses = np.array([(0.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (0.0, 0.0, np.pi)])
    free = BACKING.is_free_behind(poses, HERE, GRID, looked((), until=0.0), (), LIMO)
    assert free.tolist() == [False, False, True]


def test_a_person_who_goes_out_of_sight_is_remembered_until_measured_again() -> None:
    nobody, one = places(), places((1.0, 1.0))
    others = BACKING.remember((), one, nobody, nobody, 0.0)
    others = BACKING.remember(others, nobody, nobody, nobody, 3.0)
    assert others == (Other(1.0, 1.0, 0.0),)
    behind = places((-0.4, 0.0))
    assert BACKING.can_hold_other(others, behind, 3.0).all()
    # The same person, as far away as they can have walked.
    others = BACKING.remember(others, places((3.0, 1.0)), nobody, nobody, 3.0)
    assert others == (Other(3.0, 1.0, 3.0),)
    assert not BACKING.can_hold_other(others, behind, 3.0).any()
    assert BACKING.remember(others, nobody, nobody, nobody, 63.0) == ()


def test_legs_in_the_scan_continue_another_person_and_begin_none() -> None:
    nobody, here = places(), places((1.1, 1.0))
    assert BACKING.remember((), nobody, here, nobody, 1.0) == ()
    assert BACKING.remember((Other(1.0, 1.0, 0.0),), nobody, here, nobody, 1.0) == (Other(1.1, 1.0, 1.0),)
    # The person followed is no other.
    assert BACKING.remember((Other(1.0, 1.0, 0.0),), nobody, here, here, 1.0) == ()


def test_where_a_person_out_of_sight_can_be_it_looks_behind_before_it_backs() -> None:
    limit = BACKING.blind_limit((BESIDE,), HERE, LIMO, 10.0)
    assert limit == 0
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, NEAR, -0.5, 0.3, "following a person")
    assert command.linear == 0
    # The person is to the right already: it goes on to the left.
    assert command.angular > 1
    assert "behind" in reason


def test_it_does_not_turn_away_from_a_person_who_walks() -> None:
    walks = Aim(-0.1, 1.0, 0.0, -0.6, -0.1, False)
    command, _ = BACKING.blindly(Twist(-0.4, 0.1), 0.0, walks, -0.5, 0.3, "following a person")
    assert command == Twist(0.0, 0.1)


def test_with_nobody_else_about_it_backs_slowly() -> None:
    limit = BACKING.blind_limit((), HERE, LIMO, 10.0)
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, NEAR, -0.5, 0.3, "following a person")
    assert command == Twist(-0.2, 0.1)
    assert reason == "following a person"


def test_a_person_to_the_left_is_turned_away_from_to_the_right_to_look_behind() -> None:
    left, right = Aim(0.1, 1.0, 0.0, 0.0, 0.1, False), NEAR
    turns = [BACKING.blindly(Twist(-0.4, 0.0), 0.0, aim, -0.5, 0.3, "")[0].angular for aim in (left, right)]
    assert turns[0] == -turns[1] < -1


@pytest.mark.parametrize("yaw", [-3.0, -2.0, -np.pi / 2, -0.7, 0.0, 0.7, np.pi / 2, 2.0, 3.0])
def test_the_ground_behind_a_pose_is_up_to_three_decimetres_behind_its_outline(yaw: float) -> None:
    pose = np.array([0.4, -0.3, yaw])
    back, side = np.array([-np.cos(yaw), -np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    behind = np.array(
        [pose[:2] + (0.145 + far) * back + 0.11 * share * side for far in (0.1, 0.2, 0.3) for share in (-1, 0, 1)]
    )
    ground = GRID.start(HERE)
    freed = np.full((GRID.cells, GRID.cells), -np.inf)
    rows, columns = GRID.index(ground, behind)[0].T
    freed[rows, columns] = np.inf
    assert BACKING.is_free_behind(pose, HERE, GRID, replace(ground, freed=freed), (), LIMO)
    for row, column in zip(rows, columns, strict=True):
        missing = freed.copy()
        missing[row, column] = -np.inf
        assert not BACKING.is_free_behind(pose, HERE, GRID, replace(ground, freed=missing), (), LIMO)


def test_before_the_first_scan_nothing_is_known_to_block() -> None:
    assert not BACKING.is_blocked(HERE, GRID, None, LIMO)
    assert BACKING.is_free_behind(AHEAD, HERE, GRID, None, (), LIMO)


def post(bearing: float, distance: float) -> Points:
    """A post at a bearing from straight behind [rad] and a distance [m]."""
    return places((-distance * np.cos(bearing), -distance * np.sin(bearing)))


def test_to_back_it_faces_the_person_while_nothing_stands_behind() -> None:
    assert BACKING.heading(0.15, NO_POINTS, LIMO) == 0.15
    # Nor does what stands ahead or beside matter, nor what is further than a metre from what `Guard` keeps.
    for around in (places((0.5, 0.1)), places((0.0, 0.5)), post(0.0, 1.8)):
        assert BACKING.heading(0.15, around, LIMO) == 0.15


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_to_back_it_faces_beside_the_person_where_that_leaves_room(side: float) -> None:
    # A post behind, a little to one side: turned so that it passes on that side.
    heading = BACKING.heading(0.0, post(side * 0.15, 0.8), LIMO)
    assert heading == pytest.approx(-side * 0.4)
    # It is passed by more than `Guard` keeps beside the robot.
    turned = post(side * 0.15 - heading, 0.8)
    assert abs(turned[0, 1]) > LIMO.half_width + 0.25


def test_it_faces_no_further_beside_the_person_than_the_image_shows() -> None:
    # Of a post so near, `Guard` would keep off from .54 rad beside it on.
    heading = BACKING.heading(0.0, post(0.0, 0.6), LIMO)
    assert heading == 0.5
    assert LIMO.field_of_view / 2 - heading > 0.1
