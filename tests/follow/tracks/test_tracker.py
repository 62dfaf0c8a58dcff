"""From frame to frame: what is kept for how long, what one box changes, and whose the legs in the scan can be."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.estimates import upper
from tests.follow.tracks.people import IN_GREEN, IN_RED, NOISE, POSE, WINDOW, a_person, box
from tests.follow.tracks.walkers import FREE, GRID, person, walker
from tests.follow.views import boxes, flat, look, scan_of

from limo_hog.follow.sense.observation import Observation, Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.association import Legs, Returns
from limo_hog.follow.tracks.kalman import Track
from limo_hog.follow.tracks.person import Existence, Person, Recall
from limo_hog.follow.tracks.tracker import Tracker, Tracks

TRACKER = Tracker()


def frame(stamp: float, *, scan: bool = True) -> Observation:
    """A frame in which nobody is found, with a scan that hits nothing."""
    return replace(look(stamp=stamp), odometry=Odometry(stamp), scan=scan_of([], stamp) if scan else None)


def after(*stamps: float) -> Tracks:
    """Return the tracks after frames at these stamps."""
    tracks = Tracks()
    for stamp in stamps:
        tracks, _ = TRACKER.update(frame(stamp), tracks)
    return tracks


def test_poses_are_kept_for_two_seconds_and_scans_for_one() -> None:
    assert [one.stamp for one in after(0.0, 1.9).poses] == [0.0, 1.9]
    assert [one.stamp for one in after(0.0, 2.1).poses] == [2.1]
    assert [one.stamp for one in after(0.0, 0.9).scans] == [0.0, 0.9]
    assert [one.stamp for one in after(0.0, 1.1).scans] == [1.1]


def test_a_scan_that_comes_twice_is_entered_once() -> None:
    tracks, _ = TRACKER.update(replace(frame(0.1), scan=frame(0.0).scan), after(0.0))
    assert [one.stamp for one in tracks.scans] == [0.0]


@pytest.mark.parametrize(("between", "period"), [(0.01, 0.02), (0.3, 0.3), (0.45, 0.45), (0.9, 0.5)])
def test_the_next_frame_is_expected_after_as_long_as_the_last_but_at_2_to_50_hz(between: float, period: float) -> None:
    assert after(0.0, between).period == pytest.approx(period)


def test_a_person_not_measured_is_forgotten_after_eight_seconds() -> None:
    for unseen_s, people in ((7.9, 1), (8.1, 0)):
        tracks, _ = TRACKER.update(frame(unseen_s), Tracks(people=(a_person(1, 2.0),), stamp=0.0))
        assert len(tracks.people) == people


def test_one_box_moves_the_known_size_by_a_fifth_of_the_difference() -> None:
    seen = replace(box(2.0), window=1.1 * WINDOW, middle=-130.0)
    corrected = TRACKER.correct(a_person(1, 2.0), seen, POSE)
    assert corrected.window == pytest.approx(WINDOW * (1 + 0.1 / 5))
    assert corrected.centre == pytest.approx(-120.0 - 10.0 / 5)
    # A box on a picture, in one plane with what is beside it, shows no size.
    on_a_picture = TRACKER.correct(a_person(1, 2.0), replace(seen, stands_out=0.1), POSE)
    assert (on_a_picture.window, on_a_picture.centre) == (WINDOW, -120.0)


def test_a_person_cut_off_by_the_image_can_only_be_taller_than_they_show() -> None:
    shown = replace(box(2.0), whole=False, middle=-140.0)
    for window, known in ((0.9 * WINDOW, (WINDOW, -120.0)), (1.1 * WINDOW, (1.1 * WINDOW, -140.0))):
        corrected = TRACKER.correct(a_person(1, 2.0), replace(shown, window=window), POSE)
        assert (corrected.window, corrected.centre) == known


@pytest.mark.parametrize("side", [-1, 1])
def test_a_box_half_of_what_people_keep_from_each_other_off_may_be_anothers(side: int) -> None:
    for off, in_place in ((0.2, True), (0.3, False)):
        corrected = TRACKER.correct(a_person(1, 2.5), replace(box(2.5), range=2.5 + side * off), POSE)
        assert (corrected.strained, corrected.tall) == (not in_place, WINDOW if in_place else None)


def test_the_stature_is_taken_from_whole_outlines_not_too_near() -> None:
    for distance, tall in ((1.35, None), (1.45, WINDOW)):
        assert TRACKER.correct(a_person(1, distance), box(distance), POSE).tall == tall
    for partly in (replace(box(2.0), whole=False), replace(box(2.0), window=0.0), replace(box(2.0), range=None)):
        assert TRACKER.correct(a_person(1, 2.0), partly, POSE).tall is None


def test_clothes_are_seen_where_the_patches_are_on_shirt_and_trousers() -> None:
    def worn(seen_: object) -> NDArray[np.float64] | None:
        return TRACKER.correct(a_person(1, 2.0, clothes=IN_RED), seen_, POSE).worn  # type: ignore[arg-type]

    seen = box(2.0, clothes=IN_GREEN)
    height = seen.height
    assert worn(seen) is IN_GREEN
    # A window that sits lower by an eighth of itself shows the hips in the shirt's place; so does one cut off.
    assert worn(replace(seen, centre=-60.0 + 0.10 * height)) is IN_GREEN
    assert worn(replace(seen, centre=-60.0 + 0.14 * height)) is None
    assert worn(replace(seen, whole=False)) is None
    # Without depth neither is known. A box of another size is on a part of the body.
    assert worn(replace(seen, range=None)) is IN_GREEN
    assert worn(replace(seen, height=round(1.4 * height))) is None


def test_a_weak_box_says_nothing_against_a_person_who_is_known() -> None:
    known = replace(a_person(1, 2.0), log_odds=3.5)
    weak = replace(box(2.0), score=0.05)
    assert TRACKER.correct(known, weak, POSE, 0.9).log_odds == 3.5
    assert TRACKER.correct(replace(known, confirmed=False), weak, POSE, 0.9).log_odds == pytest.approx(3.5 - 0.4)
    assert TRACKER.correct(known, replace(weak, stands_out=0.0), POSE, 0.9).log_odds == pytest.approx(3.5 - 0.4)


def test_a_person_measured_again_after_a_second_begins_anew_without_a_velocity() -> None:
    for unseen_s, anew in ((0.9, False), (1.1, True)):
        track = replace(a_person(1, 2.0).track, stamp=unseen_s, mean=(2.0, 0.0, 0.5, 0.5))
        corrected = TRACKER.correct(replace(a_person(1, 2.0), track=track), box(2.1, 0.05), POSE)
        fresh = kalman.initiate(unseen_s, 0.05, 2.1, POSE, NOISE)
        assert np.allclose(corrected.track.mean, fresh.mean) == anew
        assert corrected.seen == unseen_s


def test_boxes_on_pictures_and_second_boxes_begin_no_track() -> None:
    view = replace(look(boxes((300, 100, 120, 240))), odometry=Odometry())
    wall = replace(view, depth=flat(2.5))
    assert TRACKER.update(wall, Tracks())[0].people == ()
    alone, found = TRACKER.update(view, Tracks())
    assert [one.number for one in alone.people] == [1]
    assert found == {1: 0}
    twice = replace(view, detections=boxes((300, 100, 120, 240), (304, 100, 120, 240), (60, 100, 120, 240)))
    both, found = TRACKER.update(twice, Tracks())
    assert [one.number for one in both.people] == [1, 2]
    assert (found, both.next_number) == ({1: 0, 2: 2}, 3)


def test_a_new_track_is_a_person_the_likelier_the_surer_its_box() -> None:
    chances = []
    for score in (0.1, 1.0, 3.0):
        view = replace(look(boxes((300, 100, 120, 240), scores=(score,))), odometry=Odometry())
        chances.append(TRACKER.update(view, Tracks())[0].people[0].existence)
    assert chances == sorted(chances)
    assert chances[0] < 0.1 < chances[1] < 0.2


def unseen(number: int, stamp: float, x: float = 2.0, y: float = 0.0) -> Person:
    """A person who was measured last at a stamp."""
    return person(number, x, y, stamp)


def test_a_person_who_is_not_found_for_a_second_walked_on_and_is_no_less_a_person() -> None:
    for last, falls in ((0.1, True), (-0.1, False)):
        one = replace(unseen(1, last, 2.5), window=WINDOW)
        after_ = TRACKER.update(look(stamp=1.0), Tracks(people=(one,), stamp=0.9))[0].people[0]
        assert (after_.log_odds < one.log_odds) == falls


def test_a_confirmed_person_who_is_not_found_is_glimpsed_where_the_depth_image_shows_them() -> None:
    for confirmed, depth, glimpsed in ((True, 1.916, 1.0), (True, 8.0, -np.inf), (False, 1.916, -np.inf)):
        one = replace(unseen(1, 0.9), window=WINDOW, centre=-120.0, confirmed=confirmed, log_odds=2.0)
        seen = replace(look(stamp=1.0), image=np.full((480, 640, 3), 90, np.uint8), depth=flat(depth))
        after_ = TRACKER.update(seen, Tracks(people=(one,), stamp=0.9))[0].people[0]
        assert after_.glimpsed == glimpsed
        assert (after_.worn is not None) == (glimpsed == 1.0)


def around(followed: Person | None, people: tuple[Person, ...], *movers: object) -> tuple[int, list[float], bool]:
    """Return how many are around at 1 s, the x of those who are others, and whether one is the person followed."""
    tracks = Tracks(people, stamp=1.0, movers=movers)  # type: ignore[arg-type]
    everyone, others, own = TRACKER.around(tracks, followed, 1.0, 0.8)
    return len(everyone), sorted(one.x for one in others), own is not None


def test_everyone_measured_lately_or_moving_is_around() -> None:
    mine, other = unseen(1, 1.0, 2.0), unseen(2, 0.3, 4.0)
    assert around(mine, (mine, other)) == (2, [4.0], True)
    assert around(None, (mine, other)) == (2, [2.0, 4.0], False)
    # One not measured for .8 s is taken to walk on, but is not where they were; what is no person yet does not count.
    assert around(mine, (mine, unseen(2, 0.1, 4.0))) == (2, [], True)
    assert around(mine, (mine, unseen(2, -1.1, 4.0))) == (1, [], True)
    assert around(mine, (mine, replace(other, confirmed=False))) == (1, [], True)
    # Legs that walk are one more, but for those of a person who is counted, or within half a metre of one.
    assert around(mine, (mine,), walker(None, 5.0, 0.0)) == (2, [5.0], True)
    assert around(mine, (mine, other), walker(2, 5.0, 0.0)) == (2, [4.0], True)
    assert around(mine, (mine,), walker(None, 2.45, 0.0)) == (1, [], True)
    assert around(mine, (mine,), walker(None, 2.55, 0.0)) == (2, [2.55], True)
    # The person followed, lost .9 s ago, may be where the legs walk; then they are nobody else's.
    lost = unseen(1, 0.1, 2.0)
    assert around(lost, (lost,), walker(None, 3.35, 0.0)) == (2, [], True)
    assert around(lost, (lost,), walker(None, 3.45, 0.0)) == (2, [3.45], True)
    assert around(lost, (lost,), walker(1, 5.0, 0.0)) == (1, [], True)


def test_what_moves_may_be_the_person_until_the_camera_has_shown_it_twelve_times() -> None:
    for shown, may in ((11, 1), (12, 0)):
        for number, own in ((None, 1), (3, 1), (4, 0)):
            mover = replace(walker(number, 2.0, 0.0), shown=shown)
            assert len(TRACKER.may_be(3, Tracks(movers=(mover,)), 1.0)) == may * own


def test_what_moves_where_another_person_was_just_measured_is_their_legs() -> None:
    mover = walker(None, 2.0, 0.0)
    for number, aside, stamp, may in ((4, 0.3, 0.8, 0), (4, 0.4, 0.8, 1), (4, 0.3, 0.4, 1), (3, 0.3, 0.8, 1)):
        other = unseen(number, stamp, 2.0, aside)
        assert len(TRACKER.may_be(3, Tracks(people=(other,), movers=(mover,)), 1.0)) == may


def with_legs(one: Person, stamp: float, place: tuple[float, float], **tracks: object) -> Person:
    """Return the person after a scan with legs at a place."""
    returns = Returns(stamp, np.array([place, place]), Odometry())
    known = replace(Tracks((one,), scans=(returns,), stamp=1.0), **tracks)  # type: ignore[arg-type]
    now, later = TRACKER.follow_legs(one, known, GRID, None)
    assert later.people[0].felt == now.felt
    return now


def test_legs_continue_a_person_who_was_measured_within_a_second() -> None:
    for last, felt in ((0.05, True), (-0.05, False)):
        assert (with_legs(unseen(1, last), 1.0, (2.0, 0.1)).felt == 1.0) == felt


def test_a_scan_older_than_the_last_legs_or_a_period_before_the_image_is_not_used() -> None:
    for stamp, used in ((0.9, True), (0.85, False)):
        assert (with_legs(unseen(1, 1.0), stamp, (2.0, 0.1)).felt == stamp) == used
    assert with_legs(replace(unseen(1, 0.8), felt=1.0), 1.0, (2.0, 0.1)).track.mean[1] == 0.0


def test_legs_follow_no_person_who_is_unknown_or_missed_too_often_for_chance() -> None:
    assert with_legs(replace(unseen(1, 1.0), confirmed=False), 1.0, (2.0, 0.1)).felt < 0
    # Of a person who is found in four frames of ten, fourteen misses in a row happen once in a thousand times.
    for misses, felt in ((13, True), (14, False)):
        assert (with_legs(replace(unseen(1, 0.9), misses=misses), 1.0, (2.0, 0.1)).felt == 1.0) == felt


def leg_track(x: float) -> Track:
    return Track(1.0, (x, 0.0, 0.0, 0.0), upper(np.diag([0.04, 0.04, 0.5, 0.5])))


def test_returns_within_half_a_stride_are_legs_and_a_wider_group_is_furniture() -> None:
    def found(*points: tuple[float, float], x: float = 2.0) -> bool:
        returns = Returns(1.0, np.array(points).reshape(-1, 2), Odometry())
        one = replace(person(7, x, 0.0, 0.9), track=leg_track(x))
        return TRACKER.movers.walked(one, (), returns, NOISE).felt == 1.0

    assert not found()
    assert not found((3.4, 0.0), x=3.4)
    assert found((3.6, 0.0), x=3.6)
    assert found((2.0, 0.0), (2.0, 0.05))
    assert found((2.0, 0.34), (2.0, 0.33))
    assert not found((2.0, 0.36), (2.0, 0.37))
    assert found((2.0, -0.27), (2.0, 0.27))
    assert not found((2.0, -0.28), (2.0, 0.28))
    assert found((6.45, 0.0), x=6.45)
    assert not found((6.55, 0.0), x=6.55)


def test_the_legs_of_a_person_who_walks_trail_by_a_twentieth_of_a_second() -> None:
    legs = Legs()
    for speed in (0.0, 0.8, -0.8):
        one = replace(leg_track(2.0), mean=(2.0, 0.0, 0.0, speed))
        trailing = -0.05 * speed
        returns = np.array([(2.0, trailing - 0.02), (2.0, trailing + 0.02)])
        corrected = legs.corrected(one, returns, Odometry(), NOISE)
        assert corrected is not None
        assert corrected.mean == pytest.approx(one.mean, abs=1e-3)


@pytest.mark.parametrize(("found", "recall"), [(False, 0.2), (True, 0.98)])
def test_a_detector_is_believed_to_find_between_one_in_five_and_49_in_50(found: bool, recall: float) -> None:
    learnt = Recall()
    for _ in range(3000):
        learnt = Existence(recall_frames=0.01).learn(learnt, 300.0, found=found)
    assert Existence(recall_frames=0.01).recall_of(learnt, 300.0) == recall


def test_the_first_clothes_seen_are_taken_and_none_seen_leave_those_known() -> None:
    near = IN_RED + 1.0
    assert TRACKER.correct(a_person(1, 2.0), box(2.0, clothes=near), POSE).clothes is near
    assert TRACKER.correct(a_person(1, 2.0, clothes=near), box(2.0), POSE).clothes is near
    # One box moves those known a little.
    known = a_person(1, 2.0, clothes=IN_RED)
    assert TRACKER.correct(known, box(2.0, clothes=near), POSE, 0.4).clothes == pytest.approx(IN_RED + 0.05)


def test_no_clothes_are_learnt_from_a_box_that_is_not_on_shirt_and_trousers() -> None:
    # Once the first of 23 boxes, on a part of the body, gave half of the shirt that the person was known by.
    partly = replace(box(2.0, clothes=IN_GREEN), whole=False)
    for clothes in (None, IN_RED):
        assert TRACKER.correct(a_person(1, 2.0, clothes=clothes), partly, POSE).clothes is clothes
    for seen, clothes in ((partly, None), (box(2.0, clothes=IN_GREEN), IN_GREEN)):
        assert TRACKER.begin(1, seen, 1.0, POSE).clothes is clothes


def test_legs_that_walk_continue_a_person_for_longer_than_legs_that_stand() -> None:
    for last, walks, goes_on in ((-2.9, False, True), (-3.1, False, False), (-3.1, True, True)):
        one = unseen(7, last)
        legs = replace(walker(7, 2.0, 0.1), began=(2.0 - walks, 0.1), way=float(walks))
        scan = Returns(1.0, np.array([(2.0, 0.08), (2.0, 0.12)]), Odometry())
        tracks = Tracks((one,), scans=(scan,), stamp=1.0, movers=(replace(legs, felt=0.9),), moved_at=0.9)
        assert (TRACKER.follow_movers(tracks, (2.0, 0.5), GRID, FREE).people[0].felt == 1.0) == goes_on
    # One who was found in this frame is where the box is.
    found = Tracks((unseen(7, 1.0),), scans=(scan,), stamp=1.0, movers=(replace(legs, felt=0.9),), moved_at=0.9)
    assert TRACKER.follow_movers(found, (2.0, 0.5), GRID, FREE).people[0].felt < 0


def test_a_box_exactly_half_a_metre_from_everyone_found_is_a_new_person() -> None:
    people = [a_person(1, 2.0), replace(a_person(2, 2.5), misses=1)]
    for distance, new in ((2.5, True), (2.49, False), (1.5, True), (1.51, False)):
        assert TRACKER.association.is_new(box(distance), people, POSE) == new


def test_how_often_a_person_is_found_is_learnt_for_the_size_they_have_in_the_image() -> None:
    # Windows of 125 to 400 px, one in each class; whoever is nearer than .3 m counts as there.
    for window, distance, size in ((500.0, 2.5, 1), (500.0, 3.5, 0), (500.0, 1.8, 2), (700.0, 1.8, 3)):
        one = replace(unseen(1, 0.9, distance), window=window, centre=0.0)
        tracks, _ = TRACKER.update(look(stamp=1.0), Tracks(people=(one,), stamp=0.9))
        assert tracks.recall.expected == tuple(float(index == size) for index in range(4))
        assert tracks.recall.found == (0.0,) * 4


def test_misses_are_no_chance_where_people_of_that_size_are_nearly_always_found() -> None:
    learnt = Recall()
    for _ in range(300):
        learnt = TRACKER.existence.learn(learnt, 200.0, found=True)
    for distance, felt in ((2.0, False), (1.0, True)):
        one = replace(unseen(1, 0.9, distance), misses=3)
        assert (with_legs(one, 1.0, (distance, 0.1), recall=learnt).felt == 1.0) == felt
