"""Which track is the person followed: by way, clothes and stature together, with doubt where they do not tell."""

from dataclasses import replace

import pytest
from tests.follow.tracks.people import IN_GREEN, IN_RED, WINDOW
from tests.follow.tracks.wearers import at, legs, person

from limo_hog.follow.sense.observation import Clothes
from limo_hog.follow.tracks.identity import Identity, Likeness, Traits

IDENTITY = Identity()


def followed(first: Clothes = IN_RED) -> Likeness:
    """Return what is known of a person in red, by all boxes but the `first`, followed for a second, 2 m ahead."""
    known = IDENTITY.begin(person(1, 0.0, clothes=first))
    for frame in range(1, IDENTITY.settled + 1):
        stamp = frame / IDENTITY.settled
        known = IDENTITY.update(known, at(stamp, person(1, stamp)))
    assert known.of(1) > 0.99
    return known


@pytest.mark.parametrize("beside", [(), (0.4,)])
def test_a_track_that_goes_over_to_another_shirt_is_not_the_person_any_more(beside: tuple[float, ...]) -> None:
    known = followed()
    for frame in range(11, 26):
        stamp = 0.1 * frame
        others = [person(2, stamp, off) for off in beside]
        known = IDENTITY.update(known, at(stamp, person(1, stamp, clothes=IN_GREEN, tall=0.95 * WINDOW), *others))
    assert known.of(1) < 0.1
    # What the other person wears was not learnt.
    assert known.traits.clothes == pytest.approx(IN_RED)


def test_one_box_of_odd_colours_does_not_lose_the_person() -> None:
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1, clothes=IN_GREEN)))
    assert known.of(1) > 0.9


def test_a_first_box_that_shows_the_shirt_in_place_of_the_trousers_is_outvoted() -> None:
    assert followed(IN_RED[[0, 0]]).traits.clothes == pytest.approx(IN_RED)


def test_a_person_of_whom_most_of_the_first_boxes_were_odd_is_learnt_by_the_later_ones() -> None:
    known = IDENTITY.begin(person(1, 0.0, clothes=IN_RED[[0, 0]]))
    for frame in range(1, 91):
        one = person(1, 0.1 * frame, clothes=IN_RED[[0, 0]] if frame < 7 else IN_RED)
        known = IDENTITY.update(known, replace(at(0.1 * frame, one), movers=(legs(one, one.seen),)))
        assert known.of(1) > 0.95
    assert known.traits.clothes == pytest.approx(IN_RED, abs=0.2)


def test_odd_boxes_of_a_whole_second_lose_nobody_whose_legs_are_known_only_half_a_second_later() -> None:
    known = IDENTITY.begin(person(1, 0.0, clothes=IN_RED[[0, 0]]))
    for frame in range(1, 91):
        walker = person(1, 0.1 * frame, clothes=IN_RED[[0, 0]] if frame < 11 else IN_RED)
        moving = (legs(walker, walker.seen, since=0.5),) if frame > 5 else ()
        known = IDENTITY.update(known, replace(at(0.1 * frame, walker), movers=moving))
        assert known.of(1) > 0.9
    assert known.traits.clothes == pytest.approx(IN_RED, abs=0.2)


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
    assert known.of(1) > 0.75


def test_two_alike_side_by_side_hardly_change_places_while_each_has_legs_that_go_on() -> None:
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


def test_a_track_kept_by_legs_alone_beside_another_may_not_be_the_person_any_more() -> None:
    # The camera does not find the person, and legs of somebody else are .3 m beside those taken for theirs.
    for beside, low, high in ((0.3, 0.2, 0.6), (2.0, 0.9, 1.0)):
        known = followed()
        for frame in range(11, 31):
            stamp = 0.1 * frame
            one = replace(person(1, stamp, measured=1.0), felt=stamp)
            other = replace(legs(person(2, stamp, beside), stamp), number=None)
            known = IDENTITY.update(known, replace(at(stamp, one), movers=(legs(one, stamp), other)))
        assert low <= known.of(1) <= high


def test_the_person_whose_legs_may_be_those_of_somebody_tracked_beside_is_one_of_the_two() -> None:
    known = followed()
    for frame in range(11, 31):
        stamp = 0.1 * frame
        one, other = (replace(person(number, stamp, 0.3 * number, measured=1.0), felt=stamp) for number in (1, 2))
        known = IDENTITY.update(known, at(stamp, one, other))
    assert known.of(2) > 0.3
    assert known.of(1) + known.of(2) > 0.95


