"""Label files of every kind give the same boxes, and what is wrong with one is told in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from limo_hog.imaging.writing import write_image
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import Box, LabelError, LabelWarning, Picture, choose, inside

WIDTH, HEIGHT = 200, 100
#: Two people in the first picture, one of them to be ignored; none in the second.
PEOPLE = [Box("person", 20, 10, 30, 80), Box("person", 120, 40, 20, 50, ignored=True)]


def _voc(folder: Path) -> Path:
    things = "".join(
        f"<object><name>{b.label}</name><difficult>{int(b.ignored)}</difficult><bndbox><xmin>{b.x + 1}</xmin>"
        f"<ymin>{b.y + 1}</ymin><xmax>{b.x + b.width}</xmax><ymax>{b.y + b.height}</ymax></bndbox></object>"
        for b in PEOPLE
    )
    labels = folder / "Annotations"
    labels.mkdir()
    for name, inner in (("a", things), ("b", "")):
        (labels / f"{name}.xml").write_text(f"<annotation><filename>{name}.png</filename>{inner}</annotation>")
    return folder


def _coco(folder: Path) -> Path:
    notes = [
        {"image_id": 7, "category_id": 3, "bbox": [b.x, b.y, b.width, b.height], "iscrowd": int(b.ignored)}
        for b in PEOPLE
    ]
    images = [{"id": 7, "file_name": "a.png"}, {"id": 9, "file_name": "b.png"}]
    path = folder / "instances.json"
    path.write_text(json.dumps({"images": images, "annotations": notes, "categories": [{"id": 3, "name": "person"}]}))
    return path


def _imglab(folder: Path) -> Path:
    boxes = "".join(
        f"<box top='{b.y}' left='{b.x}' width='{b.width}' height='{b.height}' ignore='{int(b.ignored)}'>"
        f"<label>{b.label}</label></box>"
        for b in PEOPLE
    )
    path = folder / "imglab.xml"
    images = f"<image file='a.png'>{boxes}</image><image file='b.png'/>"
    path.write_text(f"<?xml version='1.0'?><dataset><name>x</name><images>{images}</images></dataset>")
    return path


def _cvat(folder: Path) -> Path:
    boxes = "".join(
        f'<box label="{b.label}" occluded="0" xtl="{b.x}" ytl="{b.y}" xbr="{b.x + b.width}" ybr="{b.y + b.height}"/>'
        for b in PEOPLE
    )
    path = folder / "cvat.xml"
    path.write_text(
        f'<annotations><image id="0" name="a.png">{boxes}</image><image id="1" name="b.png"/></annotations>'
    )
    return path


def _yolo(folder: Path) -> Path:
    lines = [
        f"0 {(b.x + b.width / 2) / WIDTH} {(b.y + b.height / 2) / HEIGHT} {b.width / WIDTH} {b.height / HEIGHT}"
        for b in PEOPLE
    ]
    (folder / "labels").mkdir()
    (folder / "labels" / "a.txt").write_text("\n".join(lines) + "\n")
    (folder / "labels" / "classes.txt").write_text("person\ndog\n")
    return folder


def _boxes_json(folder: Path) -> Path:
    (folder / "boxes.json").write_text(
        json.dumps({"a.png": [[b.x, b.y, b.width, b.height] for b in PEOPLE], "b.png": []})
    )
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        write_image(tmp_path / "images" / f"{name}.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    return tmp_path


@pytest.mark.parametrize("write", [_voc, _coco, _imglab, _cvat, _yolo, _boxes_json])
def test_every_kind_gives_the_same_boxes(write: Callable[[Path], Path], folder: Path) -> None:
    pictures = read_labels(write(folder))
    assert [picture.path.resolve().name for picture in pictures] == ["a.png", "b.png"]
    boxes, ignored = pictures[0].arrays()
    assert boxes == pytest.approx(np.array([[20, 10, 30, 80], [120, 40, 20, 50]]), abs=1e-9)
    # Not all kinds can say that a box is to be ignored, or what it is.
    if write in (_voc, _coco, _imglab):
        assert ignored.tolist() == [False, True]
    assert {box.label for box in pictures[0].boxes} == {"" if write is _boxes_json else "person"}
    assert pictures[1].boxes == ()


def test_pictures_may_lie_elsewhere(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = _coco(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(LabelError, match=r"2 of which are not there, a\.png for one; say where .* --pictures"):
        read_labels(path)
    assert len(read_labels(path, folder / "images")) == 2


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("x.json", "[1, 2]", "neither COCO labels nor"),
        ("x.json", '{"a.png": [[1, 2, 3]]}', "neither COCO labels nor"),
        ("x.json", '{"a.png": [[1, 2, 3, NaN]]}', "finite numbers are wanted"),
        ("x.json", "{", "neither COCO labels nor"),
        ("x.json", '{"images": [], "annotations": [1]}', "neither COCO labels nor"),
        ("x.json", f'{{"a.png": [[1, 2, 3, {10**400}]]}}', "neither COCO labels nor"),
        ("x.json", "{}", "names no picture"),
        ("x.json", '{"a.png": ["1234"]}', "a box is '1234'; four finite numbers"),
        ("x.json", '{"a.png": [[1, 2, 3, 1e300]]}', "of at most 1e"),
        ("x.json", '{"a.png": [], "a.png": []}', "'a.png' is there twice"),
        ("x.json", '{"images": [{"id": 1}, {"id": 1}], "annotations": []}', "two of its images have one id"),
        (
            "x.json",
            '{"images": [], "annotations": [{"image_id": 1, "bbox": [1, 2, 3, 4], "iscrowd": "no"}]}',
            "iscrowd or ignore is",
        ),
        ("x.xml", "<html/>", r"its outermost tag is <html>; wanted is VOC's"),
        ("x.xml", "<annotation", "wanted is VOC's"),
        ("x.xml", "<annotation><filename>a.png</filename><object/></annotation>", "has no <bndbox/xmin>"),
        ("x.xml", "<dataset><image file='a.png'><box/></image></dataset>", "wanted is VOC's"),
        ("x.xml", '<?xml version="1.0" encoding="foo"?><annotation/>', "x.xml: unknown encoding: foo; wanted is VOC's"),
        ("x.csv", "a,b", "holds no labels; wanted is a folder of VOC"),
        ("labels/a.txt", "person 1 2", r"lines of label, centre x"),
        ("labels/a.txt", "0 .5 .5 nan .5", "finite numbers are wanted"),
    ],
)
def test_other_files_are_refused_in_one_line(name: str, text: str, complaint: str, folder: Path) -> None:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    with pytest.raises(LabelError, match=complaint) as raised:
        read_labels(folder if name.startswith("labels") else path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["a.txt", "classes.txt"])
def test_yolo_text_in_another_encoding_is_named(name: str, folder: Path) -> None:
    (_yolo(folder) / "labels" / name).write_bytes("Fußgänger".encode("latin-1"))
    with pytest.raises(LabelError, match=rf"{name} is no text in UTF-8.*save it as UTF-8"):
        read_labels(folder)


def test_a_folder_without_labels_says_what_is_wanted(folder: Path) -> None:
    with pytest.raises(LabelError, match="holds no labels; wanted is a folder of VOC XML"):
        read_labels(folder)
    with pytest.raises(LabelError, match="no such file or folder"):
        read_labels(folder / "missing")


def test_several_label_files_are_not_guessed_at(folder: Path) -> None:
    path = _coco(folder)
    path.with_name("other.json").write_text(path.read_text())
    with pytest.raises(LabelError, match=r"several label files: instances\.json, other\.json; name one"):
        read_labels(folder)


def test_one_label_is_chosen_and_the_others_are_left_out() -> None:
    pictures = [Picture(Path("a.png"), (Box("dog", 0, 0, 9, 9), Box("cat", 5, 5, 9, 9), Box("dog", 9, 9, 9, 9)))]
    assert [box.label for box in choose(pictures, "cat")[0].boxes] == ["cat"]
    with pytest.raises(LabelError, match=r"several labels: dog \(2\), cat \(1\); choose one with --label"):
        choose(pictures, None)
    with pytest.raises(LabelError, match=r"no box has the label 'cow'; there are dog \(2\), cat \(1\)"):
        choose(pictures, "cow")
    with pytest.raises(LabelError, match="no labelled box in 1 pictures"):
        choose([Picture(Path("a.png"), ())], None)


def test_labels_of_nothing_but_boxes_without_area_are_refused() -> None:
    pictures = [Picture(Path("a.png"), (Box("", 2, 2, 0, 5), Box("", 2, 2, 5, 5, ignored=True)))]
    with pytest.raises(LabelError, match="none of the 1 labelled boxes has an area"):
        choose(pictures, None)


def test_boxes_without_area_or_outside_are_left_out_with_a_warning() -> None:
    good = Box("", 1, 1, 5, 5)
    with pytest.warns(LabelWarning, match="2 boxes without area are left out"):
        chosen = choose([Picture(Path("a.png"), (good, Box("", 2, 2, 0, 5), Box("", 2, 2, 5, -1)))], None)
    assert chosen[0].boxes == (good,)
    partly = Box("", 95, 40, 20, 20)
    with pytest.warns(LabelWarning, match=r"a\.png: 1 boxes outside of its 100 x 50 pixels are left out"):
        kept = inside(Picture(Path("a.png"), (good, partly, Box("", 100, 10, 5, 5))), (100, 50))
    assert kept.boxes == (good, partly)


def test_blanks_around_a_pictures_name_are_no_part_of_it(folder: Path) -> None:
    (folder / "x.xml").write_text("<annotation><filename>\n a.png </filename></annotation>")
    assert [picture.path.name for picture in read_labels(folder / "x.xml")] == ["a.png"]
