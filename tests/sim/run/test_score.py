"""A score card says of a made-up log what anybody can count."""

import json
import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.sim.logs import CAMERA, OFF, ON, TRUNK, add, card, followed, other_person, person, step

from limo_hog.follow.decision import Belief
from limo_sim.run.log import Step
from limo_sim.run.matching import Criteria, on_person, person_of
from limo_sim.run.score import Scorer
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, PersonTruth


def seen_at(left: int, visible: float = 1.0) -> PersonTruth:
    """A person whose silhouette begins at a column [px]."""
    return person(visible=visible, box=(left, 100, 60, 120))


def log(of: str, metres: float = 0.0) -> list[Step]:
    """A step for each letter, so far [m] from the last: of two people, whom the target is on.

    One of them (a, b), nobody (x), or there is none (-), the first person also hidden (h) or out of sight (o).
    """
    boxes, first = {"a": [ON], "b": [OFF], "x": [ELSEWHERE]}, {"h": person(visible=0.0), "o": UNSEEN}
    people = [(first.get(one, person()), other_person()) for one in of]
    targets = [0 if one in boxes else None for one in of]
    return [step(k, *people[k], boxes=boxes.get(of[k]), target=targets[k], at=metres * k) for k in range(len(of))]


APART, CLOCK_MS = (0.4, 1.0, 2.0, 4.0), (1.0, 2.0, 3.0, 4.0, 90.0)
UNSEEN = person(visible=0.0, box=None)
RIGHT = [step(k, person(), boxes=[ON, OFF], target=0) for k in range(1, 4)]
BOTH, ELSEWHERE = (person(3.0), replace(other_person(), distance=1.0)), [400, 10, 80, 160]
SECOND_RADIUS = Scenario.load("two_people").people[1].radius
NEAR, FAR, CLOSE, TOO_FAR = replace(other_person(), distance=0.9), person(4.0), person(0.3), person(3.01)
#: What a log shows, its steps, and the figures that its card has.
CARDS: dict[str, tuple[list[Step], dict[str, Any]]] = {
    "fractions begin when the person is first in view": (
        log("oooooaaah"),
        {"in_view": 0.75, "detected": 1.0, "first_detection_s": 0.5},
    ),
    "half of a person is in view": ([step(0, person()), step(1, seen_at(300, 0.5))], {"in_view": 1.0}),
    "less than half of a person is not": ([step(0, person()), step(1, seen_at(300, 0.499))], {"in_view": 0.5}),
    "nothing to measure is none": (
        [step(k) for k in range(3)],
        {"in_view": None, "distance_mean_m": None, "found_again": None, "contacts_person": 1, "contacts_wall": 2},
    ),
    "nobody to succeed with, nor to intrude upon": (
        [step(0), step(1, None, None)],
        {"success": None, "intrusion_intimate": None, "intrusion_personal": None, "intrusion_social": None},
    ),
    "the pixel error is from the image's middle, of frames with the subject in view": (
        [step(0, seen_at(300)), step(1, seen_at(0, 0.4)), step(2, seen_at(250))],
        {"pixel_error_mean": 25.0},
    ),
    "95 of 100 frames are nearer": (
        [step(k, seen_at(290 + k)) for k in range(101)],
        {"pixel_error_mean": 50.0, "pixel_error_p95": 95.0},
    ),
    "distances fall into zones": (
        [step(k, person(distance)) for k, distance in enumerate(APART)],
        {"distance_min_m": 0.4, "distance_mean_m": 1.85}
        | dict.fromkeys(("zone_intimate", "zone_personal", "zone_social", "zone_public"), 0.25),
    ),
    "intrusions are those of the nearest of all people": (
        [step(0, FAR, NEAR), step(1, FAR, None), step(2, CLOSE, NEAR), step(3, None, None)],
        {"intrusion_intimate": 0.25, "intrusion_personal": 0.25, "intrusion_social": 0.0},
    ),
    "following the other person is told": (log("aaab"), {"follows_first": 0.75}),
    "changes of the turn rate are averaged": (
        [step(k, turn=turn) for k, turn in enumerate((0.0, 0.5, 0.2, 0.2))],
        {"mean_abs_domega": 0.8 / 3},
    ),
    "a turn rate that is no number counts as none": (
        [step(k, turn=turn) for k, turn in enumerate((0.0, math.nan, 0.2))],
        {"mean_abs_domega": 0.1},
    ),
    "driving after a decoy is measured": (log("xxxx", 0.1), {"path_wrong_m": 0.3, "path_m": 0.3}),
    "from a target that is nobody to one that is": (log("-aax-xa-a", 0.5), {"path_wrong_m": 1.5, "path_m": 4.0}),
    "a robot keeps up with a person in view and at most three metres away": (
        [step(k, one) for k, one in enumerate((person(2.0), person(3.0), TOO_FAR, person(2.0, visible=0.4), TOO_FAR))],
        {"kept_up": 0.4, "in_view": 0.8},
    ),
    # The real-time factor: five steps of 0.1 s in half a second of the wall's time.
    "the wall clock has percentiles and means": (
        [step(k, person(), detect_ms=ms, render_ms=ms / 2) for k, ms in enumerate(CLOCK_MS)],
        {"detect_ms_p50": 3.0, "detect_ms_p95": float(np.percentile(CLOCK_MS, 95)), "detect_ms_mean": 20.0}
        | {"render_ms_p50": 1.5, "real_time_factor": 1.0},
    ),
    "periods without a frame are not counted": ([step(k, person(), frame=k != 2) for k in range(5)], {"frames": 4}),
    "the longest gap is between two detections of the subject": (log("aaxxxaxax"), {"longest_gap_s": 0.4}),
    "who is never found again is lost once": (log("aaa" + "-" * 47), {"lost": 1, "found_again": 0.0}),
    "the time behind a pillar is not counted": (log("aaa" + "h" * 47 + "a"), {"lost": 1, "found_again": 1.0}),
    "the time out of the image is": (log("aaa" + "o" * 47 + "a"), {"lost": 1, "found_again": 0.0}),
    "the time to find the subject again is the mean over the losses": (
        log("aaa" + "-" * 9 + "aaa" + "-" * 19 + "aaa"),
        {"time_to_find_again_s": (1.0 + 2.0) / 2},
    ),
    "who is never lost takes no time to find again": (log("aaa"), {"time_to_find_again_s": None}),
    "who is not found again takes all the time there is": (log("aaa" + "-" * 50), {"time_to_find_again_s": 5.0}),
    "the best box may be on nobody": (
        [step(0, person(), boxes=[OFF, ON], target=1), *RIGHT, step(4, person())],
        {"best_box_wrong": 0.25, "detected": 0.8},
    ),
    "the best box is on somebody": (RIGHT, {"best_box_wrong": 0.0}),
    "there is no box": ([step(4, person())], {"best_box_wrong": None}),
    "the subject is the first person chosen": (
        [step(0, *BOTH, boxes=[ELSEWHERE], target=0)]
        + [step(k, *BOTH, boxes=[ON, OFF], target=1) for k in range(1, 4)],
        {"distance_mean_m": 1.0, "follows_first": 0.75, "first_detection_s": 0.1},
    ),
    "nobody is chosen, and the subject is the scenario's first": ([step(0, *BOTH)], {"distance_mean_m": 3.0}),
    "clearance is the smallest over people who are there and time, each with their own radius": (
        [step(0, person(2.0), person(1.0)), step(1, None, person(2.0))],
        {"clearance_min_m": 1.0 - 0.145 - SECOND_RADIUS},
    ),
}
CARDS |= {
    # A switch is a target that changes from one person to another.
    f"the targets are {of}": (log(of), {"identity_switches": switches})
    for of, switches in {"aaaa": 0, "aabb": 1, "abab": 3, "a-a-": 0, "a-b-": 1, "----": 0, "axbx": 1}.items()
}


