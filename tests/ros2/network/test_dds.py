"""Topics over DDS: bytes, loss and latency on loopback, the tools that look, and the follower that drives."""

import json
import os
import re
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from cyclonedds import builtin
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy
from cyclonedds.topic import Topic
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.ros2.network.publishing import publishing, until_it_comes
from tests.somebody import somebody_ahead

from limo_hog.cli.topic import as_yaml
from limo_hog.follow.robot import LIMO, RobotGeometry, Twist
from limo_hog.follow.sense.observation import Scan
from limo_hog.ros2 import dds, follower, frames, messages, names
from limo_sim.ros.live import second_publishers

SCAN = messages.laser_scan(Scan(1.0, np.ones(292, np.float32), -2.0, 2.0, 0.12, 8.0))
BLACK = messages.image(1.0, np.zeros((8, 8, 3), np.uint8))
LIMO_SITS = "camera 0.08 m ahead, 0.17 m high · lidar 0.10 m ahead, turned by 0°"


def test_names_types_and_hashes_are_what_ros_2_looks_for() -> None:
    bus = dds.Bus()
    with publishing(names.COMMAND, messages.twist(Twist())):
        bus.topics(5.0, enough=lambda found: names.COMMAND in found)
        reader = builtin.BuiltinDataReader(bus._participant, builtin.BuiltinTopicDcpsPublication)
        ends = {sample.topic_name: sample for sample in reader.read(100)}
    end = ends["rt/cmd_vel"]
    assert end.type_name == "geometry_msgs::msg::dds_::Twist_"
    assert end.qos[Policy.Reliability].max_blocking_time == 100_000_000
    assert bytes(end.qos[Policy.Userdata].data).startswith(b"typehash=RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a")


RECEIVER = """
import sys, time
import numpy as np
from limo_hog.ros2 import dds, follower, frames, messages, names
bus = dds.Bus()
images = bus.subscription(names.IMAGE, names.TYPES[names.IMAGE], depth=50)
print("ready", flush=True)
late, stamps = [], []
until = time.monotonic() + float(sys.argv[1])
while len(late) < int(sys.argv[2]) and time.monotonic() < until:
    bus.wait(2.0)
    for message in images.take():
        if message.encoding != "mono8":
            late.append(time.time() - messages.to_seconds(message.header.stamp))
            stamps.append(int(message.data[0]))
print(len(late), np.percentile(late, 95), stamps[:1], np.unique(np.diff(stamps) % 256).tolist())
"""


def received(seconds: float, hertz: float) -> list[str]:
    """Send numbered images to `RECEIVER` and return the words that it prints.

    Grey images go first, for the time in which a publisher leaves out images for a new reader.
    """
    count = int(seconds * hertz)
    command = [sys.executable, "-c", RECEIVER, str(seconds + 20), str(count)]
    receiver = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert receiver.stdout is not None and receiver.stdout.readline() == "ready\n"
    publisher = dds.Bus().publisher(names.IMAGE, names.TYPES[names.IMAGE], depth=50)
    while not publisher.has_readers:
        time.sleep(0.01)
    grey, until = messages.image(0.0, np.zeros((8, 8), np.uint8)), time.monotonic() + 1.5 * dds._CATCH_UP
    while time.monotonic() < until:
        publisher.publish(grey)
        time.sleep(1 / hertz)
    pixels = np.zeros((480, 640, 3), np.uint8)
    for number in range(count):
        pixels[0, 0, 0] = number % 256
        publisher.publish(messages.image(time.time(), pixels))
        # (Without catching up: a machine that stood for a second would send more at once than a writer keeps.)
        time.sleep(1 / hertz)
    return receiver.communicate(timeout=30)[0].split()


# A receiver that images do not wake is late by up to 2 s; the minute's figure is exact.
MINUTE = pytest.param(60.0, 10.0, 0.010, marks=pytest.mark.slow)


@pytest.mark.parametrize(("seconds", "hertz", "latest"), [(3.0, 20.0, 0.5), MINUTE])
def test_images_reach_another_process_whole_and_in_time(seconds: float, hertz: float, latest: float) -> None:
    came, late, *numbers = received(seconds, hertz)
    assert numbers == ["[0]", "[1]"], "the numbers on the images do not run from 0 by 1"
    assert int(came) == int(seconds * hertz) and float(late) <= latest


