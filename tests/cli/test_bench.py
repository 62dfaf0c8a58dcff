"""`limo-hog bench` times in turn, checks parity, and works without an OpenCV that has HOG."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import limo_hog
from limo_hog import detector
from limo_hog.cli import bench
from limo_hog.cli.main import main
from limo_hog.cli.support.race import race
from limo_hog.cli.support.scene import street


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "SECONDS", 0.05)


def _bench(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main(["bench", "--json", "-", *arguments]) == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    return result


def test_each_size_image_and_thread_count_is_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    result = _bench(capsys, "--size", "128x160", "96x256", "--threads", "1", "2")
    assert [(row["size"], row["channels"], row["threads"]) for row in result["rows"]] == [
        ([w, h], channels, threads) for w, h in ((128, 160), (96, 256)) for channels in (1, 3) for threads in (1, 2)
    ]
    for row in result["rows"]:
        assert row["rects_equal"] is True
        assert row["max_weight_diff"] < 1e-5
        assert 0 < row["limo_ms"]["min"] <= row["limo_ms"]["p50"]
        assert row["ratio"] == pytest.approx(row["cv2_ms"]["min"] / row["limo_ms"]["min"])
        assert row["backend"] == result["environment"]["backend"]
    assert result["environment"]["opencv"] == cv2.__version__


def test_without_a_rival_this_detector_is_timed_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(cv2, "HOGDescriptor")
    (row,) = _bench(capsys, "--size", "128x160", "--channels", "gray", "--threads", "1")["rows"]
    assert row["limo_ms"]["min"] > 0
    assert [row[name] for name in ("cv2_ms", "ratio", "rects_equal", "max_weight_diff")] == [None] * 4
    assert main(["bench", "--size", "128x160", "--channels", "gray", "--threads", "1"]) == 0
    assert "pip install 'opencv-python-headless<5' to compare" in capsys.readouterr().out


def test_other_rectangles_than_opencvs_are_an_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limo_hog.HOGDescriptor, "detectMultiScale", lambda *_, **__: ([[0, 0, 64, 128]], [1.0]))
    assert main(["bench", "--size", "128x160", "--channels", "gray", "--threads", "1"]) == 1
    shown = capsys.readouterr()
    assert "differ" in shown.out
    assert "other rectangles than OpenCV" in shown.err


def test_a_picture_of_ones_own_is_benched_in_its_own_size_or_another(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "own.png"
    cv2.imwrite(str(path), street(144, 192, 3))
    own = _bench(capsys, "--image", str(path), "--channels", "bgr", "--threads", "1")
    other = _bench(capsys, "--image", str(path), "--channels", "bgr", "--threads", "1", "--size", "96x128")
    assert own["rows"][0]["size"] == [144, 192]
    assert other["rows"][0]["size"] == [96, 128]


def test_calls_are_timed_in_turn_and_no_more_often_than_asked() -> None:
    called: list[str] = []
    timings = race([lambda: called.append("a"), lambda: called.append("b")], seconds=60, least=2, most=3)
    assert "".join(called) == "ab" * 4  # the first call of each does not count
    assert all(0 <= timing.min <= timing.p50 for timing in timings)


def test_the_street_is_the_same_each_time_and_has_people_in_it() -> None:
    picture = street(640, 480, 3)
    assert np.array_equal(picture, street(640, 480, 3))
    assert len(limo_hog.PeopleDetector().detect(picture)) >= 3


def test_a_guided_search_may_miss_what_the_exact_one_finds(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["--search", "guided", "--size", "128x160", "--channels", "gray", "--threads", "1"]
    (row,) = _bench(capsys, *arguments)["rows"]
    assert (row["search"], row["rects_equal"]) == ("guided", True)
    assert row["ratio"] > 0
    monkeypatch.setattr(bench, "street", lambda *_: street(640, 480, 1))
    monkeypatch.setitem(detector._GUIDES, "guided", (6, 0.0, (0.0, 0.0)))
    (row,) = _bench(capsys, *arguments)["rows"]
    assert row["rects_equal"] is False
