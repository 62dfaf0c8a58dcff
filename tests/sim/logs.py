"""Logs of runs: made up, which are the scorer's input; and of the arena, kept without their pictures."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.follow.views import there as there

from limo_hog.detections import Detections
from limo_hog.follow.decision import Belief, Decision, Mode
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Sensors
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.run.episode import Episode, run_episode, score
from limo_sim.run.log import Step
from limo_sim.run.matching import CRITERIA, Criteria
from limo_sim.run.score import ScoreCard, Scorer
from limo_sim.world.crowd import STEP_S, Crowd
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Scenario
from limo_sim.world.truth import Contacts, PersonTruth, Truth

#: A person's silhouette in the image, a box on it and one that is on nobody [px].
BOX = (300, 100, 60, 120)
ON, OFF = [285, 90, 80, 160], [20, 90, 80, 160]
#: From the robot's centre to the camera, and from a person's surface to the axis [m].
CAMERA, TRUNK = 0.084, 0.08
TOUCHED = Contacts(person=1, wall=2)
#: Figures of a card that differ from run to run.
WALL_CLOCK = {"detect_ms_p50", "detect_ms_p95", "detect_ms_mean", "render_ms_p50", "real_time_factor"}


class Finds:
    """A detector that finds the same windows in every image, whatever it shows, after something else."""

    def __init__(self, *windows: list[int], first: Callable[[], None] = lambda: None) -> None:
        self.first = first
        self.found = Detections(np.array(windows, np.int32).reshape(-1, 4), np.linspace(1.0, 0.8, len(windows)))

    def detect(self, _image: NDArray[np.uint8]) -> Detections:
        self.first()
        return self.found


def person(distance: float = 2.0, visible: float = 1.0, box: tuple[int, int, int, int] | None = BOX) -> PersonTruth:
    return PersonTruth(distance, 0.0, math.pi, distance, 0.0, distance - CAMERA - TRUNK, visible, box)


def other_person(box: tuple[int, int, int, int] = (20, 100, 60, 120)) -> PersonTruth:
    return replace(person(), box=box)


def step(
    number: int,
    *people: PersonTruth | None,
    boxes: list[list[int]] | None = None,
    target: int | None = None,
    time: float | None = None,
    at: float = 0.0,
    robot: tuple[float, float, float] | None = None,
    turn: float | None = None,
    keeps: float | None = None,
    detect_ms: float = 2.0,
    render_ms: float = 1.0,
    frame: bool = True,
) -> Step:
    """A control period, at a tenth of a second times its number unless `time` says when [s]."""
    truth = Truth(0.1 * number, robot or (at, 0.0, 0.0), people, Contacts(0, 0))
    found = Detections.none() if not boxes else Detections(np.array(boxes, np.int32), np.arange(len(boxes), 0.0, -1.0))
    twist = Twist(0.0, 0.1 * number if turn is None else turn)
    decision = Decision(twist, None, Mode.FOLLOW, "because", target, belief=Belief(keeps))
    log = FrameLog(0.1 * number if time is None else time, decision, Sensors(), None, found, detect_ms=detect_ms)
    return Step(log, truth, truth if frame else None, render_ms)


def followed(number: int, time: float | None = None) -> Step:
    return step(number, person(), boxes=[ON], target=0, time=time)


def card(
    *steps: Step, target: float | None = 1.5, contacts: Contacts = TOUCHED, criteria: Criteria | None = None
) -> ScoreCard:
    scenario = Scenario.load("two_people")
    scorer = Scorer(scenario, criteria or CRITERIA)
    add(scorer, steps)
    return score(Episode(scenario, "c", "d", 0, 0.1 * len(steps), scorer, contacts, 0.5, target))


def add(scorer: Scorer, steps: Iterable[Step]) -> None:
    for one in steps:
        scorer.add(one)


def commands(steps: Iterable[Step]) -> Iterator[tuple[float, float, Decision[Any]]]:
    """Every command of a run: when it was sent, the age of the frame that it is of [s], and what it says."""
    taken = 0.0
    for one in steps:
        taken = one.seen.stamp if one.seen else taken
        yield one.log.time, one.log.time - taken, one.log.decision


def figures(card: ScoreCard) -> dict[str, Any]:
    """What a card says but for the wall clock's figures, which are there."""
    told = card.to_json()
    for name in WALL_CLOCK:
        assert told.pop(name) is not None
    return told


def kept_in(steps: list[Step]) -> Callable[[Step], None]:
    """What a run is to be watched by, so that its steps are kept."""
    return lambda step: steps.append(step.bare())


def steps_of(*arguments: Any, **options: Any) -> list[Step]:
    """Run an episode, with the arguments of `run_episode`, and return its control periods."""
    steps: list[Step] = []
    run_episode(*arguments, watch=kept_in(steps), **options)
    return steps


def drive(arena: Arena, seconds: float, twist: Twist | None = None) -> Arena:
    """Let a time pass, with a command before every step where there is one."""
    for _ in range(round(seconds * STEPS_PER_SECOND)):
        if twist is not None:
            arena.command(twist)
        arena.step()
    return arena


def poses_of(
    scenario: Scenario, seconds: float, robot: tuple[float, float, float] = (-4.5, -4.5, 0.0), seed: int = 0
) -> list[tuple[Pose | None, ...]]:
    """Where everybody is from step to step, while the robot stands."""
    scenario.check()
    crowd = Crowd(scenario, seed)
    seen = [crowd.poses]
    for step in range(1, round(seconds / STEP_S) + 1):
        crowd.advance(step * STEP_S, robot)
        seen.append(crowd.poses)
    return seen
