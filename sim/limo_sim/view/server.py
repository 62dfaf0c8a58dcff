"""The arena's live page: what it shows of a run's newest step, and which parameters it sets."""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import asdict
from typing import Any

from limo_hog.follow.decision import Mode
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.sense.measurement import ZONE_ENDS
from limo_hog.imaging.writing import jpeg
from limo_hog.live.pace import Pace
from limo_hog.live.server import LOOPBACK, Live
from limo_sim.run.log import Step
from limo_sim.view import reading
from limo_sim.view.tuning import Tunable
from limo_sim.world.furniture import Disc
from limo_sim.world.scenario import Scenario

#: Somebody not found for so long cannot be clicked on [s]: longer than between two searches of the whole image.
_BOX_S = 2.0


class View(Live[Step]):
    """Serves the page of one run; a context manager, whose `watch` goes to `run_episode`.

    The page may set the parameters of `controller`, None for a run without one of ours; the rest is as `Live` has it.
    """

    def __init__(
        self,
        scenario: Scenario,
        controller: Tunable[Any] | None = None,
        host: str = LOOPBACK,
        port: int = 0,
        pace: Pace | None = None,
    ) -> None:
        super().__init__("limo_sim.view", controller, host, port, pace)
        self._scenario, self._controller = scenario, controller
        # The newest box of each tracked person, by number: the follower searches the whole image now and then.
        self._boxes: dict[int, tuple[float, list[int]]] = {}
        # Index of the person followed last; None before, and during a search.
        self._followed: int | None = None
        # Time and pose of the last control periods: a scan is as old as it is.
        self._poses: deque[tuple[float, float, float, float]] = deque(maxlen=32)

    def watch(self, step: Step) -> None:
        """Show a step, and return when the run may go on."""
        log, robot = step.log, step.truth.robot
        if log.frame is not None:
            self._pictured = self._written, step
            boxes, tracked = log.detections.boxes, log.decision.belief.people
            self._boxes |= {
                person.number: (log.time, boxes[person.box].tolist()) for person in tracked if person.box is not None
            }
        people = [(None, None) if p is None else (p.x, p.y) for p in step.truth.people]
        self._rows.append([*reading.figures(step).values(), reading.measured_m(log), *robot, *itertools.chain(*people)])
        if log.decision.mode is Mode.SEARCH:
            self._followed = None
        elif (followed := reading.followed_person(step)) is not None:
            self._followed = followed
        self._poses.append((log.time, *robot))
        self._written += 1
        self._newest = step
        self.pace.wait(log.time)

    def _welcome(self) -> dict[str, Any]:
        robot = self._scenario.robot.geometry
        set_here = self._controller.parameters.values() if self._controller else ()
        return {
            "scenario": self._scenario.name,
            "room": self._scenario.room.half,
            "field": robot.field_of_view,
            "body": [robot.half_length, robot.half_width],
            "furniture": [
                [f.x, f.y, f.radius] if isinstance(f, Disc) else [f.x, f.y, f.half_x, f.half_y, f.yaw]
                for f in self._scenario.footprints
            ],
            "zones": list(ZONE_ENDS.values()),
            "depth": {"far": self._scenario.depth.far_m, "colours": reading.depth_colours(self._scenario.depth.far_m)},
            "parameters": [{**asdict(parameter), "whole": parameter.whole} for parameter in set_here],
        }

    def _state(self, step: Step) -> dict[str, Any]:
        log = step.log
        return {
            **reading.figures(step),
            "mode": log.decision.mode.value,
            "reason": log.decision.reason,
            "robot": step.truth.robot,
            "people": [None if p is None else (p.x, p.y) for p in step.truth.people],
            "followed": self._followed,
            "believed": reading.believed(step),
            "rollouts": reading.rollouts(step),
            "shares": log.decision.belief.shares,
            "measured_m": reading.measured_m(log),
            "scan": reading.hits(log.sensors.scan, self._scenario.robot.geometry, list(self._poses)),
            "detect_ms": log.detect_ms or None,
            "boxes": len(log.detections),
            "choices": self._choices(log) if self._controller else [],
            "contacts": asdict(step.truth.contacts),
            "paused": self.pace.paused,
            "speed": self.pace.speed,
        }

    def _choices(self, log: FrameLog) -> list[list[int]]:
        """Return who can be clicked on: number, whether followed, and the newest box x, y, w, h [px] of each."""
        belief = log.decision.belief
        boxes = {person.number: self._boxes.get(person.number, (-math.inf, [])) for person in belief.people}
        fresh = ((number, box) for number, (at, box) in sorted(boxes.items()) if log.time - at < _BOX_S)
        return [[number, number == belief.followed, *box] for number, box in fresh]

    def _pictures(self, step: Step) -> list[bytes]:
        """Encode the pictures of a step: the camera's, the depth's and a node's windows; a letter tells which."""
        frame = step.log.frame
        if frame is None or frame.depth is None:
            return []
        depth = reading.depth_picture(frame.depth[::2, ::2], self._scenario.depth.far_m)
        # A window's name stands between its letter and its picture, ended by a line feed.
        windows = (b"w" + " ".join(name.split()).encode() + b"\n" + jpeg(p) for name, p in step.windows.items())
        return [b"c" + jpeg(reading.annotated(step.log, caption=False)), b"d" + jpeg(depth), *windows]