@pytest.mark.parametrize("said", CARDS)
def test_the_card_of_a_log_in_which(said: str) -> None:
    steps, wanted = CARDS[said]
    found = card(*steps)
    assert {name: getattr(found, name) for name in wanted} == {
        name: value if value is None else pytest.approx(value, abs=1e-12) for name, value in wanted.items()
    }


def test_a_score_as_the_run_goes_needs_12_bytes_a_frame() -> None:
    scorer = Scorer(Scenario.load("two_people"))

    def memory_after(first: int, last: int) -> int:
        add(scorer, (followed(k) for k in range(first, last)))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = memory_after(0, 1000)
        grown = memory_after(1000, 5000) - before
    finally:
        tracemalloc.stop()
    # an array is made larger by up to a sixteenth more than it needs
    assert 0 < grown < 1.2 * 12 * 4000


@pytest.mark.parametrize("target", [0.8, 1.5, 3.0])
def test_the_distance_error_is_to_the_target_of_the_run(target: float) -> None:
    result = card(*(step(k, person(distance)) for k, distance in enumerate(APART)), target=target)
    assert result.target_m == target
    errors = np.array(APART) - CAMERA - TRUNK - target
    assert result.distance_rms_error_m == pytest.approx(math.sqrt(np.mean(errors**2)))
    without = card(step(0, person()), target=None)
    assert (without.target_m, without.distance_rms_error_m, without.distance_mean_m) == (None, None, 2.0)


