"""Whose legs the lidar shows: a person's whom the camera shows too, or has shown."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.tracks.walkers import FREE, GRID, HALF_VIEW, MOVERS, NOISE, SCAN_S, legs, person, update, walk, walker
from tests.follow.views import look

from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.association import Returns
from limo_hog.follow.tracks.movers import Mover, named
from limo_hog.follow.tracks.tracker import Tracker, Tracks

Place = tuple[float, float]


def numbers(movers: tuple[Mover, ...]) -> list[int | None]:
    return [mover.number for mover in movers]


def test_the_legs_of_a_person_continue_the_track_that_the_camera_does_not_show() -> None:
    known = person(7, 1.55, 0.05, 0.875)
    movers = MOVERS.assign(walk((1.5, -0.4), (0.0, 0.5), 8), [known], 0.875, NOISE)
    assert numbers(movers) == [7]
    returns = Returns(1.0, np.array(legs(1.5, 0.1, 9.0)), Odometry())
    movers = MOVERS.update(movers, returns, (HALF_VIEW, 0.0), NOISE, GRID, FREE)
    continued = MOVERS.continued(known, movers, 1.0)
    assert continued.felt == 1.0
    assert math.dist(continued.track.mean[:2], (1.5, 0.1)) < math.dist(known.track.mean[:2], (1.5, 0.1))
    # Not one whose legs they are not, and each scan counts once.
    assert MOVERS.continued(person(8, 1.5, 0.1, 0.9), movers, 1.0).felt < 0
    assert MOVERS.continued(continued, movers, 1.0) is continued


def test_two_people_side_by_side_have_one_pair_of_legs_each() -> None:
    movers = tuple(Mover(person(0, 1.5, y, 1.0).track, (1.5, y), 0.0, 1.0) for y in (0.0, 0.3))
    people = [person(1, 1.6, 0.2, 1.0), person(2, 1.5, 0.35, 1.0)]
    assert numbers(MOVERS.assign(movers, people, 1.0, NOISE)) == [1, 2]
    # The number goes along with the person, and is given once.
    later = MOVERS.assign(MOVERS.assign(movers, people, 1.0, NOISE), [person(1, 1.5, 0.62, 1.0)], 1.0, NOISE)
    assert numbers(later) == [1]


def test_the_legs_of_a_tall_person_are_found_as_far_apart_as_their_stride() -> None:
    # An adult begins to walk, too near for the camera to show the head: one foot stands, the other is ahead.
    standing, stride = legs(3.0, 0.0, 0.0), [(3.15, -0.1), (3.15, -0.06), (2.6, 0.1), (2.6, 0.14)]
    for stature in (0.9, 1.75):
        tall = replace(person(7, 3.0, 0.0, 0.0), stature=stature)
        movers = update((), 0.0, *standing)
        movers = MOVERS.assign(movers, [tall], 0.0, NOISE)
        movers = update(movers, SCAN_S, *stride)
        (legs_of_7,) = [mover for mover in movers if mover.number == 7]
        # Both feet draw the track to their middle at 2.9 m, the standing foot alone away from it.
        assert (legs_of_7.track.mean[0] < 3.0) == (stature > 1), stature
        assert len(movers) == (1 if stature > 1 else 2)


def test_the_legs_of_two_who_walk_side_by_side_stay_apart() -> None:
    people = [person(1, 1.5, 0.0, 0.0), person(2, 1.6, 0.4, 0.0)]
    movers = tuple(
        Mover(one.track, (1.0, 0.0), 0.0, 0.0, left=True, number=one.number, named=0.0) for one in reversed(people)
    )
    for index in range(1, 40):
        y = 0.03 * index
        # Three scans of eight show only the first person, who hides the second.
        shown = legs(1.5, y, 1.0 * index) + (legs(1.6, y + 0.4, 1.3 * index) if index % 8 < 5 else [])
        movers = update(movers, index * SCAN_S, *shown)
    places = {one.number: one.track.mean[:2] for one in movers if one.number is not None}
    assert math.dist(places[1], (1.5, y)) < 0.2
    assert math.dist(places[2], (1.6, y + 0.4)) < 0.2


def test_legs_are_a_persons_since_the_camera_first_showed_that() -> None:
    legs_alone = Mover(person(0, 1.5, 0.0, 1.0).track, (1.5, 0.0), 0.0, 1.0)
    movers: tuple[Mover, ...] = (legs_alone,)
    since = list[float]()
    for number, y, stamp in ((1, 0.0, 1.0), (1, 0.1, 2.0), (2, 0.1, 3.0)):
        felt = tuple(replace(mover, felt=stamp) for mover in movers)
        movers = MOVERS.assign(felt, [person(number, 1.5, y, stamp)], stamp, NOISE)
        since += [mover.named for mover in movers]
    assert since == [1.0, 1.0, 3.0]


@pytest.mark.parametrize("late_s", [0.0, 0.4])
def test_the_legs_of_a_person_whom_the_camera_shows_are_where_it_shows_them(late_s: float) -> None:
    before = walker(7, 2.0, 0.0)
    # The image is older than the scan: the person has walked on since.
    shown = person(7, 2.1, 0.2 - 0.5 * late_s, 1.0 - late_s)
    shown = replace(shown, track=replace(shown.track, mean=(*shown.track.place, 0.0, 0.5)))
    (after,) = MOVERS.assign((before,), [shown], 1.0, NOISE)
    assert after.track.stamp == 1.0
    assert after.track.mean == pytest.approx((2.1, 0.2, 0.0, 0.5), abs=0.05)


def test_a_person_keeps_their_legs_where_a_box_lies_between_two_who_pass() -> None:
    movers = (walker(1, 1.5, 0.0), walker(2, 1.75, 0.25))
    between = [person(2, 1.6, 0.1, 1.0)]
    kept = MOVERS.assign(movers, between, 1.0, NOISE)
    assert numbers(kept) == [1, 2]
    assert [mover.track for mover in kept] == [movers[0].track, between[0].track]
    on_the_first = [person(2, 1.5, 0.0, 1.0)]
    assert numbers(MOVERS.assign(movers, on_the_first, 1.0, NOISE)) == [2]


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


def test_a_miss_says_nothing_of_a_person_whose_legs_walk() -> None:
    known = person(1, 2.5, 0.0, 0.95)
    for movers, falls in (((walker(1, 2.5, 0.0),), False), ((), True)):
        before = Tracks(people=(known,), stamp=0.95, movers=movers)
        after, boxes = Tracker().update(look(stamp=1.05), before)
        assert boxes == {}
        assert (after.people[0].log_odds < known.log_odds) == falls
        assert after.people[0].misses == 1


def assigned(movers: tuple[Mover, ...], *people: tuple[int, float, float]) -> list[int | None]:
    return numbers(MOVERS.assign(movers, [person(n, x, y, 1.0) for n, x, y in people], 1.0, NOISE))


def test_legs_within_four_decimetres_of_a_person_are_theirs() -> None:
    for off, number in ((0.39, 7), (0.41, None)):
        assert assigned((walker(None, 2.0, 0.0),), (7, 2.0, off)) == [number]
    # Not those that this scan did not show.
    assert assigned((replace(walker(None, 2.0, 0.0), felt=0.9),), (7, 2.0, 0.0)) == [None]


@pytest.mark.parametrize("whose", [9, None])
def test_other_legs_become_a_persons_where_they_are_clearly_nearer_than_their_own(whose: int | None) -> None:
    for off, numbers in ((0.36, [7]), (0.34, [7, whose])):
        # The other legs are where the person is; those that were their own are `off` away, or begin again.
        assert assigned((walker(7, 2.0, 0.0), walker(whose, 2.0, off)), (7, 2.0, off)) == numbers


def test_the_nearest_legs_are_a_persons_and_those_taken_for_them_before_begin_again() -> None:
    before = (walker(7, 2.0, 0.38), walker(None, 2.0, 0.02), walker(3, 0.0, 2.0))
    assert assigned(before, (7, 2.0, 0.0)) == [7, 3]
    one = named(replace(before[1], shown=5), person(7, 1.5, 0.0, 4.0), 4.0)
    assert (one.number, one.shown, one.named) == (7, 0, 4.0)
    assert named(one, person(7, 1.5, 0.0, 5.0), 5.0).named == 4.0


@pytest.mark.parametrize("pose", [Odometry(), Odometry(1.0, -1.0, 1.5, 0.7), Odometry(1.0, 2.0, -0.8, -2.5)])
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
