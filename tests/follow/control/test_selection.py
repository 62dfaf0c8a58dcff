"""Which person to follow: both sides of every probability and time that decides it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.follow.tracks.people import IN_RED, WINDOW
from tests.follow.tracks.wearers import at, person
from tests.follow.views import there

from limo_hog.follow.control.selection import Choice, Selection
from limo_hog.follow.tracks.identity import Likeness, Traits
from limo_hog.follow.tracks.person import Person

SELECTION = Selection()
NOW = 8.0


def known(**chances: float) -> Likeness:
    """What is known of a person in red, and each track's probability, by `one=`, `two=` and so on."""
    numbers = {"one": 1, "two": 2, "three": 3}
    odds = tuple((numbers[name], chance) for name, chance in chances.items())
    return Likeness(Traits(1, IN_RED, WINDOW), (2.0, 0.0), NOW, odds)


def plain(number: int, y: float = 0.0, **other: float) -> Person:
    """A person measured now of whom neither clothes nor stature are seen: what is known stays nearly as it is."""
    return replace(person(number, NOW, y, None, **other), tall=None)  # type: ignore[arg-type]


def unproved(number: int, existence: float, x: float = 2.0, y: float = 0.0, age: int = 5) -> Person:
    """A track in view that is not confirmed, of a probability of being a person."""
    one = plain(number, age=age)
    odds = float(np.log(existence / (1 - existence)))
    return replace(one, confirmed=False, log_odds=odds, track=replace(one.track, mean=(x, y, 0.0, 0.0)))


def choose(choice: Choice, *people: Person) -> Choice:
    return SELECTION.choose(at(NOW, *people), choice)


def test_a_track_is_followed_that_is_likely_and_three_times_as_likely_as_any_other() -> None:
    both = plain(1), plain(2, 1.0)
    for one, two, candidates in ((0.52, 0.0, ()), (0.48, 0.0, ()), (0.7, 0.22, ()), (0.66, 0.24, (1, 2))):
        after = choose(Choice(1, known(one=one, two=two), NOW), *both)
        assert (after.number, after.candidates) == (1, candidates)
    # The likeliest of the others counts, not the last.
    three = known(one=0.6, two=0.25, three=0.11)
    assert choose(Choice(1, three, NOW), *both, plain(3, -1.0)).candidates == (1, 2, 3)


def test_a_track_that_is_likelier_than_not_is_taken_though_another_was_followed() -> None:
    for chance, number in ((0.52, 2), (0.47, None)):
        assert choose(Choice(None, known(two=chance), NOW), plain(2)).number == number


def test_the_time_of_the_person_is_that_of_the_last_frame_in_which_it_was_sure() -> None:
    for chance, measured in ((0.96, NOW), (0.94, 3.0)):
        assert choose(Choice(1, replace(known(one=chance), at=NOW), 3.0), plain(1)).measured == measured


@pytest.mark.parametrize("together", [0.45, 0.55])
def test_between_two_it_waits_where_together_they_are_likelier_than_not(together: float) -> None:
    after = choose(Choice(1, known(one=0.5 * together, two=0.5 * together), NOW), plain(1), plain(2, 1.0))
    assert (after.candidates == (1, 2)) == (together > 0.5)
    assert after.unsure_at == NOW


def test_after_four_seconds_the_likelier_of_two_is_taken_and_is_as_likely_as_not() -> None:
    for since, decided in ((NOW - 3.9, False), (NOW - 4.1, True)):
        choice = Choice(1, known(one=0.3, two=0.4), NOW - 1.0, unsure_at=since)
        after = choose(choice, plain(1), plain(2, 1.0))
        assert (after.candidates == ()) == decided
        if decided:
            assert (after.number, after.measured) == (2, NOW - 1.0)
            assert there(after.likeness).chances == ((2, 0.5),)
        else:
            assert (after.number, after.unsure_at) == (1, since)


def test_a_person_who_may_be_the_lost_person_is_looked_at_for_four_seconds() -> None:
    doubts = (0.12, None, True), (0.08, None, False), (0.12, NOW - 3.9, True), (0.12, NOW - 4.1, False)
    for chance, since, looked in doubts:
        after = choose(Choice(None, known(two=chance), NOW - 1.0, unsure_at=since), plain(2))
        assert after.candidates == ((2,) if looked else ())
        # The doubt goes on as long as they are in view.
        assert (after.unsure_at is None) == (chance < 0.1)


def test_legs_alone_are_no_reason_to_stand_for_they_do_not_show_who_it_is() -> None:
    for seen, candidates in ((NOW, (2,)), (NOW - 2.0, ())):
        legs = replace(plain(2), seen=seen, felt=NOW)
        assert choose(Choice(None, known(two=0.4), NOW - 1.0), legs).candidates == candidates


def test_of_two_known_by_legs_alone_the_likelier_is_followed() -> None:
    legs = [replace(plain(number, number), seen=NOW - 2.0, felt=NOW) for number in (1, 2)]
    for chance, number in ((0.55, 2), (0.45, 1)):
        after = choose(Choice(1, known(one=0.3, two=chance), NOW), *legs)
        assert (after.number, after.candidates) == (number, ())


def test_a_person_who_is_followed_in_doubt_is_followed_on_and_not_looked_at() -> None:
    after = choose(Choice(1, known(one=0.3), NOW), plain(1))
    assert (after.number, after.candidates, after.unsure_at) == (1, (), NOW)


def test_a_track_that_is_another_by_nine_in_ten_is_left_only_where_it_is_measured() -> None:
    for chance, measured, number in ((0.08, NOW, None), (0.12, NOW, 1), (0.08, NOW - 0.4, 1), (0.08, NOW - 0.2, None)):
        one = plain(1) if measured == NOW else replace(plain(1), seen=measured)
        assert choose(Choice(1, known(one=chance), NOW), one).number == number


