"""A detector and a follower over a recording: what they would have found and done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from limo_hog.detections import Detections, Detector
from limo_hog.follow.decision import Controller
from limo_hog.follow.pipeline import Follower, FrameLog
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Frame
from limo_hog.ros2 import messages
from limo_hog.ros2.bag import BagError, Record, to_detections
from limo_hog.ros2.names import COMMAND, DETECTIONS_TYPE, IMAGE, STAMPED_COMMAND_TYPE, TYPES
from limo_hog.ros2.senses import DEPTH_ENCODINGS, Senses, picture_of

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Replayed:
    """One camera frame, then and now.

    Attributes
    ----------
    frame
        What the camera saw.
    log
        What is found and decided now.
    recorded, recorded_twist
        What was found and commanded then; None where that was not recorded.
    """

    frame: Frame
    log: FrameLog
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
    BagError
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

    def work(now: float, twist: Twist | None) -> Replayed:
        if senses.focal_px is None:
            raise BagError("no camera info before the first image: its focal length is needed")
        frame = senses.frame(messages.to_seconds(waiting.header.stamp), picture_of(waiting))
        log = follower.tick(now, frame, senses.sensors)
        if log is None:
            raise RuntimeError("a new frame begins a control period")
        return Replayed(frame, log, recorded, twist)

    for topic, time, message in records:
        topics.add(topic)
        kind = message.__msgtype__
        is_image, command = topic == image_topic, _command(topic, message)
        if waiting is not None and (is_image or command is not None):
            yield work(time, command)
            waiting, recorded, frames = None, None, frames + 1
        elif command is not None:
            follower.tick(time, None, senses.sensors)
        if is_image:
            waiting = message
        elif kind == DETECTIONS_TYPE:
            recorded = to_detections(message)
        elif kind != "sensor_msgs/msg/Image" or message.encoding in DEPTH_ENCODINGS:
            senses.take(message)
    if waiting is not None:
        yield work(time, None)
        frames += 1
    if not frames:
        there = ", ".join(sorted(topics)) or "nothing"
        raise BagError(f"no images on {image_topic}; the recording holds {there}")


def _command(topic: str, message: Any) -> Twist | None:
    """Return the command that drives the robot, of either type; None of any other message."""
    if topic == COMMAND and message.__msgtype__ == TYPES[COMMAND]:
        return messages.to_twist(message)
    if topic == COMMAND and message.__msgtype__ == STAMPED_COMMAND_TYPE:
        return messages.to_twist(message.twist)
    return None