def glimpses(clothes: Clothes, count: int, chance: float = 0.5) -> float:
    """Return the chance of the person's track after some frames that showed clothes where HOG found nobody."""
    known = replace(followed(), chances=((1, chance),), at=-10.0)
    for frame in range(11, 11 + count):
        one = person(1, 0.1 * frame, clothes=clothes, measured=1.0)
        one = replace(one, felt=0.1 * frame, glimpsed=0.1 * frame, tall=None)
        known = IDENTITY.update(known, at(0.1 * frame, one))
    return known.of(1)


def test_a_glimpse_of_the_persons_clothes_tells_less_than_a_box_and_one_of_others_next_to_nothing() -> None:
    box = IDENTITY.update(replace(followed(), chances=((1, 0.5),), at=-10.0), at(1.1, person(1, 1.1))).of(1)
    assert 0.6 < glimpses(IN_RED, 1) < box
    assert glimpses(IN_RED, 10) > 0.98
    assert 0.45 < glimpses(IN_GREEN, 1) < 0.5
    # What is before the person is not there for long.
    assert glimpses(IN_GREEN, 100, chance=0.9) < 0.5


def test_a_track_that_was_just_the_persons_is_theirs_again_where_no_other_begins() -> None:
    for last_s, low, high in ((0.0, 0.75, 0.9), (-10.0, 0.4, 0.6)):
        known = replace(followed(), chances=((1, 0.5),), at=last_s)
        for frame in range(11, 40):
            one = replace(person(1, 0.1 * frame, clothes=None, measured=1.0), felt=0.1 * frame, tall=None)
            known = IDENTITY.update(known, at(0.1 * frame, one))
        assert low < known.of(1) < high


def test_another_in_the_same_clothes_is_not_the_person_whose_legs_go_on_too_near_for_the_camera() -> None:
    known = followed()
    for frame in range(11, 80):
        stamp = 0.1 * frame
        one = replace(person(1, stamp, measured=1.0), felt=stamp)
        known = IDENTITY.update(known, replace(at(stamp, one, person(2, stamp, 2.0)), movers=(legs(one, stamp),)))
    assert known.of(1) > 0.95


def test_a_lost_person_is_known_again_by_the_clothes_and_another_is_not() -> None:
    for clothes, low, high in ((IN_RED, 0.8, 1.0), (IN_GREEN, 0.0, 0.2)):
        known = followed()
        for frame in range(11, 60):
            known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.0)))
        for frame in range(60, 70):
            found = person(2, 0.1 * frame, 0.5, clothes, age=frame - 59)
            known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.0), found))
        assert low <= known.of(2) <= high


def test_a_track_of_another_that_goes_over_to_the_lost_person_is_known_by_the_clothes() -> None:
    for clothes, low, high in ((IN_RED, 0.8, 1.0), (IN_GREEN, 0.0, 0.1)):
        known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), person(2, 1.1, 0.8, IN_GREEN, age=1)))
        for frame in range(12, 32):
            found = person(2, 0.1 * frame, 0.8, clothes)
            known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.1), found))
        assert low <= known.of(2) <= high


def test_what_little_the_light_makes_of_the_clothes_of_two_alike_does_not_add_up() -> None:
    dim = IN_RED - [[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]]
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), person(2, 1.1, 1.0, dim)))
    known = replace(known, chances=((1, 0.85), (2, 0.1)))
    for frame in range(12, 42):
        both = person(1, 0.1 * frame, clothes=None), person(2, 0.1 * frame, 1.0)
        known = IDENTITY.update(known, at(0.1 * frame, *both))
    assert known.of(2) < 0.2


def test_a_track_that_begins_beside_the_person_or_too_far_off_to_walk_to_is_another() -> None:
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), person(2, 1.1, 0.8, age=1)))
    assert (known.of(1) > 0.99, known.of(2)) == (True, 0.0)
    assert IDENTITY.update(followed(), at(2.0, person(2, 2.0, 4.0, age=1))).of(2) == 0.0


def test_the_stature_tells_apart_people_in_one_kind_of_clothes() -> None:
    known = replace(followed(), others=(Traits(7, IN_RED, 1.1 * WINDOW),))
    for frame in range(11, 71):
        known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, tall=1.1 * WINDOW)))
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


