"""A robot that lacks or loses senses, in `followable` with two walls, as over ROS 2: it must stand, and say which.

`python -m tests.hardening.lost_senses --seeds 20 --rows FILE` plays each subset of the senses missing from the start or
lost after 5 s, and each topic's clock wrong before another sense dies, from where FILE ends: .25 h on a core.
"""

import argparse
import itertools
import json
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import cv2

import limo_hog
from limo_hog.follow import Decision, Follower, Frame, TrackingController, Twist
from limo_hog.named_detectors import detector_named
from limo_hog.ros2 import messages, names
from limo_hog.ros2.senses import Senses, picture_of
from limo_sim.ros.outlet import Outlet
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario, Wall

#: The topics that may be missing; how a reason, and how the line at the start, call their sense.
TOPICS = {
    "scan": (names.SCAN, "no scan", "scan NO"),
    "depth": (names.DEPTH, "no depth image", "depth no"),
    "odometry": (names.ODOMETRY, "no odometry", "odom no"),
    "camera_info": (names.CAMERA_INFO, "", "camera_info no"),  # without calibration it drives on
    "camera": (names.IMAGE, "no camera frame", ""),
}
SUBSETS = [subset for count in (1, 2, 3, 4) for subset in itertools.combinations(list(TOPICS)[:4], count)]
SHIFTED = ("camera", "depth", "scan", "odometry")
SHIFTS = (-100.0, -2.0, -0.3, 0.3, 2.0, 100.0)
WALLS = (Wall((-0.9, -1.5), (-0.9, 1.5)), Wall((-0.5, -1.1), (1.5, -1.1)))
#: When senses die, by when the robot must stand, and how long it is looked at [s].
LOST_AT, STANDS_S, WATCHED_S = 5.0, 1.0, 1.5
#: What the sensors' clocks show when the arena's is 0, and the robot's own [s].
SET, BOOTED = 200.0, 7000.0


@dataclass(frozen=True)
class Moment:
    """A step of the arena: its time [s], the newest decision, and how fast a wheel turns at most [m/s]."""

    time: float
    decision: Decision[None]
    wheels: float


class Ride:
    """A run, which can be driven up to a time and then on with fewer senses."""

    def __init__(self, seed: int, shifted: str = "", shift: float = 0.0) -> None:
        self.arena = Arena(replace(Scenario.load("followable"), walls=WALLS), seed)
        self.senses, self.moments = Senses(), list[Moment]()
        self._outlet = Outlet(self.arena)
        self._follower = Follower(TrackingController(), detector_named("hog-half"))
        self._shifts = {TOPICS[shifted][0]: shift} if shifted else {}
        self._frame: Frame | None = None

    def until(self, end: float, lost: tuple[str, ...] = ()) -> None:
        heard = {topic for name, (topic, *_) in TOPICS.items() if name not in lost}
        while self.arena.time < end - 1e-9:
            for topic, make in self._outlet.new(self.arena.passed()):
                if topic in heard:
                    self._take(topic, make())
            log = self._follower.tick(BOOTED + self.arena.time, self._frame, self.senses.sensors)
            if log is not None:
                self.arena.command(log.decision.twist)
            x, y, yaw = self.arena.plan().robot
            self.arena.step()
            after = self.arena.plan().robot
            wheels = 50 * (math.hypot(after[0] - x, after[1] - y) + 0.086 * abs(after[2] - yaw))
            decision = log.decision if log else self.moments[-1].decision
            self.moments.append(Moment(self.arena.time, decision, wheels))

    def _take(self, topic: str, message: object) -> None:
        stamp = messages.to_seconds(message.header.stamp) + SET + self._shifts.get(topic, 0.0)  # type: ignore[attr-defined]
        message.header.stamp = messages.to_time(stamp)  # type: ignore[attr-defined]
        if topic == names.IMAGE:
            self._frame = self.senses.frame(stamp, picture_of(message))
        else:
            self.senses.take(message)


