"""The follower's loop: detect, observe, decide, limit the command. Arena, robot and recording are adapters to it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections, Detector
from limo_hog.follow.decision import Controller, Decision, made_for
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.safety import Guard
from limo_hog.follow.sense.clearance import completed
from limo_hog.follow.sense.observation import Frame, Observation, Odometry, Scan, Sensors, clothes_in
from limo_hog.follow.sense.region import Region, detect_in
from limo_hog.follow.tracks.asking import Whom

S = TypeVar("S")

#: How `Follower` searches a region of an image, or all of it where that is None.
Search = Callable[[Detector, NDArray[np.uint8], Region | None], Detections]

#: A command is sent at least this often [s]: the period of the workshop's camera, a fifth of the robot's watchdog.
CONTROL_PERIOD = 0.1
#: A period may be this much shorter [s]: half of the arena's step, since its times are sums of steps.
_SLACK = 0.01

#: So many scans between two camera images are kept at most [1]. Chosen: a second of the Limo's lidar.
_SCANS_BETWEEN = 8


@dataclass(frozen=True, slots=True)
class FrameLog:
    """One control period: what was sensed, found and commanded."""

    time: float  #: When the command was decided, on the robot's own clock [s].
    decision: Decision[None]  #: The command and the reason for it; its `target` is an index into `detections`.
    sensors: Sensors  #: The readings that it is based on.
    frame: Frame | None = None  #: The camera image that was worked on; None in a period without a new one.
    #: What was found in the image, best first; empty without one, and where the detector failed.
    detections: Detections = field(default_factory=Detections.none)
    region: Region | None = None  #: Part of the image that was searched; None where all of it was.
    failure: str = ""  #: How the detector failed, "" where it did not.
    detect_ms: float = 0.0  #: Wall time of the detection [ms].


class Periods:
    """Says when a control period begins: with each new camera image, and `CONTROL_PERIOD` after the last began."""

    def __init__(self) -> None:
        self._began: float | None = None
        self._last: object = None

    def begins(self, now: float, frame: object) -> tuple[bool, bool]:
        """Return whether a control period begins `now` [s], on the robot's own clock, and whether with a new image.

        A clock that was set back begins one. `frame` is the newest camera image: new if it is another object than the
        last.
        """
        new = frame is not None and frame is not self._last
        if not new and self._began is not None and 0 <= now - self._began <= CONTROL_PERIOD - _SLACK:
            return False, False
        self._began, self._last = now, frame if new else self._last
        return True, new


class Follower(Generic[S]):
    """A detector and a controller behind the safety layer, fed with one stream of camera images.

    Controllers and guard are pure functions; this object keeps their state, and the region to search next. The detector
    finds people in uint8 (H, W, 3) BGR images; if it raises, the robot stops and the decision says so. `search` applies
    it to a region of an image. Without lidar see `Guard`. The decisions that are logged hold no state, so that a list
    of them does not keep every scan. Raises `RobotError` for a controller that was made for another robot.
    """

    def __init__(
        self,
        controller: Controller[S],
        detector: Detector,
        robot: RobotGeometry = LIMO,
        *,
        search: Search = detect_in,
        without_lidar: bool = False,
    ) -> None:
        self._guard = Guard(made_for(controller, robot), robot=robot, without_lidar=without_lidar)
        self._robot = robot
        self._detector, self._search = detector, search
        self._state = self._guard.start()
        self._region: Region | None = None
        self._between: tuple[tuple[Scan, Odometry], ...] = ()
        self._periods = Periods()

    def tick(self, now: float, frame: Frame | None, sensors: Sensors) -> FrameLog | None:
        """Decide what to do now; None while the last control period lasts.

        `now` is on the robot's own clock [s], which only goes on: ages are counted on it, whatever the stamps say. A
        new camera image is searched for people; without one the last command is checked against the newest scan.
        """
        begins, new = self._periods.begins(now, frame)
        if not begins:
            return None
        # The scan's angles as the robot's.
        turned = replace(sensors, scan=sensors.scan and sensors.scan.turned(self._robot.lidar_yaw))
        return self._see(now, frame, sensors, turned) if frame and new else self._recheck(now, sensors, turned)

    def follow(self, whom: Whom) -> None:
        """Ask to follow one person of several in view: "nearest", "left", "right", "largest", or a number.

        Numbers are those of `Decision.belief.people`. Until then the followed person stays the same, and the reason
        says who is asked for. Raises `WhomError` for anything else, and for a controller that cannot be asked.
        """
        self._state = self._guard.ask(whom, self._state)

    def _see(self, now: float, frame: Frame, sensors: Sensors, turned: Sensors) -> FrameLog:
        region = self._region
        began = time.perf_counter()
        try:
            detections, failure = self._search(self._detector, frame.image, region), ""
        except Exception as error:  # whatever a detector raises, the robot must stop and the loop must go on
            detections, failure = Detections.none(), f"the detector failed: {error}"
        detect_ms = 1e3 * (time.perf_counter() - began)
        if turned.scan is not None:
            turned = replace(turned, scan=completed(turned.scan, frame, turned.odometry, self._robot))
        stamp, (height, width), scan, pose = frame.stamp, frame.image.shape[:2], turned.scan, turned.odometry
        seen = Observation(stamp, width, height, frame.focal_px, detections, region, frame.depth, scan, pose, failure)
        worn, between = clothes_in(frame.image, detections.windows), self._between
        seen = replace(seen, image=frame.image, clothes=worn, between=between, clock=now, depth_stamp=frame.depth_stamp)
        self._between = ()
        decision = self._guard.step(seen, self._state)
        self._state, self._region = decision.state, decision.region
        told: Decision[None] = replace(decision, state=None)  # type: ignore[arg-type, assignment]
        return FrameLog(now, told, sensors, frame, detections, region, failure, detect_ms)

    def _recheck(self, now: float, sensors: Sensors, turned: Sensors) -> FrameLog:
        if turned.scan is not None and turned.odometry is not None:
            self._between = (*self._between[1 - _SCANS_BETWEEN :], (turned.scan, turned.odometry))
        decision = self._guard.recheck(now, turned, self._state)
        self._state = decision.state
        told: Decision[None] = replace(decision, state=None)  # type: ignore[arg-type, assignment]
        return FrameLog(now, told, sensors)
