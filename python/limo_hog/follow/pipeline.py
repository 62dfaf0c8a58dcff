"""The follower's loop, once: detect, observe, decide, limit the command. Arena, robot and replay are adapters to it."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.safety import Guard
from limo_hog.follow.sense.detectors import Detector, Region, detect_in
from limo_hog.follow.sense.observation import Odometry, Scan, observed

S = TypeVar("S")

#: A command is sent at least this often [s]: the period of the workshop's camera, a fifth of the robot's watchdog.
CONTROL_PERIOD = 0.1

#: So many scans between two camera images are kept at most [1]. Chosen: a second of the Limo's lidar.
_SCANS_BETWEEN = 8


@dataclass(frozen=True, slots=True)
class Sensors:
    """What the robot's sensors say at the time of one camera image.

    Attributes
    ----------
    focal_px
        Focal length of the camera [px].
    depth
        float32 (H, W) [m] of the same view; None without one.
    scan, odometry
        The newest readings; None without a lidar, without wheel encoders.
    """

    focal_px: float
    depth: NDArray[np.float32] | None = None
    scan: Scan | None = None
    odometry: Odometry | None = None


@dataclass(frozen=True, slots=True)
class Sighting:
    """What the follower made of one camera image.

    Attributes
    ----------
    decision
        The command and the reason for it; its `target` is an index into `detections`.
    detections
        What was found in the image, best first; empty where the detector failed.
    region
        Part of the image that was searched; None where all of it was.
    failure
        How the detector failed, "" where it did not.
    detect_ms
        Wall time of the detection [ms].
    """

    decision: Decision[None]
    detections: Detections
    region: Region | None
    failure: str
    detect_ms: float


class Follower(Generic[S]):
    """A detector and a controller behind the safety layer, fed with one stream of camera images.

    The controllers and the guard are pure functions of observation and state. This object is where their state is
    kept between two images, together with the region to search next: every adapter would otherwise carry both, which
    is how three copies of the loop came to differ. State therefore stays inside, and the decisions handed out hold
    none, so that a log of decisions does not keep every scan in memory.

    Parameters
    ----------
    controller
        Steers by what the detector finds; `Guard` limits its commands.
    detector
        Finds people in uint8 (H, W, 3) BGR images. If it raises, the robot stops and the decision says so.
    """

    def __init__(self, controller: Controller[S], detector: Detector) -> None:
        self._guard = Guard(controller)
        self._detector = detector
        self._state = self._guard.start()
        self._region: Region | None = None
        self._between: tuple[tuple[Scan, Odometry], ...] = ()

    def see(self, stamp: float, image: NDArray[np.uint8], sensors: Sensors) -> Sighting:
        """Detect people in a camera image and decide what to do.

        Parameters
        ----------
        stamp
            When the image was taken [s].
        image
            uint8 (H, W, 3) BGR or (H, W).
        sensors
            The other sensors' readings.
        """
        region = self._region
        began = time.perf_counter()
        try:
            detections, failure = detect_in(self._detector, image, region), ""
        except Exception as error:  # whatever a detector raises, the robot must stop and the loop must go on
            detections, failure = Detections.none(), f"the detector failed: {error}"
        detect_ms = 1e3 * (time.perf_counter() - began)
        observation = observed(
            stamp,
            image,
            sensors.focal_px,
            detections,
            region,
            sensors.depth,
            sensors.scan,
            sensors.odometry,
            failure,
            self._between,
        )
        self._between = ()
        decision = self._guard.step(observation, self._state)
        self._state, self._region = decision.state, decision.region
        return Sighting(replace(decision, state=None), detections, region, failure, detect_ms)  # type: ignore[arg-type]

    def recheck(self, now: float, scan: Scan | None, odometry: Odometry | None) -> Decision[None]:
        """Check the last command against a newer scan, for a control period without a camera image.

        Parameters
        ----------
        now
            Time on the clock of the sensors' stamps [s].
        scan, odometry
            The newest readings.
        """
        if scan is not None and odometry is not None:
            self._between = (*self._between[1 - _SCANS_BETWEEN :], (scan, odometry))
        decision = self._guard.recheck(now, scan, odometry, self._state)
        self._state = decision.state
        return replace(decision, state=None)  # type: ignore[arg-type, return-value]
