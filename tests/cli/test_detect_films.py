"""`detect` of films and live sources: numbered people, the live page, sources that do not wait or break off."""

from __future__ import annotations

import asyncio
import csv
import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import cv2
import numpy as np
import pytest
from tests.cli.material import PICTURE, film_of, frames_of, lines_of

from limo_hog import Detections, PeopleDetector
from limo_hog.cli.main import main
from limo_hog.imaging import reading
from limo_hog.models import load_model


@pytest.fixture
def film(tmp_path: Path) -> Path:
    film_of(tmp_path / "walk.mp4")
    return tmp_path / "walk.mp4"


def test_people_of_a_film_are_numbered_in_every_format(film: Path, tmp_path: Path) -> None:
    pytest.importorskip("trackers", reason="needs limo-hog[track]")
    names = {name: tmp_path / f"people.{name}" for name in ("json", "csv", "mot", "coco")}
    options = [word for name, file in names.items() for word in (f"--{name}", str(file))]
    assert main(["detect", str(film), "--track", "--out", str(tmp_path / "out"), *options]) == 0
    assert frames_of(tmp_path / "out" / "walk.mp4") == 12
    results = lines_of(names["json"].read_text())
    assert all(len(result["ids"]) == len(result["boxes"]) for result in results)
    known = [(result["frame"], who) for result in results for who in result["ids"]]
    counts = [sum(who == one for _, who in known) for one in {who for _, who in known}]
    assert max(counts) >= 8  # the street moves by 4 px a frame
    rows = list(csv.DictReader(names["csv"].read_text().splitlines()))
    assert [(int(row["frame"]), int(row["id"])) for row in rows] == known
    mot = np.loadtxt(names["mot"], delimiter=",", ndmin=2)
    assert [(int(frame) - 1, int(who)) for frame, who in mot[:, :2]] == known
    assert mot[0, 2:6].tolist() == [int(rows[0]["x"]) + 1, int(rows[0]["y"]) + 1, int(rows[0]["w"]), int(rows[0]["h"])]
    assert [one["track_id"] for one in json.loads(names["coco"].read_text())["annotations"]] == [
        who for _, who in known
    ]
    # Gone on with, numbers are those of one run.
    half = tmp_path / "half.json"
    half.write_text("".join(names["json"].read_text().splitlines(keepends=True)[:5]))
    assert main(["detect", str(film), "--track", "--json", str(half), "--resume"]) == 0
    assert [result["ids"] for result in lines_of(half.read_text())] == [result["ids"] for result in results]


def test_a_film_without_the_tracker_names_the_line_that_installs_it(
    film: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "trackers", None)
    assert main(["detect", str(film), "--track"]) == 1
    assert "tracking people needs trackers: pip install 'limo-hog[track]'" in capsys.readouterr().err


class Camera:
    """Stands for `cv2.VideoCapture`: each opening plays the next of some scripts, at a rate.

    A script is how many frames come before it breaks off; 0 cannot be opened. After the last, its user stops it.
    """

    scripts: Iterator[int]
    period_s = 0.0
    newest = 0

    def __init__(self, *_: object) -> None:
        self._left = next(Camera.scripts, -1)
        if self._left < 0:
            raise KeyboardInterrupt

    def isOpened(self) -> bool:
        return self._left > 0

    def get(self, _: int) -> float:
        return 0.0

    def grab(self) -> bool:
        time.sleep(Camera.period_s)
        self._left -= 1
        Camera.newest += self._left >= 0
        return self._left >= 0

    def retrieve(self) -> tuple[bool, np.ndarray[Any, Any]]:
        return True, np.full((96, 96, 3), Camera.newest % 256, np.uint8)

    def release(self) -> None:
        pass


def play(monkeypatch: pytest.MonkeyPatch, *scripts: int, period_s: float = 0.01) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", Camera)
    monkeypatch.setattr(reading, "RETRY_AFTER_S", (0.01, 0.02, 0.04))
    Camera.scripts, Camera.period_s, Camera.newest = iter(scripts), period_s, 0