@pytest.mark.parametrize("publisher_first", [True, False])
def test_a_driver_that_sends_with_best_effort_is_heard(publisher_first: bool) -> None:
    listening, sending = dds.Bus(), dds.Bus()
    kind = dds.dds_type(names.TYPES[names.SCAN])

    def writer() -> Any:
        qos = dds._qos(names.TYPES[names.SCAN], 10, reliable=False)
        return DataWriter(sending._participant, Topic(sending._participant, f"rt{names.SCAN}", kind), qos=qos)

    driver = writer() if publisher_first else None
    if publisher_first:
        listening.topics(10.0, enough=lambda found: names.SCAN in found)
    scans = listening.subscription(names.SCAN, names.TYPES[names.SCAN])
    driver = driver or writer()
    heard = until_it_comes(listening, lambda: driver.write(kind(SCAN)), scans.take)
    assert len(heard[0].ranges) == 292


def test_what_is_no_message_is_dropped_and_counted() -> None:
    bus = dds.Bus()
    heard = bus.subscription(names.IMAGE, names.TYPES[names.IMAGE])
    publisher = dds.Bus().publisher(names.IMAGE, names.TYPES[names.IMAGE])
    sample = publisher._type(None)
    # Cyclone DDS itself refuses bytes of the wrong shape; a text that is not UTF-8 comes through.
    foreign = messages.serialize(messages.image(0.0, np.zeros((4, 4), np.uint8))).replace(b"depth_link", 10 * b"\xff")
    publisher._type.serialize = lambda *_, **__: foreign
    try:
        until_it_comes(bus, lambda: publisher._writer.write(sample), lambda: heard.take() or heard.dropped)
    finally:
        dds.dds_type.cache_clear()
    assert heard.dropped >= 1 and heard.take() == []


def test_topic_list_info_and_echo_print_as_ros2_topic_does(answer_to: AnswerTo) -> None:
    assert re.fullmatch(r"no topics in .+\n", answer_to("topic", "list", "-t").err)
    assert "topic /nothing is not there in ROS domain" in answer_to("topic", "echo", "/nothing").err
    with publishing(names.COMMAND, messages.twist(Twist(0.2, 0.0))):
        assert "/cmd_vel [geometry_msgs/msg/Twist]\n" in answer_to("topic", "list", "-t").out
        assert answer_to("topic", "info", "/cmd_vel").out == (
            "Type: geometry_msgs/msg/Twist\nPublisher count: 1\n  geometry_msgs/msg/Twist: Reliable, Volatile\n"
            "Subscription count: 0\n"
        )
        echo = answer_to("topic", "echo", "--once", "/cmd_vel").out
    assert echo == "linear:\n  x: 0.2\n  y: 0.0\n  z: 0.0\nangular:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n---\n"


def test_topic_echo_shows_what_a_publisher_kept(answer_to: AnswerTo) -> None:
    publisher = dds.Bus().publisher(names.TF_STATIC, names.TYPES[names.TF_STATIC], kept=True)
    publisher.publish(frames.static_transforms(0.0, LIMO))
    shown = answer_to("topic", "echo", "--once", "/tf_static", "--seconds", 10).out
    assert "child_frame_id: laser_link" in shown


def test_the_follower_takes_its_sensors_places_from_tf_static() -> None:
    own = RobotGeometry(camera_x=0.2, camera_z=0.25, lidar_x=-0.1, lidar_yaw=3.0)
    with publishing(names.SCAN, SCAN), publishing(names.IMAGE, BLACK):
        bus = dds.Bus()
        inputs = follower.Inputs(bus, names.IMAGE)
        assert follower.mounted(bus, inputs, names.IMAGE, LIMO) == (LIMO, f"{LIMO_SITS} (a Limo's)")
        with publishing(names.TF_STATIC, frames.static_transforms(0.0, own)):
            robot, line = follower.mounted(bus, inputs, names.IMAGE, LIMO)
    assert [robot.camera_x, robot.camera_z, robot.lidar_x, robot.lidar_yaw] == pytest.approx([0.2, 0.25, -0.1, 3.0])
    assert line == "camera 0.20 m ahead, 0.25 m high · lidar -0.10 m ahead, turned by 172° (/tf_static)"


