"""`limo-hog evaluate` measures detectors on labelled pictures."""

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.answers import AnswerTo

from limo_hog.cli.main import main
from limo_hog.cli.support.scene import street
from limo_hog.detector import PeopleDetector
from limo_hog.imaging.writing import write_image
from limo_hog.learn.evaluation.run import Rival, compare, evaluate
from limo_hog.learn.formats import read_labels


@pytest.fixture
def streets(tmp_path: Path) -> Path:
    """Drawn streets whose labels are what the detector itself finds, but for one person and one dog."""
    boxes = {}
    for i, size in enumerate([(192, 256), (256, 192), (64, 64)]):
        picture = street(*size, 3)
        write_image(tmp_path / "data" / f"{i}.png", picture)
        boxes[f"{i}.png"] = PeopleDetector().detect(picture).boxes.tolist()
    assert sum(map(len, boxes.values())) >= 2
    boxes["2.png"].append([10, 5, 15, 40])
    (tmp_path / "data" / "boxes.json").write_text(json.dumps(boxes))
    return tmp_path / "data"


def test_figures_come_as_json(streets: Path, answer_to: AnswerTo) -> None:
    objects = sum(map(len, json.loads((streets / "boxes.json").read_text()).values()))
    result = json.loads(answer_to("evaluate", "opencv", streets, "--json", "-").out)
    assert (result["pictures"], result["objects"], result["differences"]) == (3, objects, [])
    (model,) = result["models"]
    found = (objects - 1) / objects
    assert model["recall_1"] == pytest.approx(found)
    low, high = model["intervals"]["recall_1"]
    assert low <= found <= high > low
    assert sum(row["objects"] for row in model["by_height"]) == objects and model["ms"] > 0


def test_others_are_compared_on_the_same_draws(streets: Path, answer_to: AnswerTo) -> None:
    result = json.loads(answer_to("evaluate", "opencv", streets, "--against", "daimler", "--json", "-").out)
    first, other = result["models"]
    lamr = next(d for d in result["differences"] if d["figure"] == "lamr")
    assert (lamr["model"], lamr["difference"]) == ("daimler", pytest.approx(first["lamr"] - other["lamr"]))


def test_a_detector_differs_from_itself_by_nothing(streets: Path) -> None:
    detector = PeopleDetector(threshold=-1)
    _, (one, same) = evaluate([Rival("a", detector), Rival("b", detector)], read_labels(streets))
    for difference in compare(one, same):
        assert (difference.difference, *difference.interval) == (0, 0, 0)


def test_the_report_is_a_page_with_curve_and_mistakes(streets: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    out, heights = tmp_path / "report", ("--min-height", 64, "none")
    said = answer_to("evaluate", "opencv", streets, *heights, "--report", out, "--against", "daimler").out
    assert str(out / "index.html") in said
    assert sorted(path.name for path in out.iterdir()) == ["det.png", "figures.json", "index.html", "mistakes.png"]
    page = (out / "index.html").read_text("utf-8")
    assert "opencv 64 px" in page and "opencv as is" in page
    # Figures by their names, colours as they are, and how little so few objects tell.
    assert "recall_01" not in page and ">lamr<" not in page
    assert "False alarms in orange" in page and 'name="viewport"' in page
    warned = re.search(r"only \d+ objects?: below 50 these figures are mostly chance", said)
    assert warned is not None and warned[0] in page
    mistakes = json.loads((out / "figures.json").read_text())["mistakes"]
    assert [one["box"] for one in mistakes if one["kind"] == "missed"] == [[10, 5, 15, 40]]
    assert np.asarray(cv2.imread(str(out / "mistakes.png"))).std() > 10


def test_the_report_shows_the_first_look_apart_from_the_second(streets: Path, tmp_path: Path) -> None:
    out = tmp_path / "report"
    assert main(["evaluate", "limo", str(streets), "--against", "opencv", "--report", str(out), "--json", "-"]) == 0
    names = [model["model"] for model in json.loads((out / "figures.json").read_text())["models"]]
    assert names == ["limo", "limo, first look", "opencv"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda folder: (folder / "0.png").unlink(), "1 of which are not there, 0.png for one"),
        (lambda folder: (folder / "0.png").write_bytes(b"no"), "0.png: not an image"),
        (
            lambda folder: (folder / "boxes.json").write_text('{"0.png": [[500, 5, 20, 40]]}'),
            "no labelled box lies inside",
        ),
    ],
)
def test_bad_data_is_named_in_one_line(
    change: Any, told: str, streets: Path, tmp_path: Path, answer_to: AnswerTo
) -> None:
    change(streets)
    out, figures = tmp_path / "report", tmp_path / "x.json"
    code, _, err = answer_to("evaluate", "opencv", streets, "--report", out, "--json", figures)
    (shown,) = [line for line in err.splitlines() if "warning:" not in line]
    assert code == 1 and told in shown and not out.exists() and not figures.exists()


def test_a_curve_without_misses_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr("matplotlib.axes.Axes.text", lambda *at, **_: said.append(at[-1]))
    write_image(tmp_path / "a.png", street(192, 256, 3))
    found = PeopleDetector().detect(tmp_path / "a.png").boxes.tolist()
    for boxes, words in ((found, ["no misses"]), ([*found, [10, 5, 15, 40]], [])):
        (tmp_path / "boxes.json").write_text(json.dumps({"a.png": boxes}))
        said.clear()
        assert main(["evaluate", "limo", str(tmp_path), "--report", str(tmp_path / "report"), "--overwrite"]) == 0
        assert said == words


def test_boxes_left_out_are_told_as_warnings(streets: Path, answer_to: AnswerTo) -> None:
    boxes = json.loads((streets / "boxes.json").read_text())
    boxes["0.png"] += [[500, 5, 20, 40], [5, 5, 0, 40]]
    (streets / "boxes.json").write_text(json.dumps(boxes))
    first, second = answer_to("evaluate", "opencv", streets).err.strip().splitlines()
    assert first == "limo-hog: warning: 1 boxes without area are left out"
    assert second.endswith("0.png: 1 boxes outside of its 192 x 256 pixels are left out")
