"""How much a frame moves the probability that a track is the person followed: the formula of Bayes, by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.tracks.test_identity import IDENTITY, IN_RED, WINDOW, at, legs, person

from limo_hog.follow.tracks.identity import Likeness, Traits
from limo_hog.follow.tracks.person import Person

OTHER_SHIRT = IN_RED + np.array([[9.0, 9.0, 9.0], [0.0, 0.0, 0.0]])
OTHER_TROUSERS = IN_RED + np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0]])
TRAITS = Traits(1, IN_RED, WINDOW)


def known_as(*chances: tuple[int, float], others: int = 0) -> Likeness:
    """The person in red, last measured for sure 2 m ahead at 1 s, and each track's probability."""
    about = tuple(Traits(100 + index, None, WINDOW) for index in range(others))
    return Likeness(TRAITS, (2.0, 0.0), 1.0, chances, about)


def plain(number: int, stamp: float, y: float = 0.0, measured: float | None = None) -> Person:
    """A person of whom neither clothes nor stature are seen."""
    return replace(person(number, stamp, y, None, measured=measured), tall=None)


def unlike(times: float) -> float:
    """How often a person of the same stature is measured as so many times as tall, of 1, by a deviation of .05."""
    return math.exp(-((math.log(times) / 0.05) ** 2) / 2)


# How often the person shows this, and how often another does. One shirt in ten, one pair of trousers in two and three
# statures in ten are alike; one box in ten hides the shirt, three in ten the trousers and the outline.
SHOWN = {
    "shirt": (0.9 + 0.1 * 0.1, 0.1),
    "another shirt": (0.1 * 0.1, 0.1),
    "trousers": (0.7 + 0.3 * 0.5, 0.5),
    "other trousers": (0.3 * 0.5, 0.5),
    "as tall": (0.7 + 0.3 * 0.3, 0.3),
    "far taller": (0.3 * 0.3, 0.3),
    "a little taller": (0.7 * unlike(1.05) + 0.3 * 0.3, 0.3),
}


def ratio(what: str) -> float:
    """Return how many times as often the person followed shows this as another does."""
    own, other = SHOWN[what]
    return own / other


@pytest.mark.parametrize(
    ("clothes", "times", "worn", "tall"),
    [
        (None, 1.0, (), "as tall"),
        (None, 1.5, (), "far taller"),
        (None, 1.05, (), "a little taller"),
        (IN_RED, None, ("shirt", "trousers"), None),
        (OTHER_SHIRT, None, ("another shirt", "trousers"), None),
        (OTHER_TROUSERS, None, ("shirt", "other trousers"), None),
        (OTHER_SHIRT, 1.0, ("another shirt", "trousers"), "as tall"),
    ],
)
def test_a_box_multiplies_the_odds_by_how_much_more_often_the_person_shows_it(
    clothes: NDArray[np.float64] | None, times: float | None, worn: tuple[str, ...], tall: str | None
) -> None:
    dress, stature = math.prod(ratio(one) for one in worn), 1.0 if tall is None else ratio(tall)
    # Of a track's later boxes, the clothes count by half, and the stature by a tenth.
    for age, expected in ((1, min(dress * stature, math.exp(2.5))), (2, dress**0.5 * stature**0.1)):
        one = person(1, 1.0, clothes=clothes, age=age)
        one = replace(one, tall=None if times is None else times * WINDOW)
        chance = IDENTITY.update(known_as((1, 0.5)), at(1.0, one)).of(1)
        # Before the box: once in five hundred frames it is another person's, or what was taken for another's is none.
        before = 0.5 * 0.998 + 0.002 * (1 - 0.5 * 0.998)
        assert chance / (1 - chance) == pytest.approx(expected * before / (1 - before))


def test_a_shirt_in_other_light_is_as_likely_as_its_three_numbers_say() -> None:
    for chi2 in (0.5, 2.0, 4.5):
        worn = IN_RED + np.array([[math.sqrt(chi2 / 2), 0.0, math.sqrt(chi2 / 2)], [0.0, 0.0, 0.0]])
        one = replace(person(1, 1.0, clothes=worn, age=2), tall=None)
        chance = IDENTITY.update(known_as((1, 0.5)), at(1.0, one)).of(1)
        shirt = (0.9 * math.exp(-chi2 / 2) + 0.1 * 0.1) / 0.1
        before = 0.5 * 0.998 + 0.002 * (1 - 0.5 * 0.998)
        assert chance / (1 - chance) == pytest.approx((shirt * ratio("trousers")) ** 0.5 * before / (1 - before))


