"""Descriptors of many crops: those of `HOGDescriptor.compute`, within 1e-6."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import limo_hog


def crops_of(count: int, width: int, height: int, channels: int) -> NDArray[np.uint8]:
    """Return crops with edges and noise."""
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
        assert found.shape == (count, wanted.shape[1]) and found.dtype == np.float32
        assert np.abs(found - wanted[:count]).max() < 1e-6


def test_crops_of_another_memory_layout_are_described_alike() -> None:
    crops = crops_of(5, 64, 128, 3)
    wanted = limo_hog.describe(crops)
    assert np.array_equal(limo_hog.describe(np.asfortranarray(crops)), wanted)
    assert np.array_equal(limo_hog.describe(crops.repeat(2, axis=2)[:, :, ::2]), wanted)
    assert np.array_equal(limo_hog.describe(crops[..., :1]), limo_hog.describe(crops[..., 0]))


def test_no_crops_have_no_descriptors() -> None:
    assert limo_hog.describe(np.empty((0, 128, 64, 3), np.uint8)).shape == (0, 3780)


@pytest.mark.parametrize("shape", [(128, 64), (2, 128, 64, 2), (1, 2, 128, 64, 3)])
def test_another_shape_is_an_image_error(shape: tuple[int, ...]) -> None:
    with pytest.raises(limo_hog.ImageError, match="N, H, W"):
        limo_hog.describe(np.zeros(shape, np.uint8))


def test_what_is_no_array_of_bytes_is_a_type_error() -> None:
    with pytest.raises(limo_hog.ImageTypeError, match="uint8"):
        limo_hog.describe(np.zeros((1, 128, 64), np.float32))
    with pytest.raises(limo_hog.ImageTypeError, match="list"):
        limo_hog.describe([np.zeros((128, 64), np.uint8)])  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [(60, 128), (8, 16), (64, 100)])
def test_a_size_that_is_no_window_is_a_geometry_error(size: tuple[int, int]) -> None:
    with pytest.raises(limo_hog.GeometryError):
        limo_hog.describe(np.zeros((1, size[1], size[0]), np.uint8))
