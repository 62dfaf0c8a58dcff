"""A detector and a follower over a recording: what they would have found and done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detector import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.safety.guard import Guard, GuardState
from limo_hog.follow.sense.detectors import Detector, detect_in
from limo_hog.follow.sense.observation import Odometry, Scan, observed
from limo_hog.follow.sense.region import Region
from limo_hog.follow.twist import Twist
from limo_hog.ros2 import messages
from limo_hog.ros2.bag import DETECTIONS, Record, to_detections
from limo_hog.ros2.names import IMAGE

S = TypeVar("S")


class ReplayError(LimoHogError):
    """A recording lacks what a follower needs."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """One camera frame, then and now.

    Attributes
    ----------
    stamp
        Of the frame [s].
    image
        uint8 (H, W, 3) BGR or (H, W) gray.
    found, twist, target
        What is found and decided now.
    recorded, recorded_twist
        What was found and commanded then; None where that was not recorded.
    """

    stamp: float
    image: NDArray[np.uint8]
    found: Detections
    twist: Twist
    target: int | None
    recorded: Detections | None
    recorded_twist: Twist | None


@dataclass(slots=True)
class _Senses:
    """The newest of everything."""

    image: Any = None
    focal_px: float | None = None
    depth: NDArray[np.float32] | None = None
    scan: Scan | None = None
    odometry: Odometry | None = None
    recorded: Detections | None = None


def replay(
    records: Iterable[Record], controller: Controller[S], detector: Detector, image_topic: str = IMAGE
) -> Iterator[Replayed]:
    """Let a follower look at a recording; what it decides moves nothing.

    A frame is worked on when the command comes that answered it, or the next frame; the other sensors' messages
    before that are what it goes by.

    Raises
    ------
    ReplayError
        If there are no images on the topic, or no camera info before the first.
    """
    guard = Guard(controller)
    state: GuardState[S] = guard.start()
    region: Region | None = None
    senses = _Senses()
    topics: set[str] = set()
    frames = 0

    def work(twist: Twist | None) -> Replayed:
        nonlocal state, region, frames
        decision, done = _decide(guard, state, detector, senses, region, twist)
        state, region, frames = decision.state, decision.region, frames + 1
        senses.image = senses.recorded = None
        return done

    for topic, time, message in records:
        topics.add(topic)
        kind = message.__msgtype__
        if kind == "geometry_msgs/msg/Twist":
            if senses.image is not None:
                yield work(messages.to_twist(message))
            else:
                state = guard.recheck(time, senses.scan, senses.odometry, state).state
        elif topic == image_topic:
            if senses.image is not None:
                yield work(None)
            senses.image = message
        else:
            _sense(senses, kind, message)
    if senses.image is not None:
        yield work(None)
    if not frames:
        there = ", ".join(sorted(topics)) or "nothing"
        raise ReplayError(f"no images on {image_topic}; the recording holds {there}")


def _sense(senses: _Senses, kind: str, message: Any) -> None:
    if kind == "sensor_msgs/msg/CameraInfo":
        senses.focal_px = float(message.k[0])
    elif kind == "sensor_msgs/msg/LaserScan":
        senses.scan = messages.to_scan(message)
    elif kind == "nav_msgs/msg/Odometry":
        senses.odometry = messages.to_odometry(message)
    elif kind == DETECTIONS:
        senses.recorded = to_detections(message)
    elif kind == "sensor_msgs/msg/Image" and message.encoding == "32FC1":
        senses.depth = messages.pixels_of(message)
    elif kind == "sensor_msgs/msg/Image" and message.encoding == "16UC1":
        senses.depth = messages.pixels_of(message) * np.float32(1e-3)


def _decide(
    guard: Guard[S],
    state: GuardState[S],
    detector: Detector,
    senses: _Senses,
    region: Region | None,
    twist: Twist | None,
) -> tuple[Decision[GuardState[S]], Replayed]:
    if senses.focal_px is None:
        raise ReplayError("no camera info before the first image: its focal length is needed")
    image = messages.pixels_of(senses.image)
    if senses.image.encoding == "rgb8":
        image = np.ascontiguousarray(image[..., ::-1])
    stamp = messages.to_seconds(senses.image.header.stamp)
    depth = senses.depth if senses.depth is not None and senses.depth.shape == image.shape[:2] else None
    found = detect_in(detector, image, region)
    observation = observed(stamp, image, senses.focal_px, found, region, depth, senses.scan, senses.odometry)
    decision = guard.step(observation, state)
    return decision, Replayed(stamp, image, found, decision.twist, decision.target, senses.recorded, twist)
