"""A detector and a follower over a recording: what they would have found and done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller
from limo_hog.follow.pipeline import Follower, Sighting
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.detectors import Detector
from limo_hog.ros2 import messages
from limo_hog.ros2.bag import Record, to_detections
from limo_hog.ros2.names import COMMAND, DETECTIONS_TYPE, IMAGE, STAMPED_COMMAND_TYPE, TYPES
from limo_hog.ros2.senses import DEPTH_ENCODINGS, Senses, picture_of

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
        uint8 (H, W, 3) BGR.
    sighting
        What is found and decided now.
    recorded, recorded_twist
        What was found and commanded then; None where that was not recorded.
    """

    stamp: float
    image: NDArray[np.uint8]
    sighting: Sighting
    recorded: Detections | None
    recorded_twist: Twist | None


def replay(
    records: Iterable[Record], controller: Controller[S], detector: Detector, image_topic: str = IMAGE
) -> Iterator[Replayed]:
    """Let a follower look at a recording; what it decides moves nothing.

    A frame is worked on when the command that answered it comes, or the next frame; the other sensors' messages up
    to then are what the follower knows. A detector that raises is a fault of the frame, as on a robot.

    Raises
    ------
    ReplayError
        If there are no images on the topic, or no camera info before the first.
    MessageError
        If an image or a depth image contradicts itself.
    """
    follower = Follower(controller, detector)
    senses = Senses()
    waiting: Any = None
    recorded: Detections | None = None
    topics: set[str] = set()
    frames = 0

    def work(twist: Twist | None) -> Replayed:
        if senses.focal_px is None:
            raise ReplayError("no camera info before the first image: its focal length is needed")
        stamp, image = messages.to_seconds(waiting.header.stamp), picture_of(waiting)
        return Replayed(stamp, image, follower.see(stamp, image, senses.at(stamp, image)), recorded, twist)

    for topic, time, message in records:
        topics.add(topic)
        kind = message.__msgtype__
        is_image, command = topic == image_topic, _command(topic, message)
        if waiting is not None and (is_image or command is not None):
            yield work(command)
            waiting, recorded, frames = None, None, frames + 1
        elif command is not None:
            follower.recheck(time, senses.scan, senses.odometry)
        if is_image:
            waiting = message
        elif kind == DETECTIONS_TYPE:
            recorded = to_detections(message)
        elif kind != "sensor_msgs/msg/Image" or message.encoding in DEPTH_ENCODINGS:
            senses.take(message)
    if waiting is not None:
        yield work(None)
        frames += 1
    if not frames:
        there = ", ".join(sorted(topics)) or "nothing"
        raise ReplayError(f"no images on {image_topic}; the recording holds {there}")


def _command(topic: str, message: Any) -> Twist | None:
    """Return the command that drives the robot, of either type; None of any other message."""
    if topic == COMMAND and message.__msgtype__ == TYPES[COMMAND]:
        return messages.to_twist(message)
    if topic == COMMAND and message.__msgtype__ == STAMPED_COMMAND_TYPE:
        return messages.to_twist(message.twist)
    return None
