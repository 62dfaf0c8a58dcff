"""The follower on a ROS 2 robot: it drives the robot that publishes the workshop's topics, behind the safety layer."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from limo_hog.detections import Detector
from limo_hog.follow.decision import Controller
from limo_hog.follow.pipeline import CONTROL_PERIOD, Follower, FrameLog
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.observation import Frame
from limo_hog.follow.tracks.asking import WhomError
from limo_hog.ros2 import messages, names
from limo_hog.ros2.dds import Bus, Endpoints
from limo_hog.ros2.frames import Mounts, whence
from limo_hog.ros2.messages import MessageError
from limo_hog.ros2.network import BusError
from limo_hog.ros2.outputs import Commands, Findings, frame_named
from limo_hog.ros2.senses import Senses, picture_of

#: The drive ends after so long without a camera image [s]: discovery takes up to 3 s, a driver as long to start.
SILENT_AFTER = 10.0
#: So many answers are kept: an hour's at 10 Hz.
_ANSWERS = 36_000

#: Other senses than the camera are said to be missing so long after the first image [s]: discovery takes up to 3 s.
SETTLED = 3.0


@dataclass
class Report:
    """How a drive went."""

    frames: int = 0  #: Camera images worked on, and those with a person detected.
    found: int = 0
    dropped: int = 0  #: Messages that could not be read.
    #: From the arrival of each image to its command, for the last hour [ms]; number of commands in each mode.
    answer_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_ANSWERS))
    modes: dict[str, int] = field(default_factory=dict)

    def add(self, log: FrameLog, answer_ms: float) -> None:
        """Count a control period whose command was sent `answer_ms` after its image came [ms]."""
        mode = log.decision.mode.value
        self.modes[mode] = self.modes.get(mode, 0) + 1
        if log.frame is not None:
            self.frames += 1
            self.found += len(log.detections) > 0
            self.answer_ms.append(answer_ms)


def camera_topic(bus: Bus, *, compressed: bool = False) -> str:
    """Wait for a camera; returns the topic of its raw images or, without these, of its compressed ones.

    With `compressed` it waits for compressed images alone. Raises `BusError` if no camera is found within 10 s.
    """
    wanted = (names.IMAGE_COMPRESSED,) if compressed else (names.IMAGE, names.IMAGE_COMPRESSED)
    here = [names.resolved(bus.node, topic) for topic in wanted]
    found = bus.topics(SILENT_AFTER, enough=lambda found: any(_offered(name, found) for name in here))
    if not any(_offered(name, found) for name in here):
        raise BusError(
            f"no publisher of {' or '.join(here)} in {bus.network}, within {SILENT_AFTER:g} s; {_images_in(found)}"
        )
    # Of a camera that offers both, either topic may be discovered first.
    found = bus.topics(0.5, enough=lambda found: _offered(here[0], found))
    return next(topic for topic, name in zip(wanted, here, strict=True) if _offered(name, found))


def _offered(topic: str, found: dict[str, Endpoints]) -> bool:
    return topic in found and bool(found[topic].publishers)


def _images_in(found: dict[str, Endpoints]) -> str:
    """Say which images there are, and how one is chosen."""
    kinds = (names.TYPES[names.IMAGE], names.TYPES[names.IMAGE_COMPRESSED])
    images = [topic for topic, ends in found.items() if ends.publishers and ends.publishers[0][0] in kinds]
    if images:
        own = names.IMAGE.lstrip("/")
        return f"images are on {', '.join(images)}: choose one by --ros-args -r {own}:=TOPIC"
    return f"there are no images; topics: {', '.join(found) or 'none'}"


class Inputs:
    """The follower's subscriptions; images come from the `camera` topic."""

    def __init__(self, bus: Bus, camera: str, robot: RobotGeometry = LIMO) -> None:
        self.senses = Senses(robot)  #: the other sensors' newest readings
        self.complaint = ""  #: why the last message that was not read was not; "" while all were
        self._unreadable = 0
        self.frames: dict[str, str] = {}  #: the frame that the newest message of each topic names
        self._topic, self._camera = camera, bus.subscription(camera, names.TYPES[camera], depth=5)
        self._others = {
            topic: bus.subscription(topic, names.TYPES[topic], depth=5)
            for topic in (names.CAMERA_INFO, names.DEPTH, names.SCAN, names.ODOMETRY)
        }

    @property
    def dropped(self) -> int:
        """How many messages could not be read, or contradicted themselves."""
        return self._unreadable + sum(reader.dropped for reader in (self._camera, *self._others.values()))

    def newest(self) -> Frame | None:
        """Take in what has come; returns the newest camera image, if there is a new one."""
        for topic, reader in self._others.items():
            for message in reader.take():
                self.frames[topic] = message.header.frame_id
                self._read(self.senses.take, message)
        # Older images are passed over: the robot acts on the newest.
        for message in reversed(self._camera.take()):
            self.frames[self._topic] = message.header.frame_id
            picture = self._read(picture_of, message)
            if picture is not None:
                return self.senses.frame(messages.to_seconds(message.header.stamp), picture)
        return None

    def _read(self, read: Callable[[Any], Any], message: Any) -> Any:
        """Read a message; None of one that contradicts itself, which is counted."""
        try:
            return read(message)
        except MessageError as error:
            self.complaint, self._unreadable = str(error), self._unreadable + 1
            return None


