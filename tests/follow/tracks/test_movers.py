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


def test_a_place_is_empty_once_a_beam_ends_behind_it_and_nothing_is_nearer() -> None:
    wall = [(3.5, 0.05 * step - 3.0) for step in range(120)]
    post = [(0.8, 0.0), (0.8, 0.05)]
    for nearer, moving in (([], 1), (post, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(10):
            y = 0.1 * index
            hidden = [one for one in wall if abs(one[1] - y * 3.5 / 2.0) > 0.3]
            after = nearer if index > 1 else []
            points = sorted([(2.0, y - 0.03), (2.0, y + 0.03), *hidden, *after], key=lambda p: p[1] / p[0])
            movers = update(movers, index * SCAN_S, *points, ground=NEVER)
        assert len(MOVERS.moving(movers)) == moving


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


def test_legs_are_two_returns_within_a_stride_near_enough_for_a_beam_on_each_shin() -> None:
    assert begun() == []
    assert begun((2.0, 0.0)) == []
    assert begun((2.0, 0.0), (2.0, 0.1)) == [pytest.approx((2.0, 0.05))]
    for wide, groups in ((0.54, 1), (0.56, 0)):
        assert len(begun((2.0, -wide / 2), (2.0, 0.0), (2.0, wide / 2))) == groups
    for far, groups in ((3.45, 1), (3.55, 0)):
        for pose in POSES:
            place = (pose.x + far * math.cos(pose.yaw), pose.y + far * math.sin(pose.yaw))
            assert len(begun(place, place, pose=pose)) == groups


def test_what_is_followed_does_not_begin_again_and_what_stands_beside_it_does() -> None:
    first = update((), 0.0, (2.0, -0.05), (2.0, 0.05))
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05))) == 1
    turn = 0.45 / 2.0
    beside = [(2.0 * math.cos(turn), 2.0 * math.sin(turn) + dy) for dy in (-0.03, 0.03)]
    assert len(update(first, 0.125, (2.0, -0.05), (2.0, 0.05), *beside)) == 2


def test_it_has_moved_after_half_a_second_and_a_quarter_of_a_metre() -> None:
    one = replace(walker(None, 2.0, 0.0), began=(2.0, 0.26), scans=4)
    assert MOVERS.moving((one,)) == [one]
    others = (replace(one, scans=3), replace(one, began=(2.0, 0.24)), replace(one, left=False))
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


@pytest.mark.parametrize(
    ("off", "beyond", "left"), [(0.028, 0.35, True), (-0.028, 0.35, True), (0.032, 0.35, False), (0.0, 0.25, False)]
)
def test_a_place_is_empty_where_the_beams_beside_it_end_three_decimetres_behind(
    off: float, beyond: float, left: bool
) -> None:
    moved = replace(walker(None, 2.0, 0.9), began=(2.0, 0.0), left=False)
    far = 2.0 - LIMO.lidar_x + beyond
    behind = LIMO.lidar_x + far * math.cos(off), far * math.sin(off)
    (after, *_) = update((moved,), 1.1, (2.0, 0.88), (2.0, 0.92), behind, ground=NEVER)
    assert after.left is left
