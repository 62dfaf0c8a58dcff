"""Detections are indexed, drawn, and told as probabilities."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest

import limo_hog
from limo_hog import Detections, PeopleDetector
from limo_hog.cli.support.scene import street
from limo_hog.exceptions import HogError
from limo_hog.models import Calibration, PersonBox
from limo_hog.suppression import intersection_over_union, share_inside

PHOTOGRAPHS = Path(__file__).parents[3] / "shared" / "data" / "real" / "pedestrians"
PICTURE = street(640, 480, 3)


def some() -> Detections:
    boxes = np.array([[0, 0, 64, 128], [100, 50, 128, 256], [10, 10, 100, 200]], np.int32)
    return Detections(boxes, np.array([2.0, 0.5, -1.0]))


def test_the_person_is_two_tenths_in_from_the_side_and_one_from_the_top() -> None:
    assert some().boxes.tolist() == [[13, 13, 38, 100], [126, 76, 77, 200], [30, 30, 60, 156]]
    assert some().boxes.dtype == np.int32


def test_detections_are_indexed_as_they_are_iterated() -> None:
    found = some()
    for index, (box, score) in enumerate(found):
        np.testing.assert_array_equal(found[index][0], box)
        assert found[index][1] == score
    assert found[-1][1] == -1.0
    with pytest.raises(IndexError):
        found[3]


def test_a_slice_or_mask_of_detections_is_detections() -> None:
    found = replace(some(), person_box=PersonBox(0, 0, 1, 1), calibration=Calibration(1, 0))
    for part in (found[:2], found[found.scores > 0], found[np.array([0, 1])]):
        assert isinstance(part, Detections)
        assert part.boxes.tolist() == found.boxes[:2].tolist() and part.scores.tolist() == [2.0, 0.5]
        assert (part.person_box, part.calibration) == (found.person_box, found.calibration)
    assert len(found[5:]) == 0


def test_no_detections_are_empty_arrays() -> None:
    none = Detections.none()
    assert none.boxes.shape == (0, 4) and none.boxes.dtype == np.int32 and none.scores.shape == (0,)
    assert len(none) == 0 and list(none) == [] and none.boxes.shape == (0, 4)


def test_opencvs_models_have_a_calibration_in_which_surer_is_likelier() -> None:
    for model, even in (("opencv", 0.26), ("daimler", 1.52)):
        found = replace(PeopleDetector(model=model).detect(PICTURE), scores=np.array([3.0, even, -1.0]))
        assert found.probabilities == pytest.approx([1.0, 0.5, 0.0], abs=0.05)


def test_probabilities_need_a_calibration() -> None:
    with pytest.raises(limo_hog.HogError, match="no calibration"):
        _ = some().probabilities
    found = replace(some(), calibration=Calibration(500.0, 0.0))
    assert found.probabilities.tolist() == [1.0, 1.0, 0.0]


def test_a_label_is_the_probability_and_without_calibration_the_margin() -> None:
    assert some().labels == ["2.00", "0.50", "-1.00"]
    assert replace(some(), calibration=Calibration(1, 0)).labels == ["88 %", "62 %", "27 %"]


def test_the_people_are_drawn_into_a_copy() -> None:
    for shape in ((480, 640, 3), (480, 640), (480, 640, 1)):
        image = np.full(shape, 128, np.uint8)
        drawn = some().draw(image)
        assert drawn.shape == (480, 640, 3)
        assert (image == 128).all()
        assert (drawn[76 + 100, 126] != 128).any()
        assert (drawn[300:, 300:] == 128).all()


def test_drawing_without_opencv_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.delitem(sys.modules, "limo_hog.imaging.drawing", raising=False)
    with pytest.raises(limo_hog.MissingExtraError, match=r"pip install 'limo-hog\[cv\]'"):
        some().draw(PICTURE)


def test_detecting_and_enlarging_need_no_opencv() -> None:
    code = (
        "import sys; sys.modules['cv2'] = None; import numpy as np, limo_hog;"
        "limo_hog.PeopleDetector().detect(np.zeros((200, 200, 3), np.uint8))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_detections_are_an_array_of_boxes_and_scores() -> None:
    array = np.asarray(some())
    assert array.dtype == np.float64
    assert array.tolist() == [[13, 13, 38, 100, 2.0], [126, 76, 77, 200, 0.5], [30, 30, 60, 156, -1.0]]
    assert np.asarray(Detections.none()).shape == (0, 5)
    assert some().xyxy.tolist() == [[13, 13, 51, 113], [126, 76, 203, 276], [30, 30, 90, 186]]


def test_detections_are_equal_where_all_they_hold_is() -> None:
    other = replace(some(), scores=np.array([2.0, 0.5, -1.1]))
    assert some() == some()
    assert some() != other
    assert some() != replace(some(), calibration=Calibration(1, 0))
    assert some() != "people"
    assert len({some(), some(), other}) == 2


def test_detections_say_how_many_people_there_are() -> None:
    assert str(some()) == "3 people, best 2.00"
    assert str(some()[:1]) == "1 person, best 2.00"
    assert str(Detections.none()) == "0 people"


def test_detections_become_json() -> None:
    found = replace(some()[:1], calibration=Calibration(1, 0))
    plain = {"boxes": [[13, 13, 38, 100]], "windows": [[0, 0, 64, 128]], "scores": [2.0]}
    assert json.loads(json.dumps(some()[:1].to_dict())) == plain
    assert found.to_dict()["probabilities"] == found.probabilities.tolist()


def test_the_picture_is_saved_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    image = PICTURE.copy()
    found = PeopleDetector().detect(image)
    found.save(tmp_path / "people.png")
    found.show()
    written = cv2.imread(str(tmp_path / "people.png"))
    np.testing.assert_array_equal(written, found.draw(image))
    (shown,) = [Path(urlsplit(address).path) for address in opened]
    np.testing.assert_array_equal(cv2.imread(str(shown)), written)
    del image
    with pytest.raises(HogError, match=r"is gone: keep it in a variable, or use draw"):
        found.save(tmp_path / "again.png")


@pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="photographs lie in ../shared")
def test_on_a_street_no_box_is_on_what_is_no_person() -> None:
    labels = {one["file"]: one["boxes_xywh"] for one in json.loads((PHOTOGRAPHS.parent / "manifest.json").read_text())}
    frames = sorted(PHOTOGRAPHS.glob("TUD_*.jpg"))
    assert len(frames) == 9
    for frame in frames:
        found = PeopleDetector().detect(frame)
        people = np.array(labels[f"pedestrians/{frame.name}"])
        assert (share_inside(found.boxes, people).max(axis=1) > 0.5).all()
        assert (intersection_over_union(found.boxes, people).max(axis=1) > 0.5).sum() >= 4


@pytest.mark.parametrize("library", ["supervision", "pandas"])
@pytest.mark.parametrize("tracked", [False, True])
@pytest.mark.parametrize("count", [0, 2])
@pytest.mark.parametrize("calibration", [None, Calibration(2.0, -1.0)])
def test_detections_come_back_equal_from_other_libraries(
    library: str, tracked: bool, count: int, calibration: Calibration | None
) -> None:
    pytest.importorskip(library, reason=f"needs {library}")
    ids = np.array([7, 3], np.int64)[:count] if tracked else None
    given = replace(some()[:count], ids=ids, calibration=calibration)
    other = getattr(given, f"to_{library}")()
    assert len(other) == count
    back = getattr(Detections, f"from_{library}")
    assert back(other) == given
    assert back(other[np.arange(count) < 1]) == given[:1]
    assert given != replace(given, ids=np.arange(count)) or not count


def test_another_detectors_boxes_are_their_own_windows_best_first() -> None:
    supervision = pytest.importorskip("supervision")
    xyxy = np.array([[1, 2, 11, 22], [5, 6, 25, 46]], np.float32)
    found = Detections.from_supervision(supervision.Detections(xyxy, confidence=np.array([0.2, 0.9])))
    assert found.boxes.tolist() == [[5, 6, 20, 40], [1, 2, 10, 20]]
    assert found.scores.tolist() == [0.9, 0.2]
    with pytest.raises(HogError, match=r"no confidence; give each box one"):
        Detections.from_supervision(supervision.Detections(xyxy))


def test_a_table_read_from_a_file_needs_boxes_and_scores(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="needs pandas")
    some().to_pandas().to_csv(tmp_path / "a.csv")
    read = pandas.read_csv(tmp_path / "a.csv")
    assert np.array_equal(Detections.from_pandas(read).boxes, some().boxes)
    with pytest.raises(HogError, match=r"no column w, score; x, y, w, h and score are wanted"):
        Detections.from_pandas(read.drop(columns=["w", "score"]))
