"""Whose box is whose: by where people are, how sure that is, how large they are and what they wear."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.tracks.people import IN_GREEN, IN_RED, NOISE, POSE, WINDOW, a_person, box
from tests.follow.views import boxes, flat, look, scan_of

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.measurement import Measurement, Visibility, measure
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.sense.region import Region
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.person import Person, distance_to, predict
from limo_hog.follow.tracks.tracker import Tracker, Tracks

TRACKER = Tracker()


def pairs(people: tuple[Person, ...], *boxes: Measurement) -> dict[int, int]:
    return TRACKER.association.pair(people, boxes, POSE, NOISE)


def test_a_person_long_unseen_does_not_take_the_box_of_one_in_view() -> None:
    seen, gone = a_person(1, 1.6), predict(replace(a_person(2, 2.6), seen=-2.0), 2.0, NOISE)
    # He may be anywhere by now, and so fits everywhere.
    assert pairs((gone,), box(1.7, 0.05)) == {0: 0}
    assert pairs((gone, seen), box(1.7, 0.05)) == {1: 0}


def test_two_who_meet_are_told_apart_by_their_clothes() -> None:
    one, other = a_person(1, 2.0, 0.0, IN_RED), a_person(2, 2.1, 0.1, IN_GREEN)
    # Each box is a little nearer to the wrong one.
    assert pairs((one, other), box(2.02, 0.03, IN_GREEN), box(2.08, 0.07, IN_RED)) == {0: 1, 1: 0}


def test_two_who_meet_in_equal_clothes_are_told_apart_by_their_ways() -> None:
    one, other = a_person(1, 2.0, 0.0, IN_RED), a_person(2, 2.6, 0.1, IN_RED)
    assert pairs((one, other), box(2.55, 0.08, IN_RED), box(2.05, 0.02, IN_RED)) == {0: 1, 1: 0}


def test_somebody_unseen_does_not_become_somebody_in_other_clothes() -> None:
    gone = predict(a_person(1, 2.0, 0.0, IN_RED), 2.0, NOISE)
    assert pairs((gone,), box(2.5, 0.2, IN_RED)) == {0: 0}
    assert pairs((gone,), box(2.5, 0.2, IN_GREEN)) == {}


def test_a_box_is_measured_from_the_robots_centre_by_its_depth() -> None:
    seen = look(boxes((68, 100, 64, 128)))
    slope = (320 - 100) / 448.6
    (bearing_only,) = measure(seen, LIMO)
    assert bearing_only.range is None
    assert bearing_only.bearing == pytest.approx(math.atan(slope))
    (ranged,) = measure(replace(seen, depth=flat(2.0)), LIMO)
    assert ranged.range == pytest.approx(math.hypot(2.084, slope * 2.0))
    assert ranged.bearing == pytest.approx(math.atan2(slope * 2.0, 2.084))
    assert (ranged.height, ranged.centre, ranged.score) == (128, 164 - 240, 2.0)


def test_a_box_without_a_range_is_as_far_off_as_across_the_line_of_sight() -> None:
    without = replace(box(2.0), range=None)
    for bearing, off in ((0.3, 2.0 * math.tan(0.3)), (-0.3, 2.0 * math.tan(0.3)), (3.0, math.inf)):
        assert distance_to(a_person(1, 2.0), replace(without, bearing=bearing), POSE) == pytest.approx(off)


def test_a_new_person_without_a_range_may_be_anywhere_along_the_line_of_sight() -> None:
    person = TRACKER.begin(1, replace(box(2.0), range=None), 0.0, POSE)
    assert person.track.mean[:2] == pytest.approx([3.0, 0.0])
    assert person.track.matrix[0, 0] == pytest.approx(1.5**2)
    assert person.track.matrix[1, 1] == pytest.approx((3.0 * NOISE.bearing) ** 2)


def test_a_range_that_contradicts_the_size_of_the_box_moves_nobody() -> None:
    person = a_person(1, 3.0)
    hand_in_front = replace(box(3.0, 0.02), range=0.8)
    after = TRACKER.correct(person, hand_in_front, POSE)
    assert math.hypot(*after.track.mean[:2]) == pytest.approx(3.0, abs=0.02)
    assert after.track.mean[1] > 0


def test_a_person_who_turned_sharply_is_where_the_box_is() -> None:
    aside = box(3.0, 0.15)
    after = TRACKER.correct(a_person(1, 3.0), aside, POSE)
    # By the gain of a certain track alone it would be a fifth of the way.
    assert math.atan2(after.track.mean[1], after.track.mean[0]) > 0.8 * 0.15


def expected(distance: float, bearing: float = 0.0, middle: float = 240.0, **other: object) -> bool:
    """Whether a confirmed person is expected to be found, their window's middle at an image row."""
    confirmed = bool(other.pop("confirmed", True))
    view = replace(look(), **other)  # type: ignore[arg-type]
    return Visibility().expected(bearing, distance, WINDOW, (middle - 240) * distance, view, confirmed=confirmed)