def test_the_distance_error_is_to_what_the_controller_keeps_at_the_time() -> None:
    # The target of the run counts until then; silence is the same as before.
    surfaces, keeps, held = (1.0, 1.2, 1.9, 2.3, 2.5), (None, None, 2.0, None, 3.0), (1.5, 1.5, 2.0, 2.0, 3.0)
    steps = [step(k, person(surfaces[k] + CAMERA + TRUNK), keeps=keeps[k]) for k in range(5)]
    result = card(*steps, target=1.5)
    assert result.kept_m == pytest.approx(np.mean(held))
    assert result.distance_rms_error_m == pytest.approx(math.sqrt(np.mean(np.subtract(surfaces, held) ** 2)))
    assert card(*steps, target=None).kept_m is None
    assert card(step(0, person())).kept_m == 1.5
    assert card(step(0)).kept_m is None


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, 2.0, math.pi, -0.7, -math.pi / 2])
@pytest.mark.parametrize("bearing", [0.0, 0.9, math.pi / 2, math.pi, -2.0])
def test_clearance_is_from_outline_to_outline_wherever_the_person_is(yaw: float, bearing: float) -> None:
    x, y, direction = 1.2, -0.7, yaw + bearing
    standing = replace(person(), x=x + 0.8 * math.cos(direction), y=y + 0.8 * math.sin(direction))
    radius = Scenario.load("two_people").people[0].radius
    # The outline as its corners, sampled every millimetre: an independent way to the nearest point.
    side, front = np.linspace(-0.11, 0.11, 221), np.linspace(-0.145, 0.145, 291)
    edges = [(end, side) for end in (-0.145, 0.145)] + [(front, end) for end in (-0.11, 0.11)]
    outline = np.concatenate([np.stack(np.broadcast_arrays(*edge), 1) for edge in edges])
    ahead, beside = 0.8 * math.cos(bearing), 0.8 * math.sin(bearing)
    nearest = np.hypot(*(outline - (ahead, beside)).T).min() - radius
    found = card(step(0, standing, robot=(x, y, yaw))).clearance_min_m
    assert found == pytest.approx(nearest, abs=1e-3)


@pytest.mark.parametrize(
    ("shown", "contacts", "unseen_s", "success"),
    [
        ("-" * 300, 0, 10.0, True),
        ("-" * 300, 1, 10.0, False),
        ("h" * 150 + "-" * 150, 0, 10.0, True),  # not yet found is not lost
        ("-" * 100 + "h" * 98 + "-" * 102, 0, 10.0, True),
        ("-" * 100 + "h" * 100 + "-" * 100, 0, 10.0, False),
        ("-" * 299 + "h", 0, 10.0, False),
        ("h" * 300, 0, 10.0, False),
        ("--hh--", 0, 0.31, True),
        ("--hh--", 0, 0.29, False),
        ("------hhhh-", 0, 0.5, True),  # from .5 s to 1 s, and no longer than allowed
    ],
)
def test_success_is_a_person_in_view_untouched(shown: str, contacts: int, unseen_s: float, success: bool) -> None:
    assert card(*log(shown), contacts=Contacts(contacts, 3), criteria=Criteria(unseen_s=unseen_s)).success is success


def test_driving_is_the_share_of_the_steps_whose_command_moves_the_robot() -> None:
    scorer = Scorer(Scenario.load("two_people"))
    assert scorer.driving == 0.0
    add(scorer, (step(k, turn=turn) for k, turn in enumerate((0.0, 0.5, 0.2, 0.0))))
    assert scorer.driving == 2 / 4


