"""A detector and a follower over a recording: what they would have found and done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

from limo_hog.detections import Detections, Detector
from limo_hog.follow.decision import Controller
from limo_hog.follow.pipeline import Follower, FrameLog
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.observation import Frame
from limo_hog.ros2 import messages, names
from limo_hog.ros2.arguments import NodeNames
from limo_hog.ros2.bag import BagError, Record, to_detections
from limo_hog.ros2.frames import Mounts
from limo_hog.ros2.outputs import frame_named
from limo_hog.ros2.senses import DEPTH_ENCODINGS, Senses, picture_of

#: Types of the commands that drive a robot.
_COMMANDS = (names.TYPES[names.COMMAND], names.STAMPED_COMMAND_TYPE)
#: Sensors beside the camera's images.
SENSED = (names.CAMERA_INFO, names.DEPTH, names.DEPTH_LCAS, names.SCAN, names.ODOMETRY)


@dataclass(frozen=True, slots=True)
class Replayed:
    """One camera frame, then and now."""

    frame: Frame  #: What the camera saw.
    log: FrameLog  #: What is found and decided now.
    #: What was found and commanded then; None where that was not recorded.
    recorded: Detections | None
    recorded_twist: Twist | None


def replay(
    records: Iterable[Record],
    controller: Controller[Any],
    detector: Detector,
    node: NodeNames | None = None,
    robot: RobotGeometry = LIMO,
) -> Iterator[Replayed]:
    """Let a follower look at a recording; what it decides moves nothing.

    A frame is worked on when the command that answered it comes, or the next frame; the other sensors' messages up to
    then are what the follower knows. A detector that raises is a fault of the frame, as on a robot. The topics have the
    names that they have for `node`; the robot's sensors sit where the transforms say that come before the first image
    is worked on. Raises `BagError` if there are no images on the topic, or no camera info before the first;
    `MessageError` if an image or a depth image contradicts itself; `RobotError` as `Mounts.applied` has it.
    """
    recording = _Recording(controller, detector, NodeNames("limo_hog_follower") if node is None else node, robot)
    for record in records:
        if (answered := recording.take(record)) is not None:
            yield answered
    if (last := recording.end()) is not None:
        yield last


class _Recording:
    """What is known of a recording, and the image that waits for the command that answered it."""

    def __init__(self, controller: Controller[Any], detector: Detector, node: NodeNames, robot: RobotGeometry) -> None:
        self._controller, self._detector, self._node, self._robot = controller, detector, node, robot
        self._follower: Follower[Any] | None = None
        self._senses, self._mounts, self._lidar = Senses(robot), Mounts(), ""
        self._waiting: Any = None
        self._recorded: Detections | None = None
        self._topics: set[str] = set()
        self._time = 0.0  # of the last record
        known = (*SENSED, names.IMAGE, names.IMAGE_COMPRESSED, names.COMMAND, names.TF_STATIC)
        self._own = {names.resolved(node, topic): topic for topic in known}

    def take(self, record: Record) -> Replayed | None:
        """Take in a record; return what is made of the frame that waited, where this one ends the wait."""
        topic, self._time, message = record
        self._topics.add(topic)
        name, answered = self._own.get(topic, ""), None
        is_image = self._is_image(name)
        drives = name == names.COMMAND and message.__msgtype__ in _COMMANDS
        command = messages.to_twist(message) if drives else None
        if self._waiting is not None and (is_image or command is not None):
            answered = self._work(command)
        elif command is not None and self._follower is not None:
            self._follower.tick(self._time, None, self._senses.sensors)
        if is_image:
            self._waiting = message
        elif message.__msgtype__ == names.DETECTIONS_TYPE:
            self._recorded = to_detections(message)
        elif name == names.TF_STATIC:
            self._mounts.take(message)
        elif name in SENSED:
            self._lidar = message.header.frame_id if name == names.SCAN else self._lidar
            self._senses.take(message)
        return answered

    def end(self) -> Replayed | None:
        """Return what is made of a frame that no command answered."""
        if self._waiting is not None:
            return self._work(None)
        if self._follower is None:
            there = ", ".join(sorted(self._topics)) or "nothing"
            raise BagError(f"no images on {names.resolved(self._node, names.IMAGE)}; the recording holds {there}")
        return None

    def _is_image(self, name: str) -> bool:
        """Whether a topic's images are looked at: of a camera recorded both ways, the raw ones."""
        if name != names.IMAGE_COMPRESSED:
            return name == names.IMAGE
        return names.resolved(self._node, names.IMAGE) not in self._topics

    def _work(self, twist: Twist | None) -> Replayed:
        """Let the follower look at the frame that waits, which `twist` answered then."""
        image, recorded, self._waiting, self._recorded = self._waiting, self._recorded, None, None
        if self._follower is None:
            base = frame_named(self._node, "base_frame")
            robot = self._mounts.applied(self._robot, base, image.header.frame_id, self._lidar)[0]
            self._follower = Follower(self._controller, self._detector, robot)
        if self._senses.focal_px is None:
            raise BagError("no camera info before the first image: its focal length is needed")
        frame = self._senses.frame(messages.to_seconds(image.header.stamp), picture_of(image))
        # A new frame begins a control period, and so has a log.
        log = cast(FrameLog, self._follower.tick(self._time, frame, self._senses.sensors))
        return Replayed(frame, log, recorded, twist)


def kind_of(record: Record) -> str:
    """Return the type of a record's message; a depth image's is that of its own, "depth"."""
    kind: str = record.message.__msgtype__
    is_depth = kind == names.TYPES[names.DEPTH] and record.message.encoding in DEPTH_ENCODINGS
    return "depth" if is_depth else kind


def elsewhere(kinds: Mapping[str, str], node: NodeNames) -> list[str]:
    """Name the sensors that a recording has on other topics than they have for `node`.

    `kinds` has what `kind_of` says of each topic of the recording.
    """
    told = []
    for topic, *more in ((names.SCAN,), (names.ODOMETRY,), (names.DEPTH, names.DEPTH_LCAS)):
        wanted = "depth" if topic == names.DEPTH else names.TYPES[topic]
        known = [names.resolved(node, name) for name in (topic, *more)]
        others = sorted(other for other, kind in kinds.items() if kind == wanted)
        if others and not set(known) & set(others):
            rule = f"--ros-args -r {topic.lstrip('/')}:={others[0]}"
            told.append(f"not used, since it is not on {known[0]}: {', '.join(others)} ({wanted}); give {rule}")
    return told
