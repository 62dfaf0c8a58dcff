"""People whom the lidar alone shows: groups of returns that move."""

from __future__ import annotations

import math

import numpy as np

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.legs import Returns
from limo_hog.follow.tracks.movers import Mover, Movers
from limo_hog.follow.tracks.person import Person

MOVERS, NOISE, HALF_VIEW, SCAN_S = Movers(), Noise(), 2.0, 0.125


def legs(x: float, y: float, phase: float) -> list[tuple[float, float]]:
    """Three returns of each of two shins, of which one stands while the other swings."""
    swing = 0.15 * math.sin(phase)
    return [(x + side * swing, y + side * 0.06 + d) for side in (-1, 1) for d in (-0.02, 0.0, 0.02)]


def scanned(points: list[tuple[float, float]]) -> Points:
    """These points and the walls of a room, in the order of the beams; what is behind the points is hidden."""
    shown = [math.atan2(y, x - LIMO.lidar_x) for x, y in points]
    walls = []
    for angle in np.linspace(-HALF_VIEW, HALF_VIEW, 292):
        if all(abs(angle - other) > 0.04 for other in shown):
            far = 4.0 / max(abs(math.cos(angle)), abs(math.sin(angle)))
            walls.append((LIMO.lidar_x + far * math.cos(angle), far * math.sin(angle)))
    return np.array(sorted(points + walls, key=lambda point: math.atan2(point[1], point[0] - LIMO.lidar_x)))


def walk(start: tuple[float, float], velocity: tuple[float, float], scans: int) -> tuple[Mover, ...]:
    """What moves after so many scans of a robot that stands in a room of 8 x 8 m; it sees ±115°."""
    movers: tuple[Mover, ...] = ()
    for index in range(scans):
        time = index * SCAN_S
        x, y = start[0] + velocity[0] * time, start[1] + velocity[1] * time
        shown = abs(math.atan2(y, x - LIMO.lidar_x)) < HALF_VIEW
        points = scanned(legs(x, y, 9.0 * time) * shown)
        movers = MOVERS.update(movers, Returns(time, points, Odometry()), HALF_VIEW, NOISE)
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
        movers = MOVERS.update(movers, Returns(index * SCAN_S, nothing, Odometry()), HALF_VIEW, NOISE)
    assert movers == ()


def test_a_piece_of_wall_that_shows_through_a_gap_does_not_move() -> None:
    movers: tuple[Mover, ...] = ()
    for index in range(20):
        # Two wide things go along with the robot, and between them a piece of the wall behind shows.
        x = 0.1 * index
        ahead, back = ([(x + 0.02 * step, 1.2) for step in side] for side in (range(45, 10, -1), range(-3, -40, -1)))
        behind = [(x + 0.02 * step, 2.5) for step in range(20, -4, -1)]
        points = np.array([*ahead, *behind, *back])
        movers = MOVERS.update(movers, Returns(index * SCAN_S, points, Odometry(x=x)), HALF_VIEW, NOISE)
    assert MOVERS.moving(movers) == []


def person(number: int, x: float, y: float, stamp: float) -> Person:
    """Someone found by the camera at a stamp."""
    track = Track(stamp, np.array([x, y, 0.0, 0.0]), np.diag([0.04, 0.04, 0.5, 0.5]))
    return Person(number, track, stamp, 5.0, 400.0, 0.0, confirmed=True)


def test_the_legs_of_a_person_continue_the_track_that_the_camera_does_not_show() -> None:
    movers = MOVERS.assign(walk((1.5, -0.4), (0.0, 0.5), 8), [person(7, 1.55, 0.05, 0.875)], 0.875)
    assert [one.number for one in movers] == [7]
    points = scanned(legs(1.5, 0.1, 9.0))
    returns = Returns(1.0, points, Odometry())
    movers = MOVERS.update(movers, returns, HALF_VIEW, NOISE)
    known = person(7, 1.55, 0.05, 0.875)
    continued = MOVERS.continued(known, movers, returns, NOISE)
    assert continued.felt == 1.0
    assert math.dist(continued.track.mean[:2], (1.5, 0.1)) < math.dist(known.track.mean[:2], (1.5, 0.1))
    # Not one whose legs they are not, and each scan counts once.
    assert MOVERS.continued(person(8, 1.5, 0.1, 0.9), movers, returns, NOISE).felt < 0
    assert MOVERS.continued(continued, movers, returns, NOISE) is continued


def test_two_people_side_by_side_have_one_pair_of_legs_each() -> None:
    movers = tuple(Mover(person(0, 1.5, y, 1.0).track, (1.5, y), 1.0, 5) for y in (0.0, 0.3))
    people = [person(1, 1.6, 0.2, 1.0), person(2, 1.5, 0.35, 1.0)]
    assert [one.number for one in MOVERS.assign(movers, people, 1.0)] == [1, 2]
    # The number goes along with the person, and is given once.
    later = MOVERS.assign(MOVERS.assign(movers, people, 1.0), [person(1, 1.5, 0.3, 1.0)], 1.0)
    assert [one.number for one in later] == [None, 1]
