"""Runs in the arena: closed loop, the same for the same seed, and safe when the detector is not."""

import dataclasses
import math
import time
from typing import Any

import numpy as np
import pytest
from tests.hardening.lost_senses import Ride, Row, judged
from tests.sim.logs import Finds, commands, drive, figures, steps_of

from limo_hog.detector import PeopleDetector
from limo_hog.follow import ApproachController, Mode, ProxemicController, TrackingController, Twist, controller_named
from limo_hog.named_detectors import detector_named
from limo_sim.run.arena import Arena
from limo_sim.run.episode import Episode, run_episode, score
from limo_sim.view.tuning import Tunable
from limo_sim.world.scenario import Scenario

#: Sees a person straight ahead whatever there is.
AHEAD = Finds([288, 150, 64, 128])


STANDING = Scenario.load("standing")


def standing_at(x: float) -> Scenario:
    return dataclasses.replace(STANDING, people=(dataclasses.replace(STANDING.people[0], route=((x, 0.0, 0.0),)),))


def run(scenario: str, seconds: float, controller: Any = None, detector: Any = None, seed: int = 0) -> Episode:
    return run_episode(
        Scenario.load(scenario), controller or TrackingController(), detector or detector_named("hog"), seconds, seed
    )


def tuned(controller: Any) -> Tunable[Any]:
    tunable: Tunable[Any] = Tunable(controller)
    if "target_distance" in tunable.parameters:
        tunable.set("target_distance", 2.4)
    return tunable


def test_the_same_seed_gives_the_same_score_but_for_the_wall_clock() -> None:
    one, two = (figures(score(run("followable", 3.0))) for _ in range(2))
    assert one == two


def test_the_clock_figures_are_those_of_the_wall() -> None:
    began = time.perf_counter()
    episode = run("standing", 1.0, ProxemicController(), Finds(first=lambda: time.sleep(0.02)))
    took = time.perf_counter() - began
    result = score(episode)
    assert result.detect_ms_p50 is not None and result.render_ms_p50 is not None
    assert 20.0 <= result.detect_ms_p50 < 1e3 * took / 10
    # between a tenth of a frame's usual 1.5 … 3 ms and all the time there was
    assert 0.15 < result.render_ms_p50 < 1e3 * took / 10 - 20.0
    assert 10 * 0.02 < episode.wall_seconds <= took
    assert result.real_time_factor == pytest.approx(1.0 / episode.wall_seconds)


@pytest.mark.parametrize(
    ("controller", "target"),
    [
        (ProxemicController(), 1.5),
        (TrackingController(target_distance=2.2), 2.2),
        (ApproachController(), None),
        (tuned(ProxemicController()), 2.4),
        (tuned(ApproachController()), None),
    ],
)
def test_the_card_tells_the_distance_that_the_controller_holds(controller: Any, target: float | None) -> None:
    result = score(run("standing", 0.2, controller))
    assert result.target_m == target
    assert (result.distance_rms_error_m is None) == (target is None)


@pytest.mark.parametrize("target", [1.6, 2.2])
def test_a_controller_that_holds_its_distance_has_little_error(target: float) -> None:
    # where the follower wants to be: camera, trunk seen from the front
    x = target + 0.084 + 0.052 * STANDING.people[0].height
    held = run_episode(standing_at(x), ProxemicController(target), PeopleDetector(), 6.0, 0)
    assert (score(held).distance_rms_error_m or math.inf) < 0.03


def test_a_person_who_walks_in_between_is_not_followed_instead() -> None:
    result = score(run("crossing", 22.0, seed=1))
    assert (result.follows_first or 0.0) > 0.95
    assert result.contacts_person == 0


@pytest.mark.parametrize("name", ["approach", "proxemic", "tracking"])
def test_a_person_who_stands_is_followed_behind_the_safety_layer(name: str) -> None:
    result = score(run("standing", 9.0, controller_named(name)))
    assert (result.in_view, result.contacts_person) == (1.0, 0)
    assert result.path_m > 0.5
    assert name != "tracking" or (result.detected == 1.0 and result.modes["hold"] > 0.1)


def test_nobody_is_approached_nearer_than_the_safety_layer_allows() -> None:
    result = score(run_episode(standing_at(2.0), ProxemicController(0.3), AHEAD, 15.0, 0))
    assert 0.45 <= (result.clearance_min_m or 0.0) < 0.7
    assert result.modes["blocked"] > 0.1


def test_nobody_is_found_where_nobody_is() -> None:
    result = score(run("empty", 4.0))
    assert (result.in_view, result.modes["search"]) == (None, 1.0)
    assert result.path_m < 0.05


def test_between_slow_frames_a_command_goes_out_every_period_until_one_is_too_old() -> None:
    slow = dataclasses.replace(STANDING, camera=dataclasses.replace(STANDING.camera, rate_hz=1.0))
    steps = steps_of(slow, controller_named("approach"), detector_named("hog"), 3.0, 0)
    ages: dict[float, Any] = {}
    for _, old, decision in commands(steps):
        ages.setdefault(round(old, 1), []).append(decision)
    assert sorted(ages) == pytest.approx([0.1 * k for k in range(10)])
    assert all(decision.mode is Mode.FOLLOW for age in (0.0, 0.1, 0.4) for decision in ages[age])
    for age in (0.6, 0.7, 0.8, 0.9):
        assert {(one.twist, one.reason) for one in ages[age]} == {(Twist(), f"no camera frame for {age} s")}


@pytest.mark.parametrize("name", ["flat", "gathering", "poster_wall", "side_door", "tall"])
def test_a_scenario_is_played_by_the_tracking_controller(name: str) -> None:
    card = score(run(name, 4.0))
    assert card.frames == 40
    assert card.contacts_person == card.contacts_wall == 0
    assert card.in_view and card.detected


def test_in_the_corridor_one_person_walks_ahead_and_the_other_passes_the_robot() -> None:
    arena, places = Arena(Scenario.load("side_door"), 0), []
    while arena.time < 25.0:
        places.append([(pose.x, pose.y) for pose in drive(arena, 0.02).plan().people if pose is not None])
    ahead, towards = np.moveaxis(np.array(places), 1, 0)
    assert ahead[:, 0].max() > 1.5
    assert towards[:, 0].min() < -6.5
    in_corridor = (towards[:, 0] > -7.5) & (towards[:, 0] < 1.0)
    assert np.abs(towards[in_corridor, 1]).max() < 0.95
    assert arena.contacts.person == 0


@pytest.mark.parametrize(
    "row",
    [
        Row(3, ("scan",), 0.0),
        Row(0, ("depth", "camera_info"), 0.0),
        Row(1, ("scan", "odometry"), 2.0),
        Row(2, ("depth",), 2.0),
        Row(0, ("camera",), 2.0, "odometry", 100.0),
        Row(1, ("scan",), 2.0, "camera", -0.3),
    ],
    ids=str,
)
def test_without_a_sense_the_robot_stands_and_says_which(row: Row) -> None:
    ride = Ride(row.seed, row.shifted, row.shift)
    ride.until(row.at)
    assert judged(ride, row).wrong == []
