"""A peer that is not ours, Cyclone DDS's C library with types from idlc, understands us and we it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from limo_hog.follow.twist import Twist
from limo_hog.ros2 import dds, messages, names

HERE = Path(__file__).parent / "peer"


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the peer."""
    if shutil.which("idlc") is None or shutil.which("cc") is None:
        pytest.skip("needs Debian's cyclonedds-tools, cyclonedds-dev and a C compiler")
    folder = tmp_path_factory.mktemp("peer")
    subprocess.run(["idlc", str(HERE / "ros.idl")], cwd=folder, check=True)
    source = [str(HERE / "peer.c"), "ros.c", "-I.", "-lddsc", "-o", "peer"]
    subprocess.run(["cc", "-O1", *source], cwd=folder, check=True)
    return folder / "peer"


def test_a_c_peer_receives_images_and_twists_and_its_twists_arrive(peer: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "121")
    environment = {**os.environ, "CYCLONEDDS_URI": dds.LOOPBACK}
    bus = dds.Bus()
    commands = bus.subscription(names.COMMAND, names.TYPES[names.COMMAND])
    images = bus.publisher(names.IMAGE, names.TYPES[names.IMAGE])
    heard = bus.publisher("/heard", names.TYPES[names.COMMAND])
    other = subprocess.Popen([str(peer), "121", "250"], stdout=subprocess.PIPE, text=True, env=environment)
    assert other.stdout is not None
    assert other.stdout.readline() == "ready\n"
    until = time.monotonic() + 5
    while not (images.has_readers and heard.has_readers) and time.monotonic() < until:
        time.sleep(0.01)
    pixels = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    for number in range(60):
        images.publish(messages.image(number / 30, pixels))
        heard.publish(messages.twist(Twist(0.0, 0.125)))
        time.sleep(1 / 30)
    said = json.loads(other.communicate(timeout=60)[0])
    assert said == {
        "images": 60,
        "encoding": "bgr8",
        "pixel_sum": int(pixels.sum()),
        "twists": 60,
        "angular": 0.125,
    }
    got = [messages.to_twist(message) for message in commands.take()]
    assert got
    assert set(got) == {Twist(0.5, -0.25)}
    assert commands.dropped == 0
