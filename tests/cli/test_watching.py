"""What `follow` keeps of a run is whole, readable by others, and gives the same detections again."""

from __future__ import annotations

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiohttp
import av
import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from limo_hog.cli.main import main
from limo_hog.extras import MissingExtraError, needed

LIMO_HOG = Path(sys.executable).with_name("limo-hog")
SECONDS = 6


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that a short run leaves."""
    folder = tmp_path_factory.mktemp("run")
    names = {"--video": "run.mp4", "--record": "run.mcap", "--plot": "run.png", "--json": "card.json"}
    files = [word for option, name in names.items() for word in (option, str(folder / name))]
    assert main(["follow", "--seconds", str(SECONDS), *files]) == 0
    assert sorted(p.name for p in folder.iterdir()) == sorted(names.values())
    return folder


def test_the_film_is_h264_with_a_frame_for_each_of_the_cameras(kept: Path) -> None:
    frames = json.loads((kept / "card.json").read_text())["frames"]
    with av.open(kept / "run.mp4") as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 640, 480)
        assert stream.average_rate == 10
        assert len(list(container.decode(stream))) == frames == 10 * SECONDS


def test_the_figure_is_a_picture_with_something_on_it(kept: Path) -> None:
    picture = np.asarray(cv2.imread(str(kept / "run.png")))
    assert picture.shape[1] > 1200
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_the_recording_is_read_by_another_library_than_wrote_it(kept: Path) -> None:
    counts: Counter[tuple[str, str]] = Counter()
    boxes = 0
    with AnyReader([kept / "run.mcap"]) as reader:
        for connection, _, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            counts[connection.topic, connection.msgtype] += 1
            if connection.topic == "/limo_camera/image":
                assert (message.width, message.height, message.encoding) == (640, 480, "bgr8")
            elif connection.topic == "/limo_camera/detections":
                boxes += len(message.detections)
    frames = 10 * SECONDS
    assert counts == {
        ("/limo_camera/image", "sensor_msgs/msg/Image"): frames,
        ("/limo_camera/depth/image_raw", "sensor_msgs/msg/Image"): frames,
        ("/limo_camera/camera_info", "sensor_msgs/msg/CameraInfo"): frames,
        ("/limo_camera/detections", "vision_msgs/msg/Detection2DArray"): frames,
        ("/cmd_vel", "geometry_msgs/msg/Twist"): frames,
        ("/odom", "nav_msgs/msg/Odometry"): frames,
        ("/scan", "sensor_msgs/msg/LaserScan"): 8 * SECONDS,
    }
    assert boxes > 10


def test_a_recording_replayed_gives_the_same_detections(
    kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film = tmp_path / "again.mp4"
    assert main(["replay", str(kept / "run.mcap"), "--json", "-", "--video", str(film)]) == 0
    card = json.loads(capsys.readouterr().out)
    assert card["same_detections"] == card["frames_recorded_with_detections"] == card["frames"] == 10 * SECONDS
    assert card["frames_with_people"] > 10
    assert card["linear_difference_max"] < 1e-6
    assert card["angular_difference_max"] < 1e-6
    with av.open(film) as container:
        assert container.streams.video[0].frames == 10 * SECONDS


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda path: path.write_bytes(b""), "no ROS 2 recording"),
        (lambda path: path.write_bytes(b"hello" * 100), "no ROS 2 recording"),
        (_cut, "no ROS 2 recording"),
        (lambda path: path.unlink(), "no such recording"),
    ],
)
def test_a_file_that_is_no_recording_is_one_line(
    damage: Callable[[Path], object], said: str, kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes((kept / "run.mcap").read_bytes())
    damage(path)
    assert main(["replay", str(path)]) == 1
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"bad.mcap: {said}" in complaint


def test_a_recording_without_the_camera_says_what_it_holds(kept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(kept / "run.mcap"), "--image", "/other"]) == 1
    assert "no images on /other; the recording holds /cmd_vel, " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "name"), [("--video", "a.avi"), ("--record", "a.bag"), ("--plot", "a.txt"), ("--view", "x:y")]
)
def test_a_name_that_cannot_be_is_refused_at_once(option: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["follow", option, name]) == 2
    assert f"argument {option}" in capsys.readouterr().err


def test_a_port_in_use_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["follow", "--seconds", "1", "--view", str(port)]) == 1
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert "give --view another port" in complaint


def test_a_folder_that_may_not_be_written_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("no folder")
    assert main(["follow", "--seconds", "1", "--record", str(tmp_path / "file" / "run.mcap")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_ctrl_c_leaves_whole_files(tmp_path: Path) -> None:
    film, bag = tmp_path / "run.mp4", tmp_path / "run.mcap"
    command = [str(LIMO_HOG), "follow", "--seconds", "3600", "--video", str(film), "--record", str(bag)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    part = tmp_path / ".run.part.mcap"
    deadline = time.monotonic() + 60
    while not (part.exists() and part.stat().st_size > 1_000_000) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert said == "limo-hog: stopped\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.mcap", "run.mp4"]
    with av.open(film) as container, AnyReader([bag]) as reader:
        frames = len(list(container.decode(video=0)))
        images = sum(connection.msgcount for connection in reader.connections if connection.topic.endswith("/image"))
        assert frames > 0
        assert abs(frames - images) <= 1


async def _text(page: Any) -> str:
    message = await page.receive(timeout=30)
    return str(message.data) if message.type is aiohttp.WSMsgType.TEXT else ""


def test_ctrl_c_ends_a_run_that_is_paused_on_its_page() -> None:
    command = [str(LIMO_HOG), "follow", "--seconds", "3600", "--view", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    url = process.stderr.readline().split()[-1]

    async def pause() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(url + "live") as page:
            await page.send_str('{"do": "pause"}')
            told = ""
            while '"paused": true' not in told:
                told = await _text(page)
            process.send_signal(signal.SIGINT)
            # The page is told that it is over.
            while '"ended"' not in told:
                told = await _text(page)

    asyncio.run(pause())
    assert process.communicate(timeout=30)[1] == "limo-hog: stopped\n"
    assert process.returncode == 130


def test_a_log_for_the_rerun_viewer_is_one(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="needs the extra viz: pip install 'limo-hog[viz]'")
    assert main(["follow", "--seconds", "2", "--rerun", str(tmp_path / "run.rrd")]) == 0
    log = tmp_path / "run.rrd"
    assert log.read_bytes()[:3] == b"RRF"
    assert log.stat().st_size > 100_000
    assert list(tmp_path.iterdir()) == [log]


def test_a_missing_library_is_named_with_what_brings_it() -> None:
    with (
        pytest.raises(MissingExtraError, match=r"^--rerun needs the Rerun SDK: pip install 'limo-hog\[viz\]'$"),
        needed(by="--rerun", what="the Rerun SDK", install="'limo-hog[viz]'"),
    ):
        import no_such_library  # type: ignore[import-not-found]  # noqa: F401
