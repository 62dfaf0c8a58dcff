"""People out of sight: remembered where they were, and taken to walk on from there."""

import numpy as np
import pytest

from limo_hog.follow.tracks.hiding import Hiding, Other

HIDING, NOW, NOWHERE = Hiding(), 100.0, np.empty((0, 2))


def remembered(*others: Other, **places: list[tuple[float, float]]) -> list[Other]:
    felt, own = (np.array(places.get(name, ())).reshape(-1, 2) for name in ("felt", "own"))
    return list(HIDING.remember(others, [Other(x, y, NOW) for x, y in places.get("seen", ())], felt, own, NOW))


def test_a_person_seen_again_within_a_walk_of_where_they_were_is_the_same() -> None:
    # Two seconds at 1 m/s and half a metre.
    for x, people in ((2.4, 1), (2.6, 2)):
        assert len(remembered(Other(0.0, 0.0, NOW - 2.0), seen=[(x, 0.0)])) == people


def test_the_nearest_of_two_is_the_one_seen_again() -> None:
    left, right = Other(0.0, 1.0, NOW - 1.0), Other(0.0, -1.0, NOW - 1.0)
    assert remembered(left, right, seen=[(0.0, 0.5)]) == [Other(0.0, 0.5, NOW), right]


def test_of_two_who_can_be_anywhere_the_one_just_measured_is_the_one_seen_again() -> None:
    long_ago, just = Other(0.0, 0.5, NOW - 20.0), Other(1.0, 0.0, NOW - 0.1)
    assert remembered(long_ago, just, seen=[(1.0, 0.2)]) == [Other(1.0, 0.2, NOW), long_ago]


def test_a_person_in_other_clothes_is_another() -> None:
    red, green = np.array([[6.0, 0.0, 5.0], [1.0, 1.0, 2.0]]), np.array([[-3.0, 5.0, 5.0], [1.0, 1.0, 2.0]])
    for clothes, people in ((red + 0.5, 1), (green, 2), (None, 1)):
        seen = [Other(1.0, 0.0, NOW, clothes)]
        kept = HIDING.remember((Other(0.0, 0.0, NOW - 9.0, red),), seen, NOWHERE, NOWHERE, NOW)
        assert len(kept) == people
    assert kept[0].clothes is red


def test_legs_where_a_person_was_are_still_theirs_and_others_are_nobodys() -> None:
    stands = Other(1.0, 1.0, NOW - 3.0)
    assert remembered(stands, felt=[(1.2, 1.0), (5.0, 5.0)]) == [Other(1.2, 1.0, NOW)]
    assert remembered(stands, felt=[(1.6, 1.0)]) == [stands]


def test_the_person_followed_is_no_other_and_nobody_is_remembered_for_over_a_minute() -> None:
    assert remembered(Other(1.0, 0.0, NOW - 0.1), own=[(1.3, 0.0)]) == []
    assert remembered(Other(1.0, 0.0, NOW - 59.1)) == []


def test_who_is_out_of_sight_can_be_as_far_off_as_people_walk() -> None:
    circles = HIDING.circles((Other(1.0, 2.0, NOW - 3.0), Other(0.0, 0.0, NOW - 0.7)), NOW)
    assert circles == pytest.approx(np.array([(1.0, 2.0, 3.5)]))