def test_one_box_is_never_worth_more_than_a_factor_of_twelve_either_way() -> None:
    before = 0.5 * 0.998 + 0.002 * (1 - 0.5 * 0.998)
    for clothes, times, most in ((IN_RED, 1.0, 12.18), (IN_RED + 9.0, 2.0, 1 / 12.18)):
        one = person(1, 1.0, clothes=clothes, tall=times * WINDOW, age=1)
        chance = IDENTITY.update(known_as((1, 0.5)), at(1.0, one)).of(1)
        assert chance / (1 - chance) == pytest.approx(most * before / (1 - before), rel=1e-3)


def test_a_person_who_is_likelier_known_as_another_is_compared_with_that_one() -> None:
    # Both wear red: the shirt tells nothing, the odds stay.
    known = replace(known_as((1, 0.5)), others=(Traits(7, IN_RED, WINDOW),))
    chance = IDENTITY.update(known, at(1.0, person(1, 1.0, age=1))).of(1)
    assert chance == pytest.approx(0.5 * 0.998 + 0.002 * (1 - 0.5 * 0.998))
    # A track that was another person before is compared with that one alone.
    known = replace(known, others=(Traits(7, IN_RED, WINDOW), Traits(1, IN_RED + 9.0, 2 * WINDOW)))
    assert IDENTITY.update(known, at(1.0, person(1, 1.0, age=1))).of(1) > 0.8


def test_what_the_person_shows_counts_by_a_tenth_while_their_legs_are_the_same() -> None:
    one = replace(person(1, 2.0, clothes=OTHER_SHIRT), tall=None)
    chance = IDENTITY.update(known_as((1, 0.8)), replace(at(2.0, one), movers=(legs(one, 2.0, since=1.0),))).of(1)
    # Legs that have been the same for a second: no box is another's, and one that was not theirs may have been.
    before = 0.8 + 0.002 * 0.2
    tells = (ratio("another shirt") * ratio("trousers")) ** (0.5 * 0.1)
    assert chance / (1 - chance) == pytest.approx(tells * before / (1 - before))


def test_a_person_who_is_not_measured_is_in_their_track_for_another_two_seconds() -> None:
    known = known_as((1, 0.9))
    for frame in range(20):
        stamp = 5.0 + 0.1 * frame
        known = IDENTITY.update(known, at(stamp, plain(1, stamp, measured=1.0)))
    assert known.of(1) == pytest.approx(0.9 / math.e)
    # Three frames are no gap.
    after = IDENTITY.update(known_as((1, 0.9)), at(5.0, plain(1, 5.0, measured=4.75)))
    assert after.of(1) == pytest.approx(0.9 * 0.998 + 0.002 * (1 - 0.9 * 0.998))


@pytest.mark.parametrize(("others", "share"), [(0, 1 / 2), (1, 1 / 3), (6, 1 / 8)])
def test_a_track_that_begins_is_the_person_as_likely_as_any_who_is_about(others: int, share: float) -> None:
    # Two seconds and more after the first three tenths it may surely be; in between in proportion.
    for lost_s, sure in ((0.3, 0.0), (1.3, 0.5), (2.3, 1.0), (5.0, 1.0)):
        stamp = 1.0 + lost_s
        for tracks in (at(stamp, plain(2, stamp)), at(stamp, plain(1, stamp, measured=1.0), plain(2, stamp))):
            after = IDENTITY.update(known_as((1, 0.8), others=others), tracks)
            assert after.of(2) == pytest.approx(sure * share, abs=1e-5)
            if tracks.person(1) and lost_s > 0.3:
                assert after.of(1) == pytest.approx(0.8 * math.exp(-0.1 / 2.0) * (1 - sure * share), rel=1e-4)


def test_a_track_that_begins_within_three_frames_is_another() -> None:
    after = IDENTITY.update(known_as((1, 0.8)), at(1.1, plain(1, 1.1), plain(2, 1.1, 0.55)))
    assert after.of(2) == 0.0
    assert after.of(1) == pytest.approx(0.8 * 0.998 + 0.002 * (1 - 0.8 * 0.998))


@pytest.mark.parametrize("lost_s", [1.0, 2.5])
def test_a_track_that_begins_is_the_persons_only_where_they_can_have_walked(lost_s: float) -> None:
    stamp = 1.0 + lost_s
    for off, may in ((-0.05, True), (0.05, False)):
        # A body's width, and a metre a second.
        after = IDENTITY.update(known_as((1, 1.0)), at(stamp, plain(2, stamp, 0.5 + lost_s + off)))
        assert (after.of(2) > 0.1) == may


def walking(one: Person, vx: float, vy: float) -> Person:
    """The person, walking at so many metres a second."""
    x, y, _, _ = one.track.mean
    return replace(one, track=replace(one.track, mean=(x, y, vx, vy)))


