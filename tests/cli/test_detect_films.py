"""`detect` of films and live sources: numbered people, the live page, sources that do not wait or break off."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any
from unittest.mock import Mock
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, PICTURE, film_of, frames_of, lines_of
from tests.sim.view.browser import CHROMIUM, chromium

from limo_hog import Detections, PeopleDetector
from limo_hog.cli.main import main
from limo_hog.imaging import reading


def test_people_of_a_film_are_numbered_in_every_format(tmp_path: Path) -> None:
    pytest.importorskip("trackers", reason="needs limo-hog[track]")
    film_of(film := tmp_path / "walk.mp4")
    names = {name: tmp_path / f"people.{name}" for name in ("json", "csv", "mot", "coco")}
    options = [word for name, file in names.items() for word in (f"--{name}", str(file))]
    assert main(["detect", str(film), "--track", "--out", str(tmp_path / "out"), *options]) == 0
    assert frames_of(tmp_path / "out" / "walk.mp4") == 12
    results = lines_of(names["json"].read_text())
    known = [(row["frame"], who, *box) for row in results for who, box in zip(row["ids"], row["boxes"], strict=True)]
    assert max(Counter(who for _, who, *_ in known).values()) >= 8  # the street moves by 4 px a frame
    rows = csv.DictReader(names["csv"].read_text().splitlines())
    assert [tuple(int(row[name]) for name in ("frame", "id", *"xywh")) for row in rows] == known
    mot = np.loadtxt(names["mot"], delimiter=",", ndmin=2)[:, :6]
    assert [tuple(line) for line in mot - [1, 0, 1, 1, 0, 0]] == known  # it counts from 1
    coco = json.loads(names["coco"].read_text())["annotations"]
    assert [(note["image_id"] - 1, note["track_id"], *note["bbox"]) for note in coco] == known
    # Gone on with, numbers are those of one run.
    half = tmp_path / "half.json"
    half.write_text("".join(names["json"].read_text().splitlines(keepends=True)[:5]))
    assert main(["detect", str(film), "--track", "--json", str(half), "--resume"]) == 0
    assert [result["ids"] for result in lines_of(half.read_text())] == [result["ids"] for result in results]


#: Writes a film of noise.
_WRITTEN = """
import numpy as np, pathlib, sys
from limo_hog.imaging.writing import video_writer
with video_writer(pathlib.Path(sys.argv[1]), fps=25) as write:
    for picture in np.random.default_rng(0).integers(0, 255, (50, 17, 25, 3), np.uint8):
        write(picture.repeat(4, 0).repeat(4, 1))
