"""What `follow` keeps of a run is whole, readable by others, and gives the same detections again."""

import asyncio
import errno
import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections import Counter
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import aiohttp
import av
import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, frames_of, on_a_full_disk
from tests.sim.view.stalled import stalled

from limo_hog.cli.main import main
from limo_hog.ros2.bag import read_bag
from limo_hog.signals import Stopped

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


def test_the_film_is_h264_of_all_the_cameras_frames_and_the_figure_is_drawn(kept: Path) -> None:
    frames = json.loads((kept / "card.json").read_text())["frames"]
    with av.open(kept / "run.mp4") as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height, stream.average_rate) == ("h264", 640, 480, 10)
        assert len(list(container.decode(stream))) == frames == 10 * SECONDS
    picture = np.asarray(cv2.imread(str(kept / "run.png")))
    assert picture.shape[1] > 1200 and len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_the_recording_is_read_by_another_library_than_wrote_it(kept: Path) -> None:
    with AnyReader([kept / "run.mcap"]) as reader:
        read = [(one, reader.deserialize(data, one.msgtype)) for one, _, data in reader.messages()]
    messages: dict[str, list[Any]] = {one.topic: [] for one, _ in read}
    for one, message in read:
        messages[one.topic].append(message)
    assert {(i.width, i.height, i.encoding) for i in messages["/limo_camera/image"]} == {(640, 480, "bgr8")}
    assert sum(len(found.detections) for found in messages["/detections"]) > 10
    # Up to the last command, a tenth of a second before the end.
    frames, steps = 10 * SECONDS, 50 * SECONDS - 4
    assert Counter((one.topic, one.msgtype) for one, _ in read) == {
        ("/limo_camera/image", "sensor_msgs/msg/Image"): frames,
        ("/limo_camera/depth/image_raw", "sensor_msgs/msg/Image"): frames,
        ("/limo_camera/camera_info", "sensor_msgs/msg/CameraInfo"): frames,
        ("/detections", "vision_msgs/msg/Detection2DArray"): frames,
        ("/cmd_vel", "geometry_msgs/msg/Twist"): frames,
        ("/odom", "nav_msgs/msg/Odometry"): steps,
        ("/tf", "tf2_msgs/msg/TFMessage"): steps,
        ("/clock", "rosgraph_msgs/msg/Clock"): steps,
        ("/imu", "sensor_msgs/msg/Imu"): 2 * steps,
        ("/tf_static", "tf2_msgs/msg/TFMessage"): 1,
        ("/scan", "sensor_msgs/msg/LaserScan"): 8 * SECONDS,
    }


def test_a_recording_says_how_the_scenarios_lens_bends(tmp_path: Path, answer_to: AnswerTo) -> None:
    scenario, path, card = (tmp_path / name for name in ("lens.toml", "run.mcap", "card.json"))
    scenario.write_text("[camera]\nk1 = -0.1\nk2 = 0.02\n", encoding="utf-8")
    told = answer_to("follow", "--scenario", scenario, "--seconds", 1, "--record", path, "--json", card).out
    assert f"written: {card}, {path}\n" in told
    infos = [record.message.d.tolist() for record in read_bag(path) if record.topic == "/limo_camera/camera_info"]
    assert infos and all(bends == [-0.1, 0.02, 0, 0, 0] for bends in infos)


def test_a_replay_says_what_its_differences_are_of(kept: Path, answer_to: AnswerTo) -> None:
    told = answer_to("replay", kept / "run.mcap", "--controller", "approach").out
    assert re.search(rf"^same detections +\d+ of the {10 * SECONDS} frames recorded with some *$", told, re.MULTILINE)
    assert re.search(r"^largest difference of forward speed +[\d.]+ m/s *$", told, re.MULTILINE)
    assert "differ where another detector, controller or version made the recording" in told


def test_a_recording_replayed_gives_the_same_detections(kept: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    film = tmp_path / "again.mp4"
    card = json.loads(answer_to("replay", kept / "run.mcap", "--json", "-", "--video", film).out)
    assert card["same_detections"] == card["frames_recorded_with_detections"] == card["frames"] == 10 * SECONDS
    assert card["frames_with_people"] > 10
    assert max(card["linear_difference_max"], card["angular_difference_max"]) < 1e-6
    assert frames_of(film) == 10 * SECONDS


def test_a_recording_without_the_camera_says_what_it_holds(kept: Path, answer_to: AnswerTo) -> None:
    code, _, err = answer_to("replay", kept / "run.mcap", "--ros-args", "-r", "limo_camera/image:=/other")
    assert code == 1 and "no images on /other; the recording holds /clock, /cmd_vel, " in err


@pytest.mark.parametrize(
    ("options", "display", "opens"),
    [("", ":0", True), ("--view off", ":0", False), ("--json -", ":0", False), ("", "", False)],
)
def test_follow_opens_its_page_unasked_where_a_display_is_and_else_says_how(
    options: str, display: str, opens: bool, monkeypatch: pytest.MonkeyPatch, answer_to: AnswerTo
) -> None:
    opened: list[bytes] = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(urllib.request.urlopen(url, timeout=10).read()))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    for name, value in (("DISPLAY", display), ("WAYLAND_DISPLAY", "")):
        monkeypatch.setenv(name, value)
    code, out, _ = answer_to("follow", "--seconds", 1, *options.split())
    assert (code, [b"<canvas" in page for page in opened]) == (0, [True] * opens)
    said = "To see the robot follow: limo-hog follow --view" in out
    assert said == (not opens and "--json" not in options)