def test_a_person_is_expected_to_be_found_where_the_search_shows_all_of_them() -> None:
    for bearing, found in ((0.0, True), (0.4, True), (0.7, False), (math.pi, False), (-math.pi + 0.01, False)):
        assert expected(2.5, bearing) == found
    # Too near for HOG excuses a person and not a new track.
    for distance, found in ((1.75, True), (1.7, True), (1.65, False)):
        assert expected(distance) == found
    assert expected(1.65, confirmed=False)
    left = Region(0, 0, 320, 480, 200.0)
    assert [expected(2.5, bearing, region=left) for bearing in (0.3, -0.1)] == [True, False]
    # Far away they are where the search enlarges, and not those who are higher than the part that is searched.
    far = Region(0, 140, 640, 200, 100.0)
    assert [expected(distance) for distance in (4.0, 5.0)] == [True, False]
    assert [expected(distance, region=far) for distance in (2.5, 5.0, 8.0, 9.0)] == [False, True, True, False]
    # Behind something they are not found.
    assert [expected(3.0, depth=flat(there)) for there in (2.6, 2.4)] == [True, False]


@pytest.mark.parametrize("middle", [0.4 * WINDOW / 2, 480 - 0.4 * WINDOW / 2])
def test_a_window_cut_off_by_the_image_excuses_a_person_and_not_a_new_track(middle: float) -> None:
    assert not expected(2.0, middle=middle)
    assert expected(2.0, middle=middle, confirmed=False)
    assert expected(2.0, middle=abs(middle - 0.1 * WINDOW) if middle > 240 else middle + 0.1 * WINDOW)


@pytest.mark.parametrize(("turn", "range_"), [(0.0, 2.5), (0.4, 2.0), (-0.7, 3.1), (2.0, 1.0)])
def test_the_distance_to_a_box_with_a_range_is_that_of_two_points_in_the_plane(turn: float, range_: float) -> None:
    pose = Odometry(0.0, 1.0, -2.0, 0.8)
    person = TRACKER.begin(1, Measurement(0.2, 2.0, 120, 0.0, 1.0), 0.0, pose)
    seen = Measurement(0.2 + turn, range_, 120, 0.0, 1.0)
    there = [(r * math.cos(b), r * math.sin(b)) for b, r in ((0.2, 2.0), (0.2 + turn, range_))]
    assert distance_to(person, seen, pose) == pytest.approx(math.dist(*there))


def test_clothes_of_which_one_number_is_missing_are_unknown() -> None:
    clothes = np.stack([IN_RED, IN_GREEN])
    clothes[0, 1, 2] = np.nan
    view = replace(look(boxes((300, 100, 60, 120), (100, 100, 60, 120))), depth=flat(2.0), clothes=clothes)
    first, second = measure(view, LIMO)
    assert first.clothes is None
    np.testing.assert_array_equal(second.clothes, IN_GREEN)


