"""An exported run holds what was seen, where it was, how far away, and which person it was."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from limo_hog.cli.main import main
from limo_hog.learn.formats import read_labels
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

SCENE = """
[[people]]
route = [[2.4, -0.8, 0.0], [2.4, 0.8, 0.0]]
speed = 0.4

[[people]]
route = [[3.6, 0.6, 0.0], [3.6, -0.6, 0.0]]
speed = 0.3
shirt = [150, 44, 40]

[[furniture]]
kind = "bollard"
x = 3.0
y = 0.2
"""


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    (folder / "scene.toml").write_text(SCENE)
    scene, out = str(folder / "scene.toml"), str(folder / "out")
    assert main(["export", "--scenario", scene, "--seconds", "4", "--out", out]) == 0
    return folder / "out"


def table(folder: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((folder / "annotations.json").read_text())
    return read


def test_the_pictures_are_the_arenas_and_depth_is_in_millimetres(exported: Path) -> None:
    first = table(exported)["images"][0]
    frame = Arena(Scenario.load(exported.parent / "scene.toml"), 0).frame()
    np.testing.assert_array_equal(cv2.imread(str(exported / first["file_name"])), frame.image)
    depth = cv2.imread(str(exported / first["depth_file_name"]), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    assert depth.dtype == np.uint16
    known = np.isfinite(frame.depth)
    assert np.abs(depth[known] / 1000.0 - frame.depth[known]).max() <= 0.00051
    assert (depth[~known] == 0).all()
    assert first["stamp"] == frame.stamp == 0.0


def test_every_frame_has_both_people_by_their_number_where_the_truth_has_them(exported: Path) -> None:
    data = table(exported)
    assert len(data["images"]) == 40
    people = [note for note in data["annotations"] if note["category_id"] == 1]
    for number, side in ((1, 2.4), (2, 3.6)):
        own = [note for note in people if note["track_id"] == number]
        assert len(own) > 30
        assert all(note["pose"][0] == side for note in own)
        assert len({note["image_id"] for note in own}) == len(own)
    for note in people:
        assert note["iscrowd"] == (note["visible"] < 0.65)
        image = data["images"][note["image_id"] - 1]
        depth = cv2.imread(str(exported / image["depth_file_name"]), cv2.IMREAD_UNCHANGED)
        assert depth is not None
        x, y, width, height = note["bbox"]
        if note["visible"] > 0.95:
            # The trunk, in the middle of the box, is as far ahead of the camera as the person.
            middle = depth[y + height // 3 : y + height // 2, x + width // 3 : x + 2 * width // 3] / 1000.0
            at_x, at_y, yaw = image["robot"]
            ahead = (note["pose"][0] - at_x) * math.cos(yaw) + (note["pose"][1] - at_y) * math.sin(yaw) - 0.084
            assert ((ahead - middle > -0.05) & (ahead - middle < 0.3)).mean() > 0.2
    assert any(note["iscrowd"] for note in people)


def test_furniture_has_a_box_of_its_own_kind(exported: Path) -> None:
    data = table(exported)
    kinds = {category["id"]: category["name"] for category in data["categories"]}
    pieces = [note for note in data["annotations"] if kinds[note["category_id"]] == "bollard"]
    assert pieces
    at_rest = next(note for note in pieces if note["image_id"] == 1)
    # 0.26 m broad and 0.92 m high, 2.916 m ahead of the camera at its middle.
    x, y, width, height = at_rest["bbox"]
    scale = 448.6 / 2.916
    assert width == pytest.approx(0.26 * scale, abs=3)
    assert height == pytest.approx(0.92 * scale, abs=7)
    assert x + width / 2 == pytest.approx(319.5 - 0.2 * scale, abs=3)
    assert y == pytest.approx(239.5 - (0.92 - 0.175) * scale, abs=4)


def test_the_labels_can_be_read_as_those_of_any_other_pictures(exported: Path) -> None:
    pictures = read_labels(exported / "annotations.json")
    assert len(pictures) == 40
    assert all(picture.path.is_file() for picture in pictures)
    assert sum(len(picture.boxes) for picture in pictures) == len(table(exported)["annotations"])
    assert any(box.ignored for picture in pictures for box in picture.boxes)


def test_an_earlier_export_is_not_replaced_unasked(exported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["export", "--scenario", "empty", "--seconds", "0.2", "--out", str(exported)]
    assert main(command) == 2
    assert "would be overwritten" in capsys.readouterr().err


def test_an_empty_room_gives_pictures_without_a_box(tmp_path: Path) -> None:
    assert main(["export", "--scenario", "empty", "--seconds", "0.5", "--out", str(tmp_path / "out")]) == 0
    data = table(tmp_path / "out")
    assert len(data["images"]) == 5
    assert data["annotations"] == []
