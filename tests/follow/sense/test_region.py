"""The part of an image where the person is expected is searched alone."""

import numpy as np
import pytest
from tests.somebody import OneBox, somebody_ahead

from limo_hog.detector import PeopleDetector
from limo_hog.follow.sense.region import Region, detect_in
from limo_hog.named_detectors import detector_named


@pytest.mark.parametrize(
    ("region", "shown", "box"),
    [
        (Region(96, 32, 208, 192, 150.0), (192, 208, 3), [106, 52, 64, 128]),
        # Large people are searched in a smaller picture.
        (Region(0, 0, 400, 400, 320.0), (200, 200, 3), [20, 40, 128, 256]),
        # And small ones, who are far away, in a larger one.
        (Region(96, 32, 208, 192, 100.0), (384, 416, 3), [101, 42, 32, 64]),
    ],
)
def test_a_region_is_searched_alone(region: Region, shown: tuple[int, ...], box: list[int]) -> None:
    detector = OneBox()
    assert detect_in(detector, np.zeros((480, 640, 3), np.uint8), region).windows.tolist() == [box]
    assert [image.shape for image in detector.images] == [shown]


def test_a_part_keeps_the_models_person_box_and_calibration() -> None:
    limo = PeopleDetector(model="limo", min_height=None)
    image = np.zeros((480, 640, 3), np.uint8)
    whole = limo.detect(image)
    for height in (150.0, 320.0):
        part = detect_in(limo, image, Region(0, 0, 400, 400, height))
        assert (part.person_box, part.calibration) == (whole.person_box, whole.calibration)
        assert part.calibration is not None


def test_a_region_around_a_person_finds_what_the_whole_image_does() -> None:
    detector, frame = detector_named("hog"), somebody_ahead()
    whole = detector.detect(frame).windows[0]
    x, y, w, h = (int(value) for value in whole)
    region = Region(x - 48, max(y - 32, 0), w + 96, h + 64, float(h))
    part = detect_in(detector, frame, region).windows[0]
    assert np.abs(part - whole).max() <= 16