def test_a_box_that_contradicts_the_track_in_this_frame_may_be_anothers() -> None:
    # Clothes and stature tell nothing, so what is left is the chance that the box is another person's.
    for strained, late_s, low, high in ((True, 0.0, 0.88, 0.92), (False, 0.0, 0.99, 1.0), (True, 0.1, 0.99, 1.0)):
        one = replace(person(1, 1.1, clothes=None, measured=1.1 - late_s), tall=None, strained=strained)
        assert low < IDENTITY.update(followed(), at(1.1, one)).of(1) < high


def test_one_box_never_decides_and_a_track_that_ends_is_doubted_more_and_more() -> None:
    # However alike or unlike it is, one box is worth a factor of some twelve.
    unsure = replace(followed(), chances=((1, 0.5),))
    for clothes, tall, low, high in ((IN_RED, WINDOW, 0.9, 0.93), (IN_RED + 9.0, 2 * WINDOW, 0.07, 0.1)):
        known = IDENTITY.update(unsure, at(1.1, person(1, 1.1, clothes=clothes, tall=tall, age=1)))
        assert low < known.of(1) < high
    known, doubts = followed(), []
    for frame in range(11, 41):
        known = IDENTITY.update(known, at(0.1 * frame, person(1, 0.1 * frame, measured=1.0)))
        doubts.append(1 - known.of(1))
    assert doubts[0] < 0.01
    assert doubts == sorted(doubts)
    assert 0.5 < doubts[-1] < 0.9


def test_where_another_wears_the_same_the_clothes_tell_nothing() -> None:
    known = replace(followed(), chances=((1, 0.5),), others=(Traits(7, IN_RED, WINDOW),))
    assert IDENTITY.update(known, at(1.1, person(1, 1.1, age=1))).of(1) == pytest.approx(0.5, abs=0.01)


def test_the_less_the_boxes_of_one_person_vary_the_more_a_small_difference_tells() -> None:
    for variance, low, high in ((1.0, 0.58, 1.0), (0.16, 0.0, 0.2)):
        known = replace(followed(), chances=((1, 0.5),))
        one = replace(person(1, 1.1, clothes=IN_RED - 0.8, age=1), tall=None)
        assert low < IDENTITY.update(known, replace(at(1.1, one), variance=variance)).of(1) < high


def test_others_are_learnt_only_beside_the_person_who_may_else_be_one_of_them() -> None:
    for beside, learnt in ((person(1, 5.0),), [2]), ((), []):
        known = replace(followed(), chances=((1, 1.0), (2, 0.0)))
        for _ in range(2):
            known = IDENTITY.update(known, at(5.0, *beside, person(2, 5.0, 1.5, IN_GREEN)))
        assert [one.number for one in known.others] == learnt


def test_another_is_learnt_by_the_boxes_and_not_by_what_the_track_wore_before() -> None:
    hijacked = replace(person(2, 1.1, 1.5, IN_RED), worn=IN_GREEN)
    assert IDENTITY.update(followed(), at(1.1, person(1, 1.1), hijacked)).others[0].clothes == pytest.approx(IN_GREEN)


def test_where_the_person_is_and_what_they_wear_is_learnt_where_it_is_sure() -> None:
    for chance, learnt in ((0.5, False), (0.999, True)):
        known = followed()
        known = replace(known, traits=replace(known.traits, first=(IN_RED,) * IDENTITY.voters), chances=((1, chance),))
        after = IDENTITY.update(known, at(1.1, replace(person(1, 1.1, 0.7, IN_RED - 0.5), tall=None)))
        assert (after.at == 1.1) == (after.place == (2.0, 0.7)) == learnt
        assert after.traits.clothes is not None
        assert (after.traits.clothes < IN_RED).all() == learnt


def test_the_eight_others_seen_last_are_remembered() -> None:
    crowd = [person(number, 1.1, 2.0 * number) for number in range(2, 13)]
    known = IDENTITY.update(followed(), at(1.1, person(1, 1.1), *crowd))
    assert [one.number for one in known.others] == list(range(5, 13))
    # What is no person yet is nobody else.
    unknown = replace(crowd[0], confirmed=False)
    assert IDENTITY.update(followed(), at(1.1, person(1, 1.1), unknown)).others == ()
