"""The follower on a ROS 2 robot: whatever publishes the workshop's topics is driven, behind the safety layer."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detector import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.safety.guard import Guard
from limo_hog.follow.sense.detectors import Detector, detect_in
from limo_hog.follow.sense.observation import Odometry, Scan, observed
from limo_hog.follow.twist import Twist
from limo_hog.imaging.drawing import annotate
from limo_hog.ros2 import messages, names
from limo_hog.ros2.dds import Bus, Endpoints
from limo_hog.ros2.messages import MessageError

S = TypeVar("S")

#: A command is sent at least this often [s], and the robot is given up for silent after so long without a picture.
CONTROL_PERIOD, SILENT_AFTER = 0.1, 10.0
#: A depth image belongs to a picture if their stamps differ by no more than this [s].
SLOP = 0.05
#: The Limo's camera, until its calibration has come [px].
FOCAL_PX = 448.6

_NOTHING = Detections(np.empty((0, 4), np.int32), np.empty(0))


class SilentRobotError(LimoHogError):
    """Nobody publishes a camera image."""


@dataclass
class Report:
    """How a drive went.

    Attributes
    ----------
    frames, found
        Pictures worked on, and those with somebody in them.
    dropped
        Messages that could not be read.
    answer_ms
        From a picture's arrival to its command, for each [ms].
    modes
        How many commands were given in each mode.
    """

    frames: int = 0
    found: int = 0
    dropped: int = 0
    answer_ms: list[float] = field(default_factory=list)
    modes: dict[str, int] = field(default_factory=dict)


def camera_topic(bus: Bus) -> str:
    """Wait for a camera; returns its raw images' topic or, where there are none, its compressed ones'.

    Raises
    ------
    SilentRobotError
        If no camera turns up within 10 s.
    """

    def offered(topic: str, found: dict[str, Endpoints]) -> bool:
        return topic in found and found[topic].publishers > 0

    def either(found: dict[str, Endpoints]) -> bool:
        return offered(names.IMAGE, found) or offered(names.IMAGE_COMPRESSED, found)

    if not either(bus.topics(SILENT_AFTER, enough=either)):
        raise SilentRobotError(
            f"nobody publishes {names.IMAGE} in ROS domain {bus.domain}: no camera in {SILENT_AFTER:g} s"
        )
    # Of a camera that offers both, either may be heard of first.
    found = bus.topics(0.5, enough=lambda found: offered(names.IMAGE, found))
    return names.IMAGE if offered(names.IMAGE, found) else names.IMAGE_COMPRESSED


class Senses:
    """The newest of every sensor; pictures come from the `camera` topic."""

    def __init__(self, bus: Bus, camera: str) -> None:
        self._camera = camera
        self._readers = {
            topic: bus.subscription(topic, names.TYPES[topic], depth=5)
            for topic in (camera, names.DEPTH, names.CAMERA_INFO, names.SCAN, names.ODOMETRY)
        }
        self._depths: deque[tuple[float, NDArray[np.float32]]] = deque(maxlen=10)
        self._broken = 0
        self.focal_px = FOCAL_PX
        self.scan: Scan | None = None
        self.odometry: Odometry | None = None

    @property
    def dropped(self) -> int:
        """How many messages could not be read, or contradicted themselves."""
        return self._broken + sum(reader.dropped for reader in self._readers.values())

    def look(self) -> tuple[float, NDArray[np.uint8]] | None:
        """Take in what has come; returns the newest picture's stamp [s] and BGR pixels, if there is a new one."""
        for message in self._readers[names.CAMERA_INFO].take():
            if math.isfinite(message.k[0]) and message.k[0] > 0:
                self.focal_px = float(message.k[0])
        for message in self._readers[names.DEPTH].take():
            depth = self._read(messages.pixels_of, message)
            if depth is not None and depth.ndim == 2:
                metres = depth / 1000.0 if depth.dtype == np.uint16 else depth
                self._depths.append((messages.to_seconds(message.header.stamp), metres.astype(np.float32, copy=False)))
        for message in self._readers[names.SCAN].take():
            self.scan = messages.to_scan(message)
        for message in self._readers[names.ODOMETRY].take():
            self.odometry = messages.to_odometry(message)
        # Old pictures are passed over: the robot acts on the newest.
        for message in reversed(self._readers[self._camera].take()):
            picture = self._picture(message)
            if picture is not None:
                return messages.to_seconds(message.header.stamp), picture
        return None

    def depth_at(self, stamp: float, shape: tuple[int, ...]) -> NDArray[np.float32] | None:
        """Return the depth image of a picture, None where there is none."""
        fitting = [(abs(at - stamp), depth) for at, depth in self._depths if depth.shape == shape[:2]]
        gap, depth = min(fitting, key=lambda pair: pair[0], default=(math.inf, None))
        return depth if gap <= SLOP else None

    def _picture(self, message: Any) -> NDArray[np.uint8] | None:
        if self._camera == names.IMAGE_COMPRESSED:
            pixels, encoding = self._read(messages.decompressed, message), "bgr8"
        else:
            pixels, encoding = self._read(messages.pixels_of, message), message.encoding
        if pixels is None:
            return None
        if pixels.dtype != np.uint8 or pixels.shape[2:] not in ((), (3,)):
            self._broken += 1
            return None
        if pixels.ndim == 2:
            return np.repeat(pixels[..., None], 3, axis=2)
        return np.ascontiguousarray(pixels[..., ::-1] if encoding == "rgb8" else pixels)

    def _read(self, read: Callable[[Any], NDArray[Any]], message: Any) -> NDArray[Any] | None:
        try:
            return read(message)
        except MessageError:
            self._broken += 1
            return None


