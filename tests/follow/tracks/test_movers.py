"""People whom the lidar alone shows: groups of returns that move."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.estimates import upper
from tests.follow.tracks.walkers import FREE, GRID, HALF_VIEW, MOVERS, NOISE, SCAN_S, legs, person, update, walk, walker

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.association import Returns
from limo_hog.follow.tracks.kalman import Track
from limo_hog.follow.tracks.movers import Mover, is_in_view

Place = tuple[float, float]
#: Ground that was never seen to be free.
NEVER = replace(FREE, freed=np.full_like(FREE.freed, -np.inf))
POSES = [Odometry(), Odometry(1.0, -1.0, 1.5, 0.7), Odometry(1.0, 2.0, -0.8, -2.5)]


def test_a_person_who_walks_beside_the_robot_moves_as_fast_as_they_do() -> None:
    moving = MOVERS.moving(walk((1.5, -1.5), (-0.7, 0.0), 12))
    assert len(moving) == 1
    x, y, vx, vy = moving[0].track.mean
    assert math.dist((x, y), (1.5 - 0.7 * 11 * SCAN_S, -1.5)) < 0.2
    assert abs(vx + 0.7) < 0.25
    assert abs(vy) < 0.25


def test_a_person_who_stands_and_a_wall_do_not_move() -> None:
    assert MOVERS.moving(walk((1.5, -1.5), (0.0, 0.0), 40)) == []


def test_a_person_who_walks_behind_the_robot_is_predicted_for_three_seconds() -> None:
    into_the_blind = (0.0, -1.0), (-0.7, 0.0)
    assert len(MOVERS.moving(walk(*into_the_blind, 16))) == 1
    assert len(MOVERS.moving(walk(*into_the_blind, 26))) == 1
    assert MOVERS.moving(walk(*into_the_blind, 60)) == []


def test_a_person_who_is_gone_from_where_the_lidar_looks_is_forgotten_at_once() -> None:
    movers = walk((2.0, -0.5), (-0.7, 0.0), 10)
    assert MOVERS.moving(movers)
    for index in range(10, 16):
        movers = update(movers, index * SCAN_S)
    assert movers == ()


def test_what_is_seen_of_a_wall_beside_a_nearer_post_does_not_begin_to_move() -> None:
    wall = [(2.0, 0.05 * step) for step in range(6)]
    for beside, place in (([(1.0, -0.1), (1.0, -0.05)], (1.0, -0.075)), ([(3.0, -0.9), (3.0, -0.5)], (2.0, 0.125))):
        (mover,) = update((), 0.0, *beside, *wall)
        assert mover.began == pytest.approx(place)
    # And on its other side.
    (mover,) = update((), 0.0, (2.0, -0.05), (2.0, 0.0), (1.0, 0.35), (1.0, 0.4))
    assert mover.began == pytest.approx((1.0, 0.375))


def test_the_end_of_a_wall_that_comes_into_view_does_not_move() -> None:
    for ground, moving in ((FREE, 1), (NEVER, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(12):
            seen = [(2.0, 0.07 * index + 0.05 * step) for step in range(5)]
            movers = update(movers, index * SCAN_S, *seen, ground=ground)
        assert len(MOVERS.moving(movers)) == moving


def test_what_is_seen_of_a_wall_at_the_edge_of_its_cells_does_not_move_along_it() -> None:
    # The wall is in the cells up to 2 m; its returns stray by a centimetre to either side of that.
    wall, _ = GRID.flat(FREE, np.array([(1.95, 0.05 * step - 1.0) for step in range(60)]))
    occupied, freed = FREE.occupied.copy(), FREE.freed.copy()
    occupied.flat[wall], freed.flat[wall] = 2.0, -np.inf
    walled = replace(FREE, stamp=0.0, occupied=occupied, freed=freed)
    for ground, moving in ((FREE, 1), (walled, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(12):
            seen = [(2.01, 0.07 * index + 0.05 * step - 0.8) for step in range(5)]
            movers = update(movers, index * SCAN_S, *seen, ground=ground)
        assert len(MOVERS.moving(movers)) == moving


def test_what_the_camera_has_shown_for_long_is_counted() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(10):
        points = np.array(legs(2.0, 0.06 * index - 0.3, 1.0 * index))
        movers = MOVERS.update(movers, Returns(index * SCAN_S, points, Odometry()), (HALF_VIEW, 0.5), NOISE, GRID, FREE)
    assert movers[0].shown == movers[0].scans - 1


def test_a_person_who_comes_straight_here_moves_where_the_ground_was_free() -> None:
    # They hide where they began, which is never seen to be free; a wall that comes into view was hidden as well.
    cells = np.arange(GRID.cells) * GRID.cell + FREE.corner[0] * GRID.cell
    ahead = replace(FREE, freed=np.where(cells[:, None] < 2.9, FREE.freed, -np.inf))
    for ground, moving in ((ahead, 1), (NEVER, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(10):
            movers = update(movers, index * SCAN_S, *legs(3.0 - 0.1 * index, 0.0, 1.0 * index), ground=ground)
        assert len(MOVERS.moving(movers)) == moving


def test_a_person_who_is_back_where_they_began_has_moved_all_the_same() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(17):
        y = 0.08 * min(index, 16 - index)
        movers = update(movers, index * SCAN_S, *legs(2.0, y, 1.0 * index))
    (mover,) = MOVERS.moving(movers)
    assert math.dist(mover.track.place, mover.began) < 0.15


@pytest.mark.parametrize("side", [1, -1])
def test_two_who_pass_through_each_other_keep_their_legs(side: int) -> None:
    movers: tuple[Mover, ...] = (walker(7, 2.0, 0.0), walker(8, 2.05, -0.9 * side))
    stands = legs(2.0, 0.0, 0.0)
    for index in range(1, 36):
        y = side * (0.05 * index - 0.9)
        # The person who stands hides what is behind them.
        walks = [place for place in legs(2.05, y, 1.0 * index) if abs(place[1]) > 0.11]
        movers = update(movers, 1.0 + index * SCAN_S, *stands, *walks)
        velocities = {mover.number: mover.track.mean[2:] for mover in movers}
        assert math.dist(velocities[7], (0.0, 0.0)) < 0.1
    places = {mover.number: mover.track.place for mover in movers if mover.number is not None}
    assert math.dist(places[7], (2.0, 0.0)) < 0.2
    assert math.dist(places[8], (2.05, y)) < 0.2


def test_where_two_pass_through_each_other_the_returns_are_not_one_persons() -> None:
    beside = walker(8, 2.0, 0.05)
    passing = replace(beside, track=replace(beside.track, mean=(2.0, 0.05, 0.0, 0.6)))
    returns = Returns(1.0, np.array([(2.0, -0.02), (2.0, 0.02)]), Odometry())
    followed = person(7, 2.0, 0.0, 0.9)
    assert MOVERS.walked(followed, (passing,), returns, NOISE) == followed
    assert MOVERS.walked(followed, (beside,), returns, NOISE).felt == 1.0


def test_what_begins_is_where_its_returns_are_wherever_the_robot_is() -> None:
    for pose in (Odometry(), Odometry(0.0, -1.0, 1.5, 0.7), Odometry(0.0, 2.0, -0.8, -2.5)):
        angle = pose.yaw - 0.4
        place = (pose.x + 2.0 * math.cos(angle), pose.y + 2.0 * math.sin(angle))
        (mover,) = MOVERS.update((), Returns(0.0, np.array([place, place]), pose), (HALF_VIEW, 0.0), NOISE, GRID, FREE)
        np.testing.assert_allclose(mover.track.mean, [*place, 0.0, 0.0], atol=1e-9)


def begun(*points: Place, pose: Odometry | None = None) -> list[Place]:
    """Return where groups of these returns begin to be followed."""
    returns = Returns(0.0, np.array(points).reshape(-1, 2), pose or Odometry())
    return [mover.began for mover in MOVERS.update((), returns, (HALF_VIEW, 0.0), NOISE, GRID, FREE)]


def test_returns_three_decimetres_apart_are_of_two_groups() -> None:
    # At equal distances, so that neither hides the other.
    for apart, groups in ((0.29, 1), (0.31, 2)):
        turn = 2 * math.asin(apart / 2 / 2.0)
        ends = [(2.0 * math.cos(a), 2.0 * math.sin(a)) for a in (0.0, 0.0, turn, turn)]
        assert len(begun(*ends)) == groups


def test_legs_are_returns_within_a_stride_near_enough_for_a_beam_on_a_shin() -> None:
    assert begun() == []
    assert begun((3.4, 0.0)) == []
    assert begun((3.6, 0.0)) == [pytest.approx((3.6, 0.0))]
    assert begun((2.0, 0.0), (2.0, 0.1)) == [pytest.approx((2.0, 0.05))]
    for wide, groups in ((0.54, 1), (0.56, 0)):
        assert len(begun((2.0, -wide / 2), (2.0, 0.0), (2.0, wide / 2))) == groups
    for far, groups in ((6.45, 1), (6.55, 0)):
        for pose in POSES:
            place = (pose.x + far * math.cos(pose.yaw), pose.y + far * math.sin(pose.yaw))
            assert len(begun(place, pose=pose)) == groups


def test_what_is_followed_does_not_begin_again_and_what_stands_beside_it_does() -> None:
    first = update((), 0.0, (2.0, -0.05), (2.0, 0.05))
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05))) == 1
    turn = 0.45 / 2.0
    beside = [(2.0 * math.cos(turn), 2.0 * math.sin(turn) + dy) for dy in (-0.03, 0.03)]
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05), *beside)) == 2


def test_it_has_moved_after_half_a_second_and_a_quarter_of_a_metre() -> None:
    one = replace(walker(None, 2.0, 0.0), way=0.26, scans=4)
    assert MOVERS.moving((one,)) == [one]
    others = (replace(one, scans=3), replace(one, way=0.24), replace(one, left=False))
    assert MOVERS.moving(others) == []


def test_what_a_scan_has_just_shown_is_felt_for_half_a_second() -> None:
    one = walker(None, 2.0, 0.3)
    assert MOVERS.felt((one,), 1.45).tolist() == [[2.0, 0.3]]
    assert MOVERS.felt((one,), 1.55).shape == (0, 2)


@pytest.mark.parametrize(("place", "seconds"), [((2.0, 0.3), 0.5), ((-1.5, 0.2), 3.0)])
def test_it_is_given_up_after_half_a_second_in_sight_and_after_three_out_of_sight(place: Place, seconds: float) -> None:
    track = Track(1.0, (*place, 0.0, 0.0), upper(0.01 * np.eye(4)))
    one = replace(walker(None, *place), track=track)
    assert update((one,), 1.0 + seconds - 0.05) == (one,)
    assert update((one,), 1.0 + seconds + 0.05) == ()


@pytest.mark.parametrize("pose", POSES)
def test_the_lidar_sees_to_either_side_of_straight_ahead_from_where_it_sits(pose: Odometry) -> None:
    x, y = pose.x + LIMO.lidar_x * math.cos(pose.yaw), pose.y + LIMO.lidar_x * math.sin(pose.yaw)
    for angle in (-1.95, -1.0, 0.0, 1.95, 2.05, -2.05, math.pi):
        at = x + 0.3 * math.cos(pose.yaw + angle), y + 0.3 * math.sin(pose.yaw + angle), 0.0, 0.0
        returns = Returns(1.0, np.empty((0, 2)), pose)
        assert is_in_view(Track(1.0, at, upper(np.eye(4))), returns, 2.0, LIMO) == (abs(angle) < 2.0)


def test_nothing_moves_or_has_left_before_the_ground_is_mapped() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(8):
        y = 0.1 * index
        movers = update(movers, SCAN_S * index, (2.0, y - 0.03), (2.0, y + 0.03), ground=None)
    assert (len(movers), MOVERS.moving(movers)) == (1, [])


def test_returns_are_one_movers_the_nearest_of_those_that_are_known_to_walk() -> None:
    persons, nameless = walker(7, 2.0, 0.0), walker(None, 2.0, 0.3)
    between = (2.0, 0.18), (2.0, 0.22)
    assert felt((nameless, persons), *between) == {7: 1.0, None: 1.1}
    assert felt((replace(nameless, left=False), persons), *between) == {7: 1.1, None: 1.0}
    assert felt((nameless, persons), (2.0, -0.02), (2.0, 0.0), *between) == {7: 1.1, None: 1.1}


def felt(movers: tuple[Mover, ...], *points: Place) -> dict[int | None, float]:
    """Return when the legs of each number were felt last, after a scan at 1.1 s."""
    return {mover.number: mover.felt for mover in update(movers, 1.1, *points)}


@pytest.mark.parametrize(
    ("movers", "taken"),
    [
        ((), True),
        ((walker(7, 2.0, 0.0), walker(None, 2.0, 0.3)), False),
        # Legs without a number may be the person's own, where these are not known. What stands may be anything.
        ((walker(None, 2.0, 0.3),), True),
        ((walker(7, 2.0, 0.0), replace(walker(None, 2.0, 0.3), left=False)), True),
        ((walker(8, 2.0, 0.3),), False),
        ((walker(8, 2.0, -0.3),), True),
    ],
)
def test_a_passer_by_does_not_take_the_track_along(movers: tuple[Mover, ...], taken: bool) -> None:
    followed = person(7, 2.0, 0.0, 0.9)
    returns = Returns(1.0, np.array([(2.0, 0.18), (2.0, 0.22)]), Odometry())
    after = MOVERS.walked(followed, movers, returns, NOISE)
    assert (after.felt == 1.0) == taken
    assert (after.track.mean[1] > 0.0) == taken
