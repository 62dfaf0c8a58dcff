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
    follower: Follower[Any] | None = None
    senses, mounts, lidar = Senses(robot), Mounts(), ""
    waiting: Any = None
    recorded: Detections | None = None
    topics: set[str] = set()
    node = NodeNames("limo_hog_follower") if node is None else node
    own = {
        names.resolved(node, topic): topic
        for topic in (*SENSED, names.IMAGE, names.IMAGE_COMPRESSED, names.COMMAND, names.TF_STATIC)
    }

    def work(now: float, twist: Twist | None) -> Replayed:
        nonlocal follower
        if follower is None:
            base = frame_named(node, "base_frame")
            follower = Follower(controller, detector, mounts.applied(robot, base, waiting.header.frame_id, lidar)[0])
        if senses.focal_px is None:
            raise BagError("no camera info before the first image: its focal length is needed")
        frame = senses.frame(messages.to_seconds(waiting.header.stamp), picture_of(waiting))
        # A new frame begins a control period, and so has a log.
        return Replayed(frame, cast(FrameLog, follower.tick(now, frame, senses.sensors)), recorded, twist)

    for topic, time, message in records:
        topics.add(topic)
        name = own.get(topic, "")
        # Of a camera recorded both ways, the raw images are looked at.
        is_image = name == names.IMAGE or (
            name == names.IMAGE_COMPRESSED and names.resolved(node, names.IMAGE) not in topics
        )
        drives = name == names.COMMAND and message.__msgtype__ in _COMMANDS
        command = messages.to_twist(message) if drives else None
        if waiting is not None and (is_image or command is not None):
            yield work(time, command)
            waiting = recorded = None
        elif command is not None and follower is not None:
            follower.tick(time, None, senses.sensors)
        if is_image:
            waiting = message
        elif message.__msgtype__ == names.DETECTIONS_TYPE:
            recorded = to_detections(message)
        elif name == names.TF_STATIC:
            mounts.take(message)
        elif name in SENSED:
            lidar = message.header.frame_id if name == names.SCAN else lidar
            senses.take(message)
    if waiting is not None:
        yield work(time, None)
    if follower is None:
        there = ", ".join(sorted(topics)) or "nothing"
        raise BagError(f"no images on {names.resolved(node, names.IMAGE)}; the recording holds {there}")


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
