"""Label files of every kind give the same boxes, and what is wrong with one is told in one line."""

from pathlib import Path

import numpy as np
import pytest

from limo_hog.imaging.writing import write_image
from limo_hog.learn.formats import read_labels
from limo_hog.learn.labels import Box, LabelError, LabelWarning, Picture, choose, inside

WIDTH, HEIGHT = 200, 100
#: Label files of each kind: two people in a.png, the second to be ignored where the kind can say so; nobody in b.png.
KINDS = {
    "VOC": {
        "Annotations/a.xml": "<annotation><filename>a.png</filename><object><name>person</name><difficult>0</difficult>"
        "<bndbox><xmin>21</xmin><ymin>11</ymin><xmax>50</xmax><ymax>90</ymax></bndbox></object><object><name>person"
        "</name><difficult>1</difficult><bndbox><xmin>121</xmin><ymin>41</ymin><xmax>140</xmax><ymax>90</ymax></bndbox>"
        "</object></annotation>",
        "Annotations/b.xml": "<annotation><filename>\n b.png </filename></annotation>",
    },
    "COCO": {
        "coco.json": '{"images": [{"id": 7, "file_name": "a.png"}, {"id": 9, "file_name": "b.png"}], "annotations":'
        '[{"image_id": 7, "category_id": 3, "bbox": [20, 10, 30, 80], "iscrowd": 0},'
        '{"image_id": 7, "category_id": 3, "bbox": [120, 40, 20, 50], "iscrowd": 1}],'
        '"categories": [{"id": 3, "name": "person"}]}'
    },
    "imglab": {
        "imglab.xml": "<?xml version='1.0'?><dataset><name>x</name><images><image file='a.png'>"
        "<box top='10' left='20' width='30' height='80' ignore='0'><label>person</label></box>"
        "<box top='40' left='120' width='20' height='50' ignore='1'><label>person</label></box></image>"
        "<image file='b.png'/></images></dataset>"
    },
    "CVAT": {
        "cvat.xml": '<annotations><image id="0" name="a.png"><box label="person" occluded="0" xtl="20" ytl="10"'
        ' xbr="50" ybr="90"/><box label="person" occluded="0" xtl="120" ytl="40" xbr="140" ybr="90"/></image>'
        '<image id="1" name="b.png"/></annotations>'
    },
    "YOLO": {"labels/a.txt": "0 .175 .5 .15 .8\n0 .65 .65 .1 .5\n", "labels/classes.txt": "person\ndog\n"},
    "boxes": {"boxes.json": '{"a.png": [[20, 10, 30, 80], [120, 40, 20, 50]], "b.png": []}'},
}


def written(kind: str, folder: Path) -> Path:
    for name, text in KINDS[kind].items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder / name if kind in ("COCO", "imglab", "CVAT") else folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        write_image(tmp_path / "images" / f"{name}.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    return tmp_path


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_the_same_boxes(kind: str, folder: Path) -> None:
    pictures = read_labels(written(kind, folder))
    assert [picture.path.resolve().name for picture in pictures] == ["a.png", "b.png"]
    boxes, ignored = pictures[0].arrays()
    assert boxes == pytest.approx(np.array([[20, 10, 30, 80], [120, 40, 20, 50]]), abs=1e-9)
    if kind in ("VOC", "COCO", "imglab"):
        assert ignored.tolist() == [False, True]
    assert {box.label for box in pictures[0].boxes} == {"" if kind == "boxes" else "person"}
    assert pictures[1].boxes == ()


def test_pictures_may_lie_elsewhere(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = written("COCO", tmp_path_factory.mktemp("elsewhere"))
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
        ("x.json", '{"images": [], "annotations": [{"iscrowd": 2}]}', "iscrowd or ignore is [2, 0]; 0 or 1 is wanted"),
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
    with pytest.raises(LabelError) as raised:
        read_labels(folder if name.startswith("labels") else path)
    assert complaint in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["a.txt", "classes.txt"])
def test_yolo_text_in_another_encoding_is_named(name: str, folder: Path) -> None:
    (written("YOLO", folder) / "labels" / name).write_bytes("Fußgänger".encode("latin-1"))
    with pytest.raises(LabelError, match=rf"{name} is no text in UTF-8.*save it as UTF-8"):
        read_labels(folder)


def test_a_folder_without_labels_or_with_several_files_is_refused(folder: Path) -> None:
    with pytest.raises(LabelError, match="holds no labels; wanted is a folder of VOC XML"):
        read_labels(folder)
    with pytest.raises(LabelError, match="no such file or folder"):
        read_labels(folder / "missing")
    path = written("COCO", folder)
    path.with_name("other.json").write_text(path.read_text())
    with pytest.raises(LabelError, match=r"several label files: coco\.json, other\.json; name one"):
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
    flat = Picture(Path("a.png"), (Box("", 2, 2, 0, 5), Box("", 2, 2, 5, 5, ignored=True)))
    with pytest.raises(LabelError, match="none of the 1 labelled boxes has an area"):
        choose([flat], None)


def test_boxes_without_area_or_outside_are_left_out_with_a_warning() -> None:
    good = Box("", 1, 1, 5, 5)
    with pytest.warns(LabelWarning, match="2 boxes without area are left out"):
        chosen = choose([Picture(Path("a.png"), (good, Box("", 2, 2, 0, 5), Box("", 2, 2, 5, -1)))], None)
    assert chosen[0].boxes == (good,)
    partly = Box("", 95, 40, 20, 20)
    with pytest.warns(LabelWarning, match=r"a\.png: 1 boxes outside of its 100 x 50 pixels are left out"):
        kept = inside(Picture(Path("a.png"), (good, partly, Box("", 100, 10, 5, 5))), (100, 50))
    assert kept.boxes == (good, partly)
