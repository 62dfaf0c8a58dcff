"""What the follower publishes: messages as planners and costmaps read them, with the bytes of Cyclone DDS's encoder."""

import math
import threading
from functools import cache
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from cyclonedds.idl import make_idl_struct, types
from tests.ros2.network.publishing import publishing, until_it_comes

from limo_hog.detections import Detections
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.decision import Believed, Mode
from limo_hog.follow.pipeline import FrameLog
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.observation import Scan
from limo_hog.named_detectors import detector_named
from limo_hog.ros2 import dds, findings, follower, frames, messages, names
from limo_hog.ros2.bag import to_detections
from limo_hog.ros2.outputs import Commands
from limo_sim.ros.live import run_live
from limo_sim.run.log import Step
from limo_sim.world.scenario import Person, Scenario

PERSON = Believed(2.0, 2.0, 0.875, 7, 0.5, -0.25, 1)
OTHER = Believed(3.0, -1.0, 0.95, 12)
BOXES = Detections(np.array([[10, 20, 64, 128], [300, 20, 50, 101]], np.int32), np.array([1.5, 0.25]))

MESSAGES = {
    "scan": messages.laser_scan(Scan(1.25, np.array([1.0, 2.5, np.inf], np.float32), -2.0, 2.0, 0.12, 8.0)),
    "detections": findings.detections_message(12.5, BOXES, "depth_link", {1: 7}),
    "no detections": findings.detections_message(12.5, Detections.none(), "depth_link"),
    "pose": findings.person_pose(12.5, PERSON),
    "people": findings.people_message(12.5, [PERSON, OTHER]),
    "frames": findings.person_frames(12.5, [PERSON, OTHER], 7),
    "robot": frames.static_transforms(12.5, LIMO),
    "command": messages.twist(Twist(0.5, -0.25)),
    "stamped command": findings.stamped_twist(12.5, Twist(0.5, -0.25)),
}


@cache
def cyclone_type(name: str) -> Any:
    generic: Any = types
    fields = {}
    for field in messages.fields_of(name):
        plain = {"string": str, "bool": bool}.get(field.item) or getattr(types, field.item, None)
        one = cyclone_type(field.item) if field.is_message else plain
        several = generic.array[one, field.length] if field.length else generic.sequence[one]
        fields[field.name] = one if field.length is None else several
    return make_idl_struct(name.replace("/", "_"), name, fields)


def cyclone(value: Any) -> Any:
    """A message as Cyclone's own struct, with what it holds."""
    if isinstance(value, list | np.ndarray):
        return [cyclone(one) for one in value]
    if not hasattr(value, "__msgtype__"):
        return value
    fields = messages.fields_of(value.__msgtype__)
    return cyclone_type(value.__msgtype__)(**{one.name: cyclone(getattr(value, one.name)) for one in fields})


@pytest.mark.parametrize("name", MESSAGES)
def test_the_bytes_are_those_of_cyclone_dds_own_encoder(name: str) -> None:
    assert messages.serialize(MESSAGES[name]) == cyclone(MESSAGES[name]).serialize(use_version_2=False)


def test_boxes_carry_the_number_of_their_person_best_first() -> None:
    message = MESSAGES["detections"]
    assert [one.id for one in message.detections] == ["", "7"]
    np.testing.assert_array_equal(to_detections(message).boxes, BOXES.boxes)
    np.testing.assert_array_equal(to_detections(message).scores, BOXES.scores)


def test_people_are_listed_the_likeliest_first_and_face_away_from_the_robot() -> None:
    pose, listed = MESSAGES["pose"], MESSAGES["people"].people
    assert 2 * math.atan2(pose.pose.orientation.z, pose.pose.orientation.w) == pytest.approx(math.pi / 4)
    assert pose.header.frame_id == "base_link"
    assert [(one.name, one.reliability, one.velocity.x) for one in listed] == [("12", 0.95, 0.0), ("7", 0.875, 0.5)]
    assert [one.child_frame_id for one in MESSAGES["frames"].transforms] == ["person_7", "followed_person", "person_12"]


