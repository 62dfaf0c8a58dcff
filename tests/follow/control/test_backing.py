"""Backing off: only onto ground that was seen to be free, and that nobody can have come to since."""

from __future__ import annotations

import math
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
    assert [is_free_behind(looked((1.5, -1.5), until=until)) for until in (2.0, 58.9, 59.1)] == [True, True, False]


def test_where_a_person_out_of_sight_can_be_ground_is_known_for_a_shorter_time() -> None:
    grounds = [looked((1.5, -1.5), until=until) for until in (4.9, 5.1)]
    assert [is_free_behind(one, BESIDE) for one in grounds] == [True, False]
    # One who was 20 m away cannot have come so soon; one who is in sight is given way to.
    assert is_free_behind(grounds[1], Other(0.0, 20.0, at=0.0))
    assert is_free_behind(grounds[1], Other(0.0, 2.0, at=4.5))


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
    assert BACKING.remember(others, nobody, nobody, nobody, 61.9) == others
    assert BACKING.remember(others, nobody, nobody, nobody, 62.1) == ()


def test_legs_in_the_scan_continue_another_person_and_begin_none() -> None:
    nobody, here = places(), places((1.1, 1.0))
    assert BACKING.remember((), nobody, here, nobody, 1.0) == ()
    assert BACKING.remember((Other(1.0, 1.0, 0.0),), nobody, here, nobody, 1.0) == (Other(1.1, 1.0, 1.0),)
    # The person followed is no other.
    assert BACKING.remember((Other(1.0, 1.0, 0.0),), nobody, here, here, 1.0) == ()


@pytest.mark.parametrize(("bearing", "left"), [(-0.1, 1), (0.0, 1), (0.1, -1)])
def test_where_a_person_out_of_sight_can_be_it_looks_behind_before_it_backs(bearing: float, left: int) -> None:
    limit = BACKING.blind_limit((BESIDE,), HERE, LIMO, 10.0)
    assert limit == 0
    aim = replace(NEAR, bearing=bearing, heading=bearing)
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, aim, -0.5, 0.3, "following a person")
    assert command.linear == 0
    # A person to the right is turned away from to the left, and the other way round.
    assert left * command.angular > 1
    assert "behind" in reason


def test_with_nobody_else_about_it_backs_slowly() -> None:
    limit = BACKING.blind_limit((), HERE, LIMO, 10.0)
    command, reason = BACKING.blindly(Twist(-0.4, 0.1), limit, NEAR, -0.5, 0.3, "following a person")
    assert command == Twist(-0.2, 0.1)
    assert reason == "following a person"


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


def test_a_person_is_out_of_sight_after_eight_tenths_of_a_second() -> None:
    for unseen_s, can in ((0.75, False), (0.85, True)):
        assert BACKING.can_hold_other((Other(0.0, 0.0, 0.0),), places((0.1, 0.0)), unseen_s).tolist() == [can]


def test_each_who_is_measured_is_the_nearest_remembered_who_can_have_walked_there() -> None:
    others = (Other(0.0, 0.0, 0.0), Other(3.0, 0.0, 0.0))
    for x, left in ((2.9, Other(0.0, 0.0, 0.0)), (0.2, Other(3.0, 0.0, 0.0))):
        assert BACKING.remember(others, places((x, 0.0)), places(), places(), 1.0) == (Other(x, 0.0, 1.0), left)
    # Half a metre and a metre for the second since; further off it is one more.
    one = others[:1]
    for x, count in ((1.49, 1), (1.51, 2)):
        assert len(BACKING.remember(one, places((x, 0.0)), places(), places(), 1.0)) == count


def test_legs_within_half_a_metre_are_the_remembered_persons() -> None:
    one = (Other(1.0, 1.0, 0.0),)
    for x, at in ((1.49, 1.0), (1.51, 0.0)):
        assert [other.at for other in BACKING.remember(one, places(), places((x, 1.0)), places(), 1.0)] == [at]
    both = places((1.4, 1.0), (0.9, 1.0), (8.0, 8.0))
    assert BACKING.remember(one, places(), both, places(), 1.0) == (Other(0.9, 1.0, 1.0),)
    # Who is within half a metre of the person followed is that person.
    for x, count in ((1.49, 0), (1.51, 1)):
        assert len(BACKING.remember(one, places(), places(), places((x, 1.0)), 1.0)) == count


def test_it_looks_behind_where_a_person_who_stands_is_a_quarter_of_a_metre_too_near() -> None:
    for too_far, looks in ((-0.24, False), (-0.26, True)):
        command, reason = BACKING.blindly(Twist(-0.4, 0.1), 0.0, NEAR, too_far, 0.3, "why")
        assert command == (Twist(0.0, 3.0) if looks else Twist(0.0, 0.1))
        assert (reason == "why") != looks


def test_a_person_walks_who_comes_or_crosses_faster_than_standing_people_seem_to() -> None:
    for range_rate, bearing_rate, walks in (
        (-0.29, 0.0, False),
        (-0.31, 0.0, True),
        (0.31, 0.0, True),
        (0.0, 0.14, False),
        (0.0, -0.16, True),
    ):
        # Two metres off, .15 rad/s are .3 m/s.
        aim = replace(NEAR, distance=2.0, range_rate=range_rate, bearing_rate=bearing_rate)
        command, _ = BACKING.blindly(Twist(-0.4, 0.1), 0.0, aim, -0.5, 0.3, "")
        assert (command == Twist(0.0, 0.1)) == walks


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_a_person_who_can_be_at_any_place_behind_makes_it_stand(yaw: float) -> None:
    pose = Odometry(9.0, 1.0, -2.0, yaw)
    back = complex(-math.cos(yaw), -math.sin(yaw))
    # Seen a second ago: 1.5 m from the farthest place, .3 m behind the outline.
    for off, limit in ((1.49, 0.0), (1.51, 0.2)):
        at = complex(1.0, -2.0) + (0.145 + 0.3 + off) * back
        assert BACKING.blind_limit((Other(at.real, at.imag, 8.0),), pose, LIMO, 9.0) == limit


def test_what_stands_behind_blocks_once_it_has_stood_there_for_six_seconds() -> None:
    ground = GRID.start(HERE)
    occupied, freed = ground.occupied.copy(), ground.freed.copy()
    behind = GRID.flat(ground, np.array([(-0.345, 0.0)]))
    occupied.flat[behind] = 1.0
    for seen_free, blocked in ((3.9, True), (4.1, False)):
        freed.flat[behind] = seen_free
        stands = replace(ground, occupied=occupied, freed=freed, stamp=10.0)
        assert BACKING.is_blocked(HERE, GRID, stands, LIMO) == blocked
        assert not BACKING.is_blocked(Odometry(yaw=math.pi), GRID, stands, LIMO)
    assert bool(BACKING.is_free_behind(AHEAD, HERE, GRID, None, (), LIMO))
