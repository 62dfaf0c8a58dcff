"""Pictures are resized as OpenCV's exact linear resize does it, without OpenCV."""

import cv2
import numpy as np
import pytest

from limo_hog._core import resize
from limo_hog.exceptions import ImageError


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (9, 1, 3), (48, 64), (48, 64, 1), (37, 53, 3), (480, 640, 3)])
@pytest.mark.parametrize("to", [(1, 1), (3, 2), (64, 48), (100, 75), (53, 37), (997, 311)])
def test_every_pixel_is_opencvs(shape: tuple[int, ...], to: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    theirs = cv2.resize(image, to, interpolation=cv2.INTER_LINEAR_EXACT)
    np.testing.assert_array_equal(resize(image, *to), np.reshape(theirs, (to[1], to[0], *shape[2:])))


def test_memory_layout_does_not_matter() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 30, 3), dtype=np.uint8)
    for view in (image[::2, ::-1], image.transpose(1, 0, 2), np.asfortranarray(image)):
        np.testing.assert_array_equal(resize(view, 50, 60), resize(np.ascontiguousarray(view), 50, 60))


@pytest.mark.parametrize("size", [(0, 5), (5, 0), (-1, 5), (2**40, 2)])
def test_sizes_that_no_image_can_have_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(ImageError):
        resize(np.zeros((4, 4), np.uint8), *size)
