"""Boxes are drawn where they are, in the workshop's colours."""

import numpy as np
import pytest

from limo_hog.imaging.drawing import BLUE, CHOSEN, OTHER, annotate

BOXES = np.array([[100, 60, 64, 128], [300, 100, 96, 192]], np.int32)


def test_the_target_is_red_with_a_blue_centre_and_the_others_are_green() -> None:
    image = np.full((480, 640, 3), 128, np.uint8)
    picture = annotate(image, BOXES, labels=["1.2", "0.3"], target=1, caption="2.31 m")
    assert (image == 128).all()  # it is drawn into a copy
    assert tuple(picture[60 + 64, 100]) == OTHER and tuple(picture[100 + 96, 300]) == CHOSEN
    assert tuple(picture[100 + 96, 300 + 48]) == BLUE and tuple(picture[60 + 64, 100 + 32]) == (128, 128, 128)


@pytest.mark.parametrize("shape", [(480, 640), (4, 3, 3), (128, 64, 3), (2000, 40, 3)])
def test_any_image_can_be_drawn_on(shape: tuple[int, ...]) -> None:
    boxes = np.array([[-500, -3, 64, 128], [2_000, 9_000, 64, 128], [0, 0, 3, 4]], np.int32)
    picture = annotate(np.zeros(shape, np.uint8), boxes, ["a", "b", "c"], target=2, caption="far away")
    assert picture.shape == (*shape[:2], 3)