@pytest.mark.parametrize("kind", [names.TYPES[names.COMMAND], names.STAMPED_COMMAND_TYPE])
def test_commands_have_the_type_that_the_robot_takes(kind: str) -> None:
    robot = dds.Bus()
    heard, commands = robot.subscription(names.COMMAND, kind), Commands(dds.Bus())
    came = until_it_comes(robot, lambda: commands.publish(1.0, Twist(0.25, 0.0)), heard.take)
    assert {message.__msgtype__ for message in came} == {kind}


def test_a_drive_publishes_where_the_person_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follower, "SILENT_AFTER", 20.0)
    scenario = Scenario(name="standing", people=(Person(route=((3.0, 0.5, 3600.0),)),))
    arena = threading.Thread(target=run_live, args=(scenario, 0, 12.0, dds.Bus()))
    arena.start()
    watcher = dds.Bus()
    listening = {topic: watcher.subscription(topic, kind) for topic, kind in names.FINDINGS.items()}
    listening[names.TF] = watcher.subscription(names.TF, names.TYPES[names.TF], depth=1000)
    kept = watcher.subscription(names.TF_STATIC, names.TYPES[names.TF_STATIC], kept=True)
    said: list[str] = []
    asked = watcher.publisher(names.ASKED, names.ASKED_TYPE)

    def ask(log: FrameLog) -> None:
        # A publisher's first messages may come before its discovery.
        if any(one.same for one in log.decision.belief.people) and not reasons:
            message = messages.default_message(names.ASKED_TYPE)
            message.data = "7" if said[-1:] and said[-1].startswith("got 'leftmost'") else "leftmost"
            asked.publish(message)
        if log.decision.reason.endswith("asked for person 7, not found yet"):
            reasons.append(log.decision.reason)

    reasons: list[str] = []
    settings = follower.Settings(7.0, watch=ask, say=said.append)
    report = follower.drive(dds.Bus(), controller_named("tracking", 1.5), detector_named("hog"), settings)
    arena.join()
    assert reasons and any(line.startswith("got 'leftmost' for the person to follow") for line in said)
    found = {topic: reader.take() for topic, reader in listening.items()}
    assert report.found > 10
    pose = found[names.PERSON][0]
    # The arena's person stands 3 m away; by now the robot is on its way to hold 1.5 m.
    assert 1.3 < math.hypot(pose.pose.position.x, pose.pose.position.y) < 3.2
    assert {one.name for one in found[names.PEOPLE][-1].people} == {"1"}
    assert found[names.DETECTIONS][-1].detections[0].id == "1"
    children = {one.child_frame_id for message in found[names.TF] for one in message.transforms}
    assert {"base_link", "person_1", "followed_person"} <= children
    assert [one.child_frame_id for one in kept.take()[0].transforms][:1] == ["depth_link"]


def test_a_robot_that_publishes_images_alone_is_told_what_is_missing_and_stands() -> None:
    commands = dds.Bus().subscription(names.COMMAND, names.TYPES[names.COMMAND], depth=1000)
    said: list[str] = []
    logs: list[FrameLog] = []
    settings = follower.Settings(6.0, watch=logs.append, say=said.append)
    with publishing(names.IMAGE, messages.image(1.0, np.full((480, 640, 3), 90, np.uint8))):
        follower.drive(dds.Bus(), controller_named("tracking", 1.5), detector_named("hog"), settings)
    assert said[0].endswith("(a Limo's)")
    assert said[1:] == ["camera yes · camera_info no, 71° wide is assumed · depth no · scan NO · odom no"]
    assert {log.decision.reason for log in logs} == {"no depth image has come; no scan has come; no odometry has come"}
    sent = [messages.to_twist(message) for message in commands.take()]
    assert len(sent) > 20 and set(sent) == {Twist()}


def test_a_command_that_is_no_number_is_shown_and_recorded_as_standing() -> None:
    steps: list[Step] = []
    with publishing(names.COMMAND, messages.twist(Twist(math.nan, 0.5)), hertz=20.0):
        run_live(Scenario(name="empty"), 0, 4.0, dds.Bus(), steps.append)
    assert {(step.log.decision.twist, step.log.decision.mode) for step in steps} == {(Twist(), Mode.STAND)}
