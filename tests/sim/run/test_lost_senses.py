"""A robot that lacks or loses a sense stands, in `followable` with two walls; `-m slow` plays every case."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import pytest

from limo_hog import PeopleDetector
from limo_hog.follow import Decision, Follower, Frame, TrackingController, Twist
from limo_hog.ros2 import messages, names
from limo_hog.ros2.senses import Senses, picture_of
from limo_sim.ros.outlet import Outlet
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario, Wall

#: The topics that may be missing, and how a reason calls them; one without calibration drives on.
TOPICS = {
    "scan": (names.SCAN, "scan"),
    "depth": (names.DEPTH, "depth image"),
    "odometry": (names.ODOMETRY, "odometry"),
    "camera_info": (names.CAMERA_INFO, ""),
    "camera": (names.IMAGE, "camera frame"),
}
SUBSETS = [subset for count in (1, 2, 3, 4) for subset in itertools.combinations(list(TOPICS)[:4], count)]
SHIFTS = (-100.0, -2.0, -0.3, 0.3, 2.0, 100.0)
WALLS = (Wall((-0.9, -1.5), (-0.9, 1.5)), Wall((-0.5, -1.1), (1.5, -1.1)))
LOST_AT, SECONDS = 5.0, 7.0
#: What the sensors' clocks show when the arena's is 0, and the robot's own [s].
SET, BOOTED = 200.0, 7000.0


@dataclass(frozen=True)
class Case:
    """What is lost and when [s], and by how much the clock of which topic is wrong [s]."""

    lost: tuple[str, ...]
    at: float = LOST_AT
    shifted: str = ""
    shift: float = 0.0


CASES = [Case(subset, at) for subset in SUBSETS for at in (0.0, LOST_AT)]
CASES += [
    Case((lost,), LOST_AT, shifted, shift)
    for shifted, lost in itertools.permutations(("camera", "depth", "scan", "odometry"), 2)
    for shift in SHIFTS
]


@dataclass(frozen=True)
class Moment:
    """A step of the arena: its time [s], the newest decision, and how fast the wheels turn [m/s]."""

    time: float
    decision: Decision[None]
    wheels: float


def play(case: Case, seed: int, seconds: float = SECONDS) -> tuple[list[Moment], int]:
    """Let the robot follow as over ROS 2; return its moments and how often it touched something."""
    arena = Arena(replace(Scenario.load("followable"), walls=WALLS), seed)
    outlet, senses = Outlet(arena), Senses()
    follower = Follower(TrackingController(), PeopleDetector())
    lost = [TOPICS[name][0] for name in case.lost]
    shifted = TOPICS[case.shifted][0] if case.shifted else ""
    moments: list[Moment] = []
    frame: Frame | None = None
    while arena.time < seconds:
        for topic, make in outlet.new():
            if topic not in [topic for topic, _ in TOPICS.values()] or (topic in lost and arena.time >= case.at):
                continue
            message = make()
            stamp = messages.to_seconds(message.header.stamp) + SET + (case.shift if topic == shifted else 0.0)
            message.header.stamp = messages.to_time(stamp)
            if topic == names.IMAGE:
                frame = senses.frame(stamp, picture_of(message))
            else:
                senses.take(message)
        log = follower.tick(BOOTED + arena.time, frame, senses.sensors)
        if log is not None:
            arena.command(log.decision.twist)
        before = moments[-1].decision if moments else None
        decision = log.decision if log else before
        assert decision is not None
        x, y, yaw = arena.plan().robot
        arena.step()
        after = arena.plan().robot
        wheels = 50 * (math.hypot(after[0] - x, after[1] - y) + 0.086 * abs(after[2] - yaw))
        moments.append(Moment(arena.time, decision, wheels))
    return moments, arena.contacts.wall + arena.contacts.person


def wrong(case: Case, seed: int, seconds: float = SECONDS) -> list[str]:
    """Return what a run of a case did that it must not."""
    moments, contacts = play(case, seed, seconds)
    found = [f"{contacts} contacts"] if contacts else []
    needed = [TOPICS[name][1] for name in case.lost if TOPICS[name][1]]
    if not needed:
        return found
    for moment in moments:
        if moment.time <= case.at + (1.0 if case.at else 0.0):
            continue
        decision = moment.decision
        if decision.twist != Twist() or moment.wheels > 0.01:
            found.append(f"at {moment.time:.2f} s {decision.twist}, wheels {moment.wheels:.2f}: {decision.reason}")
            break
        if unsaid := [name for name in needed if f"no {name}" not in decision.reason]:
            found.append(f"at {moment.time:.2f} s it does not say {unsaid}: {decision.reason}")
            break
    return found


@pytest.mark.parametrize(
    ("case", "seed"),
    [
        (Case(("scan",), 0.0), 3),
        (Case(("depth", "camera_info"), 0.0), 0),
        (Case(("scan", "odometry"), 2.0), 1),
        (Case(("depth",), 2.0), 2),
        (Case(("camera",), 2.0, "odometry", 100.0), 0),
        (Case(("scan",), 2.0, "scan", 0.3), 1),
    ],
    ids=str,
)
def test_without_a_sense_the_robot_stands_and_says_which(case: Case, seed: int) -> None:
    assert wrong(case, seed, case.at + 2.0) == []


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=str)
def test_whatever_is_lost_and_whosever_clock_is_wrong_it_stands(case: Case) -> None:
    assert wrong(case, 0) == []
