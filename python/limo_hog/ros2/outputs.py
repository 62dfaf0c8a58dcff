"""The follower's publishers: commands as the robot takes them, and what was found."""

from __future__ import annotations

import time
from typing import Any

from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import Twist
from limo_hog.imaging.drawing import annotate
from limo_hog.ros2 import findings, messages, names
from limo_hog.ros2.arguments import NodeNames
from limo_hog.ros2.dds import Bus
from limo_hog.ros2.network import BusError
from limo_hog.ros2.senses import Senses

#: While nothing listens to the commands, the robot's type is looked for again after so long [s]. Chosen: discovery
#: takes about a second.
_LOOK_EVERY = 1.0

#: The node's parameters, each a frame that messages name, and its default.
FRAMES = {"base_frame": messages.BASE_FRAME, "camera_frame": messages.CAMERA_FRAME}


def frame_named(node: NodeNames, parameter: str) -> str:
    """Return a frame by its parameter; raises `BusError` if the parameter is no text."""
    frame = node.parameters.get(parameter, FRAMES[parameter])
    if not isinstance(frame, str) or not frame:
        raise BusError(f"parameter {parameter} is {frame!r}; wanted is a frame's name such as {FRAMES[parameter]}")
    return frame


class Commands:
    """Publishes commands as `Twist`, or as `TwistStamped` where the robot subscribes to that."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._base = bus, frame_named(bus.node, "base_frame")
        self._looked = 0.0
        self._open(names.TYPES[names.COMMAND])

    def _open(self, kind: str) -> None:
        self.kind = kind
        self._publisher = self._bus.publisher(names.COMMAND, kind)

    def publish(self, stamp: float, command: Twist) -> None:
        """Send a command; `stamp` is on the robot's clock [s]."""
        now = time.monotonic()
        if now - self._looked > _LOOK_EVERY and not self._publisher.has_readers:
            self._looked = now
            taken = self._bus.subscribed_types(names.COMMAND)
            if names.STAMPED_COMMAND_TYPE in taken and self.kind not in taken:
                self._open(names.STAMPED_COMMAND_TYPE)
        stamped = self.kind == names.STAMPED_COMMAND_TYPE
        message = findings.stamped_twist(stamp, command, self._base) if stamped else messages.twist(command)
        self._publisher.publish(message)


class Findings:
    """Publishes what was made of a camera image, each topic only while something listens to it."""

    def __init__(self, bus: Bus) -> None:
        self._base, self._camera = frame_named(bus.node, "base_frame"), frame_named(bus.node, "camera_frame")
        self._annotated = bus.publisher(names.ANNOTATED, names.TYPES[names.ANNOTATED])
        self._publishers = {topic: bus.publisher(topic, kind) for topic, kind in names.FINDINGS.items()}
        self._frames = bus.publisher(names.TF, names.TYPES[names.TF], depth=100)

    def publish(self, log: FrameLog, senses: Senses) -> None:
        """Send what was found in a frame; people's positions are as of the newest stamp of any sense."""
        if log.frame is None:
            return
        stamp, found, belief = log.frame.stamp, log.detections, log.decision.belief
        now = senses.newest(stamp)
        ids = {person.box: person.number for person in belief.people if person.box is not None}
        self._send(names.DETECTIONS, lambda: findings.detections_message(stamp, found, self._camera, ids))
        self._send(names.PEOPLE, lambda: findings.people_message(now, belief.people, self._base))
        followed = next((person for person in belief.people if person.number == belief.followed), None)
        if followed is not None:
            self._send(names.PERSON, lambda: findings.person_pose(now, followed, self._base))
        if belief.people and self._frames.has_readers:
            self._frames.publish(findings.person_frames(now, belief.people, belief.followed, self._base))
        if self._annotated.has_readers:
            drawn = annotate(log.frame.image, found.boxes, found.labels, log.decision.target, log.decision.reason)
            self._annotated.publish(messages.image(stamp, drawn, self._camera))

    def _send(self, topic: str, make: Any) -> None:
        publisher = self._publishers[topic]
        if publisher.has_readers:
            publisher.publish(make())
