"""Descriptors of many crops: those of `HOGDescriptor.compute`, within 1e-6."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import limo_hog


def crops_of(count: int, width: int, height: int, channels: int) -> NDArray[np.uint8]:
    random = np.random.default_rng(width * height + channels)
    coarse = random.integers(0, 200, (count, -(-height // 5), -(-width // 5), channels), np.uint8)
    shapes = coarse.repeat(5, axis=1).repeat(5, axis=2)[:, :height, :width]
    return np.asarray(shapes + random.integers(0, 56, shapes.shape, np.uint8), np.uint8)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(
    "size", [(64, 128), (48, 96), (16, 16), (24, 200), (136, 16), (72, 136), (128, 128), (264, 32)]
)
def test_every_crop_has_the_descriptor_that_compute_gives_it(size: tuple[int, int], channels: int) -> None:
    crops = crops_of(35, *size, channels)
    hog = limo_hog.HOGDescriptor(size, (16, 16), (8, 8), (8, 8), 9, _gammaCorrection=True)
    wanted = np.stack([hog.compute(crop) for crop in crops])
    for count in (1, 2, 3, 35):
        found = limo_hog.describe(crops[:count])
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, wanted[:count], rtol=0, atol=1e-6)


def test_crops_of_another_memory_layout_are_described_alike() -> None:
    crops = crops_of(5, 64, 128, 3)
    wanted = limo_hog.describe(crops)
    assert np.array_equal(limo_hog.describe(np.asfortranarray(crops)), wanted)
    assert np.array_equal(limo_hog.describe(crops.repeat(2, axis=2)[:, :, ::2]), wanted)
    assert np.array_equal(limo_hog.describe(crops[..., :1]), limo_hog.describe(crops[..., 0]))
    assert limo_hog.describe(crops[:0]).shape == (0, 3780)


@pytest.mark.parametrize(
    ("crops", "kind", "told"),
    [
        *((np.zeros(s, np.uint8), limo_hog.ImageError, "N, H, W") for s in ((128, 64), (2, 8, 8, 2), (1, 2, 8, 8, 3))),
        (np.zeros((1, 128, 64), np.float32), limo_hog.ImageTypeError, "uint8"),
        ([np.zeros((128, 64), np.uint8)], limo_hog.ImageTypeError, "list"),
        *((np.zeros((1, *s), np.uint8), limo_hog.GeometryError, "block") for s in ((128, 60), (16, 8), (100, 64))),
    ],
)
def test_what_are_no_crops_of_a_windows_size_is_a_named_error(crops: Any, kind: type[Exception], told: str) -> None:
    with pytest.raises(kind, match=told):
        limo_hog.describe(crops)
