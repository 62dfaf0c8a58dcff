"""One closed-loop run: sense, detect, decide, drive, score. Two clocks: the arena's and the wall's."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from limo_hog.detections import Detector
from limo_hog.follow.decision import Controller
from limo_hog.follow.pipeline import Follower, Search
from limo_hog.follow.sense.observation import Sensors
from limo_hog.follow.sense.region import detect_in
from limo_sim.run.arena import Arena
from limo_sim.run.detector_faults import FaultySearch
from limo_sim.run.log import Passed, Step, Watch
from limo_sim.run.score import Episode as Episode
from limo_sim.run.score import ScoreCard, Scorer
from limo_sim.world.scenario import DetectorFaults, Scenario


def score(episode: Episode) -> ScoreCard:
    """Return the score card of a run."""
    return episode.scorer.card(episode)


def run_episode(
    scenario: Scenario,
    controller: Controller[Any],
    detector: Detector,
    seconds: float,
    seed: int,
    *,
    names: tuple[str, str] = ("controller", "detector"),
    watch: Watch = lambda _: None,
) -> Episode:
    """Let a controller drive the robot, behind the safety layer, for some seconds of simulated time.

    The same scenario and seed give the same run. The detector finds people in uint8 (H, W, 3) BGR images; the
    scenario's faults come on top. If it raises, the robot stops and says so. `names` is what the log calls the
    controller and the detector. `watch` is called with every control period: the run keeps none, so its memory does not
    grow.
    """
    arena = Arena(scenario, seed)
    search: Search = detect_in
    if scenario.detector != DetectorFaults():
        search = FaultySearch(arena.scenario, seed, lambda: arena.frame().truth)
    follower = Follower(controller, detector, scenario.robot.geometry, search=search)
    episode = play(arena, follower, seconds, names=names, watch=watch)
    return replace(episode, target_distance=getattr(controller, "target_distance", None))


def play(
    arena: Arena, follower: Follower[Any], seconds: float, *, names: tuple[str, str], watch: Watch = lambda _: None
) -> Episode:
    """Let a follower drive the arena's robot; as `run_episode`, whose parameters these are."""
    began = time.perf_counter()
    scorer = Scorer(arena.scenario)
    passed: list[Passed] = []
    while arena.time < seconds:
        passed.append(arena.passed())
        drawing = time.perf_counter()
        frame = arena.frame()
        render_ms = 1e3 * (time.perf_counter() - drawing)
        log = follower.tick(arena.time, frame, Sensors(arena.scan(), arena.odometry()))
        if log is not None:
            arena.command(log.decision.twist)
            step = Step(log, arena.truth(), frame.truth if log.frame else None, render_ms, passed=tuple(passed))
            passed.clear()
            scorer.add(step)
            watch(step)
        arena.step()
    wall_seconds = time.perf_counter() - began
    return Episode(arena.scenario, *names, arena.seed, arena.time, scorer, arena.contacts, wall_seconds)
