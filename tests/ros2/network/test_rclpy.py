"""ROS 2's own rclpy, with Fast DDS and no settings, hears the arena, sees our nodes, and is followed as a robot."""

import json
import os
import re
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from tests.ros2.real import needs_rclpy, start

from limo_hog.ros2 import names

pytestmark = needs_rclpy

ROOT = Path(__file__).parents[3]
NODES = ROOT / "tests" / "ros2" / "rclpy_nodes"
PATH = os.pathsep.join([str(ROOT / "python"), str(ROOT / "sim"), sysconfig.get_path("purelib")])
COMMAND = [sys.executable, "-m", "limo_hog"]

#: The arena's rates [Hz]; a machine that is busy draws fewer images.
RATES = {names.IMAGE: 10, names.CAMERA_INFO: 10, names.SCAN: 8, names.ODOMETRY: 50, names.IMU: 100, names.CLOCK: 50}
CAMERA = names.CAMERA_INFO, names.IMAGE, names.DEPTH


@contextmanager
def arena(*words: str, seconds: float = 120) -> Iterator[None]:
    command = [*COMMAND, "arena", "--ros2", "--seconds", str(seconds), *words]
    one = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        one.terminate()
        one.wait(20)


def listened(seconds: float, *words: str, topics: Iterable[str] = RATES) -> dict[str, Any]:
    typed = [f"{topic}={names.TYPES[topic].replace('/msg/', '/')}" for topic in topics]
    listener = start(NODES / "listener.py", str(seconds), *typed, *words)
    try:
        said: dict[str, Any] = json.loads(listener.communicate(timeout=100)[0].splitlines()[-1])
    finally:
        listener.kill()
    return said


def heard(seconds: float, arena_s: float = 120) -> dict[str, Any]:
    with arena(seconds=arena_s):
        return listened(seconds)


def nearly_all_pictures(*words: str) -> bool:
    """Whether a reader that computes gets colour and depth; a camera_info, which goes with each, is never lost."""
    counts = listened(5.0, "--busy", *words, topics=CAMERA)["counts"]
    return bool(min(counts[names.IMAGE], counts[names.DEPTH]) > 0.9 * counts[names.CAMERA_INFO] > 0)


def test_a_stock_reader_hears_every_topic_and_sees_the_node_with_its_topics() -> None:
    # A camera_info goes out with each image, and is too short to be lost. Short fragments lose three quarters of the
    # images; so does, at times, a machine that runs other tests as well: the best of three.
    for _ in range(3):
        said = heard(4.0)
        if most := said["counts"][names.IMAGE] > 0.5 * said["counts"][names.CAMERA_INFO] > 0:
            break
    assert most and said["missing"] == []
    writes, reads = said["nodes"]["/limo_hog_arena"]
    assert writes[names.SCAN] == [names.TYPES[names.SCAN]]
    assert reads == {names.COMMAND: ["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"]}
    assert said["counts"][names.SCAN] > 0.6 * said["counts"][names.CLOCK] * 8 / 50


def test_a_stock_reader_that_computes_gets_colour_and_depth() -> None:
    # Before heartbeats came every 10 ms, 1 to 9 of 10 came.
    with arena():
        assert any(nearly_all_pictures() for _ in range(3))


@pytest.mark.slow
def test_the_examples_longer_buffer_loses_no_images_without_asking_again(monkeypatch: pytest.MonkeyPatch) -> None:
    if int(Path("/proc/sys/net/core/rmem_max").read_text()) < 4 << 20:
        pytest.skip("net.core.rmem_max is less than 4 MB")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(ROOT / "examples" / "robot" / "fast_dds.xml"))
    with arena():
        assert nearly_all_pictures("--best-effort")


@pytest.mark.slow
def test_a_stock_reader_that_starts_late_finds_the_arena() -> None:
    # Without a word about it, Cyclone DDS tries an address at which nobody was found for 30 s.
    with arena():
        time.sleep(40)
        assert listened(1.0)["missing"] == []


@pytest.mark.slow
def test_a_stock_reader_that_replaces_a_killed_one_gets_images() -> None:
    # Images that the dead reader did not answer for were replaced while the new one had a part of them: Fast DDS hung.
    with arena():
        for _ in range(4):
            said = listened(3.0, "--busy", "--die", topics=CAMERA)
            assert said["counts"][names.IMAGE] > 10


@pytest.mark.slow
def test_a_stock_reader_outlives_the_arena() -> None:
    # What Cyclone DDS says of a topic whose writer has gone, Fast DDS reads for ever.
    assert heard(15.0, arena_s=8.0)["missing"] == []


@pytest.mark.slow
def test_a_stock_reader_gets_nearly_every_raw_image_of_a_machine_at_rest() -> None:
    counts = heard(20.0)["counts"]
    assert [topic for topic, rate in RATES.items() if counts[topic] / 20 <= 0.95 * rate] == []


def test_the_follower_drives_a_robot_in_a_namespace_with_names_of_its_own(tmp_path: Path) -> None:
    robot = start(NODES / "robot.py", "15", PYTHONPATH=PATH)
    assert robot.stdout is not None and robot.stdout.readline() == "ready\n"
    log = tmp_path / "log.jsonl"
    rules = "-r limo_camera/image:=camera/color/image_raw -r limo_camera/depth/image_raw:=camera/depth/image_raw"
    rules += " -r scan:=scan_filtered -r odom:=wheels/odom -r cmd_vel:=base/cmd_vel -r __ns:=/robot1"
    words = ["follow", "--ros2", "--max-speed", "0.3", "--json", str(log), "--ros-args", *rules.split()]
    follower = subprocess.Popen([*COMMAND, *words], stderr=subprocess.PIPE, text=True)
    try:
        said = json.loads(robot.communicate(timeout=120)[0].splitlines()[-1])
        follower.send_signal(2)
        error = follower.communicate(timeout=20)[1]
    finally:
        robot.kill()
        follower.kill()
    assert "follow: following a person" in error
    assert said["in_view"] >= 0.95 and said["contacts"] == 0 and said["moved"] > 0.3
    assert 0.05 < said["fastest"] <= 0.3 + 1e-6
    events = [json.loads(line) for line in log.read_text().splitlines()]
    assert any(event.get("mode") == "follow" for event in events) and events[-1]["frames"] > 50


def test_the_example_on_rclpy_follows_and_stops_at_ctrl_c(tmp_path: Path) -> None:
    (tmp_path / "limo.toml").write_text("")
    rules = f"-r image:={names.IMAGE} -r camera_info:={names.CAMERA_INFO} -r depth:={names.DEPTH}"
    words = f"--ros-args -p robot:={tmp_path / 'limo.toml'} -p reliable:=true {rules}".split()
    log, said, until = tmp_path / "log.txt", "", time.monotonic() + 60
    with (
        arena("--scenario", "followable"),
        log.open("w") as errors,
        start(ROOT / "examples" / "rclpy_follower.py", *words, stderr=errors, PYTHONPATH=PATH) as node,
    ):
        while "following a person" not in said and time.monotonic() < until:
            time.sleep(0.5)
            said = log.read_text()
        node.send_signal(2)
        try:
            assert node.wait(20) != 0
        finally:
            node.kill()
    assert "following a person" in said
    told = [re.sub(r"[\d.]+", "", line.partition("]: ")[2]) for line in said.splitlines() if "[INFO]" in line]
    # A reason whose numbers alone change is said once.
    assert all(one != next_ for one, next_ in pairwise(told))
