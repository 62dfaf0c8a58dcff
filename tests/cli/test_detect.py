"""`limo-hog detect` finds people in whatever it is given, and keeps what is done whatever happens."""

import csv
import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.cli.material import LIMO_HOG, OPENCVS, PICTURE, film_of, lines_of

import limo_hog
from limo_hog.cli.main import main
from limo_hog.cli.support.scene import street
from limo_hog.detector import PeopleDetector
from limo_hog.imaging.writing import write_image


def test_results_are_lines_in_the_order_of_the_inputs(pictures: Path, answer_to: AnswerTo) -> None:
    results = lines_of(answer_to("detect", pictures, "--json", "-").out)
    assert [Path(r["source"]).name for r in results] == ["a.png", "c.png", "b.png"]
    first, expected = results[0], PeopleDetector().detect(PICTURE)
    assert (first["boxes"], first["scores"]) == (expected.boxes.tolist(), expected.scores.tolist()) != ([], [])
    assert first["probabilities"] == [round(share, 4) for share in expected.probabilities.tolist()]
    assert (first["frame"], first["width"], first["height"]) == (0, 192, 256)
    assert results[1]["boxes"] == []


def test_annotated_copies_lie_as_the_pictures_lie(pictures: Path, tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    write_image(pictures / "a.bmp", PICTURE)
    out = tmp_path / "out"
    assert main(["detect", str(pictures), "--out", str(out)]) == 0
    copies = sorted(str(p.relative_to(out)) for p in out.rglob("*") if p.is_file())
    assert copies == ["a.bmp.png", "a.png.png", "c.png", "deep/b.png"]
    drawn = np.asarray(cv2.imread(str(out / "a.png.png")))
    assert drawn.shape == PICTURE.shape and (drawn != PICTURE).any()
    # Also those of pictures above the current folder.
    before = {*tmp_path.rglob("*.png")}
    monkeypatch.chdir(pictures / "deep")
    assert main(["detect", "../a.png", "b.png", "--out", str(tmp_path / "more")]) == 0
    assert {*tmp_path.rglob("*.png")} - before == {tmp_path / "more" / "a.png", tmp_path / "more" / "deep" / "b.png"}


def test_what_cannot_be_read_is_named_and_the_rest_is_done(pictures: Path, answer_to: AnswerTo) -> None:
    (pictures / "broken.jpg").write_bytes(b"no picture")
    (pictures / "empty.mp4").write_bytes(b"")
    for link, target in (("gone.png", "nowhere.png"), ("loop.png", "loop.png"), ("up", "..")):
        (pictures / link).symlink_to(target)
    for pipe in ("b.png", "b.mp4"):
        os.mkfifo(pictures / pipe)
    (pictures / "nothing").mkdir()
    code, out, err = answer_to("detect", pictures, pictures / "nothing", "missing.png", "--json", "-")
    assert (code, len(lines_of(out))) == (1, 3)
    complaints = [line for line in err.splitlines() if line.startswith("limo-hog: ")]
    wanted = ["nothing: no image", "missing.png: no such", "broken.jpg: not an", "empty.mp4: the file is empty"]
    wanted += [
        "b.png: a pipe",
        "b.mp4: a pipe",
        "gone.png: No such file",
        "loop.png: Too many levels of symbolic links",
    ]
    assert [sum(words in line for line in complaints) for words in wanted] == [1] * len(complaints)


def test_a_film_gives_a_line_a_frame_and_an_annotated_copy(tmp_path: Path, answer_to: AnswerTo) -> None:
    film, out = tmp_path / "film.mp4", tmp_path / "out"
    film_of(film)
    found = answer_to("detect", film, "--every", 3, "--json", "-", "--out", out).out
    assert [r["frame"] for r in lines_of(found)] == [0, 3, 6, 9]
    with av.open(out / "film.mp4") as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 192, 256)
        assert len(list(container.decode(stream))) == 4
    _, told, err = answer_to("detect", film, "--every", 5)
    assert [line.split()[0] for line in told.splitlines()] == [f"{film}:{frame}" for frame in (0, 5, 10)]
    times = r"detection [\d.]+ ms each, with reading and writing [\d.]+ ms"
    assert re.fullmatch(rf"3 frames, \d+ detections; {times}\n", err)


def test_one_picture_is_summed_up_in_one_unit(pictures: Path, answer_to: AnswerTo) -> None:
    _, out, err = answer_to("detect", pictures / "c.png")
    assert "  0 people " in out and re.fullmatch(r"1 picture, 0 people; detection [\d.]+ ms\n", err)


WIDE = street(320, 240, 3)
SMALL = np.asarray(cv2.resize(PICTURE, None, fx=0.4, fy=0.4, interpolation=cv2.INTER_AREA), np.uint8)


@pytest.mark.parametrize(
    ("typed", "image", "options"),
    [
        ("--min-height none", PICTURE, {"min_height": None}),
        ("--min-height 36", SMALL, {"min_height": 36}),
        ("--max-height 120", PICTURE, {"max_height": 120}),
        ("--threshold -1 --overlap 1", PICTURE, {"threshold": -1, "overlap": 1}),
        # The exact search finds one more in it.
        ("--threshold -1 --overlap 1 --search guided", WIDE, {"threshold": -1, "overlap": 1, "search": "guided"}),
        (" ".join(OPENCVS), PICTURE, {"model": "opencv", "min_height": None, "nms": "group"}),
    ],
)
def test_options_reach_the_detector(typed: str, image: Any, options: Any, tmp_path: Path, answer_to: AnswerTo) -> None:
    write_image(tmp_path / "a.png", image)
    (result,) = lines_of(answer_to("detect", tmp_path / "a.png", "--json", "-", *typed.split()).out)
    found = PeopleDetector(**options).detect(image)
    assert len(found) > 0 and found != PeopleDetector().detect(image)
    assert (result["boxes"], result["windows"]) == (found.boxes.tolist(), found.windows.tolist())


