"""A score card says of a made-up log what anybody can count."""

from __future__ import annotations

import json
import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from tests.sim.run.steps import CAMERA, OFF, ON, TRUNK, add, card, followed, other_person, person, step

from limo_sim.run.matching import Criteria
from limo_sim.run.score import Scorer
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts


def test_fractions_begin_when_the_person_is_first_in_view() -> None:
    unseen = [step(k, person(visible=0.0, box=None)) for k in range(5)]
    seen = [followed(k) for k in range(5, 8)]
    gone = [step(8, person(visible=0.1))]
    result = card(*unseen, *seen, *gone)
    assert result.in_view == 0.75
    assert result.detected == 1.0
    assert result.first_detection_s == pytest.approx(0.5)


def test_a_robot_keeps_up_where_the_person_is_in_view_and_at_most_three_metres_away() -> None:
    near, edge, far, hidden = person(2.0), person(3.0), person(3.01), person(2.0, visible=0.4)
    result = card(*(step(k, one) for k, one in enumerate((near, edge, far, hidden, far))))
    assert (result.kept_up, result.in_view) == (0.4, 0.8)


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
    assert result.distance_mean_m == pytest.approx(1.85)
    zones = (result.zone_intimate, result.zone_personal, result.zone_social, result.zone_public)
    assert zones == (0.25, 0.25, 0.25, 0.25)


def test_the_distance_error_is_to_the_target_of_the_run() -> None:
    steps = [step(k, person(distance)) for k, distance in enumerate((0.4, 1.0, 2.0, 4.0))]
    for target in (0.8, 1.5, 3.0):
        errors = [distance - CAMERA - TRUNK - target for distance in (0.4, 1.0, 2.0, 4.0)]
        result = card(*steps, target=target)
        assert result.target_m == target
        assert result.distance_rms_error_m == pytest.approx(math.sqrt(sum(error**2 for error in errors) / 4))


def test_a_follower_that_holds_its_target_exactly_is_charged_no_error() -> None:
    result = card(*(step(k, person(1.5 + CAMERA + TRUNK)) for k in range(5)))
    assert result.distance_rms_error_m == pytest.approx(0.0, abs=1e-12)


def test_the_distance_error_is_to_what_the_controller_keeps_at_the_time() -> None:
    """The target of the run counts until the controller says what it keeps; silence is the same as before."""
    kept = (None, None, 2.0, None, 3.0)
    surfaces = (1.0, 1.2, 1.9, 2.3, 2.5)
    steps = [
        step(k, person(surface + CAMERA + TRUNK), keeps=keeps)
        for k, (surface, keeps) in enumerate(zip(surfaces, kept, strict=True))
    ]
    result = card(*steps, target=1.5)
    held = (1.5, 1.5, 2.0, 2.0, 3.0)
    assert result.kept_m == pytest.approx(sum(held) / 5)
    errors = [surface - one for surface, one in zip(surfaces, held, strict=True)]
    assert result.distance_rms_error_m == pytest.approx(math.sqrt(sum(error**2 for error in errors) / 5))
    assert card(*steps, target=None).kept_m is None
    assert card(step(0, person())).kept_m == 1.5
    assert card(step(0)).kept_m is None


def test_a_controller_that_holds_no_distance_has_no_distance_error() -> None:
    result = card(*(step(k, person()) for k in range(5)), target=None)
    assert result.target_m is None
    assert result.distance_rms_error_m is None
    assert result.distance_mean_m == 2.0


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, 2.0, math.pi, -0.7, -math.pi / 2])
@pytest.mark.parametrize("bearing", [0.0, 0.9, math.pi / 2, math.pi, -2.0])
def test_clearance_is_from_outline_to_outline_wherever_the_person_is(yaw: float, bearing: float) -> None:
    x, y, direction = 1.2, -0.7, yaw + bearing
    standing = replace(person(), x=x + 0.8 * math.cos(direction), y=y + 0.8 * math.sin(direction))
    radius = Scenario.load("two_people").people[0].radius
    # The outline as its corners, sampled every millimetre: an independent way to the nearest point.
    side, front = np.linspace(-0.11, 0.11, 221), np.linspace(-0.145, 0.145, 291)
    outline = np.concatenate(
        [np.stack(np.broadcast_arrays(end, side), 1) for end in (-0.145, 0.145)]
        + [np.stack(np.broadcast_arrays(front, end), 1) for end in (-0.11, 0.11)]
    )
    ahead, beside = 0.8 * math.cos(bearing), 0.8 * math.sin(bearing)
    nearest = np.hypot(*(outline - (ahead, beside)).T).min() - radius
    found = card(step(0, standing, robot=(x, y, yaw))).clearance_min_m
    assert found == pytest.approx(nearest, abs=1e-3)