def test_a_track_that_is_just_as_likely_as_is_possible_is_kept() -> None:
    # Chances that no frame changes, and a bound that floating point holds exactly.
    exact = replace(SELECTION, other_below=0.25, identity=replace(SELECTION.identity, passes=0.0, near_s=0.0))
    for chance, number in ((0.25, 1), (0.2499, None)):
        assert exact.choose(at(NOW, plain(1)), Choice(1, known(one=chance), NOW)).number == number


def test_a_track_that_is_no_person_after_all_is_left() -> None:
    one = replace(unproved(1, 0.2, age=40), seen=NOW - 2.0)
    assert choose(Choice(1, known(one=0.5), NOW - 2.0), one).number is None
    assert choose(Choice(1, known(one=0.5), NOW - 2.0), replace(one, age=20)).number == 1


def test_after_a_minute_anybody_is_followed_and_learnt_anew() -> None:
    for lost_s, number in ((59.9, 1), (60.1, 2)):
        after = choose(Choice(1, known(two=0.02), NOW - lost_s), plain(2))
        assert (after.number, there(after.likeness).traits.number == 2) == (number, number == 2)
        assert after.measured == (NOW if number == 2 else NOW - lost_s)


def test_a_person_followed_first_is_learnt_once_they_are_confirmed_and_in_view() -> None:
    first = choose(Choice(), unproved(3, 0.7))
    assert (first.number, first.likeness, first.measured) == (3, None, None)
    known_as = choose(first, plain(3))
    assert (known_as.number, known_as.measured, known_as.likeness is None) == (3, NOW, False)
    unseen = replace(plain(3), seen=NOW - 0.5)
    assert choose(Choice(3), unseen).likeness is None


def test_a_track_counts_while_young_likely_or_confirmed_and_as_measured_for_a_while() -> None:
    assert SELECTION.is_candidate(unproved(1, 0.1, age=29))
    assert not SELECTION.is_candidate(unproved(1, 0.39, age=30))
    assert SELECTION.is_candidate(unproved(1, 0.41, age=30))
    assert SELECTION.is_candidate(plain(1, age=300))
    lately, before = replace(plain(1), seen=NOW - 0.25), replace(plain(2), seen=NOW - 0.35)
    weak = unproved(3, 0.2, age=40)
    assert SELECTION.measured(at(NOW, lately, before, weak)) == [lately]


def test_before_one_is_followed_the_likeliest_near_straight_ahead_is_meant() -> None:
    # One radian aside costs .6, a metre .1: what is said for the image's edge and for two metres.
    def first(one: Person, two: Person) -> int | None:
        return choose(Choice(), one, two).number

    for nearer, number in ((0.05, 1), (-0.05, 2)):
        assert first(unproved(1, 0.5, 3.0 - nearer), unproved(2, 0.5, 3.0)) == number
    for existence, number in ((0.62, 1), (0.58, 2)):
        # A metre further.
        assert first(unproved(1, existence, 3.0), unproved(2, 0.5, 2.0)) == number
        # A sixth of a radian aside, to either side.
        x, y = 2.0 * np.cos(1 / 6), 2.0 * np.sin(1 / 6)
        assert first(unproved(1, existence, x, y), unproved(2, 0.5, 2.0)) == number
        assert first(unproved(1, existence, x, -y), unproved(2, 0.5, 2.0)) == number


def test_the_one_who_is_faced_already_is_kept_unless_another_is_likelier_by_a_tenth() -> None:
    for existence, number in ((0.58, 1), (0.62, 2)):
        assert choose(Choice(1), unproved(1, 0.5), unproved(2, existence)).number == number
    # Out of view they may yet be a person, and are so as long as they may.
    faced = replace(unproved(1, 0.5), seen=NOW - 0.5)
    assert choose(Choice(1), faced).number == 1
    assert choose(Choice(1), replace(faced, age=40, log_odds=-2.0)).number is None
    # Who is confirmed and just measured is kept whoever else is there.
    assert choose(Choice(1), replace(plain(1, 2.0), log_odds=0.1), unproved(2, 0.99)).number == 1


def test_strangers_are_those_who_are_less_likely_than_not_the_person_followed_before() -> None:
    for chance, stranger in ((0.45, True), (0.55, False)):
        assert SELECTION.is_stranger(plain(1), Choice(None, known(one=chance), 1.0)) == stranger
    assert SELECTION.is_stranger(plain(3), Choice(None, known(one=0.9), 1.0))
    assert not SELECTION.is_stranger(plain(1), Choice())


def test_a_word_takes_the_person_meant_once_people_were_looked_at_for_a_second() -> None:
    asked, both = Choice(asked="left"), (plain(1, -0.8), plain(2, 0.8))
    first = choose(asked, *both)
    assert (first.number, first.likeness, first.asked, first.unsure_at) == (2, None, "left", NOW)
    assert choose(replace(first, unsure_at=NOW - 0.9), *both).likeness is None
    after = choose(replace(first, unsure_at=NOW - 1.0), *both)
    assert (after.number, after.likeness is not None, after.asked) == (2, True, None)


def test_until_the_person_asked_for_is_in_view_nobody_is_begun_with_and_nobody_left() -> None:
    assert choose(Choice(asked=7), plain(1)).number is None
    follows = Choice(1, known(one=1.0), NOW)
    for asked in (7, "left"):
        unmet = choose(replace(follows, asked=asked), plain(1), unproved(7, 0.5))
        assert (unmet.number, unmet.asked) == (1, asked if asked == 7 else None)
    # A number needs no second look; whoever is asked for is followed at once, however sure the first is.
    assert choose(replace(follows, asked=7), plain(1), plain(7, 1.0)).number == 7
