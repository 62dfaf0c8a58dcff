"""`limo-hog bench` times in turn, checks parity, and works without an OpenCV that has HOG."""

import json
from pathlib import Path
from typing import Any

import cv2
import pytest
from tests.answers import AnswerTo

import limo_hog
from limo_hog import detector
from limo_hog.cli import bench
from limo_hog.cli.support.race import race
from limo_hog.cli.support.scene import street


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "SECONDS", 0.05)


#: A row of the table.
SMALL = ("bench", "--size", "128x160", "--channels", "gray", "--threads", 1)


def rows_of(answer_to: AnswerTo, *words: object) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads(answer_to(*words, "--json", "-").out)["rows"]
    return rows


def test_each_size_image_and_thread_count_is_a_row(answer_to: AnswerTo) -> None:
    result = json.loads(answer_to("bench", "--size", "128x160", "96x256", "--threads", 1, 2, "--json", "-").out)
    assert [(row["size"], row["channels"], row["threads"]) for row in result["rows"]] == [
        ([w, h], channels, threads) for w, h in ((128, 160), (96, 256)) for channels in (1, 3) for threads in (1, 2)
    ]
    for row in result["rows"]:
        assert row["rects_equal"] is True and row["max_weight_diff"] < 1e-5
        assert 0 < row["limo_ms"]["min"] <= row["limo_ms"]["p50"]
        assert row["ratio"] == pytest.approx(row["cv2_ms"]["min"] / row["limo_ms"]["min"])
        assert row["backend"] == result["environment"]["backend"]
    assert result["environment"]["opencv"] == cv2.__version__


def test_without_a_rival_this_detector_is_timed_alone(answer_to: AnswerTo, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2, "HOGDescriptor")
    (row,) = rows_of(answer_to, *SMALL)
    unknown = [row[name] for name in ("cv2_ms", "ratio", "rects_equal", "max_weight_diff")]
    assert row["limo_ms"]["min"] > 0 and unknown == [None] * 4
    assert "pip install 'opencv-python-headless<5' to compare" in answer_to(*SMALL).out


def test_other_rectangles_than_opencvs_are_an_error(answer_to: AnswerTo, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limo_hog.HOGDescriptor, "detectMultiScale", lambda *_, **__: ([[0, 0, 64, 128]], [1.0]))
    code, out, err = answer_to(*SMALL)
    assert code == 1 and "differ" in out and "other rectangles than OpenCV" in err


def test_a_picture_of_ones_own_is_benched_in_its_own_size_or_another(answer_to: AnswerTo, tmp_path: Path) -> None:
    path = tmp_path / "own.png"
    cv2.imwrite(str(path), street(144, 192, 3))
    own = ("bench", "--image", path, "--channels", "bgr", "--threads", 1)
    sizes = [rows_of(answer_to, *own, *more)[0]["size"] for more in ((), ("--size", "96x128"))]
    assert sizes == [[144, 192], [96, 128]]


def test_calls_are_timed_in_turn_and_no_more_often_than_asked() -> None:
    called: list[str] = []
    timings = race([lambda: called.append("a"), lambda: called.append("b")], seconds=60, least=2, most=3)
    assert "".join(called) == "ab" * 4  # the first call of each does not count
    assert all(0 <= timing.min <= timing.p50 for timing in timings)


def test_a_guided_search_may_miss_people(answer_to: AnswerTo, monkeypatch: pytest.MonkeyPatch) -> None:
    (row,) = rows_of(answer_to, *SMALL, "--search", "guided")
    assert (row["search"], row["rects_equal"]) == ("guided", True) and row["ratio"] > 0
    monkeypatch.setattr(bench, "street", lambda *_: street(640, 480, 1))
    monkeypatch.setitem(detector._GUIDES, "guided", (6, 0.0, (0.0, 0.0)))
    (row,) = rows_of(answer_to, *SMALL, "--search", "guided")
    assert row["rects_equal"] is False