def test_clearance_is_the_smallest_over_people_and_time_each_with_their_own_radius() -> None:
    radii = [settings.radius for settings in Scenario.load("two_people").people]
    far, near = person(2.0), person(1.0)
    assert card(step(0, far, near), step(1, far, far)).clearance_min_m == pytest.approx(1.0 - 0.145 - radii[1])
    assert card(step(0, None, near)).clearance_min_m == pytest.approx(1.0 - 0.145 - radii[1])


def test_the_best_box_on_no_person_is_wrong() -> None:
    wrong = step(0, person(), boxes=[OFF, ON], target=1)
    right = [step(k, person(), boxes=[ON, OFF], target=0) for k in range(1, 4)]
    unboxed = step(4, person())
    result = card(wrong, *right, unboxed)
    assert result.best_box_wrong == 0.25
    assert result.detected == 0.8
    assert card(*right).best_box_wrong == 0.0
    assert card(unboxed).best_box_wrong is None


def test_following_the_other_person_is_told() -> None:
    people = person(), other_person()
    mine = [step(k, *people, boxes=[ON], target=0) for k in range(3)]
    theirs = [step(3, *people, boxes=[OFF], target=0)]
    assert card(*mine, *theirs).follows_first == 0.75


def test_the_subject_is_the_first_person_chosen_not_the_scenarios_first() -> None:
    people = person(3.0), replace(other_person(), distance=1.0)
    wrong = step(0, *people, boxes=[[400, 10, 80, 160]], target=0)
    theirs = [step(k, *people, boxes=[ON, OFF], target=1) for k in range(1, 4)]
    result = card(wrong, *theirs)
    assert result.distance_mean_m == 1.0
    assert result.follows_first == 0.75
    assert result.first_detection_s == pytest.approx(0.1)
    assert card(step(0, *people)).distance_mean_m == 3.0


@pytest.mark.parametrize(
    ("targets", "switches"), [("aaaa", 0), ("aabb", 1), ("abab", 3), ("a-a-", 0), ("a-b-", 1), ("----", 0), ("axbx", 1)]
)
def test_a_switch_is_a_target_that_changes_from_one_person_to_another(targets: str, switches: int) -> None:
    boxes = {"a": ON, "b": OFF, "x": [400, 10, 80, 160]}
    steps = [
        step(k, person(), other_person(), boxes=[boxes[of]] if of != "-" else None, target=None if of == "-" else 0)
        for k, of in enumerate(targets)
    ]
    assert card(*steps).identity_switches == switches


@pytest.mark.parametrize(
    ("shown", "contacts", "success"),
    [
        ("1" * 300, 0, True),
        ("1" * 300, 1, False),
        ("0" * 150 + "1" * 150, 0, True),  # not yet found is not lost
        ("1" * 100 + "0" * 98 + "1" * 102, 0, True),
        ("1" * 100 + "0" * 100 + "1" * 100, 0, False),
        ("1" * 299 + "0", 0, False),
        ("0" * 300, 0, False),
    ],
)
def test_success_is_a_person_in_view_at_the_end_untouched_and_never_lost_for_long(
    shown: str, contacts: int, success: bool
) -> None:
    steps = [step(k, person(visible=float(seen))) for k, seen in enumerate(shown)]
    assert card(*steps, contacts=Contacts(contacts, 3)).success is success


def test_without_anybody_there_is_nothing_to_succeed_in() -> None:
    assert card(step(0), step(1, None)).success is None


def test_the_turn_rates_changes_are_averaged() -> None:
    turns = (0.0, 0.5, 0.2, 0.2)
    result = card(*(step(k, turn=turn) for k, turn in enumerate(turns)))
    assert result.mean_abs_domega == pytest.approx(0.8 / 3)


def test_a_turn_rate_that_is_no_number_counts_as_none() -> None:
    result = card(*(step(k, turn=turn) for k, turn in enumerate((0.0, math.nan, 0.2))))
    assert result.mean_abs_domega == pytest.approx((0.0 + 0.2) / 2)


def test_driving_is_the_share_of_the_steps_whose_command_moves_the_robot() -> None:
    scorer = Scorer(Scenario.load("two_people"))
    assert scorer.driving == 0.0
    add(scorer, (step(k, turn=turn) for k, turn in enumerate((0.0, 0.5, 0.2, 0.0))))
    assert scorer.driving == 2 / 4