def test_of_two_nearer_than_half_a_metre_one_in_500_changes_places_and_one_in_5_for_each_metre_past() -> None:
    for apart, speeds, swaps in (
        (0.45, (0.0, 0.0), 0.002),
        (0.45, (0.6, 0.6), 0.002),
        (0.45, (0.6, -0.4), 0.002 + 0.2 * 1.0 * 0.1),
        (0.2, (0.0, 0.5), 0.002 + 0.2 * 0.5 * 0.1),
        (0.2, (50.0, 0.0), 0.5),
        (0.55, (0.6, -0.4), 0.0),
    ):
        both = (walking(plain(1, 1.0), speeds[0], 0.0), walking(plain(2, 1.0, apart), speeds[1], 0.0))
        after = IDENTITY.update(known_as((1, 0.8), (2, 0.1)), at(1.0, *both))
        one, two = 0.8 * 0.998, 0.1 * 0.998
        one += 0.002 * (1 - one - two)
        swapped = swaps * (one - two)
        assert (after.of(1), after.of(2)) == pytest.approx((one - swapped, two + swapped))


def test_no_person_changes_places_with_one_who_is_not_measured() -> None:
    after = IDENTITY.update(known_as((1, 0.8), (2, 0.1)), at(5.0, plain(1, 5.0), plain(2, 5.0, 0.2, measured=4.0)))
    one, two = 0.8 * 0.998, 0.1 * math.exp(-0.1 / 2.0)
    assert (after.of(1), after.of(2)) == pytest.approx((one + 0.002 * (1 - one - two), two))


def test_the_place_is_learnt_where_nineteen_in_twenty_are_right() -> None:
    for chance, learnt in ((0.94, False), (0.96, True)):
        after = IDENTITY.update(known_as((1, chance)), at(3.0, plain(1, 3.0, 0.7)))
        assert (after.place, after.at) == (((2.0, 0.7), 3.0) if learnt else ((2.0, 0.0), 1.0))


def test_a_person_who_is_not_the_person_in_nineteen_of_twenty_is_remembered_as_another() -> None:
    for chance, remembered in ((0.04, True), (0.07, False)):
        after = IDENTITY.update(known_as((2, chance)), at(1.0, plain(2, 1.0)))
        assert [one.number for one in after.others] == ([2] if remembered else [])
    unknown = replace(plain(2, 1.0), confirmed=False)
    assert IDENTITY.update(known_as((2, 0.01)), at(1.0, unknown)).others == ()


def test_the_eight_others_seen_last_are_remembered() -> None:
    crowd = [plain(number, 1.0, 2.0 * number) for number in range(2, 13)]
    assert [one.number for one in IDENTITY.update(known_as((1, 1.0)), at(1.0, *crowd)).others] == list(range(5, 13))


def test_clothes_and_stature_are_the_mean_of_twenty_boxes_and_then_move_by_a_twentieth() -> None:
    worn, tall = IN_RED + 0.5, 1.02 * WINDOW
    known, moved = IDENTITY.begin(person(1, 0.0)), []
    for frame in range(1, 31):
        known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, clothes=worn, tall=tall)))
        assert known.traits.clothes is not None
        shares = (known.traits.clothes - IN_RED) / 0.5, (known.traits.window - WINDOW) / (0.02 * WINDOW)
        assert shares[0] == pytest.approx(np.full((2, 3), shares[1]))
        moved.append(shares[1])
    assert moved[:19] == pytest.approx([n / (n + 1) for n in range(1, 20)])
    assert moved[19:] == pytest.approx([1 - 0.95**n / 20 for n in range(1, 12)])


def test_a_shirt_that_clearly_differs_and_an_outline_a_twentieth_taller_are_not_learnt() -> None:
    known = known_as((1, 0.999))
    for chi2, times in ((5.9, 1.04), (6.1, 1.06)):
        worn = IN_RED + np.array([[math.sqrt(chi2), 0.0, 0.0], [0.5, 0.0, 0.0]])
        after = IDENTITY.update(known, at(1.0, person(1, 1.0, clothes=worn, tall=times * WINDOW))).traits
        assert after.clothes is not None
        learnt = chi2 < 6
        assert after.clothes - IN_RED == pytest.approx((worn - IN_RED) * np.array([[learnt / 2], [0.5]]))
        assert after.window == pytest.approx(WINDOW * (1 + (times - 1) / 2) if learnt else WINDOW)


def test_a_person_begins_as_themself_but_for_one_box_in_five_hundred() -> None:
    known = IDENTITY.begin(person(3, 2.0, 0.4))
    assert dict(known.chances) == pytest.approx({3: 0.998})
    assert (known.place, known.at) == ((2.0, 0.4), 2.0)