@pytest.mark.parametrize("turn", [1.7e308, math.inf, math.nan])
def test_no_command_and_no_short_log_makes_a_figure_infinite(turn: float) -> None:
    result = card(*(step(k, person(), turn=turn * (-1) ** k) for k in range(4)))
    # the wheels, 1 m/s each and 0.172 m apart, turn the robot by no more than this
    assert result.mean_abs_domega <= 2 * 2.0 / 0.172
    for count in range(4):
        short = card(*(step(k, person()) for k in range(count)))
        assert short.jerk_mean is None
        assert sum(short.modes.values()) == sum(short.reasons.values()) == float(count > 0)
        json.dumps([one.to_json() for one in (result, short)], allow_nan=False)


@pytest.mark.parametrize("yaw", [0.0, 0.8, math.pi, -2.0])
def test_jerk_is_the_third_derivative_of_the_distance_driven(yaw: float) -> None:
    def jerk(*distances: float) -> float | None:
        way = [(driven * math.cos(yaw), driven * math.sin(yaw), yaw) for driven in distances]
        return card(*(step(k, robot=place) for k, place in enumerate(way))).jerk_mean

    times = [0.1 * k for k in range(20)]
    assert jerk(*(0.3 * t for t in times)) == pytest.approx(0.0, abs=1e-9)
    assert jerk(*(0.2 * t**2 for t in times)) == pytest.approx(0.0, abs=1e-9)
    assert jerk(*(t**3 for t in times)) == jerk(*(-(t**3) for t in times)) == pytest.approx(6.0)
    # Pushes that come late in the run count as those that come early.
    pushes = np.cumsum([0.1] * 8 + [0.1, 0.15, 0.3, 0.3, 0.1, 0.4])
    assert jerk(*pushes) == pytest.approx(np.abs(np.diff(pushes, 3)).mean() / 0.1**3)


def test_the_critics_are_the_mean_of_what_each_adds_to_the_command_sent() -> None:
    told = [step(k, person()) for k in range(4)]
    costs = [{"walls": 0.2}, {"walls": 0.4, "effort": 0.1}, {}, {}]
    decisions = [replace(told[0].log.decision, belief=Belief(shares=tuple(cost.items()))) for cost in costs]
    steps = [replace(one, log=replace(one.log, decision=said)) for one, said in zip(told, decisions, strict=True)]
    assert card(*steps).critics == pytest.approx({"walls": 0.15, "effort": 0.025})
    assert card(*told).critics == {}


@pytest.mark.parametrize(
    ("until", "lost", "found_again"), [(0.5, 0, None), (0.75, 1, 1.0), (3.0, 1, 1.0), (3.25, 1, 0.0)]
)
def test_who_is_lost_half_a_second_is_found_in_three(until: float, lost: int, found_again: float | None) -> None:
    # Times whose sums are exact.
    without = [step(0, person(), boxes=[ON], time=float(time)) for time in np.arange(0.25, until, 0.25)]
    result = card(followed(0), *without, followed(0, until))
    assert (result.lost, result.found_again) == (lost, found_again)


@pytest.mark.parametrize(
    ("columns", "rows", "heights", "on"),
    [([285, 330, 375], [100, 220], [72, 300], True), ([284, 376], [99, 221], [70, 302], False)],
)
def test_the_middle_of_a_box_and_its_height_decide_whom_it_is_on(
    columns: list[int], rows: list[int], heights: list[int], on: bool
) -> None:
    # The silhouette is 60 px by 120 from (300, 100) on; a quarter of its breadth more counts on either side.
    off_by_one = [(c, 160, 160) for c in columns] + [(330, r, 160) for r in rows] + [(330, 160, h) for h in heights]
    for column, row, height in off_by_one:
        box = np.array([column - 40, row - height // 2, 80, height], np.int32)
        assert on_person(box, person()) is on
        assert not on_person(box, person(box=None))


def test_a_box_on_two_people_is_on_the_one_in_view_then_on_the_nearer_one() -> None:
    left, right = person(box=(300, 100, 60, 120)), person(box=(320, 100, 60, 120))

    def on(one: PersonTruth, other: PersonTruth, middle: int) -> int | None:
        return person_of(np.array([middle - 40, 90, 80, 160], np.int32), (one, other))

    # Their middles are at 330 and 350.
    assert (on(left, right, 336), on(left, right, 344)) == (0, 1)
    for visible, number in ((0.499, 1), (0.5, 0)):
        assert on(replace(left, visible=visible), replace(right, visible=0.5), 336) == number
    assert on(left, replace(right, visible=0.3), 344) == 0
