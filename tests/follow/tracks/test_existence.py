"""Is it a person? Log-odds by Bayes' rule, the recall that is learnt, and boxes that stand out from nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.tracks.test_people import NOISE, POSE, a_person, box
from tests.follow.views import FOCAL, HEIGHT, before_wall, flat

from limo_hog.follow.sense.measurement import stands_out, top_row
from limo_hog.follow.tracks.person import Existence, Person, Recall, UnknownRange, initiate

EXISTENCE = Existence()
BOX = np.array([260, 120, 120, 240], np.int32)


def new() -> Person:
    return initiate(1, box(2.5), 0.0, POSE, NOISE, UnknownRange(), EXISTENCE.prior)


def after(recall: float, score: float, frames: int, seed: int) -> Person:
    """A new track after frames in which a detector of this recall found it with this score."""
    person, random = new(), np.random.default_rng(seed)
    for _ in range(frames):
        if random.random() < recall:
            evidence = EXISTENCE.of_box(replace(box(2.5), score=score), EXISTENCE.recall)
            person = EXISTENCE.update(person, evidence, found=True)
        else:
            person = EXISTENCE.update(person, EXISTENCE.of_miss(EXISTENCE.recall), found=False)
    return person


def test_evidence_is_the_ratio_of_the_two_densities() -> None:
    free = replace(EXISTENCE, weight=1.0, most=99.0, least=99.0)
    for score in (0.2, 0.8, 1.7, 3.0):
        person = score / 1.3**2 * math.exp(-score / 1.3)
        clutter = math.exp(-score / 0.5) / 0.5
        expected = math.log(0.7 * person / (0.2 * clutter))
        assert free.of_box(replace(box(2.5), score=score), 0.7) == pytest.approx(expected)
    assert free.of_miss(0.7) == pytest.approx(math.log(0.3 / 0.8))


def test_a_miss_never_speaks_for_a_person() -> None:
    assert EXISTENCE.of_miss(0.05) == 0.0
    assert EXISTENCE.of_miss(0.98) == -EXISTENCE.least


@pytest.mark.parametrize("recall", [0.3, 0.5, 1.0])
def test_people_are_confirmed_within_four_seconds_however_often_they_are_missed(recall: float) -> None:
    confirmed = [after(recall, 2.5, 40, seed).confirmed for seed in range(100)]
    assert np.mean(confirmed) > 0.97


def test_a_pillar_found_in_every_other_frame_with_a_low_score_is_never_confirmed() -> None:
    # Measured in the arena: found in 55 % of the frames, 95 % of the scores below .75.
    assert not any(after(0.55, 0.75, 300, seed).confirmed for seed in range(50))


def test_a_certain_person_survives_a_second_of_misses_and_not_two() -> None:
    person = a_person(1, 2.5)
    for miss in range(20):
        person = EXISTENCE.update(person, EXISTENCE.of_miss(0.95), found=False)
        if miss == 9:
            assert person.confirmed
    assert not person.confirmed


def test_recall_is_learnt_by_size() -> None:
    learnt = Recall()
    for frame in range(1000):
        learnt = EXISTENCE.learn(learnt, 300.0, found=frame % 2 == 0)
    assert EXISTENCE.recall_of(learnt, 310.0) == pytest.approx(0.5, abs=0.02)
    assert EXISTENCE.recall_of(learnt, 150.0) == EXISTENCE.recall
    assert EXISTENCE.is_chance(9, 0.5)
    assert not EXISTENCE.is_chance(10, 0.5)
    assert not EXISTENCE.is_chance(5, 0.9)


@pytest.mark.parametrize("turn", [-1.2, -0.7, 0.0, 0.7, 1.2])
def test_a_picture_on_a_wall_stands_out_from_nothing_whatever_side_it_is_seen_from(turn: float) -> None:
    # Depth of a wall 2.5 m ahead that is turned about a vertical axis.
    slope = (320 - np.arange(640) - 0.5) / FOCAL
    depth = np.broadcast_to(2.5 / (1 - slope * math.tan(turn) * 0.5), (HEIGHT, 640)).astype(np.float32)
    relief = stands_out(depth, BOX)
    assert relief is not None
    assert abs(relief) < 0.02
    assert not EXISTENCE.is_solid(replace(box(2.5), stands_out=relief))
    assert EXISTENCE.of_box(replace(box(2.5), score=4.0, stands_out=relief), 0.9) < 0


def test_a_person_before_a_wall_stands_out_by_the_distance_to_it() -> None:
    assert stands_out(before_wall(2.0, tuple(BOX.tolist()), 2.6), BOX) == pytest.approx(0.6)


def test_what_has_no_depth_beside_it_stands_out_and_without_any_nothing_is_known() -> None:
    depth = before_wall(2.0, tuple(BOX.tolist()), np.nan)
    relief = stands_out(depth, BOX)
    assert relief is not None
    assert relief > 5
    assert stands_out(np.empty((0, 0), np.float32), BOX) is None


def test_the_head_ends_the_outline() -> None:
    depth = flat(8.0)
    depth[150:330, 290:350] = 2.0
    assert top_row(depth, BOX, 2.0) == 150
    depth[200:203] = np.nan
    assert top_row(depth, BOX, 2.0) == 150
    depth[:330, 290:350] = 2.0
    assert top_row(depth, BOX, 2.0) == 0


@pytest.mark.parametrize("found", [1, 2, 3])
def test_the_recall_that_is_learnt_is_the_share_of_frames_in_which_the_person_was_found(found: int) -> None:
    learnt = Recall()
    for frame in range(2000):
        learnt = EXISTENCE.learn(learnt, 300.0, found=frame % 4 < found)
    # A hundred frames are kept in mind, and ten of the recall that is assumed before anything is learnt.
    expected = (100 * found / 4 + 10 * 0.4) / 110
    assert EXISTENCE.recall_of(learnt, 300.0) == pytest.approx(expected, abs=0.01)


def test_misses_are_counted_since_the_last_box() -> None:
    person, counted = a_person(1, 2.5), []
    for found in (True, False, False, True, False):
        person = EXISTENCE.update(person, 0.0, found=found)
        counted.append(person.misses)
    assert counted == [0, 1, 2, 0, 1]


def test_log_odds_are_those_of_a_probability_and_nothing_known_is_one_half() -> None:
    assert initiate(1, box(2.5), 0.0, POSE, NOISE, UnknownRange()).existence == 0.5
    assert replace(new(), log_odds=math.log(4.0)).existence == pytest.approx(4 / 5)
    assert replace(new(), log_odds=-math.log(4.0)).existence == pytest.approx(1 / 5)


def frames_until(person: Person, *, found: bool, confirmed: bool) -> int:
    """Return after how many frames of the same outcome a track is confirmed, or is not any more."""
    frames = 0
    while person.confirmed != confirmed:
        evidence = EXISTENCE.of_box(replace(box(2.5), score=4.0), 0.9) if found else EXISTENCE.of_miss(0.98)
        person = EXISTENCE.update(person, evidence, found=found)
        frames += 1
    assert person.age == frames + (1 if found else 50)
    return frames


def test_four_clear_frames_confirm_and_fifteen_misses_drop_who_was_certain() -> None:
    assert frames_until(new(), found=True, confirmed=True) == 4
    assert frames_until(a_person(1, 2.5), found=False, confirmed=False) == 15


def test_a_track_is_confirmed_from_95_percent_until_it_is_below_27() -> None:
    for before, confirmed, after_ in (
        (2.9, False, False),
        (3.0, False, True),
        (-1.0, True, True),
        (-1.01, True, False),
    ):
        person = replace(a_person(1, 2.5), log_odds=before, confirmed=confirmed)
        assert EXISTENCE.update(person, 0.0, found=True).confirmed == after_
    assert replace(new(), log_odds=3.0).existence == pytest.approx(0.95, abs=0.005)
    assert replace(new(), log_odds=-1.0).existence == pytest.approx(0.27, abs=0.005)


@pytest.mark.parametrize("sign", [-1, 1])
def test_what_is_certain_is_so_to_five_either_way(sign: int) -> None:
    person = new()
    for _ in range(100):
        person = EXISTENCE.update(person, sign * 0.4, found=True)
    assert person.log_odds == sign * 5.0


def test_of_ten_boxes_that_begin_a_track_one_is_on_a_person() -> None:
    assert new().existence == pytest.approx(0.1, abs=0.001)


def test_a_box_is_flat_whose_surroundings_are_within_two_decimetres_before_or_behind() -> None:
    for relief, solid in ((None, True), (0.19, False), (0.21, True), (-0.19, False), (-0.21, True), (0.0, False)):
        assert EXISTENCE.is_solid(replace(box(2.5), stands_out=relief)) == solid


@pytest.mark.parametrize(("window", "same"), [(169, 100), (171, 200), (239, 200), (241, 300), (329, 300), (331, 400)])
def test_people_are_of_one_size_up_to_170_240_and_330_pixels(window: float, same: float) -> None:
    learnt = Recall()
    for _ in range(300):
        learnt = EXISTENCE.learn(learnt, window, found=True)
    for other in (100.0, 200.0, 300.0, 400.0):
        assert (EXISTENCE.recall_of(learnt, other) > 0.8) == (other == same)


def test_a_box_can_take_as_much_as_a_miss_and_no_more() -> None:
    assert EXISTENCE.of_box(replace(box(2.5), score=0.0), 0.4) == -0.4
    assert EXISTENCE.of_box(replace(box(2.5), score=9.0), 0.9) == 1.5
