"""Which track is the person followed: by way, clothes and stature together, with doubt where they do not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.follow.control.selection import Choice, Selection
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.identity import Identity, Likeness, Traits
from limo_hog.follow.tracks.kalman import Noise
from limo_hog.follow.tracks.movers import Mover
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracks

IDENTITY, SELECTION = Identity(), Selection()
IN_RED: NDArray[np.float64] = np.array([[10.0, 4.0, 10.0], [6.0, 6.0, 9.0]])
IN_GREEN: NDArray[np.float64] = np.array([[5.0, 10.0, 10.0], [6.0, 6.0, 9.0]])
WINDOW = 536.0


def person(
    number: int,
    stamp: float,
    y: float = 0.0,
    clothes: NDArray[np.float64] | None = IN_RED,
    *,
    tall: float = WINDOW,
    measured: float | None = None,
    age: int = 50,
) -> Person:
    """Return a confirmed person 2 m ahead, found in the frame of `stamp` unless `measured` says when."""
    track = kalman.initiate(stamp, 0.0, 2.0, Odometry(), Noise())
    track = replace(track, mean=(2.0, y, 0.0, 0.0))
    seen = stamp if measured is None else measured
    return Person(number, track, seen, 5.0, tall, -120.0, True, age, clothes=clothes, worn=clothes, tall=tall)


def at(stamp: float, *people: Person) -> Tracks:
    """Return the tracks of a frame."""
    return Tracks(people, stamp=stamp)


def followed() -> Likeness:
    """Return what is known of a person in red who was followed for a second and stands 2 m ahead."""
    known = IDENTITY.begin(person(1, 0.0))
    for frame in range(1, 11):
        known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame)))
    assert known.of(1) > 0.99
    return known


def test_a_track_that_goes_over_to_another_shirt_is_not_the_person_any_more() -> None:
    known = followed()
    for frame in range(11, 26):
        known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, clothes=IN_GREEN, tall=0.95 * WINDOW)))
    assert known.of(1) < 0.1
    # What the other person wears was not learnt.
    assert known.traits.clothes is not None
    assert known.traits.clothes[0] == pytest.approx(IN_RED[0])


def test_one_box_of_odd_colours_does_not_lose_the_person() -> None:
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1, clothes=IN_GREEN)))
    assert known.of(1) > 0.9


def legs(one: Person, stamp: float, *, since: float = 0.0) -> Mover:
    """Return what walks where a person is and has been shown to be their legs since then [s]."""
    return Mover(one.track, (0.0, 0.0), 0.0, stamp, left=True, number=one.number, named=since)


def test_a_person_whose_legs_have_been_the_same_stays_the_person() -> None:
    for with_legs, low, high in ((True, 0.9, 1.0), (False, 0.0, 0.1)):
        known = followed()
        for frame in range(11, 26):
            # Something before the shirt, for a second and a half.
            one = person(1, 0.1 * frame, clothes=IN_GREEN)
            walking = (legs(one, one.seen),) if with_legs else ()
            known = IDENTITY.update(known, replace(at(0.1 * frame, one), movers=walking))
        assert low <= known.of(1) <= high


def test_a_person_who_is_hardly_likely_is_known_again_while_their_legs_go_on() -> None:
    known = replace(followed(), chances=((1, 0.1),))
    for frame in range(11, 21):
        one = person(1, 0.1 * frame)
        known = IDENTITY.update(known, replace(at(0.1 * frame, one), movers=(legs(one, one.seen),)))
    assert known.of(1) > 0.8


def test_a_box_beside_another_person_tells_nothing_for_it_may_show_either() -> None:
    for apart, low, high in ((0.4, 0.6, 1.0), (0.8, 0.0, 0.2)):
        known = followed()
        for frame in range(11, 26):
            stamp = 0.1 * frame
            known = IDENTITY.update(known, at(stamp, person(1, stamp, clothes=IN_GREEN), person(2, stamp, apart)))
        assert low <= known.of(1) <= high


def test_two_alike_side_by_side_hardly_change_places_and_not_at_all_while_each_has_legs_that_go_on() -> None:
    for apart, low, high in ((0.45, 0.95, 1.0), (0.35, 0.6, 0.8)):
        known = followed()
        for frame in range(11, 111):
            stamp = 0.1 * frame
            one, other = person(1, stamp, clothes=None), person(2, stamp, apart, None)
            both = replace(at(stamp, one, other), movers=(legs(one, stamp), legs(other, stamp)))
            known = IDENTITY.update(known, both)
        assert low <= known.of(1) <= high


def test_legs_that_were_just_taken_for_the_persons_tell_nothing() -> None:
    known = followed()
    for frame in range(11, 19):
        one = replace(person(1, 0.1 * frame, clothes=IN_GREEN), strained=frame == 11)
        known = IDENTITY.update(known, replace(at(0.1 * frame, one), movers=(legs(one, one.seen, since=1.0),)))
    assert known.of(1) < 0.5


def test_a_lost_person_is_known_again_by_the_clothes_and_another_is_not() -> None:
    for clothes, low, high in ((IN_RED, 0.8, 1.0), (IN_GREEN, 0.0, 0.2)):
        known = followed()
        for frame in range(11, 60):
            known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.0)))
        for frame in range(60, 70):
            found = person(2, 0.1 * frame, 0.5, clothes, age=frame - 59)
            known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.0), found))
        assert low <= known.of(2) <= high


def test_what_little_the_light_makes_of_the_clothes_of_two_alike_does_not_add_up() -> None:
    dim = IN_RED - [[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]]
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), person(2, 1.1, 1.0, dim)))
    known = replace(known, chances=((1, 0.85), (2, 0.1)))
    for frame in range(12, 42):
        stamp = 0.1 * frame
        known = IDENTITY.update(known, at(stamp, person(1, stamp, clothes=None), person(2, stamp, 1.0)))
    assert known.of(2) < 0.2


def test_a_track_that_begins_while_the_person_is_measured_is_another() -> None:
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), person(2, 1.1, 0.8, age=1)))
    assert known.of(2) == 0.0
    assert known.of(1) > 0.99


def test_a_track_too_far_off_to_be_walked_to_is_another() -> None:
    known = IDENTITY.update(followed(), at(2.0, person(2, 2.0, 4.0, age=1)))
    assert known.of(2) == 0.0


def test_the_stature_tells_apart_people_in_one_kind_of_clothes() -> None:
    known = replace(followed(), others=(Traits(7, IN_RED, 1.1 * WINDOW),))
    for frame in range(11, 71):
        stamp = 0.1 * frame
        known = IDENTITY.update(known, at(stamp, person(1, stamp, tall=1.1 * WINDOW)))
    assert known.of(1) < 0.3


def test_two_alike_who_turn_round_each_other_cannot_be_told_apart_after_it() -> None:
    known = followed()
    for frame in range(11, 71):
        stamp = 0.1 * frame
        one, other = person(1, stamp), person(2, stamp, 0.3)
        turns = replace(other, track=replace(other.track, mean=(2.0, 0.3, 0.5, 0.0)))
        known = IDENTITY.update(known, at(stamp, one, turns))
    assert known.of(1) < 0.9
    assert known.of(2) > 0.1


def chosen(chances: tuple[tuple[int, float], ...], stamp: float, unsure_at: float | None = None) -> Choice:
    """Return the choice between two people in view, who look alike, with these probabilities."""
    likeness = replace(followed(), chances=chances, at=stamp)
    choice = Choice(1, likeness, stamp, unsure_at=unsure_at)
    people = at(stamp, person(1, stamp, clothes=None, tall=WINDOW), person(2, stamp, 1.0, None))
    return SELECTION.choose(replace(people, people=tuple(replace(one, tall=None) for one in people.people)), choice)


def test_between_two_as_likely_none_is_chosen_until_it_shows_or_takes_too_long() -> None:
    assert chosen(((1, 0.9), (2, 0.1)), 2.0).candidates == ()
    unsure = chosen(((1, 0.5), (2, 0.45)), 2.0)
    assert set(unsure.candidates) == {1, 2}
    assert unsure.unsure_at == 2.0
    late = chosen(((1, 0.5), (2, 0.45)), 2.0, unsure_at=2.0 - SELECTION.decide_s - 0.1)
    assert (late.number, late.candidates) == (1, ())


def test_the_likelier_of_two_is_followed_even_if_the_other_was() -> None:
    assert chosen(((1, 0.1), (2, 0.85)), 2.0).number == 2
    assert chosen(((1, 0.02), (2, 0.02)), 2.0).number is None


def test_before_one_is_followed_the_one_straight_ahead_and_near_is_meant() -> None:
    ahead, aside, behind = person(1, 0.0, 0.1), person(2, 0.0, -1.0), person(3, 0.0)
    behind = replace(behind, track=replace(behind.track, mean=(4.4, 0.0, 0.0, 0.0)))
    assert SELECTION.choose(at(0.0, aside, behind, ahead), Choice()).number == 1


def test_a_person_who_may_be_the_lost_person_is_looked_at_for_some_seconds_and_then_left() -> None:
    def looked(stamp: float, unsure_at: float | None) -> Choice:
        likeness = replace(followed(), chances=((2, 0.3),), at=stamp)
        back = replace(person(2, stamp, clothes=None), tall=None)
        return SELECTION.choose(at(stamp, back), Choice(None, likeness, 1.0, unsure_at=unsure_at))

    assert looked(3.0, None).candidates == (2,)
    later = looked(3.1 + SELECTION.decide_s, 3.0)
    assert later.candidates == ()
    # They are not looked at anew as long as they are in view.
    assert later.unsure_at == 3.0


def test_a_box_that_contradicts_the_track_in_this_frame_may_be_anothers() -> None:
    # Clothes and stature tell nothing, so what is left is the chance that the box is another person's.
    for strained, late_s, low, high in ((True, 0.0, 0.88, 0.92), (False, 0.0, 0.99, 1.0), (True, 0.1, 0.99, 1.0)):
        one = replace(person(1, 1.1, clothes=None, measured=1.1 - late_s), tall=None, strained=strained)
        assert low < IDENTITY.update(followed(), at(1.1, one)).of(1) < high


def test_everyone_else_who_is_about_is_remembered_once() -> None:
    known = followed()
    for frame in range(11, 16):
        stamp = 0.1 * frame
        others = person(2, stamp, 1.5, IN_GREEN), person(3, stamp, -1.5, IN_GREEN)
        known = IDENTITY.update(known, at(stamp, person(1, stamp), *others))
    assert sorted(one.number for one in known.others) == [2, 3]