def mounted(bus: Bus, inputs: Inputs, camera: str, robot: RobotGeometry) -> tuple[RobotGeometry, str]:
    """Return the robot with its sensors where /tf_static has them, and a line: where they sit, and who says so.

    Waits some seconds for the frames, where somebody publishes some; `camera` is the topic of its images. Raises
    `RobotError` where /tf_static has a sensor where none of this robot can be.
    """
    mounts, framed, file = Mounts(), frozenset[str](), robot
    static = names.resolved(bus.node, names.TF_STATIC)
    if _offered(static, bus.topics(0.5, enough=lambda found: _offered(static, found))):
        frames = bus.subscription(names.TF_STATIC, names.TYPES[names.TF_STATIC], depth=100, kept=True)
        until, base = time.monotonic() + SETTLED, frame_named(bus.node, "base_frame")
        while not {"camera_x", "lidar_x"} <= framed and time.monotonic() < until:
            bus.wait(CONTROL_PERIOD / 2)
            inputs.newest()
            for message in frames.take():
                mounts.take(message)
            own = inputs.frames.get(camera, ""), inputs.frames.get(names.SCAN, "")
            robot, framed = mounts.applied(file, base, *own)
    turned = f"turned by {math.degrees(robot.lidar_yaw):.0f}°"
    camera_at = f"camera {robot.camera_x:.2f} m ahead, {robot.camera_z:.2f} m high"
    return robot, f"{camera_at} · lidar {robot.lidar_x:.2f} m ahead, {turned} ({whence(file, framed)})"


@dataclass(frozen=True, slots=True)
class Settings:
    """How to drive."""

    seconds: float = math.inf  #: For how long [s].
    robot: RobotGeometry = LIMO
    moves: bool = True  #: Without, no command is sent: a planner drives to what is found.
    without_lidar: bool = False
    compressed: bool = False  #: Whether no raw images are asked for.
    watch: Callable[[FrameLog], None] = lambda _: None  #: Called with each control period.
    #: Told where the sensors sit, and which senses are there: some time after the first image, and when one more comes.
    say: Callable[[str], None] = lambda _: None


def drive(
    bus: Bus, controller: Controller[Any], detector: Detector, settings: Settings, report: Report | None = None
) -> Report:
    """Follow the person the camera sees until the time is up; the last command is always to stand.

    A `report` that is given is kept up to date, for a drive that is interrupted. Raises `BusError` if there is no
    camera, or no image comes for 10 s; `RobotError` as `mounted` has it.
    """
    report = Report() if report is None else report
    camera = camera_topic(bus, compressed=settings.compressed)
    inputs = Inputs(bus, camera, settings.robot)
    commands, findings = Commands(bus) if settings.moves else None, Findings(bus)
    robot, line = mounted(bus, inputs, camera, settings.robot)
    settings.say(line)
    follower = Follower(controller, detector, robot, without_lidar=settings.without_lidar)
    asked = bus.subscription(names.ASKED, names.ASKED_TYPE)
    settled, said, clock = math.inf, "", 0.0
    try:
        for now, frame, clock in _heard(bus, inputs, camera, settings.seconds):
            settled = min(settled, now + SETTLED)
            line = inputs.senses.present(without_lidar=settings.without_lidar)
            if line != said and (now > settled or "no" not in line.lower()):
                said = line
                settings.say(line)
            # Of several that came at once the last is meant.
            if came := asked.take():
                try:
                    follower.follow(came[-1].data)
                except WhomError as error:
                    settings.say(str(error))
            log = follower.tick(now, frame, inputs.senses.sensors)
            if log is None:
                continue
            if commands is not None:
                commands.publish(clock, log.decision.twist)
            report.add(log, 1e3 * (time.monotonic() - now))
            report.dropped = inputs.dropped
            findings.publish(log, inputs.senses)
            settings.watch(log)
    finally:
        if commands is not None:
            commands.publish(clock, Twist())
    return report


def _heard(bus: Bus, inputs: Inputs, camera: str, seconds: float) -> Iterator[tuple[float, Frame | None, float]]:
    """Yield from the first image on the time, an image that is new, and the time on the camera's clock [s]."""
    began = heard = time.monotonic()
    stamp: float | None = None
    while time.monotonic() - began < seconds:
        bus.wait(CONTROL_PERIOD / 2)
        now, frame = time.monotonic(), inputs.newest()
        if frame is not None:
            heard, stamp = now, frame.stamp
        elif now - heard > SILENT_AFTER:
            why = f"; {inputs.dropped} messages were not read: {inputs.complaint}" if inputs.complaint else ""
            where = f"{names.resolved(bus.node, camera)} in {bus.network}"
            raise BusError(f"no image on {where}, for {SILENT_AFTER:g} s{why}")
        if stamp is not None:
            yield now, frame, stamp + now - heard