def test_a_detector_slower_than_a_camera_gets_its_newest_frame(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    behind = []

    def slow(_: PeopleDetector, image: np.ndarray[Any, Any]) -> Detections:
        behind.append((Camera.newest - int(image[0, 0, 0])) % 256)
        time.sleep(0.2)
        return Detections.none()

    monkeypatch.setattr(PeopleDetector, "detect", slow)
    play(monkeypatch, 75, period_s=0.04)
    assert main(["detect", "0"]) == 0
    told = capsys.readouterr().err
    assert max(behind) <= 2
    assert len(behind) < 25
    assert f"{75 - len(behind)} frames dropped" in told


def test_a_stream_that_breaks_off_is_one_line_and_comes_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    play(monkeypatch, 3, 0, 0, 4)
    assert main(["detect", "rtsp://camera/live", "--out", str(tmp_path), "--json", "-"]) == 0
    shown = capsys.readouterr()
    numbers = [result["frame"] for result in lines_of(shown.out)]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == 6
    assert frames_of(tmp_path / "live.mp4") == len(numbers)
    assert [line for line in shown.err.splitlines() if "broke off" in line] == [
        "limo-hog: rtsp://camera/live: broke off after 3 frames; trying again for 0.07 s",
        "limo-hog: rtsp://camera/live: broke off after 7 frames; trying again for 0.07 s",
    ]


def test_a_stream_that_stays_away_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    play(monkeypatch, 3, 0, 0, 0)
    assert main(["detect", "0"]) == 1
    assert "limo-hog: 0: broke off after 3 frames, and did not come back\n" in capsys.readouterr().err


#: `detect` of a camera of 50/s, whose copy is in pieces of .5 s.
_KILLED = """
import cv2, sys
from tests.cli.test_detect_films import Camera
from limo_hog.cli.main import main
from limo_hog.cli.support import pictures
cv2.VideoCapture, pictures.PIECE_S, Camera.scripts, Camera.period_s = Camera, 0.5, iter([10_000]), 0.02
main(["detect", "0", "--out", sys.argv[1], "--json", "-"])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_killed_run_loses_the_open_piece_of_a_live_copy_alone(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", _KILLED, str(tmp_path)]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        searched = 0
        while not (tmp_path / "0-2.mp4").exists() and run.stdout.readline():
            searched += 1
        run.kill()
        searched += len(run.stdout.readlines())
    kept = [frames_of(tmp_path / name) for name in ("0.mp4", "0-2.mp4")]
    assert min(kept) > 0
    assert 0 < searched - sum(kept) <= 27  # .5 s, the frame that began the piece, and one under way


def test_pieces_of_an_earlier_run_are_not_overwritten(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "0-2.mp4").touch()
    play(monkeypatch, 3)
    assert main(["detect", "0", "--out", str(tmp_path)]) == 2
    assert "0-2.mp4" in capsys.readouterr().err


async def _look(url: str, seen: dict[str, Any]) -> None:
    async with aiohttp.ClientSession() as session:
        async with session.get(url) as answer:
            seen["page"] = await answer.text()
        async with session.ws_connect(url + "live") as page:
            seen["welcome"] = await page.receive_json(timeout=20)
            await page.send_json({"set": "threshold", "value": 2.5})
            await page.send_json({"set": "speed", "value": 1})
            async for message in page:
                if message.type is aiohttp.WSMsgType.BINARY:
                    seen["picture"] = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
                else:
                    seen |= json.loads(message.data)


def test_the_page_shows_a_film_and_sets_the_threshold(
    film: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: dict[str, Any] = {}
    client: list[threading.Thread] = []

    def look(url: str) -> None:
        client.append(threading.Thread(target=lambda: asyncio.run(_look(url, seen))))
        client[0].start()

    monkeypatch.setattr("limo_hog.cli.detect.announce", look)
    film_of(film, frames=25)
    start = time.monotonic()
    assert main(["detect", str(film), "--view", "0"]) == 0
    assert time.monotonic() - start > 2.3  # 25 frames at 10/s: in real time
    client[0].join(20)
    assert "film.js" in seen["page"]
    assert seen["welcome"]["threshold"]["value"] == load_model("limo").threshold
    assert seen["state"]["threshold"] == 2.5
    assert seen["complaint"] == "no parameter 'speed'; threshold is the only one"
    assert seen["picture"].shape == PICTURE.shape
    assert seen["state"]["source"] == str(film)
    assert seen["state"]["people"] == 0  # none is as sure
    assert seen["ended"]["summary"] in capsys.readouterr().err
