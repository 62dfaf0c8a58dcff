"""Whose box is whose: by where people are, how sure that is, how large they are and what they wear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise
from limo_hog.follow.tracks.person import Person, predict
from limo_hog.follow.tracks.tracker import Tracker

NOISE, POSE, TRACKER = Noise(), Odometry(), Tracker()
APPEARANCE = TRACKER.association.appearance
WINDOW = 536.0
IN_RED: NDArray[np.float64] = np.array([[10.0, 4.0, 10.0], [6.0, 6.0, 9.0]])
IN_GREEN: NDArray[np.float64] = np.array([[5.0, 10.0, 10.0], [6.0, 6.0, 9.0]])


def somebody(number: int, distance: float, bearing: float = 0.0, clothes: NDArray[np.float64] | None = None) -> Person:
    """A person who is known well, last seen at time 0."""
    sharp = replace(NOISE, range=0.05, bearing=0.01, velocity=0.1)
    track = kalman.initiate(0.0, bearing, distance, POSE, sharp)
    return Person(number, track, 0.0, 1.0, WINDOW, -120.0, confirmed=True, age=50, clothes=clothes)


def box(distance: float, bearing: float = 0.0, clothes: NDArray[np.float64] | None = None) -> Measurement:
    """A box on the whole of somebody."""
    return Measurement(bearing, distance, round(WINDOW / distance), -120.0 / distance, 2.0, clothes)


def pairs(people: tuple[Person, ...], *boxes: Measurement) -> dict[int, int]:
    return TRACKER.association.pair(people, boxes, POSE, NOISE)


def test_somebody_long_unseen_does_not_take_the_box_of_who_is_seen() -> None:
    seen, gone = somebody(1, 1.6), predict(replace(somebody(2, 2.6), seen=-2.0), 2.0, NOISE)
    # He may be anywhere by now, and so fits everywhere.
    assert pairs((gone,), box(1.7, 0.05)) == {0: 0}
    assert pairs((gone, seen), box(1.7, 0.05)) == {1: 0}


def test_a_second_box_on_somebody_is_nobody_elses() -> None:
    seen, gone = somebody(1, 1.6), predict(replace(somebody(2, 2.6), seen=-2.0), 2.0, NOISE)
    assert pairs((seen, gone), box(1.6), box(1.65, 0.05)) == {0: 0}


def test_two_who_meet_are_told_apart_by_their_clothes() -> None:
    one, other = somebody(1, 2.0, 0.0, IN_RED), somebody(2, 2.1, 0.1, IN_GREEN)
    # Each box is a little nearer to the wrong one.
    assert pairs((one, other), box(2.02, 0.03, IN_GREEN), box(2.08, 0.07, IN_RED)) == {0: 1, 1: 0}


def test_two_who_meet_in_equal_clothes_are_told_apart_by_their_ways() -> None:
    one, other = somebody(1, 2.0, 0.0, IN_RED), somebody(2, 2.6, 0.1, IN_RED)
    assert pairs((one, other), box(2.55, 0.08, IN_RED), box(2.05, 0.02, IN_RED)) == {0: 1, 1: 0}


def test_a_glimpse_of_wrong_colours_does_not_lose_who_is_certain() -> None:
    assert pairs((somebody(1, 2.0, 0.0, IN_RED),), box(2.02, 0.01, IN_GREEN)) == {0: 0}


def test_somebody_unseen_does_not_become_somebody_in_other_clothes() -> None:
    gone = predict(somebody(1, 2.0, 0.0, IN_RED), 2.0, NOISE)
    assert pairs((gone,), box(2.5, 0.2, IN_RED)) == {0: 0}
    assert pairs((gone,), box(2.5, 0.2, IN_GREEN)) == {}


def test_a_box_behind_somebody_that_is_not_their_size_is_not_theirs() -> None:
    behind = replace(box(1.6), range=4.0)
    before = replace(box(1.6), range=0.8)
    assert pairs((somebody(1, 1.6),), behind) == {}
    assert pairs((somebody(1, 1.6),), before) == {0: 0}


def test_a_person_grows_no_smaller_for_the_parts_of_them_seen_near_by() -> None:
    person, part = somebody(1, 1.5), replace(box(1.5), height=200)
    assert TRACKER.correct(person, part, POSE).window == WINDOW
    assert TRACKER.correct(replace(person, confirmed=False), part, POSE).window < WINDOW


def test_clothes_are_averaged_until_somebody_is_known_and_then_kept() -> None:
    new = replace(somebody(1, 2.0, 0.0, IN_GREEN), confirmed=False, age=1)
    for _ in range(10):
        new = TRACKER.correct(replace(new, confirmed=False), box(2.0, 0.0, IN_RED), POSE)
    assert APPEARANCE.cost(new.clothes, IN_RED) < APPEARANCE.other / 2
    known = replace(new, confirmed=True, clothes=IN_RED)
    for _ in range(30):
        known = TRACKER.correct(known, box(2.0, 0.0, IN_GREEN), POSE)
    assert APPEARANCE.cost(known.clothes, IN_RED) == 0
