"""Labelled frames: boxes lie around what is seen, the same seed gives the same pictures."""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.sim.logs import drive, there

from limo_hog.cli.main import main
from limo_hog.follow.robot import LIMO
from limo_hog.learn.formats import read_labels
from limo_sim.run.arena import Arena
from limo_sim.run.export import labelled_frames
from limo_sim.world.scenario import Furniture, Person, Scenario

PILLAR = Furniture("pillar", 2.0, 0.3)


def arena_after_a_frame(*furniture: Furniture) -> Arena:
    arena = drive(Arena(Scenario("bare", furniture=furniture)), 0.2)
    arena.frame()
    return arena


def test_a_pillars_box_is_the_projection_of_its_cylinder() -> None:
    [(visible, box)] = arena_after_a_frame(PILLAR).furniture_in_frame()
    assert visible == pytest.approx(1.0, abs=0.02)
    assert box is not None
    ahead, focal = PILLAR.x - LIMO.camera_x, LIMO.focal_px(640)
    distance = math.hypot(ahead, PILLAR.y)
    half = math.asin(0.15 / distance)
    left, right = (319.5 - focal * math.tan(math.atan2(PILLAR.y, ahead) + side) for side in (half, -half))
    assert (box[0], box[0] + box[2]) == pytest.approx((left, right), abs=2)
    # Of the edge nearest to the camera.
    assert box[1] == pytest.approx(239.5 - focal * (1.1 - LIMO.camera_z) / (distance - 0.15), abs=3)


def test_what_is_hidden_cut_off_or_behind_the_robot_counts_as_unseen() -> None:
    (near, _), (far, box) = arena_after_a_frame(PILLAR, Furniture("cone", 3.5, 0.585)).furniture_in_frame()
    assert near > 0.98 and far < 0.05 and box is not None
    [(visible, box)] = arena_after_a_frame(Furniture("pillar", 2.0, 1.3)).furniture_in_frame()
    assert 0 < visible < 0.9 and box is not None and box[0] == 0
    assert arena_after_a_frame(Furniture("pillar", -2.0, 0.0)).furniture_in_frame() == [(0.0, None)]


def test_the_robot_wanders_and_the_same_seed_gives_the_same_pictures() -> None:
    scenario = Scenario("one", people=(Person(route=((2.0, 0.0, 1.0),)),), furniture=(Furniture("cone", 2.5, -0.6),))
    runs = [list(labelled_frames(scenario, seed, 12, 1.0)) for seed in (3, 3, 4)]
    for (one, things), (other, same) in zip(runs[0], runs[1], strict=True):
        np.testing.assert_array_equal(one.image, other.image)
        assert things == same
    assert any(one.truth.robot != other.truth.robot for (one, _), (other, _) in zip(runs[0], runs[2], strict=True))
    x, y = np.array([frame.truth.robot[:2] for frame, _ in runs[0]]).T
    assert np.hypot(np.ptp(x), np.ptp(y)) > 1
    assert {thing.label for run in runs for _, things in run for thing in things} == {"person", "cone"}
    assert all(frame.truth.contacts.wall == 0 for run in runs for frame, _ in run)


def test_what_is_written_is_coco_with_depth_and_identities(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    command = ["export", "--scenario", "two_people", "--out", str(out), "--frames", "8", "--depth"]
    assert main(command) == 0
    data = json.loads((out / "coco.json").read_text())
    told = f"{out}: pictures: 8, labelled things: {len(data['annotations'])}, labels: coco.json\n"
    assert capsys.readouterr().out == told
    before = sorted(out.rglob("*"))
    assert main(command) == 2
    assert "would be overwritten" in capsys.readouterr().err and sorted(out.rglob("*")) == before
    assert [image["stamp"] for image in data["images"]] == sorted({image["stamp"] for image in data["images"]})
    assert {note["track_id"] for note in data["annotations"]} <= {0, 1}
    assert all(note["iscrowd"] == (note["visible"] < 0.65) for note in data["annotations"])
    pictures = read_labels(out / "coco.json")
    assert len(pictures) == 8 and sum(len(picture.boxes) for picture in pictures) == len(data["annotations"]) > 0
    note = next(note for note in data["annotations"] if note["visible"] > 0.95)
    image = data["images"][note["image_id"] - 1]
    depth = there(cv2.imread(str(out / image["depth_file_name"]), cv2.IMREAD_UNCHANGED))
    assert depth.dtype == np.uint16
    x, y, w, h = note["bbox"]
    on, beside = (depth[y + h // 3 : y + h // 2, x + w // 2 + shift] for shift in (0, w))
    assert np.median(on[on > 0]) < np.median(beside) or np.median(beside) == 0


@pytest.mark.parametrize("more", [[], ["--resume"]])
def test_a_folder_of_others_stays(more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("")
    assert main(["export", "--out", str(tmp_path), *more]) == 2
    assert "would be overwritten" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_killed_export_is_completed_as_if_it_had_not_been(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    typed = ["export", "--scenario", "standing", "--every", "0.2", "--frames", "4", "--out"]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert main([*typed, str(whole)]) == 0
    command = [sys.executable, "-m", "limo_hog", *typed, str(killed)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as child:
        while not list(killed.glob("images/0*.png")):
            assert child.poll() is None
            time.sleep(0.01)
        child.kill()
    assert main([*typed, str(killed), "--seed", "1", "--resume"]) == 2
    assert "of another run" in capsys.readouterr().err
    assert main([*typed, str(killed), "--resume"]) == 0
    for path in filter(Path.is_file, whole.rglob("*")):
        assert (killed / path.relative_to(whole)).read_bytes() == path.read_bytes()