def drive(
    bus: Bus,
    controller: Controller[S],
    detector: Detector,
    seconds: float,
    watch: Callable[[Decision[Any]], None] | None = None,
) -> Report:
    """Follow whoever the camera sees, until the time is up; the robot is told to stand in any case.

    Raises
    ------
    SilentRobotError
        If there is no camera, or no picture comes for 10 s.
    """
    senses = Senses(bus, camera_topic(bus))
    commands = bus.publisher(names.COMMAND, names.TYPES[names.COMMAND])
    annotated = bus.publisher(names.ANNOTATED, names.TYPES[names.ANNOTATED])
    guard = Guard(controller)
    state = guard.start()
    region = None
    report = Report()
    began = heard = commanded = time.monotonic()
    stamp = 0.0
    try:
        while time.monotonic() - began < seconds:
            bus.wait(CONTROL_PERIOD / 2)
            came = time.monotonic()
            seen = senses.look()
            if seen is not None:
                heard = came
                stamp, picture = seen
                try:
                    found, fault = detect_in(detector, picture, region), ""
                except Exception as error:  # whatever a detector raises, the robot must stop and the drive go on
                    found, fault = _NOTHING, f"the detector failed: {error}"
                depth = senses.depth_at(stamp, picture.shape)
                observation = observed(
                    stamp, picture, senses.focal_px, found, region, depth, senses.scan, senses.odometry, fault
                )
                decision = guard.step(observation, state)
                region = decision.region
                report.frames += 1
                report.found += len(found) > 0
            elif report.frames and came - commanded > CONTROL_PERIOD:
                # Without a new scan or odometry to tell the time, the robot's clock is taken to run as ours does.
                decision = guard.recheck(stamp + came - heard, senses.scan, senses.odometry, state)
            else:
                if came - heard > SILENT_AFTER:
                    raise SilentRobotError(
                        f"nobody publishes {names.IMAGE} in ROS domain {bus.domain}: no picture for {SILENT_AFTER:g} s"
                    )
                continue
            state = decision.state
            commands.publish(messages.twist(decision.twist))
            commanded = time.monotonic()
            report.dropped = senses.dropped
            report.modes[decision.mode.value] = report.modes.get(decision.mode.value, 0) + 1
            if seen is not None:
                report.answer_ms.append(1e3 * (commanded - came))
                if annotated.has_readers:
                    labels = [f"{score:.1f}" for score in found.scores]
                    drawn = annotate(picture, found.boxes, labels, decision.target, decision.reason)
                    annotated.publish(messages.image(stamp, drawn))
            if watch is not None:
                watch(decision)
    finally:
        commands.publish(messages.twist(Twist()))
    return report