def test_topic_hz_measures_the_rate(answer_to: AnswerTo) -> None:
    with publishing(names.COMMAND, messages.twist(Twist()), hertz=10.0):
        measured = answer_to("topic", "hz", "/cmd_vel", "--seconds", 5).out
    assert float(measured.split("average rate: ")[-1].split()[0]) == pytest.approx(10.0, abs=0.2)


def test_yaml_is_what_ros_prints_for_numbers_that_are_none_and_long_sequences() -> None:
    text = as_yaml(messages.laser_scan(Scan(0.0, np.array([np.inf, np.nan] + 200 * [1.0]), -2.0, 2.0, 0.12, 8.0)))
    assert "ranges:\n- .inf\n- .nan\n- 1.0\n" in text and text.count("\n- ") == 129
    assert "- '...'\nintensities: []\n" in text
    assert "z: 1.0e-05\n" in as_yaml(messages.twist(Twist(0.0, 1e-5)))


def test_a_follower_without_a_robot_says_so(monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr(follower, "SILENT_AFTER", 0.3)
    typed = ("follow", "--ros2", "--seconds", 5, "--ros-args", "-p", "base_fame:=x", "-p", "use_sim_time:=true")
    code, _, said = answer_to(*typed)
    domain = os.environ["ROS_DOMAIN_ID"]
    assert f"no publisher of /limo_camera/image or /limo_camera/image/compressed in ROS domain {domain}" in said
    assert code == 1 and "on this machine alone" in said and "there are no images; topics: " in said
    # And which parameter it does not know.
    told = "parameter base_fame is not known; known are base_frame, camera_frame"
    assert told in said and "use_sim_time" not in said


def test_a_camera_of_another_name_is_named_and_taken_under_it(monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr(follower, "SILENT_AFTER", 3.0)
    rules = "--ros-args -r __ns:=/robot1 -r limo_camera/image:=camera/image_raw".split()
    with publishing("/robot1/camera/image_raw", BLACK):
        code, _, err = answer_to("follow", "--ros2", "--seconds", 5)
        driven = answer_to("follow", "--ros2", "--seconds", 1.5, "--json", "-", *rules)
    told = "images are on /robot1/camera/image_raw: choose one by --ros-args -r limo_camera/image:=TOPIC"
    assert code == 1 and told in err
    first, *_, last = map(json.loads, driven.out.splitlines())
    assert {"seconds", "stamp", "mode", "reason"} == set(first) and last["frames"] > 0


def test_a_parameter_of_the_wrong_kind_is_refused(answer_to: AnswerTo) -> None:
    with publishing(names.IMAGE, BLACK):
        code, _, err = answer_to("follow", "--ros2", "--seconds", 1, "--ros-args", "-p", "base_frame:=7")
    assert code == 1 and "parameter base_frame is 7; wanted is a frame's name" in err


def test_an_arena_names_the_topics_that_another_publishes() -> None:
    arena = dds.Bus()
    assert second_publishers(arena) == []
    with publishing(names.SCAN, SCAN):
        assert second_publishers(arena) == [names.SCAN]


@pytest.mark.parametrize("kind", ["compressed", "mono8", "rgb8"])
def test_the_follower_reads_whatever_pictures_the_camera_sends(kind: str, answer_to: AnswerTo) -> None:
    image = somebody_ahead()
    topic, message = names.IMAGE_COMPRESSED, messages.compressed_image(1.0, image)
    if kind != "compressed":
        topic, message = names.IMAGE, messages.image(1.0, image[..., ::-1] if kind == "rgb8" else image[..., 1])
        message.encoding = kind
    with publishing(topic, message):
        report = json.loads(answer_to("follow", "--ros2", "--seconds", 1.5, "--json", "-").out.splitlines()[-1])
    assert report["found"] == report["frames"] >= 5


def test_a_robot_whose_pictures_cannot_be_read_is_given_up(monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr(follower, "SILENT_AFTER", 1.0)
    message = messages.compressed_image(1.0, np.zeros((8, 8, 3), np.uint8))
    message.data = message.data[:20]
    with publishing(names.IMAGE_COMPRESSED, message):
        code, _, said = answer_to("follow", "--ros2", "--seconds", 5)
    assert code == 1 and "no image on /limo_camera/image/compressed in ROS domain" in said
    assert "messages were not read: 20 bytes of 'bgr8; jpeg compressed bgr8' are no picture" in said
