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
import threading
import time
import urllib.request
from collections import Counter
from pathlib import Path
from typing import Any

import aiohttp
import av
import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, PICTURE, frames_of, on_a_full_disk
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


def test_the_film_is_h264_with_a_frame_for_each_of_the_cameras(kept: Path) -> None:
    frames = json.loads((kept / "card.json").read_text())["frames"]
    with av.open(kept / "run.mp4") as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 640, 480)
        assert stream.average_rate == 10 and len(list(container.decode(stream))) == frames == 10 * SECONDS


def test_the_figure_is_a_picture_with_something_on_it(kept: Path) -> None:
    picture = np.asarray(cv2.imread(str(kept / "run.png")))
    assert picture.shape[1] > 1200 and len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_the_recording_is_read_by_another_library_than_wrote_it(kept: Path) -> None:
    counts: Counter[tuple[str, str]] = Counter()
    boxes = 0
    with AnyReader([kept / "run.mcap"]) as reader:
        for connection, _, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            counts[connection.topic, connection.msgtype] += 1
            if connection.topic == "/limo_camera/image":
                assert (message.width, message.height, message.encoding) == (640, 480, "bgr8")
            elif connection.topic == "/detections":
                boxes += len(message.detections)
    frames = 10 * SECONDS
    # Up to the last command, a tenth of a second before the end.
    steps = 50 * SECONDS - 4
    assert counts == {
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
    assert boxes > 10


def test_a_recording_says_how_the_scenarios_lens_bends(tmp_path: Path) -> None:
    scenario, path = tmp_path / "lens.toml", tmp_path / "run.mcap"
    scenario.write_text("[camera]\nk1 = -0.1\nk2 = 0.02\n", encoding="utf-8")
    assert main(["follow", "--scenario", str(scenario), "--seconds", "1", "--record", str(path)]) == 0
    with AnyReader([path]) as reader:
        infos = [topic for topic in reader.connections if topic.topic == "/limo_camera/camera_info"]
        messages: list[Any] = [reader.deserialize(data, topic.msgtype) for topic, _, data in reader.messages(infos)]
        told = {tuple(message.d) for message in messages}
    assert told == {(-0.1, 0.02, 0.0, 0.0, 0.0)}


def test_follow_says_what_it_has_written(tmp_path: Path, answer_to: AnswerTo) -> None:
    card, plot = tmp_path / "card.json", tmp_path / "run.png"
    code, told, _ = answer_to("follow", "--seconds", 1, "--json", card, "--plot", plot)
    assert code == 0 and f"written: {card}, {plot}\n" in told


def test_a_replay_says_what_its_differences_are_of(kept: Path, answer_to: AnswerTo) -> None:
    code, told, _ = answer_to("replay", kept / "run.mcap", "--controller", "approach")
    assert re.search(rf"^same detections +\d+ of the {10 * SECONDS} frames recorded with some *$", told, re.MULTILINE)
    assert re.search(r"^largest difference of forward speed +[\d.]+ m/s *$", told, re.MULTILINE)
    assert code == 0 and "differ where another detector, controller or version made the recording" in told


def test_a_recording_replayed_gives_the_same_detections(kept: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    film = tmp_path / "again.mp4"
    card = json.loads(answer_to("replay", kept / "run.mcap", "--json", "-", "--video", film).out)
    assert card["same_detections"] == card["frames_recorded_with_detections"] == card["frames"] == 10 * SECONDS
    assert card["frames_with_people"] > 10
    assert card["linear_difference_max"] < 1e-6 and card["angular_difference_max"] < 1e-6
    assert frames_of(film) == 10 * SECONDS


def test_a_recording_without_the_camera_says_what_it_holds(kept: Path, answer_to: AnswerTo) -> None:
    code, _, told = answer_to("replay", kept / "run.mcap", "--ros-args", "-r", "limo_camera/image:=/other")
    assert code == 1 and "no images on /other; the recording holds /clock, /cmd_vel, " in told


def at_a_display(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Have a terminal, and beside it a browser: the pages that it opens."""
    pages: list[bytes] = []

    def look(url: str) -> bool:
        with urllib.request.urlopen(url, timeout=10) as page:
            pages.append(page.read())
        return True

    monkeypatch.setattr("webbrowser.open", look)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    return pages


@pytest.mark.parametrize(
    ("options", "display", "opens"),
    [("", True, True), ("--view off", True, False), ("--json -", True, False), ("", False, False)],
)
def test_follow_opens_its_page_unasked_where_a_display_is_and_else_says_how(
    options: str, display: bool, opens: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = at_a_display(monkeypatch)
    if not display:
        monkeypatch.delenv("DISPLAY")
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["follow", "--seconds", "1", *options.split()]) == 0
    assert [b"<canvas" in page for page in opened] == [True] * opens
    said = "To see the robot follow: limo-hog follow --view" in capsys.readouterr().out
    assert said == (not opens and "--json" not in options)


@pytest.mark.parametrize("typed", ["follow --video a.mp4 --json a.json", "detect a.png --json j --csv c --out o"])
def test_a_port_in_use_is_one_line_and_leaves_no_file_or_thread(typed: str, here: Path, answer_to: AnswerTo) -> None:
    cv2.imwrite("a.png", PICTURE)
    before = threading.enumerate()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, out, complaint = answer_to(*typed.split(), "--view", port)
    assert (code, out, complaint.count("\n")) == (1, "", 1)
    assert complaint.startswith(f"limo-hog: the page cannot be served at 127.0.0.1:{port}: ")
    assert complaint.endswith("; give --view another port\n")
    assert threading.enumerate() == before and [path.name for path in here.iterdir()] == ["a.png"]


FULL = [("--video", "run.mp4", 0), ("--video", "run.mp4", 40_000), ("--record", "run.mcap", 0)]
FULL += [("--record", "run.mcap", 40_000), ("--plot", "run.png", 300), ("--json", "run.json", 300)]


@pytest.mark.parametrize(("option", "file", "room"), FULL)
def test_a_full_disk_is_one_line_and_leaves_nothing(option: str, file: str, room: int, tmp_path: Path) -> None:
    done = on_a_full_disk(room, "follow", "--seconds", "3", option, str(tmp_path / file))
    assert (done.returncode, done.stderr) == (1, f"limo-hog: {tmp_path / file}: {os.strerror(errno.EFBIG)}\n")
    assert list(tmp_path.iterdir()) == []


def _started(*options: object, seconds: int = 3600, by: tuple[str, ...] = ()) -> subprocess.Popen[str]:
    command = [*by, str(LIMO_HOG), "follow", "--seconds", str(seconds), *map(str, options)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def _address(run: subprocess.Popen[str]) -> str:
    assert run.stderr is not None
    return run.stderr.readline().split()[-1]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_run_that_is_stopped_leaves_whole_files(name: str, tmp_path: Path) -> None:
    film, bag = tmp_path / "run.mp4", tmp_path / "run.mcap"
    process = _started("--video", film, "--record", bag)
    deadline = time.monotonic() + 60
    while not any(part.stat().st_size > 1_000_000 for part in tmp_path.glob(".run.part-*.mcap")):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(getattr(signal, name))
    said = process.communicate(timeout=60)[1]
    assert (process.returncode, said) == (128 + getattr(signal, name), "limo-hog: stopped\n")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.mcap", "run.mp4"]
    with AnyReader([bag]) as reader:
        images = sum(connection.msgcount for connection in reader.connections if connection.topic.endswith("/image"))
    assert frames_of(film) > 0 and abs(frames_of(film) - images) <= 1


SLOW = [pytest.param(seed, marks=[pytest.mark.slow, pytest.mark.timeout(1800)]) for seed in range(1, 101)]


@pytest.mark.parametrize("seed", [0, *SLOW])
def test_a_run_stopped_at_any_moment_leaves_whole_files_or_none(seed: int, tmp_path: Path) -> None:
    rng, film, bag = random.Random(seed), tmp_path / "run.mp4", tmp_path / "run.mcap"
    process = _started("--video", film, "--record", bag)
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


def test_a_run_that_is_stopped_before_its_first_frame_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise Stopped(signal.SIGTERM)

    monkeypatch.setattr("limo_sim.run.episode.run_episode", stop)
    files = ["--video", str(tmp_path / "run.mp4"), "--record", str(tmp_path / "run.mcap")]
    assert main(["follow", "--seconds", "1", *files]) == 128 + signal.SIGTERM
    assert capsys.readouterr().err == "limo-hog: stopped\n"
    assert not (tmp_path / "run.mp4").exists()


def test_a_closed_terminal_does_not_stop_what_nohup_started(tmp_path: Path) -> None:
    process = _started("--json", tmp_path / "card.json", seconds=4, by=("nohup",))
    time.sleep(1.5)
    process.send_signal(signal.SIGHUP)
    process.communicate(timeout=60)
    assert process.returncode == 0 and (tmp_path / "card.json").exists()


def test_pages_that_do_not_read_hold_no_score_card_up(tmp_path: Path) -> None:
    process = _started("--view", 0, "--json", tmp_path / "card.json", seconds=4)
    with process, stalled(_address(process), 10):
        began = time.monotonic()
        assert process.wait(60) == 0
        assert time.monotonic() - began < 20
    assert json.loads((tmp_path / "card.json").read_text())["seconds"] == pytest.approx(4)


def test_ctrl_c_ends_a_run_that_is_paused_on_its_page() -> None:
    process = _started("--view", 0)

    async def pause() -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(_address(process) + "live") as page:
            await page.send_str('{"do": "pause"}')
            while '"paused": true' not in str((await page.receive(timeout=30)).data):
                pass
            process.send_signal(signal.SIGINT)
            # The page is told that it is over.
            while '"ended"' not in str((await page.receive(timeout=30)).data):
                pass

    asyncio.run(pause())
    assert process.communicate(timeout=30)[1] == "limo-hog: stopped\n"
    assert process.returncode == 130
