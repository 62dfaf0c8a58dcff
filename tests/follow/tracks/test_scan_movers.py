"""People whom the lidar alone shows: groups of returns that move."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from tests.follow.estimates import upper
from tests.follow.views import look

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid
from limo_hog.follow.tracks.association import Returns
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.movers import Mover, Movers
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracker, Tracks

MOVERS, NOISE, HALF_VIEW, SCAN_S, GRID = Movers(), Noise(), 2.0, 0.125, Grid()
#: Ground that is free from now on, wherever nothing is.
FREE = replace(GRID.start(Odometry()), freed=np.full((GRID.cells, GRID.cells), np.inf, np.float32))


def legs(x: float, y: float, phase: float) -> list[tuple[float, float]]:
    """Three returns of each of two shins, of which one stands while the other swings."""
    swing = 0.15 * math.sin(phase)
    return [(x + side * swing, y + side * 0.06 + d) for side in (-1, 1) for d in (-0.02, 0.0, 0.02)]


def walk(start: tuple[float, float], velocity: tuple[float, float], scans: int) -> tuple[Mover, ...]:
    """What moves after so many scans of a robot that stands, with a wall 3 m to its left; it sees ±115°."""
    movers: tuple[Mover, ...] = ()
    wall = [(0.05 * step - 3.0, 3.0) for step in range(120)]
    for index in range(scans):
        time = index * SCAN_S
        x, y = start[0] + velocity[0] * time, start[1] + velocity[1] * time
        shown = abs(math.atan2(y, x - LIMO.lidar_x)) < HALF_VIEW
        # In the order of the beams.
        points = np.array(sorted(legs(x, y, 9.0 * time) * shown + wall, key=lambda one: math.atan2(one[1], one[0])))
        movers = MOVERS.update(movers, Returns(time, points, Odometry()), HALF_VIEW, NOISE, GRID, FREE)
    return movers


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
    nothing = np.empty((0, 2))
    for index in range(10, 16):
        movers = MOVERS.update(movers, Returns(index * SCAN_S, nothing, Odometry()), HALF_VIEW, NOISE, GRID, FREE)
    assert movers == ()


def test_what_is_seen_of_a_wall_beside_a_nearer_post_does_not_begin_to_move() -> None:
    wall = [(2.0, 0.05 * step) for step in range(6)]
    beside_a_post = np.array([(1.0, -0.1), (1.0, -0.05), *wall])
    alone = np.array([(3.0, -0.9), (3.0, -0.5), *wall])
    for points, begun in ((beside_a_post, 1), (alone, 1)):
        movers = MOVERS.update((), Returns(0.0, points, Odometry()), HALF_VIEW, NOISE, GRID, FREE)
        assert len(movers) == begun
    assert math.dist(movers[0].began, (2.0, 0.125)) < 1e-6


def test_the_end_of_a_wall_that_comes_into_view_does_not_move_for_it_is_still_wall_where_it_began() -> None:
    wall_stays = replace(FREE, freed=np.full((GRID.cells, GRID.cells), -np.inf, np.float32))
    for ground, moving in ((FREE, 1), (wall_stays, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(12):
            seen = np.array([(2.0, 0.07 * index + 0.05 * step) for step in range(5)])
            movers = MOVERS.update(movers, Returns(index * SCAN_S, seen, Odometry()), HALF_VIEW, NOISE, GRID, ground)
        assert len(MOVERS.moving(movers)) == moving


def test_what_is_seen_of_a_wall_at_the_edge_of_its_cells_does_not_move_along_it() -> None:
    # The wall is in the cells up to 2 m; its returns stray by a centimetre to either side of that.
    wall = GRID.flat(FREE, np.array([(1.95, 0.05 * step - 1.0) for step in range(60)]))
    occupied, freed = FREE.occupied.copy(), FREE.freed.copy()
    occupied.flat[wall], freed.flat[wall] = 2.0, -np.inf
    walled = replace(FREE, stamp=0.0, occupied=occupied, freed=freed)
    for ground, moving in ((FREE, 1), (walled, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(12):
            seen = np.array([(2.01, 0.07 * index + 0.05 * step - 0.8) for step in range(5)])
            movers = MOVERS.update(movers, Returns(index * SCAN_S, seen, Odometry()), HALF_VIEW, NOISE, GRID, ground)
        assert len(MOVERS.moving(movers)) == moving


def test_what_the_camera_has_shown_for_long_is_counted() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(10):
        points = np.array(legs(2.0, 0.06 * index - 0.3, 1.0 * index))
        movers = MOVERS.update(movers, Returns(index * SCAN_S, points, Odometry()), HALF_VIEW, NOISE, GRID, FREE, 0.5)
    assert movers[0].shown == movers[0].scans - 1


def person(number: int, x: float, y: float, stamp: float) -> Person:
    """Someone found by the camera at a stamp."""
    track = Track(stamp, (x, y, 0.0, 0.0), upper(np.diag([0.04, 0.04, 0.5, 0.5])))
    return Person(number, track, stamp, 5.0, 400.0, 0.0, confirmed=True)


def test_the_legs_of_a_person_continue_the_track_that_the_camera_does_not_show() -> None:
    known = person(7, 1.55, 0.05, 0.875)
    movers = MOVERS.assign(walk((1.5, -0.4), (0.0, 0.5), 8), [known], 0.875)
    assert [one.number for one in movers] == [7]
    returns = Returns(1.0, np.array(legs(1.5, 0.1, 9.0)), Odometry())
    movers = MOVERS.update(movers, returns, HALF_VIEW, NOISE, GRID, FREE)
    continued = MOVERS.continued(known, movers, returns, NOISE)
    assert continued.felt == 1.0
    assert math.dist(continued.track.mean[:2], (1.5, 0.1)) < math.dist(known.track.mean[:2], (1.5, 0.1))
    # Not one whose legs they are not, and each scan counts once.
    assert MOVERS.continued(person(8, 1.5, 0.1, 0.9), movers, returns, NOISE).felt < 0
    assert MOVERS.continued(continued, movers, returns, NOISE) is continued


def test_two_people_side_by_side_have_one_pair_of_legs_each() -> None:
    movers = tuple(Mover(person(0, 1.5, y, 1.0).track, (1.5, y), 0.0, 1.0) for y in (0.0, 0.3))
    people = [person(1, 1.6, 0.2, 1.0), person(2, 1.5, 0.35, 1.0)]
    assert [one.number for one in MOVERS.assign(movers, people, 1.0)] == [1, 2]
    # The number goes along with the person, and is given once.
    later = MOVERS.assign(MOVERS.assign(movers, people, 1.0), [person(1, 1.5, 0.3, 1.0)], 1.0)
    assert [one.number for one in later] == [1]


def test_the_legs_of_two_who_walk_side_by_side_stay_apart() -> None:
    people = [person(1, 1.5, 0.0, 0.0), person(2, 1.6, 0.4, 0.0)]
    movers = tuple(
        Mover(one.track, (1.0, 0.0), 0.0, 0.0, left=True, number=one.number, named=0.0) for one in reversed(people)
    )
    for index in range(1, 40):
        y = 0.03 * index
        # Three scans of eight show only the first person, who hides the second.
        shown = legs(1.5, y, 1.0 * index) + (legs(1.6, y + 0.4, 1.3 * index) if index % 8 < 5 else [])
        movers = MOVERS.update(
            movers, Returns(index * SCAN_S, np.array(shown), Odometry()), HALF_VIEW, NOISE, GRID, FREE
        )
    places = {one.number: one.track.mean[:2] for one in movers if one.number is not None}
    assert math.dist(places[1], (1.5, y)) < 0.2
    assert math.dist(places[2], (1.6, y + 0.4)) < 0.2


def test_legs_are_a_persons_since_the_camera_first_showed_that() -> None:
    movers = MOVERS.assign(
        (Mover(person(0, 1.5, 0.0, 1.0).track, (1.5, 0.0), 0.0, 1.0),), [person(1, 1.5, 0.0, 1.0)], 1.0
    )
    later = MOVERS.assign(tuple(replace(one, felt=2.0) for one in movers), [person(1, 1.5, 0.1, 2.0)], 2.0)
    other = MOVERS.assign(tuple(replace(one, felt=3.0) for one in later), [person(2, 1.5, 0.1, 3.0)], 3.0)
    assert [one.named for one in (*movers, *later, *other)] == [1.0, 1.0, 3.0]


def test_legs_that_begin_to_walk_where_a_lost_person_can_be_are_theirs_unless_another_was_lost_too() -> None:
    lost, another = person(7, 1.5, -0.4, -0.2), person(8, 1.5, 0.4, -0.2)
    seen_together = person(7, 1.5, -0.4, 0.1)
    far_off = person(7, -1.5, -0.4, -0.2)
    for people, found in (((lost,), True), ((lost, another), False), ((seen_together,), False), ((far_off,), False)):
        scan = Returns(1.0, np.array(legs(1.5, 0.1, 9.0)), Odometry())
        tracks = Tracks(people, scans=(scan,), stamp=1.0, movers=walk((1.5, -0.4), (0.0, 0.5), 8), moved_at=0.875)
        after = Tracker().follow_movers(tracks, HALF_VIEW, 0.5, GRID, FREE)
        assert (after.people[0].felt == 1.0) == found


def walker(number: int | None, x: float, y: float) -> Mover:
    """Legs that walk, of the person of a number."""
    track = Track(1.0, (x, y, 0.0, 0.0), upper(np.diag([0.01, 0.01, 0.1, 0.1])))
    return Mover(track, (x - 1.0, y), 0.0, 1.0, left=True, scans=9, number=number, named=0.0)


def test_a_person_keeps_their_own_legs_where_one_box_lies_between_two_who_pass_each_other() -> None:
    movers = (walker(1, 1.5, 0.0), walker(2, 1.75, 0.25))
    between = [person(2, 1.6, 0.1, 1.0)]
    assert [(one.number, one.track) for one in MOVERS.assign(movers, between, 1.0)] == [
        (one.number, one.track) for one in movers
    ]
    on_the_first = [person(2, 1.5, 0.0, 1.0)]
    assert [one.number for one in MOVERS.assign(movers, on_the_first, 1.0)] == [2]


def test_a_box_on_other_legs_that_walk_is_not_the_persons_whose_own_walk_elsewhere() -> None:
    known = [person(1, 1.5, 0.0, 1.0)]
    box = Measurement(0.15, 1.8, 300, 0.0, 1.0)
    beside = (1.8 * math.cos(0.15), 1.8 * math.sin(0.15))
    for number in (2, None):
        moving = (walker(1, 1.5, 0.0), walker(number, *beside))
        assert MOVERS.others(moving, known, [box], Odometry(), NOISE) == {(0, 0)}
    # Not where nothing walks there, where the person's own legs are not seen, or where the box is as near to them.
    for others in ([walker(1, 1.5, 0.0)], [walker(2, *beside), walker(3, 0.0, 2.0)]):
        assert MOVERS.others(others, known, [box], Odometry(), NOISE) == set()
    near = (walker(1, 1.7, 0.2), walker(2, *beside))
    assert MOVERS.others(near, known, [box, replace(box, range=None)], Odometry(), NOISE) == set()


def test_a_place_is_empty_as_soon_as_a_beam_ends_behind_it_and_not_where_something_nearer_is() -> None:
    never = replace(FREE, freed=np.full((GRID.cells, GRID.cells), -np.inf, np.float32))
    wall = [(3.5, 0.05 * step - 3.0) for step in range(120)]
    post = [(0.8, 0.0), (0.8, 0.05)]
    for nearer, moving in (([], 1), (post, 0)):
        movers: tuple[Mover, ...] = ()
        for index in range(10):
            y = 0.1 * index
            hidden = [one for one in wall if abs(one[1] - y * 3.5 / 2.0) > 0.3]
            after = nearer if index > 1 else []
            points = np.array(sorted([(2.0, y - 0.03), (2.0, y + 0.03), *hidden, *after], key=lambda p: p[1] / p[0]))
            movers = MOVERS.update(movers, Returns(index * SCAN_S, points, Odometry()), HALF_VIEW, NOISE, GRID, never)
        assert len(MOVERS.moving(movers)) == moving


def test_what_begins_is_where_its_returns_are_wherever_the_robot_is() -> None:
    for pose in (Odometry(), Odometry(0.0, -1.0, 1.5, 0.7), Odometry(0.0, 2.0, -0.8, -2.5)):
        angle = pose.yaw - 0.4
        place = (pose.x + 2.0 * math.cos(angle), pose.y + 2.0 * math.sin(angle))
        (mover,) = MOVERS.update((), Returns(0.0, np.array([place, place]), pose), HALF_VIEW, NOISE, GRID, FREE)
        np.testing.assert_allclose(mover.track.mean, [*place, 0.0, 0.0], atol=1e-9)


def test_a_miss_says_nothing_of_a_person_whose_legs_walk() -> None:
    known = person(1, 2.5, 0.0, 0.95)
    for movers, falls in (((walker(1, 2.5, 0.0),), False), ((), True)):
        before = Tracks(people=(known,), stamp=0.95, movers=movers)
        after, boxes = Tracker().update(look(stamp=1.05), before)
        assert boxes == {}
        assert (after.people[0].log_odds < known.log_odds) == falls
        assert after.people[0].misses == 1
