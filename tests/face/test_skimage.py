"""`limo_hog.skimage.hog` beside scikit-image's own: the same numbers, drawings, number types and kinds of error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skimage.feature
from numpy.typing import NDArray

from limo_hog.skimage import hog, hogs

KINDS = ("float64", "float32", "float16", "uint8", "int16", "int64", "uint16", "bool")
NORMS = ("L1", "L1-sqrt", "L2", "L2-Hys")


def drawn_case(seed: int) -> tuple[NDArray[Any], dict[str, Any]]:
    """An image of any number type and look, and arguments that fit it."""
    rng = np.random.default_rng(seed)
    cell, block = rng.integers(1, 13, 2), rng.integers(1, 4, 2)
    shape = tuple(cell * (block + rng.integers(0, 5, 2)) + rng.integers(0, cell))
    channels = (int(rng.integers(1, 5)),) if rng.random() < 0.4 else ()
    kind = KINDS[rng.integers(len(KINDS))]
    looks = [
        lambda: rng.integers(0, 256, shape + channels),
        lambda: rng.integers(0, 3, shape + channels),  # flat areas, axes and diagonals
        lambda: rng.random(shape + channels) * 255,
        lambda: rng.integers(0, 256, shape + channels) / 255,  # as `img_as_float` makes them: channels nearly tie
        lambda: np.exp(rng.normal(0, 12, shape + channels)),  # from 1e-20 to 1e20
    ]
    image = looks[rng.integers(len(looks) if kind.startswith("float6") else 4)]()
    axis = int(rng.integers(-3, 3)) if channels else None
    if axis is not None:
        image = np.moveaxis(image, -1, axis)
    orientations = int(rng.integers(1, 20))
    may_draw = min(cell) > 1 or orientations % 2 == 0  # else scikit-image's lines leave the image, and it fails
    arguments = {
        "orientations": orientations,
        "pixels_per_cell": tuple(map(int, cell)),
        "cells_per_block": tuple(map(int, block)),
        "block_norm": NORMS[rng.integers(4)],
        "visualize": may_draw and bool(rng.random() < 0.5),
        "transform_sqrt": bool(rng.random() < 0.3),
        "feature_vector": bool(rng.random() < 0.5),
        "channel_axis": axis,
    }
    return image.astype(kind), arguments


def differences(seeds: range) -> list[tuple[int, float]]:
    """The seeds whose descriptor or drawing differs by more than 1e-9 (float32: 1e-6 of the largest number)."""
    found = []
    for seed in seeds:
        image, arguments = drawn_case(seed)
        theirs, ours = skimage.feature.hog(image, **arguments), hog(image, **arguments)
        pairs = list(zip(theirs, ours, strict=True)) if arguments["visualize"] else [(theirs, ours)]
        for their, our in pairs:
            assert (their.dtype, their.shape) == (our.dtype, our.shape), seed
        most = float(abs(pairs[0][0] - pairs[0][1]).max())
        exact = all(np.array_equal(*pair) for pair in pairs[1:])
        if not (most <= (1e-9 if pairs[0][0].dtype == np.float64 else 1e-6) and exact):
            found.append((seed, most))
    return found


def test_any_image_and_arguments_give_scikit_images_numbers() -> None:
    assert differences(range(100)) == []


@pytest.mark.slow
def test_two_thousand_drawn_cases_give_scikit_images_numbers() -> None:
    assert differences(range(100, 2100)) == []