"""


def test_a_film_is_of_the_same_bytes_whatever_was_in_memory(tmp_path: Path) -> None:
    for junk in ("1", "200"):  # what glibc fills memory with that was never written
        command = [sys.executable, "-c", _WRITTEN, str(tmp_path / junk)]
        subprocess.run(command, check=True, env=os.environ | {"MALLOC_PERTURB_": junk})
    assert (tmp_path / "1").read_bytes() == (tmp_path / "200").read_bytes()


def capture(frames: int, period_s: float = 0.01) -> Mock:
    """Stand for a `cv2.VideoCapture` that breaks off after some frames, whose grey is their number; 0: a closed one."""
    camera = Mock(number=0)

    def grab() -> bool:
        time.sleep(period_s)
        camera.number += 1
        return bool(camera.number <= frames)

    def retrieve() -> tuple[bool, Any]:
        return True, np.full((96, 96, 3), camera.number % 256, np.uint8)

    camera.configure_mock(isOpened=lambda: frames > 0, get=lambda _: 0.0, grab=grab, retrieve=retrieve)
    return camera


def play(monkeypatch: MonkeyPatch, *captures: Mock) -> None:
    """Let a live source be opened as these, one after another; then its user stops it."""
    monkeypatch.setattr(cv2, "VideoCapture", Mock(side_effect=[*captures, KeyboardInterrupt]))
    monkeypatch.setattr(reading, "RETRY_AFTER_S", (0.01, 0.02, 0.04))


@pytest.mark.parametrize("frames", [75, pytest.param(7500, marks=[pytest.mark.slow, pytest.mark.timeout(600)])])
def test_a_detector_slower_than_a_camera_gets_its_newest_frame(
    frames: int, monkeypatch: MonkeyPatch, answer_to: AnswerTo
) -> None:
    camera, behind = capture(frames, period_s=0.04), []

    def slow(_: PeopleDetector, image: np.ndarray[Any, Any]) -> Detections:
        behind.append((camera.number - int(image[0, 0, 0])) % 256)
        time.sleep(0.2)
        return Detections.none()

    monkeypatch.setattr(PeopleDetector, "detect", slow)
    play(monkeypatch, camera)
    code, _, said = answer_to("detect", 0)
    assert code == 0 and f"{frames - len(behind)} frames dropped" in said
    assert max(behind) <= 2 and len(behind) < frames / 3


@pytest.mark.parametrize(
    ("last", "code", "said"), [(4, 0, "7 frames; trying again for 0.07 s"), (0, 1, "3 frames, and did not come back")]
)
def test_a_stream_that_breaks_off_is_one_line_and_comes_back_or_fails(
    last: int, code: int, said: str, monkeypatch: MonkeyPatch, tmp_path: Path, answer_to: AnswerTo
) -> None:
    play(monkeypatch, *map(capture, (3, 0, 0, last)))
    answer = answer_to("detect", "rtsp://camera/live", "--out", tmp_path, "--json", "-")
    numbers = [result["frame"] for result in lines_of(answer.out)]
    assert answer.code == code and numbers == sorted(set(numbers)) and numbers[-1] == 2 + last
    assert frames_of(tmp_path / "live.mp4") == len(numbers)
    told = [line for line in answer.err.splitlines() if "broke off" in line]
    lines = ("3 frames; trying again for 0.07 s", said)
    assert told == [f"limo-hog: rtsp://camera/live: broke off after {line}" for line in lines]


#: `detect` of a camera of 50/s, which ends in a kill.
_KILLED = """
import cv2, os, sys
from tests.cli.test_detect_films import capture
from limo_hog.cli.main import main
cv2.VideoCapture = lambda *_: camera
camera = capture(200, period_s=0.02)
camera.release = lambda: os.kill(os.getpid(), 9)
main(["detect", "0", "--out", sys.argv[1], "--json", "-"])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_killed_run_loses_the_last_second_of_a_live_copy_alone(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _KILLED, str(tmp_path)]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], stdout=subprocess.PIPE, check=False)
    assert done.returncode == -9
    lost = len(done.stdout.splitlines()) - frames_of(tmp_path / "0.mp4")
    assert 0 < lost <= 25 + 20  # of 25/s, and what the encoder holds


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_shows_and_steers_a_film_in_real_time_and_then_the_next_run_there(tmp_path: Path) -> None:
    film_of(film := tmp_path / "walk.mp4", frames=600)
    command = [str(LIMO_HOG), "detect", str(film), "--view"]
    with chromium() as browser, subprocess.Popen([*command, "0"], stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        page = browser.new_page()
        page.goto(run.stderr.readline().split()[-1])
        expect(page.locator("#source")).to_have_text(str(film))
        expect(page.locator("#people")).not_to_have_text(re.compile("^[0–]$"))
        expect(page.locator("#margin")).to_have_text(f"{PeopleDetector().least_score:.2f}")
        page.locator("#threshold").fill("2.5")
        expect(page.locator("#margin")).to_have_text("2.50")
        expect(page.locator("#people")).to_have_text("0")  # none is as sure
        expect(page.locator("#rate")).to_have_text(re.compile(r"^(\d|10)\.\d/s$"))
        page.evaluate("send({set: 'speed', value: 1})")
        expect(page.locator("#complaint")).to_have_text("no parameter 'speed'; threshold is the only one")
        page.get_by_role("button", name="Pause").click()
        page.get_by_role("button", name="Go on").click()
        expect(page.get_by_role("button", name="Pause")).to_be_visible()
        assert page.locator("#camera").evaluate("image => image.naturalWidth") == PICTURE.shape[1]
        # A killed run says nothing. The page asks again and again, at first in vain, and shows what runs there next.
        run.kill()
        notice = page.locator("#notice")
        expect(notice).to_have_text("The run is over, or was stopped. What you see is the last it showed.")
        page.wait_for_timeout(3000)
        with subprocess.Popen([*command, str(urlsplit(page.url).port)], stderr=subprocess.DEVNULL) as another:
            expect(notice).to_be_hidden(timeout=30_000)
            expect(page.locator("#margin")).to_have_text(f"{PeopleDetector().least_score:.2f}")
            another.send_signal(signal.SIGINT)
            expect(notice).to_have_text(re.compile(r"^The run is over: \d+ frames, \d+ detections"))
