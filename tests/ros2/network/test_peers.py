"""Peers that are not ours, Cyclone DDS's C library and Fast DDS, understand us and we them."""

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from limo_hog.detections import Detections
from limo_hog.follow.decision import Believed
from limo_hog.follow.robot import Twist
from limo_hog.ros2 import dds, findings, messages, names
from limo_hog.ros2.network import LOOPBACK

HERE = Path(__file__).parent / "peer"
#: Debian's Cyclone DDS is 0.10, which tries addresses for as long as it runs, and does not know the word.
LOOPBACK_0_10 = LOOPBACK.replace("<InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>", "")

#: Debian packages, and commands with which a peer is built from ros.idl and its source, beside it.
CYCLONE = "idlc ros.idl", "cc -O1 SOURCE.c ros.c -I. -lddsc -o peer"
FAST = (
    "fastddsgen -replace ros.idl",
    "c++ -O1 -std=c++17 SOURCE.cpp ros.cxx rosPubSubTypes.cxx -I. -lfastrtps -lfastcdr -o peer",
)
BUILDS = {
    "cyclone": ("cyclonedds-tools, cyclonedds-dev and gcc", CYCLONE),
    "fast": ("fastddsgen, libfastrtps-dev and g++", FAST),
}


def built(kind: str, folder: Path, source: str) -> Path:
    packages, commands = BUILDS[kind]
    shutil.copy(HERE / "ros.idl", folder)
    for command in (command.replace("SOURCE", str(HERE / source)).split() for command in commands):
        if shutil.which(command[0]) is None:
            pytest.skip(f"needs Debian's {packages}")
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder / "peer"


@pytest.fixture(params=["cyclone", pytest.param("fast", marks=pytest.mark.slow)])
def exchange(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Build and start a peer, and send it messages; gives what it says, and the commands that came from it."""

    def run(source: str, sent: dict[str, Any], times: int, hertz: float, command: str) -> tuple[Any, list[Any]]:
        peer = built(request.param, tmp_path, source)
        domain = str(121 + list(BUILDS).index(request.param) + 2 * (source == "findings"))
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
        bus = dds.Bus()
        commands = bus.subscription(names.COMMAND, command)
        writers = {topic: bus.publisher(topic, message.__msgtype__) for topic, message in sent.items()}
        environment = {**os.environ, "CYCLONEDDS_URI": LOOPBACK_0_10}
        # (It counts periods of 20 ms.)
        other = subprocess.Popen([str(peer), domain, "300"], stdout=subprocess.PIPE, text=True, env=environment)
        assert other.stdout is not None and other.stdout.readline() == "ready\n"
        until = time.monotonic() + 5
        while not all(writer.has_readers for writer in writers.values()) and time.monotonic() < until:
            time.sleep(0.01)
        for _ in range(times):
            for topic, message in sent.items():
                writers[topic].publish(message)
            time.sleep(1 / hertz)
        said = json.loads(other.communicate(timeout=60)[0].splitlines()[-1])
        assert commands.dropped == 0
        return said, commands.take()

    return run


def test_a_peer_receives_every_image_and_twist_and_its_twists_arrive(exchange: Callable[..., Any]) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    sent = {names.IMAGE: messages.image(1.5, pixels), "/heard": messages.twist(Twist(0.0, 0.125))}
    said, got = exchange("peer", sent, 30, 15.0, names.TYPES[names.COMMAND])
    sums = {"encoding": "bgr8", "pixel_sum": int(pixels.sum())}
    assert said == {"images": 30, "twists": 30, "angular": 0.125, **sums}
    assert {messages.to_twist(message) for message in got} == {Twist(0.5, -0.25)}


def test_a_peer_receives_what_the_follower_finds_and_its_stamped_commands_arrive(exchange: Callable[..., Any]) -> None:
    person = Believed(2.0, 0.0, 0.875, 7, 0.5, -0.25, 1)
    boxes = Detections(np.array([[10, 20, 64, 128], [300, 20, 50, 100]], np.int32), np.array([1.5, 0.5]))
    sent = {
        names.PERSON: findings.person_pose(12.5, person),
        names.DETECTIONS: findings.detections_message(12.5, boxes, "depth_link", {1: 7}),
        names.PEOPLE: findings.people_message(12.5, [person]),
        names.TF: findings.person_frames(12.5, [person], 7),
    }
    said, got = exchange("findings", sent, 5, 10.0, names.STAMPED_COMMAND_TYPE)
    pose, found = "12.500000000 base_link 2 0 1", "2  person 1.5 42 100 7"
    assert said == [pose, found, "1 7 2 -0.25 0.875", "2 base_link person_7 2"]
    told = {(one.header.stamp.sec, one.header.frame_id, messages.to_twist(one.twist)) for one in got}
    assert told == {(12, "base_link", Twist(0.5, -0.25))}
