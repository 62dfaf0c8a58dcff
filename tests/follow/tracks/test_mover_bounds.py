"""What counts as legs, as moved and as whose: both sides of what each of these is said to be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.estimates import upper
from tests.follow.tracks.test_scan_movers import FREE, GRID, HALF_VIEW, MOVERS, NOISE, person, walker

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.association import Returns, all_distances
from limo_hog.follow.tracks.kalman import Track
from limo_hog.follow.tracks.movers import Mover, is_in_view, named

Place = tuple[float, float]
POSES = [Odometry(), Odometry(1.0, -1.0, 1.5, 0.7), Odometry(1.0, 2.0, -0.8, -2.5)]


def begun(*points: Place, pose: Odometry | None = None) -> list[Place]:
    """Return where groups of these returns begin to be followed."""
    returns = Returns(0.0, np.array(points).reshape(-1, 2), pose or Odometry())
    return [mover.began for mover in MOVERS.update((), returns, HALF_VIEW, NOISE, GRID, FREE)]


def update(movers: tuple[Mover, ...], stamp: float, *points: Place) -> tuple[Mover, ...]:
    returns = Returns(stamp, np.array(points).reshape(-1, 2), Odometry())
    return MOVERS.update(movers, returns, HALF_VIEW, NOISE, GRID, FREE)


def test_returns_three_decimetres_apart_are_of_two_groups() -> None:
    # At equal distances, so that neither hides the other.
    for apart, groups in ((0.29, 1), (0.31, 2)):
        turn = 2 * math.asin(apart / 2 / 2.0)
        ends = [(2.0 * math.cos(a), 2.0 * math.sin(a)) for a in (0.0, 0.0, turn, turn)]
        assert len(begun(*ends)) == groups


def test_a_group_is_two_returns_no_wider_than_a_stride_and_no_further_than_two_shins_are_two_beams() -> None:
    assert begun() == []
    assert begun((2.0, 0.0)) == []
    assert begun((2.0, 0.0), (2.0, 0.1)) == [pytest.approx((2.0, 0.05))]
    for wide, groups in ((0.54, 1), (0.56, 0)):
        assert len(begun((2.0, -wide / 2), (2.0, 0.0), (2.0, wide / 2))) == groups
    for far, groups in ((3.45, 1), (3.55, 0)):
        for pose in POSES:
            place = (pose.x + far * math.cos(pose.yaw), pose.y + far * math.sin(pose.yaw))
            assert len(begun(place, place, pose=pose)) == groups


@pytest.mark.parametrize("order", [1, -1])
def test_a_group_beside_which_something_nearer_ends_may_be_a_piece_of_wall(order: int) -> None:
    post, wall = [(1.0, -0.4), (1.0, -0.35)], [(2.0, 0.0), (2.0, 0.05)]
    points = [(x, order * y) for x, y in (*post, *wall)][::order]
    assert begun(*points) == [pytest.approx((1.0, order * -0.375))]


def test_what_is_followed_already_does_not_begin_again_and_what_stands_half_a_stride_off_does() -> None:
    first = update((), 0.0, (2.0, -0.05), (2.0, 0.05))
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05))) == 1
    turn = 0.45 / 2.0
    beside = [(2.0 * math.cos(turn), 2.0 * math.sin(turn) + dy) for dy in (-0.03, 0.03)]
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05), *beside)) == 2


def test_it_has_moved_after_half_a_second_and_a_quarter_of_a_metre_from_where_it_left() -> None:
    one = replace(walker(None, 2.0, 0.0), began=(2.0, 0.26), scans=4)
    assert MOVERS.moving((one,)) == [one]
    others = (replace(one, scans=3), replace(one, began=(2.0, 0.24)), replace(one, left=False))
    assert MOVERS.moving(others) == []


def test_what_a_scan_has_just_shown_is_felt_for_half_a_second() -> None:
    one = walker(None, 2.0, 0.3)
    assert MOVERS.felt((one,), 1.45).tolist() == [[2.0, 0.3]]
    assert MOVERS.felt((one,), 1.55).shape == (0, 2)


@pytest.mark.parametrize(("place", "seconds"), [((2.0, 0.3), 0.5), ((-1.5, 0.2), 3.0)])
def test_it_is_given_up_after_half_a_second_in_the_lidars_sight_and_after_three_out_of_it(
    place: Place, seconds: float
) -> None:
    track = Track(1.0, (*place, 0.0, 0.0), upper(0.01 * np.eye(4)))
    one = replace(walker(None, *place), track=track)
    assert update((one,), 1.0 + seconds - 0.05) == (one,)
    assert update((one,), 1.0 + seconds + 0.05) == ()


def test_a_scan_counts_and_so_does_one_for_which_the_camera_looked_there() -> None:
    one = replace(walker(None, 2.0, 0.9), scans=5, shown=2)
    angle = math.atan2(0.9, 2.0 - LIMO.lidar_x)
    for camera, shown in ((angle + 0.02, 3), (angle - 0.02, 2)):
        returns = Returns(1.1, np.array([(2.0, 0.88), (2.0, 0.92)]), Odometry())
        (after,) = MOVERS.update((one,), returns, HALF_VIEW, NOISE, GRID, FREE, camera)
        assert (after.scans, after.shown, after.felt) == (6, shown, 1.1)


@pytest.mark.parametrize("pose", POSES)
def test_the_lidar_sees_to_either_side_of_straight_ahead_from_where_it_sits(pose: Odometry) -> None:
    x, y = pose.x + LIMO.lidar_x * math.cos(pose.yaw), pose.y + LIMO.lidar_x * math.sin(pose.yaw)
    for angle in (-1.95, -1.0, 0.0, 1.95, 2.05, -2.05, math.pi):
        at = x + 0.3 * math.cos(pose.yaw + angle), y + 0.3 * math.sin(pose.yaw + angle), 0.0, 0.0
        returns = Returns(1.0, np.empty((0, 2)), pose)
        assert is_in_view(Track(1.0, at, upper(np.eye(4))), returns, 2.0, LIMO) == (abs(angle) < 2.0)


@pytest.mark.parametrize("pose", POSES)
def test_a_beam_passes_a_place_that_it_ends_well_behind(pose: Odometry) -> None:
    x, y = pose.x + LIMO.lidar_x * math.cos(pose.yaw), pose.y + LIMO.lidar_x * math.sin(pose.yaw)

    def passed(*ends: tuple[float, float]) -> bool:
        """Whether beams at these angles off the place, of these lengths, pass a place 2 m off, where angles wrap."""
        to = math.pi
        points = np.array([(x + r * math.cos(to + a), y + r * math.sin(to + a)) for a, r in ends]).reshape(-1, 2)
        place = np.array([(x + 2.0 * math.cos(to), y + 2.0 * math.sin(to))])
        return bool(MOVERS._passed(Returns(0.0, points, pose), place)[0])

    assert not passed()
    # Two of the Limo's beams to either side, 0.014 rad each; three decimetres behind.
    for angle in (-0.028, 0.0, 0.028):
        assert passed((angle, 2.35))
        assert not passed((angle, 2.25))
        assert not passed((angle, 2.35), (-angle, 1.0))
    assert not passed((0.032, 2.5), (-0.032, 2.5))
    assert passed((0.2, 3.0), (0.0, 3.0), (-0.2, 1.0))


def assigned(movers: tuple[Mover, ...], *people: tuple[int, float, float]) -> list[int | None]:
    return [one.number for one in MOVERS.assign(movers, [person(n, x, y, 1.0) for n, x, y in people], 1.0)]


def test_legs_within_four_decimetres_of_a_person_are_theirs() -> None:
    for off, number in ((0.39, 7), (0.41, None)):
        assert assigned((walker(None, 2.0, 0.0),), (7, 2.0, off)) == [number]
    # Not those that this scan did not show.
    assert assigned((replace(walker(None, 2.0, 0.0), felt=0.9),), (7, 2.0, 0.0)) == [None]


def test_legs_that_were_anothers_are_a_persons_where_they_are_a_quarter_of_a_metre_nearer() -> None:
    for off, numbers in ((0.26, [7]), (0.24, [7, 9])):
        # The other's legs are where the person is; those that were their own are `off` away, or begin again.
        assert assigned((walker(7, 2.0, 0.0), walker(9, 2.0, off)), (7, 2.0, off)) == numbers


def test_the_nearest_legs_are_a_persons_and_what_was_taken_for_them_before_begins_again() -> None:
    before = (walker(7, 2.0, 0.3), walker(None, 2.0, 0.02), walker(3, 0.0, 2.0))
    assert assigned(before, (7, 2.0, 0.0)) == [7, 3]
    one = named(replace(before[1], shown=5), 7, 4.0)
    assert (one.number, one.shown, one.named) == (7, 0, 4.0)
    assert named(one, 7, 5.0).named == 4.0


@pytest.mark.parametrize("pose", POSES)
def test_a_box_is_on_other_legs_where_they_are_nearer_by_the_error_of_its_range(pose: Odometry) -> None:
    def place(ahead: float, left: float) -> Place:
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        return pose.x + cos * ahead - sin * left, pose.y + sin * ahead + cos * left

    seen = Measurement(math.atan2(0.5, 2.0), math.hypot(2.0, 0.5), 300, 0.0, 1.0)
    for nearer, others in ((0.17, {(0, 0)}), (0.13, set())):
        # Their own legs .4 m to one side of the box, the others nearer on the other side.
        moving = (walker(1, *place(2.0, 0.1)), walker(2, *place(2.0, 0.9 - nearer)))
        assert MOVERS.others(moving, [person(1, 2.0, 0.0, 1.0)], [seen], pose, NOISE) == others


def test_a_box_without_a_range_and_people_without_legs_tell_nothing_of_the_next() -> None:
    moving = (walker(1, 1.0, 0.0), walker(2, 2.0, 0.0))
    unknown, seen = Measurement(0.0, None, 300, 0.0, 1.0), Measurement(0.0, 2.0, 300, 0.0, 1.0)
    people = [person(5, 2.0, 0.0, 1.0), person(1, 1.0, 0.0, 1.0)]
    assert MOVERS.others(moving, people, [unknown, seen], Odometry(), NOISE) == {(1, 1)}
    assert MOVERS.others((), people, [seen], Odometry(), NOISE) == set()
    assert MOVERS.others(moving, [], [seen], Odometry(), NOISE) == set()


@pytest.mark.parametrize("pose", POSES)
def test_a_person_is_continued_where_their_legs_are_wherever_the_robot_is(pose: Odometry) -> None:
    ahead, left = 2.0, -0.6
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = pose.x + cos * ahead - sin * left, pose.y + sin * ahead + cos * left
    known = person(1, x + 0.1, y - 0.1, 0.9)
    returns = Returns(1.0, np.array([(x, y)]), pose)
    continued = MOVERS.continued(known, (walker(1, x, y),), returns, NOISE)
    # Legs are known to a decimetre, the person was to two: it goes four fifths of the way.
    gone = math.dist(continued.track.mean[:2], (x, y)) / math.hypot(0.1, 0.1)
    assert gone == pytest.approx(0.2, abs=0.03)
    assert continued.felt == 1.0


def test_a_return_may_be_of_the_legs_nearest_to_it_if_they_are_half_a_stride_off() -> None:
    movers = (walker(4, 2.0, 0.0), walker(9, 2.0, 0.5), walker(None, 2.0, 1.5))
    points = np.array([(2.0, -0.34), (2.0, -0.36), (2.0, 0.2), (2.0, 0.3), (2.0, 1.5)])
    gaps = all_distances(points, [one.track for one in movers])
    assert MOVERS._whose(movers, gaps).tolist() == [4, 0, 4, 9, 0]
    assert MOVERS._whose(movers[2:], gaps[2:]).tolist() == [0] * 5


def test_nothing_moves_or_has_left_before_the_ground_is_mapped() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(8):
        y = 0.1 * index
        returns = Returns(0.125 * index, np.array([(2.0, y - 0.03), (2.0, y + 0.03)]), Odometry())
        movers = MOVERS.update(movers, returns, HALF_VIEW, NOISE, GRID, None)
    assert len(movers) == 1
    assert MOVERS.moving(movers) == []


def test_returns_are_one_movers_and_those_of_a_persons_legs_first() -> None:
    persons, nameless = walker(7, 2.0, 0.0), walker(None, 2.0, 0.2)
    after = update((nameless, persons), 1.1, (2.0, 0.08), (2.0, 0.12))
    assert {one.number: one.felt for one in after} == {7: 1.1, None: 1.0}
    both = update((nameless, persons), 1.1, (2.0, -0.02), (2.0, 0.0), (2.0, 0.4), (2.0, 0.42))
    assert {one.number: one.felt for one in both} == {7: 1.1, None: 1.1}
