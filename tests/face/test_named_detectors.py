"""HOG, OpenCV's HOG and a network stand behind one protocol and a name each."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.face.onnx_file import dark_cells
from tests.somebody import OneBox, somebody_ahead

from limo_hog.detector import PeopleDetector
from limo_hog.named_detectors import AtScale, Cv2Detector, DetectorError, by_score, detector_named


def test_half_size_is_the_mean_of_four_pixels_with_boxes_of_the_whole_image() -> None:
    detector = OneBox()
    found = AtScale(detector, 0.5).detect(np.zeros((481, 641, 3), np.uint8))
    assert found.windows.tolist() == [[20, 40, 128, 256]]
    AtScale(detector, 0.5).detect(np.arange(4, dtype=np.uint8).reshape(2, 2, 1).repeat(3, axis=2))
    assert [image.shape for image in detector.images] == [(240, 320, 3), (1, 1, 3)]
    assert detector.images[1].tolist() == [[[2, 2, 2]]]


def test_an_image_at_twice_its_size_is_opencvs_with_boxes_of_the_image_as_it_is() -> None:
    detector, image = OneBox(), np.random.default_rng(1).integers(0, 256, (31, 21, 3), np.uint8)
    assert AtScale(detector, 2.0).detect(image).windows.tolist() == [[5, 10, 32, 64]]
    enlarged = cv2.resize(image, (42, 62), interpolation=cv2.INTER_LINEAR_EXACT)
    np.testing.assert_array_equal(detector.images[0], enlarged)


def test_the_surest_comes_first() -> None:
    found = by_score(np.array([[0, 0, 1, 2], [3, 3, 1, 2]]), np.array([0.1, 0.9]))
    assert (found.scores.tolist(), found.windows[0].tolist()) == ([0.9, 0.1], [3, 3, 1, 2])


@pytest.mark.parametrize("scale", [1, 2])
def test_a_network_from_a_file_finds_dark_cells_in_an_image_of_any_size(tmp_path: Path, scale: int) -> None:
    path = tmp_path / "dark.onnx"
    path.write_bytes(dark_cells())
    image = np.full((480, 640, 3), 255, np.uint8)
    image[160:192, 320:352] = 0
    found = detector_named(f"onnx:{path}").detect(image.repeat(scale, axis=0).repeat(scale, axis=1))
    assert found.windows.tolist() == [[320 * scale, 144 * scale, 32 * scale, 64 * scale]]
    assert found.scores[0] > 0


def test_what_is_no_network_or_no_detector_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "broken.onnx").write_bytes(b"not a network")
    for name, told in (
        (f"onnx:{tmp_path / 'broken.onnx'}", "cannot read this as an ONNX network"),
        ("onnx:absent.onnx", "no such file"),
        ("yolo", "want one of hog, hog-half, hog:MODEL, cv2, onnx:FILE"),
    ):
        with pytest.raises(DetectorError, match=told):
            detector_named(name)


def test_our_hog_and_opencvs_find_one_box_for_a_person_by_each_way_to_suppress() -> None:
    frame = somebody_ahead()
    every_hit = PeopleDetector(model="opencv", min_height=None, nms="group", group_threshold=0).detect(frame)
    assert len(every_hit) > 5
    for name in ("hog", "hog:opencv"):
        found = detector_named(name).detect(frame)
        assert len(found) == 1
        assert found.scores[0] > 1
    assert detector_named("hog:opencv").detect(frame).scores[0] == every_hit.scores[0]
    ours, theirs = detector_named("hog").detect(frame), Cv2Detector().detect(frame)
    assert len(ours) == 1
    assert ours.windows.tolist() == theirs.windows.tolist()
