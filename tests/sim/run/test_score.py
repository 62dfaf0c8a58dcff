"""A score card says of a made-up log what anybody can count."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student  # type: ignore[import-untyped]

from limo_hog.detector import Detections
from limo_hog.follow.decision import Mode
from limo_hog.follow.twist import Twist
from limo_sim.run.episode import NOTHING, Episode, Step
from limo_sim.run.score import ScoreCard, on_person, score
from limo_sim.run.sweep import estimate, summarise
from limo_sim.world.truth import Contacts, PersonTruth, Truth
from limo_sim.world.scenario import Scenario

BOX = (300, 100, 60, 120)
ON, OFF = [285, 90, 80, 160], [20, 90, 80, 160]


def person(distance: float = 2.0, visible: float = 1.0, box: tuple[int, int, int, int] | None = BOX) -> PersonTruth:
    return PersonTruth(distance, 0.0, math.pi, distance, 0.0, visible, box)


def step(
    number: int,
    *people: PersonTruth | None,
    boxes: list[list[int]] | None = None,
    target: int | None = None,
    at: float = 0.0,
) -> Step:
    truth = Truth(0.1 * number, (at, 0.0, 0.0), people, Contacts(0, 0))
    found = NOTHING if not boxes else Detections(np.array(boxes, np.int32), np.arange(len(boxes), 0.0, -1.0))
    twist = Twist(0.0, 0.1 * number)
    return Step(0.1 * number, truth, truth, found, target, None, twist, Mode.FOLLOW, "because", 2.0, 1.0)


def card(*steps: Step) -> ScoreCard:
    scenario = Scenario.load("two_people")
    return score(Episode(scenario, "c", "d", 0, 0.1 * len(steps), steps, Contacts(1, 2), 0.5))


def test_fractions_begin_when_the_person_is_first_in_view() -> None:
    unseen = [step(k, person(visible=0.0, box=None)) for k in range(5)]
    seen = [step(k, person(), boxes=[ON], target=0) for k in range(5, 8)]
    gone = [step(8, person(visible=0.1))]
    result = card(*unseen, *seen, *gone)
    assert result.in_view == 0.75
    assert result.detected == 1.0
    assert result.first_detection_s == pytest.approx(0.5)


def test_nothing_to_measure_is_none() -> None:
    result = card(*(step(k) for k in range(3)))
    assert result.in_view is None
    assert result.distance_mean_m is None
    assert result.found_again is None
    assert result.contacts_person == 1
    assert result.contacts_wall == 2


def test_pixel_error_is_from_the_middle_of_the_image() -> None:
    result = card(step(0, person(box=(300, 100, 60, 120))), step(1, person(box=(250, 100, 60, 120))))
    assert result.pixel_error_mean == 25.0


def test_distances_and_zones() -> None:
    result = card(*(step(k, person(distance)) for k, distance in enumerate((0.4, 1.0, 2.0, 4.0))))
    assert result.distance_min_m == 0.4
    assert result.distance_rms_error_m == pytest.approx(math.sqrt((1.1**2 + 0.5**2 + 0.5**2 + 2.5**2) / 4))
    zones = (result.zone_intimate, result.zone_personal, result.zone_social, result.zone_public)
    assert zones == (0.25, 0.25, 0.25, 0.25)


def test_clearance_is_from_outline_to_outline() -> None:
    radius = Scenario.load("two_people").people[0].radius
    assert card(step(0, person(1.0))).clearance_min_m == pytest.approx(1.0 - 0.145 - radius)


def test_the_best_box_on_nobody_is_wrong() -> None:
    result = card(step(0, person(), boxes=[OFF, ON], target=1), step(1, person(), boxes=[ON], target=0))
    assert result.best_box_wrong == 0.5
    assert result.detected == 1.0


def test_following_the_other_person_is_told() -> None:
    other = replace(person(), box=(20, 100, 60, 120))
    mine = [step(k, person(), other, boxes=[ON], target=0) for k in range(3)]
    theirs = [step(3, person(), other, boxes=[OFF], target=0)]
    assert card(*mine, *theirs).follows_first == 0.75


def test_a_loss_is_counted_without_the_time_behind_a_pillar() -> None:
    followed = [step(k, person(), boxes=[ON], target=0) for k in range(3)]
    hidden = [step(k, person(visible=0.0)) for k in range(3, 50)]
    again = [step(50, person(), boxes=[ON], target=0)]
    result = card(*followed, *hidden, *again)
    assert result.lost == 1
    assert result.found_again == 1.0
    away = [step(k, person(visible=0.0, box=None)) for k in range(3, 50)]
    assert card(*followed, *away, *again).found_again == 0.0


def test_driving_after_a_decoy_is_measured() -> None:
    steps = [step(k, boxes=[OFF], target=0, at=0.1 * k) for k in range(4)]
    assert card(*steps).path_wrong_m == pytest.approx(0.3)
    assert card(*steps).path_m == pytest.approx(0.3)


def test_a_box_is_on_a_person_of_its_size_and_place() -> None:
    assert on_person(np.array(ON, np.int32), person())
    assert not on_person(np.array(OFF, np.int32), person())
    assert not on_person(np.array([0, 0, 320, 480], np.int32), person())
    assert not on_person(np.array(ON, np.int32), person(box=None))


def test_the_interval_is_students() -> None:
    values = [1.0, 2.0, 4.0, 4.5, 7.0, 2.5]
    found = estimate(values)
    half = student.ppf(0.975, 5) * np.std(values, ddof=1) / math.sqrt(6)
    assert found.mean == pytest.approx(3.5)
    assert found.interval == pytest.approx(half, rel=0.02)
    assert (found.least, found.most) == (1.0, 7.0)
    assert estimate([3.0]).interval is None


def test_cards_are_summed_up_by_scenario_and_controller() -> None:
    one = card(step(0, person()))
    summaries = summarise([one, replace(one, seed=1), replace(one, controller="other")])
    assert [(s.controller, s.runs) for s in summaries] == [("c", 2), ("other", 1)]
    assert summaries[0].measures["found_again"] is None
