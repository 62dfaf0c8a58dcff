"""Detections show themselves in Jupyter: a table, and a picture while the image is there."""

import base64
import gc
import pickle
import re
import sys
import weakref
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from limo_hog import Detections, PeopleDetector
from limo_hog.cli.support.scene import street
from limo_hog.imaging.notebook import ROWS, reduced


def words(html: str) -> list[str]:
    """Read well-formed HTML and return its texts."""
    return [*ElementTree.fromstring(re.sub("(<img[^>]*)>", r"\1/>", html)).itertext()]


def picture(html: str) -> NDArray[np.uint8] | None:
    found = re.search(r'src="data:image/jpeg;base64,([^"]+)"', html)
    if found is None:
        return None
    return np.asarray(cv2.imdecode(np.frombuffer(base64.b64decode(found[1]), np.uint8), cv2.IMREAD_COLOR), np.uint8)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a<b>&.png"
    cv2.imwrite(str(path), street(640, 480, 3))
    return path


def test_the_table_holds_the_people_and_the_picture_their_boxes(file: Path) -> None:
    scene = street(640, 480, 3)
    for image in (scene, file, Image.open(file)):
        people = PeopleDetector().detect(image)
        html = people._repr_html_()
        told = words(html)
        assert {*people.labels, *map(str, people.boxes.ravel().tolist())} <= {*told}
        assert image is not file or "a<b>&.png" in "".join(told)
        shown = picture(html)
        assert shown is not None
        # JPEG changes a little; a picture without boxes or with swapped colours is much further away.
        near = np.abs(shown.astype(int) - people.draw(scene)).mean()
        assert near < 3 < np.abs(shown.astype(int) - people.draw(scene)[..., ::-1]).mean()
        assert len(html) < 200_000


def test_detections_keep_no_image_alive_and_show_their_table_when_it_is_gone() -> None:
    scene = street(640, 480, 3)
    kept = weakref.ref(scene)
    people = PeopleDetector().detect(scene)
    assert picture(people[:1]._repr_html_()) is not None
    del scene
    gc.collect()
    assert kept() is None
    assert picture(people._repr_html_()) is None and "probability" in words(people._repr_html_())


def test_a_file_that_is_gone_and_a_missing_opencv_leave_the_table(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    people = PeopleDetector().detect(file)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "cv2", None)
        patch.delitem(sys.modules, "limo_hog.imaging.writing", raising=False)
        assert picture(people._repr_html_()) is None
    assert picture(people._repr_html_()) is not None
    file.unlink()
    assert picture(people._repr_html_()) is None


def test_copies_for_other_processes_hold_boxes_and_scores() -> None:
    people = PeopleDetector().detect(street(640, 480, 3))
    copy = pickle.loads(pickle.dumps(people))
    assert copy == people and len(words(copy._repr_html_())) > 10


def test_nobody_and_a_crowd_are_told_in_a_line() -> None:
    assert words(Detections.none()._repr_html_()) == ["0 people"]
    crowd = Detections(np.full((100, 4), 7, np.int32), np.arange(100.0)[::-1])
    told = words(crowd._repr_html_())
    assert told[0] == f"100 people, the best {ROWS} here" and ("80.00" in told) and ("79.00" not in told)
    assert crowd._repr_html_().count("<tr>") == ROWS + 1


@pytest.mark.parametrize("shape", [(480, 640, 3), (1920, 1080, 3), (1, 5000, 3), (3000, 4000), (641, 1, 1)])
def test_large_pictures_are_reduced_by_means(shape: tuple[int, ...]) -> None:
    image = np.full(shape, 100, np.uint8)
    small, n = reduced(image)
    assert max(small.shape[:2]) <= 640 and max(shape[:2]) <= 640 * n
    assert (small == 100).all() and small.ndim == 3