def test_a_port_in_use_is_one_line(answer_to: AnswerTo) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        code, _, err = answer_to("follow", "--seconds", 1, "--view", taken.getsockname()[1])
    assert (code, err.count("\n")) == (1, 1) and "give --view another port" in err


@pytest.mark.parametrize(
    ("option", "file", "room"),
    [
        *(("--video", "run.mp4", room) for room in (0, 40_000)),
        *(("--record", "run.mcap", room) for room in (0, 40_000)),
        *(("--plot", "run.png", 300), ("--json", "run.json", 300)),
    ],
)
def test_a_full_disk_is_one_line_and_leaves_nothing(option: str, file: str, room: int, tmp_path: Path) -> None:
    done = on_a_full_disk(room, "follow", "--seconds", "3", option, str(tmp_path / file))
    assert (done.returncode, done.stderr) == (1, f"limo-hog: {tmp_path / file}: {os.strerror(errno.EFBIG)}\n")
    assert list(tmp_path.iterdir()) == []


def _followed(*options: object) -> subprocess.Popen[str]:
    command = [str(LIMO_HOG), "follow", *map(str, options)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _started(folder: Path) -> tuple[subprocess.Popen[str], Path, Path]:
    film, bag = folder / "run.mp4", folder / "run.mcap"
    return _followed("--seconds", 3600, "--video", film, "--record", bag), film, bag


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_run_that_is_stopped_leaves_whole_files(name: str, tmp_path: Path) -> None:
    process, film, bag = _started(tmp_path)
    deadline = time.monotonic() + 60
    while not any(part.stat().st_size > 1_000_000 for part in tmp_path.glob(".run.part-*.mcap")):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(getattr(signal, name))
    said = process.communicate(timeout=60)[1]
    assert (process.returncode, said) == (128 + getattr(signal, name), "limo-hog: stopped\n")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.mcap", "run.mp4"]
    images = sum(record.topic.endswith("/image") for record in read_bag(bag))
    assert abs(frames_of(film) - images) <= 1 <= frames_of(film)


SLOW = [pytest.param(seed, marks=[pytest.mark.slow, pytest.mark.timeout(1800)]) for seed in range(1, 101)]


@pytest.mark.parametrize("seed", [0, *SLOW])
def test_a_run_stopped_at_any_moment_leaves_whole_files_or_none(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    process, film, bag = _started(tmp_path)
    time.sleep(rng.uniform(0.2, 5.0))
    for _ in range(rng.randint(1, 3)):
        process.send_signal(rng.choice((signal.SIGINT, signal.SIGTERM, signal.SIGHUP)))
        time.sleep(rng.choice((0.0, 0.01, 0.1)))
    try:
        said = process.communicate(timeout=60)[1]
    finally:
        process.kill()
    assert {path.name for path in tmp_path.iterdir()} <= {"run.mp4", "run.mcap"}, (process.returncode, said)
    if film.exists():
        assert frames_of(film) > 0
    if bag.exists():
        assert sum(1 for _ in read_bag(bag)) > 0


def test_a_run_stopped_before_its_first_frame(here: Path, monkeypatch: pytest.MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr("limo_sim.run.episode.run_episode", Mock(side_effect=Stopped(signal.SIGTERM)))
    stopped = answer_to("follow", "--seconds", 1, "--video", "run.mp4", "--record", "run.mcap")
    assert (stopped.code, stopped.err) == (128 + signal.SIGTERM, "limo-hog: stopped\n")
    assert not (here / "run.mp4").exists()


def test_a_closed_terminal_does_not_stop_what_nohup_started(tmp_path: Path) -> None:
    command = ["nohup", str(LIMO_HOG), "follow", "--seconds", "4", "--json", str(tmp_path / "card.json")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(1.5)
    process.send_signal(signal.SIGHUP)
    assert process.wait(60) == 0 and (tmp_path / "card.json").exists()


def test_pages_that_do_not_read_hold_no_score_card_up(tmp_path: Path) -> None:
    with _followed("--seconds", 4, "--view", 0, "--json", tmp_path / "card.json") as process:
        assert process.stderr is not None
        with stalled(process.stderr.readline().split()[-1], 10):
            began = time.monotonic()
            assert process.wait(60) == 0 and time.monotonic() - began < 20
    assert json.loads((tmp_path / "card.json").read_text())["seconds"] == pytest.approx(4)


def test_ctrl_c_ends_a_run_that_is_paused_on_its_page() -> None:
    process = _followed("--seconds", 3600, "--view", 0)
    assert process.stderr is not None
    url = process.stderr.readline().split()[-1]

    async def pause() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(url + "live") as page:

            async def told(words: str) -> None:
                while words not in str((await page.receive(timeout=30)).data):
                    pass

            await page.send_str('{"do": "pause"}')
            await told('"paused": true')
            process.send_signal(signal.SIGINT)
            await told('"ended"')

    asyncio.run(pause())
    assert (process.communicate(timeout=30)[1], process.returncode) == ("limo-hog: stopped\n", 130)
