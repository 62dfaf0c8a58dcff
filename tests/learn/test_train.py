"""`limo-hog train` makes a detector that OpenCV loads, and leaves nothing half-written."""

import json
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG
from tests.learn import bollards as drawn

import limo_hog
from limo_hog.cli.main import main
from limo_hog.imaging.writing import write_image
from limo_hog.models import load_model


@pytest.fixture(scope="module")
def bollards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bollards")
    drawn.write(folder, pictures=16, seed=0)
    return folder


@pytest.fixture(scope="module")
def trained(bollards: Path) -> Path:
    model = bollards.parent / "models" / "bollard.yml"
    assert main(["train", str(bollards), "--out", str(model), "--rounds", "1"]) == 0
    return model


def test_opencv_loads_the_detector_and_finds_the_same_rectangles(trained: Path, bollards: Path) -> None:
    image = np.asarray(cv2.imread(str(bollards / "0003.png")), np.uint8)
    theirs, ours = cv2.HOGDescriptor(), limo_hog.HOGDescriptor()
    assert theirs.load(str(trained)) and ours.load(str(trained))
    options: Any = (image, -0.5, (8, 8), (4, 4), 1.05, 0)
    (expected, weights), (found, scores) = theirs.detectMultiScale(*options), ours.detectMultiScale(*options)
    assert len(expected) > 0
    assert sorted(map(tuple, np.asarray(found).tolist())) == sorted(map(tuple, np.asarray(expected).tolist()))
    assert np.sort(np.ravel(scores)) == pytest.approx(np.sort(np.ravel(weights)), abs=1e-5)


def test_the_card_says_what_the_detector_is_and_was_made_of(trained: Path, bollards: Path) -> None:
    card = json.loads(trained.with_name("bollard.yml.json").read_text())
    assert card["window"][0] % 8 == 0 and [row["round"] for row in card["rounds"]] == [0, 1]
    assert (card["data"][0]["files"], len(card["data"][0]["sha256"]), card["figures"]["pictures"]) == (16, 64, 3)
    assert str(bollards.parent) not in json.dumps(card)
    model = load_model(trained)
    assert (model.person_box, model.threshold) == (tuple(card["person_box"]), card["threshold"])
    assert model.calibration is not None and model.calibration.slope > 0
    assert sorted(path.name for path in trained.parent.iterdir()) == ["bollard.yml", "bollard.yml.json"]


def test_the_detector_finds_what_it_was_trained_on(trained: Path, bollards: Path) -> None:
    boxes = json.loads((bollards / "boxes.json").read_text())
    image = np.asarray(cv2.imread(str(bollards / "0000.png")), np.uint8)
    found = limo_hog.PeopleDetector(model=trained, min_height=48).detect(image)
    assert len(found) > 0
    x, y, _, h = found.boxes[0].tolist()
    assert any(abs(x - bx) < 10 and abs(y + h - by - bh) < 15 for bx, by, bw, bh in boxes["0000.png"])
    assert found.probabilities[0] > 0.5


def test_the_same_command_writes_the_same_bytes(trained: Path, bollards: Path, tmp_path: Path) -> None:
    again = tmp_path / "bollard.yml"
    assert main(["train", str(bollards), "--out", str(again), "--rounds", "1"]) == 0
    for name in ("bollard.yml", "bollard.yml.json"):
        assert (tmp_path / name).read_bytes() == trained.with_name(name).read_bytes()


@pytest.mark.parametrize(
    ("typed", "code", "complaint"),
    [
        ("missing", 1, "missing: no such file"),
        ("{crops}", 1, "there are crops only"),
        ("{empty} --negatives {crops}", 1, "no image or video in this folder"),
        ("{data} --label cow", 1, "no box has the label 'cow'"),
        ("{data} --window 60x60", 2, "multiples of 8"),
    ],
)
def test_bad_data_is_named_in_one_line_and_nothing_is_written(
    typed: str, code: int, complaint: str, bollards: Path, tmp_path: Path, answer_to: AnswerTo
) -> None:
    write_image(tmp_path / "crops" / "a.png", np.zeros((64, 64), np.uint8))
    (tmp_path / "empty").mkdir()
    given = typed.format(data=bollards, crops=tmp_path / "crops", empty=tmp_path / "empty").split()
    ended = answer_to("train", *given, "--out", tmp_path / "out" / "model.yml")
    (error,) = [line for line in ended.err.splitlines() if "warning:" not in line]
    assert ended.code == code and error.startswith("limo-hog: ") and complaint in error
    assert [*(tmp_path / "out").glob("*")] == []


def test_ctrl_c_keeps_the_last_round(bollards: Path, tmp_path: Path) -> None:
    out = tmp_path / "bollard.yml"
    command = [str(LIMO_HOG), "train", str(bollards), "--out", str(out), "--rounds", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("round 0"):
                process.send_signal(signal.SIGINT)
                break
        rest = process.stderr.read()
        assert process.wait(60) == 130
    assert f"{out} is round 0" in rest
    assert [row["round"] for row in json.loads(out.with_name("bollard.yml.json").read_text())["rounds"]] == [0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bollard.yml", "bollard.yml.json"]


@pytest.mark.slow
def test_the_arenas_bollards_are_learnt_and_found_in_unseen_pictures(here: Path, answer_to: AnswerTo) -> None:
    """The commands of docs/training.md."""
    for words in ("--out a --frames 500 --seed 0", "--out b --frames 150 --seed 1"):
        assert answer_to("export", "--scenario", "bollards", *words.split()).code == 0
    start = time.perf_counter()
    assert answer_to(*"train a --label bollard --out bollard.yml".split()).code == 0
    assert time.perf_counter() - start < 280
    measured = answer_to(*"evaluate bollard.yml b --label bollard --min-height 48 --json -".split())
    assert json.loads(measured.out)["models"][0]["ap"] >= 0.95
    # The robot drives to the nearest bollard.
    typed = ("follow", "--scenario", "bollards", "--controller", "approach", "--detector", "hog:bollard.yml")
    card = json.loads(answer_to(*typed, "--seconds", 15, "--json", "-").out)
    assert card["path_m"] > 0.5 and card["contacts_wall"] == 0