@pytest.mark.parametrize("turn", [1.7e308, math.inf, math.nan])
def test_no_command_makes_a_figure_infinite(turn: float) -> None:
    result = card(*(step(k, person(), turn=turn * (-1) ** k) for k in range(4)))
    # the wheels, 1 m/s each and 0.172 m apart, turn the robot by no more than this
    assert result.mean_abs_domega <= 2 * 2.0 / 0.172
    json.dumps(result.to_json(), allow_nan=False)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_the_shortest_logs_have_finite_figures(count: int) -> None:
    result = card(*(step(k, person()) for k in range(count)))
    assert result.jerk_mean is None
    json.dumps(result.to_json(), allow_nan=False)


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


def test_percentiles_and_means_of_the_wall_clock() -> None:
    times = [1.0, 2.0, 3.0, 4.0, 90.0]
    result = card(*(step(k, person(), detect_ms=ms, render_ms=ms / 2) for k, ms in enumerate(times)))
    assert result.detect_ms_p50 == 3.0
    assert result.detect_ms_p95 == pytest.approx(np.percentile(times, 95))
    assert result.detect_ms_mean == 20.0
    assert result.render_ms_p50 == 1.5
    # five steps of 0.1 s in half a second of the wall's time
    assert result.real_time_factor == 1.0


def test_the_pixel_error_reached_in_95_of_100_frames() -> None:
    steps = [step(k, person(box=(290 + k, 100, 60, 120))) for k in range(101)]
    result = card(*steps)
    assert result.pixel_error_mean == 50.0
    assert result.pixel_error_p95 == 95.0


def test_the_pixel_error_is_of_the_frames_with_the_subject_in_view() -> None:
    behind = step(1, person(visible=0.4, box=(0, 100, 60, 120)))
    result = card(step(0, person(box=(300, 100, 60, 120))), behind, step(2, person(box=(250, 100, 60, 120))))
    assert result.pixel_error_mean == 25.0


def test_the_shares_of_modes_and_reasons_add_up_to_one_however_short_the_log() -> None:
    for count in (1, 2, 5):
        result = card(*(step(k, person()) for k in range(count)))
        assert sum(result.modes.values()) == sum(result.reasons.values()) == 1.0
        assert result.modes["follow"] == result.reasons["because"] == 1.0


def test_intrusions_are_those_of_the_nearest_of_all_people() -> None:
    far, near, absent = person(4.0), replace(other_person(), distance=0.9), None
    result = card(step(0, far, near), step(1, far, absent), step(2, person(0.3), near), step(3, absent, absent))
    assert (result.intrusion_intimate, result.intrusion_personal, result.intrusion_social) == (0.25, 0.25, 0.0)
    empty = card(step(0, None, None))
    assert empty.intrusion_intimate is empty.intrusion_personal is empty.intrusion_social is None


def test_driving_after_a_decoy_is_measured() -> None:
    steps = [step(k, boxes=[OFF], target=0, at=0.1 * k) for k in range(4)]
    assert card(*steps).path_wrong_m == pytest.approx(0.3)
    assert card(*steps).path_m == pytest.approx(0.3)


def test_driving_counts_as_wrong_from_a_target_that_is_no_person_to_one_that_is() -> None:
    targets = "-aax-xa-a"
    boxes = {"a": ON, "x": OFF}
    steps = [
        step(k, person(), boxes=[boxes[of]] if of in boxes else None, target=0 if of in boxes else None, at=0.5 * k)
        for k, of in enumerate(targets)
    ]
    # from 3 to 6
    assert card(*steps).path_wrong_m == pytest.approx(1.5)
    assert card(*steps).path_m == pytest.approx(4.0)


def test_a_run_fails_only_beyond_the_time_unseen_that_the_criteria_allow() -> None:
    steps = [step(k, person(visible=float(k not in (2, 3)))) for k in range(6)]
    for unseen_s, success in ((0.31, True), (0.29, False)):
        assert card(*steps, contacts=Contacts(), criteria=Criteria(unseen_s=unseen_s)).success is success
    # From .5 s to 1 s, and no longer than allowed.
    steps = [step(k, person(visible=float(not 5 < k < 10))) for k in range(11)]
    assert card(*steps, contacts=Contacts(), criteria=Criteria(unseen_s=0.5)).success is True


def test_frames_are_counted_and_periods_without_one_are_not() -> None:
    assert card(*(step(k, person(), frame=k != 2) for k in range(5))).frames == 4


@pytest.mark.parametrize(("visible", "share"), [(0.5, 1.0), (0.499, 0.5)])
def test_a_person_is_in_view_of_whom_half_is_visible(visible: float, share: float) -> None:
    assert card(step(0, person()), step(1, person(visible=visible))).in_view == share