def test_the_legs_in_the_scans_between_two_slow_frames_show_that_a_person_has_turned() -> None:
    # The person walked to the left at .6 m/s; after the frame at 0 s they turn and walk to the right as fast.
    track = replace(kalman.initiate(0.0, 0.0, 2.0, POSE, NOISE), mean=(2.0, 0.0, 0.0, 0.6))
    tracks = Tracks(people=(replace(a_person(1, 2.0), track=track),), stamp=0.0, poses=(POSE,))
    between = tuple((scan_of([(2.0, -0.6 * t)], stamp=t), Odometry(t)) for t in (0.1, 0.2, 0.3))
    seen = replace(look(stamp=0.33), odometry=Odometry(0.33), between=between)
    without, _ = TRACKER.update(replace(seen, between=()), tracks)
    with_legs, _ = TRACKER.update(seen, tracks)
    assert without.people[0].track.mean[1] == pytest.approx(0.19, abs=0.02)
    assert with_legs.people[0].track.mean[1] == pytest.approx(-0.6 * 0.33, abs=0.1)
    assert with_legs.people[0].felt == 0.3


def test_a_box_of_another_size_is_behind_a_person_from_half_a_metre_further_off() -> None:
    for distance, theirs in ((1.2, True), (1.7, True), (2.05, True), (2.15, False)):
        wrong_size = replace(box(1.6), height=round(1.5 * WINDOW / distance), range=distance)
        assert pairs((a_person(1, 1.6),), wrong_size) == ({0: 0} if theirs else {})
    # As high as the person at its range, it is where they went.
    assert pairs((replace(a_person(1, 1.6), confirmed=False),), box(1.65)) == {0: 0}


def test_a_box_is_as_high_as_the_person_to_within_35_hundredths() -> None:
    for share, fits in ((0.66, True), (0.64, False), (1.34, True), (1.36, False)):
        seen = replace(box(2.0), height=100, range=share * WINDOW / 100)
        assert TRACKER.association.fits_size(a_person(1, 2.0), seen) == fits
    assert TRACKER.association.fits_size(a_person(1, 2.0), replace(box(2.0), range=None))


def test_a_tracks_box_is_within_its_gate_and_a_certain_persons_within_half_a_metre() -> None:
    person = a_person(1, 4.0)
    spread = math.sqrt(person.track.matrix[1, 1] / 16 + NOISE.bearing**2)
    for sigmas, fits in ((4.2, True), (4.3, False)):
        aside = box(4.0, sigmas * spread)
        assert (pairs((replace(person, confirmed=False),), aside) == {0: 0}) == fits
        assert pairs((person,), aside) == {0: 0}
    for off, fits in ((0.49, True), (0.51, False)):
        assert (pairs((person,), box(4.0, 2 * math.asin(off / 2 / 4.0))) == {0: 0}) == fits


def test_two_boxes_on_one_person_are_within_half_a_metre_and_in_the_same_clothes() -> None:
    # A person who went out of sight may be anywhere by now, and takes what box is left.
    seen, gone = a_person(1, 2.0), predict(replace(a_person(2, 2.6), seen=-2.0), 2.0, NOISE)
    trousers = IN_GREEN + np.array([[0.0, 0.0, 9.0], [9.0, 0.0, 0.0]])
    for off, clothes, same in ((0.49, None, True), (0.51, None, False), (0.49, trousers, False)):
        beside = box(2.0, 2 * math.asin(off / 2 / 2.0), clothes)
        first = box(2.0, 0.0, None if clothes is None else IN_RED)
        assert pairs((seen, gone), first, beside) == ({0: 0} if same else {0: 0, 1: 1})
        if clothes is None:
            # A box without a range is as far off as the other one.
            assert pairs((seen, gone), first, replace(beside, range=None)) == ({0: 0} if same else {0: 0, 1: 1})


def test_boxes_go_to_confirmed_people_first_and_then_to_who_fits_best() -> None:
    sure, new = a_person(1, 2.0, 0.05), replace(a_person(2, 2.0, 0.0), confirmed=False)
    assert pairs((new, sure), box(2.0, 0.01)) == {1: 0}
    assert TRACKER.association.pair((sure, new), [box(2.0)], POSE, NOISE, others={(0, 0)}) == {1: 0}