def test_a_terminal_shows_probabilities_or_margins(pictures: Path, tmp_path: Path, answer_to: AnswerTo) -> None:
    path, model, table = pictures / "a.png", tmp_path / "plain.yml", tmp_path / "people.csv"
    labels = PeopleDetector().detect(PICTURE).labels
    assert answer_to("detect", path).out.split("people")[1].split() == " ".join(labels).split() != []
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    hog.save(model)
    (result,) = lines_of(answer_to("detect", path, "--model", model, "--json", "-", "--csv", table).out)
    assert len(result["scores"]) > 0 and result["probabilities"] == [None] * len(result["scores"])
    assert all(line.endswith(",") for line in table.read_text("utf-8").splitlines()[1:])
    assert f"{result['scores'][0]:.2f}" in answer_to("detect", path, "--model", model).out


def test_a_picture_is_searched_once_however_it_is_spelled(pictures: Path, here: Path, answer_to: AnswerTo) -> None:
    film_of(Path("film.mp4"), frames=2)
    Path("link").symlink_to("in")
    Path("in", "z.png").symlink_to("a.png")  # a picture of another name
    inputs = ["in/a.png", pictures / "a.png", "in/deep/../a.png", "film.mp4", "link/a.png", "./in/../film.mp4"]
    results = lines_of(answer_to("detect", *inputs, "in/z.png", "--json", "-", "--out", "out").out)
    found = [(r["source"], r["frame"]) for r in results]
    assert found == [("in/a.png", 0), ("film.mp4", 0), ("film.mp4", 1), ("in/z.png", 0)]
    copies = sorted(str(path.relative_to("out")) for path in Path("out").rglob("*.*"))
    assert copies == ["film.mp4", "in/a.png", "in/z.png"]


def test_copies_are_of_their_pictures_format_or_the_one_asked_for(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.png", "c.bmp"):
        write_image(tmp_path / "in" / name, PICTURE)
    for asked, names in (([], ["a.jpg", "b.png", "c.png"]), (["--format", "jpg"], ["a.jpg", "b.jpg", "c.jpg"])):
        out = tmp_path / "-".join(["out", *asked])
        assert main(["detect", str(tmp_path / "in"), "--out", str(out), *asked]) == 0
        assert sorted(path.name for path in out.iterdir()) == names
        assert all(cv2.haveImageReader(str(path)) for path in out.iterdir())
        assert (out / "a.jpg").read_bytes()[:3] == b"\xff\xd8\xff"


def test_results_are_a_table_and_coco_too(pictures: Path, tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film_of(film, frames=2)
    files = {name: tmp_path / f"found.{name}" for name in ("json", "csv", "coco")}
    asked = [word for name, path in files.items() for word in (f"--{name}", str(path))]
    assert main(["detect", str(pictures), str(film), *asked]) == 0
    results = lines_of(files["json"].read_text())
    told = ("boxes", "windows", "scores", "probabilities")
    people = [(r["source"], r["frame"], *who) for r in results for who in zip(*(r[key] for key in told), strict=True)]
    assert len(people) > 2 and all(0 <= share <= 1 for *_, share in people)
    with files["csv"].open(newline="") as file:
        rows = list(csv.DictReader(file))
    box, window = "xywh", ("window_x", "window_y", "window_w", "window_h")
    for row, (source, frame, person, around, *numbers) in zip(rows, people, strict=True):
        assert (row["source"], int(row["frame"])) == (source, frame)
        assert [int(row[side]) for side in box] == person and [int(row[side]) for side in window] == around
        assert [float(row["score"]), float(row["probability"])] == numbers
    coco = json.loads(files["coco"].read_text())
    images = {image["id"]: (image["file_name"], image["frame"]) for image in coco["images"]}
    assert len(images) == len(results) == 5
    keys = ("bbox", "window", "score", "probability")
    annotated = [(*images[a["image_id"]], *(a[key] for key in keys)) for a in coco["annotations"]]
    assert annotated == people
    assert {a["category_id"] for a in coco["annotations"]} == {c["id"] for c in coco["categories"]} == {1}
    # An earlier run's results are in the tables, too.
    assert main(["detect", str(pictures), str(film), *asked, "--resume"]) == 0
    assert json.loads(files["coco"].read_text()) == coco


def test_a_name_that_is_no_text_is_printed_escaped_and_stands_in_the_table_as_it_is(tmp_path: Path) -> None:
    name = b"caf\xe9.png"
    write_image(tmp_path / os.fsdecode(name), PICTURE)
    command = [str(LIMO_HOG), "detect", os.fsdecode(name), "--csv", "found.csv"]
    strict = {**os.environ, "PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run(command, cwd=tmp_path, env=strict, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout.split()[0]) == (0, r"caf\udce9.png"), done.stderr
    lines = (tmp_path / "found.csv").read_bytes().splitlines()
    assert len(lines) > 1 and all(line.startswith(name + b",0,192,256,") for line in lines[1:])