@dataclass(frozen=True)
class Row:
    """How a run went: when the robot stood, after the loss [s], and what it did that it must not."""

    seed: int
    lost: tuple[str, ...]
    at: float = LOST_AT
    shifted: str = ""
    shift: float = 0.0
    stood_s: float = 0.0
    reason: str = ""
    wrong: list[str] = field(default_factory=list)


def judged(ride: Ride, row: Row) -> Row:
    """Drive on without the senses of a row, and fill in what happened."""
    ride.until(row.at + WATCHED_S, row.lost)
    contacts = ride.arena.contacts.wall + ride.arena.contacts.person
    wrong = [f"{contacts} contacts"] if contacts else []
    if row.at == 0:
        line = ride.senses.present()
        wrong += [f"not in {line!r}: {said}" for name in row.lost if (said := TOPICS[name][2]) not in line]
    after = [moment for moment in ride.moments if moment.time > row.at]
    moved = [one for one in after if one.wheels > 0.01 or one.decision.twist != Twist()]
    stood_s = moved[-1].time - row.at if moved else 0.0
    if needed := [TOPICS[name][1] for name in row.lost if TOPICS[name][1]]:
        limit = STANDS_S if row.at else 0.0
        wrong += [f"stands after {stood_s:.2f} s only"] if stood_s > limit + 1e-6 else []
        late = [one for one in after if one.time > row.at + limit]
        silent = [one for one in late if any(no not in one.decision.reason for no in needed)]
        wrong += [f"at {one.time:.2f} s it does not say {needed}: {one.decision.reason}" for one in silent[:1]]
        backs = [one for one in after if one.decision.twist.linear < 0 and one.time > row.at + 0.7]
        wrong += [f"backs at {one.time:.2f} s" for one in backs[:1]]
    return replace(row, stood_s=round(stood_s, 3), reason=after[-1].decision.reason, wrong=wrong)


def judged_apart(ride: Ride, row: Row) -> Row:
    """As `judged`, in a copy of this process: the ride stays where it is, for other rows."""
    reader, writer = os.pipe()
    if (pid := os.fork()) == 0:
        os.write(writer, json.dumps(asdict(judged(ride, row))).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as told:
        text = told.read()
    os.waitpid(pid, 0)
    return Row(**json.loads(text))


def rows_of(seed: int, shifted: str, shift: float) -> list[Row]:
    """Play all cases of a seed and a wrong clock: they share the first seconds."""
    limo_hog.set_num_threads(1)
    cv2.setNumThreads(0)  # OpenCV's threads do not survive the fork of `judged_apart`.
    ride = Ride(seed, shifted, shift)
    losses = [(name,) for name in SHIFTED if name != shifted] if shifted else SUBSETS
    rows = [] if shifted else [judged_apart(ride, Row(seed, lost, 0.0)) for lost in losses]
    ride.until(LOST_AT)
    return rows + [judged_apart(ride, Row(seed, lost, LOST_AT, shifted, shift)) for lost in losses]


def main() -> Iterator[str]:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="of the seeds")
    parser.add_argument("--rows", type=Path, required=True, help="a line of JSON for each run")
    args = parser.parse_args()
    args.rows.touch()
    told = [json.loads(line) for line in args.rows.read_text().splitlines()]
    done = {(row["seed"], row["shifted"], row["shift"]) for row in told}
    clocks = [("", 0.0), *itertools.product(SHIFTED, SHIFTS)]
    groups = ((args.first + i, *clock) for i in range(args.seeds) for clock in clocks)
    with args.rows.open("a") as file:
        for group in (group for group in groups if group not in done):
            rows = [json.dumps(asdict(row)) + "\n" for row in rows_of(*group)]
            told += map(json.loads, rows)
            file.writelines(rows)
            file.flush()
    wrong = [json.dumps(row) for row in told if row["wrong"]]
    yield from wrong
    driven = [row["stood_s"] for row in told if row["lost"] != ["camera_info"]]
    yield f"{len(told)} runs, {len(wrong)} wrong; stood within {max(driven, default=0):.2f} s"


if __name__ == "__main__":
    for line in main():
        sys.stdout.write(f"{line}\n")
