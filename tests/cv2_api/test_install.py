"""`install_into_cv2`: which names it puts into `cv2`, what it says, and what `except cv2.error` catches afterwards."""

import sys
import warnings
from pathlib import Path
from typing import Any

import cv2 as typed_cv2
import numpy as np
import pytest

import limo_hog
from limo_hog import HOGDescriptor

cv2: Any = typed_cv2  # whose names come and go
GEOMETRY = ((48, 96), (16, 16), (8, 8), (8, 8), 9)


class Contrib(HOGDescriptor):
    """As opencv-contrib 5 has it: gamma correction is on with arguments, too."""

    def __init__(self, *sizes: Any) -> None:
        given: Any = (*sizes, 1, -1.0, 0, 0.2, True)
        super().__init__(*given)


def test_opencv_4_keeps_its_own_names(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = cv2.HOGDescriptor
    monkeypatch.delattr(cv2, "groupRectangles")
    assert limo_hog.install_into_cv2() == ["groupRectangles"]
    assert cv2.HOGDescriptor is kept and cv2.groupRectangles is limo_hog.groupRectangles
    monkeypatch.undo()


def test_without_opencv_there_is_nothing_to_install_into(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(limo_hog.MissingExtraError, match=r"pip install 'limo-hog\[cv\]'"):
        limo_hog.install_into_cv2()


def test_a_detector_that_describes_otherwise_than_opencv_4_is_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "HOGDescriptor", Contrib)
    with pytest.warns(UserWarning, match=r"corrects gamma.*replace=True") as said:
        assert limo_hog.install_into_cv2() == []
    assert said[0].filename == __file__ and cv2.HOGDescriptor is Contrib


def test_replace_puts_every_name_in_the_place_of_opencvs() -> None:
    before = vars(cv2).copy()
    try:
        names = limo_hog.install_into_cv2(replace=True)
        assert {"HOGDescriptor", "HOGDescriptor_getDefaultPeopleDetector", "groupRectangles"} < set(names)
        assert all(getattr(cv2, name) is getattr(limo_hog, name) for name in names)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert limo_hog.install_into_cv2() == []
    finally:
        vars(cv2).update(before)


HOG = HOGDescriptor()
HOG.setSVMDetector(HOG.getDefaultPeopleDetector())
WRONG = {
    "no image": lambda: HOG.detectMultiScale(None),  # type: ignore[arg-type]
    "floats": lambda: HOG.detectMultiScale(np.zeros((200, 100), np.float32)),
    "stride": lambda: HOG.detect(np.zeros((200, 100), np.uint8), winStride=(0, 8)),
    "length": lambda: HOG.setSVMDetector(np.ones(7)),
    "geometry": lambda: HOGDescriptor((60, 128), (16, 16), (8, 8), (8, 8), 9).getDescriptorSize(),
    "no file": lambda: HOGDescriptor("none.yml"),
    "no model": lambda: HOGDescriptor(str(Path(__file__))),
    "rectangles": lambda: limo_hog.groupRectangles([[0, 0, 1]], 1),
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_once_installed_errors_are_caught_as_those_of_opencv(wrong: Any) -> None:
    limo_hog.install_into_cv2()
    with pytest.raises(cv2.error) as caught:
        wrong()
    assert isinstance(caught.value, limo_hog.HogError)
