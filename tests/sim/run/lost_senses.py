"""A robot that loses senses, in `followable` with two walls. The long form: `python -m tests.sim.run.lost_senses`."""

from __future__ import annotations

import argparse
import itertools
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

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


def main() -> Iterator[str]:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    runs = [(case, seed) for case in CASES for seed in range(seeds)]
    with ProcessPoolExecutor() as pool:
        for (case, seed), found in zip(runs, pool.map(partial(_wrong), runs), strict=True):
            if found:
                yield f"{case}, seed {seed}: {'; '.join(found)}"
    yield f"{len(runs)} runs"


def _wrong(run: tuple[Case, int]) -> list[str]:
    return wrong(*run)


if __name__ == "__main__":
    for line in main():
        sys.stdout.write(f"{line}\n")
