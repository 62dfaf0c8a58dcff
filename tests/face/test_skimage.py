"""`limo_hog.skimage.hog` beside scikit-image's own: the same numbers, drawings, number types and kinds of error."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import skimage.feature
from numpy.typing import NDArray

from limo_hog.skimage import hog, hogs

KINDS = ("float64", "float32", "float16", "uint8", "int16", "int64", "uint16", "bool")
NORMS = ("L1", "L1-sqrt", "L2", "L2-Hys")


@pytest.fixture(autouse=True)
def the_c_librarys_arctan2(monkeypatch: pytest.MonkeyPatch) -> None:
    """With AVX-512 numpy's `arctan2` is the last bit off, and a gradient between two bins votes for the other."""
    y, x = np.random.default_rng(0).integers(-255, 256, (2, 1000)).astype(float)
    exact = np.frompyfunc(math.atan2, 2, 1)
    if not np.array_equal(np.arctan2(y, x), exact(y, x).astype(float)):

        def arctan2(y: Any, x: Any) -> Any:
            return np.asarray(exact(y, x)).astype(np.result_type(np.asarray(y), np.asarray(x)))

        monkeypatch.setattr(np, "arctan2", arctan2)


def drawn_case(seed: int) -> tuple[NDArray[Any], dict[str, Any]]:
    """An image of any number type and look, and arguments that fit it."""
    rng = np.random.default_rng(seed)
    cell, block = rng.integers(1, 13, 2), rng.integers(1, 4, 2)
    shape = tuple(cell * (block + rng.integers(0, 5, 2)) + rng.integers(0, cell))
    channels = (int(rng.integers(1, 5)),) if rng.random() < 0.4 else ()
    kind = KINDS[rng.integers(len(KINDS))]
    looks: list[Callable[[], Any]] = [
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


@pytest.mark.parametrize("seeds", [range(100), pytest.param(range(100, 2100), marks=pytest.mark.slow)])
def test_any_image_and_arguments_give_scikit_images_numbers(seeds: range) -> None:
    assert differences(seeds) == []


@pytest.mark.parametrize("axis", [None, 1, -1])
@pytest.mark.parametrize("kind", ["uint8", "float32", "float64"])
def test_a_batch_is_its_images_one_by_one(kind: str, axis: int | None) -> None:
    images = np.random.default_rng(1).integers(0, 256, (5, 40, 33, 4)).astype(kind)
    images = images[..., 0] if axis is None else np.moveaxis(images, -1, axis)
    own = None if axis is None else axis - (axis > 0)
    one_by_one = np.stack([hog(image, channel_axis=own) for image in images])
    found = hogs(images, channel_axis=axis)
    assert found.dtype == one_by_one.dtype and np.array_equal(found, one_by_one)
    assert hogs(images[:0], channel_axis=axis).shape == (0, 3 * 2 * 3 * 3 * 9)


#: What pixels may be beside 0, 1 and 2.
LIMITS = {
    "NaN": [np.nan, 5.0],
    "infinity": [np.inf, 1.0],
    "very small and very large": [1e-200, 1e200],
    "lengths whose squares are 0": [1e-320, 0.0],
    "more than float32 holds, in which a cell is summed": [1e39, 0.0],
    "an angle that rounds to 180°": [-1e-20, 1.0],
}


@pytest.mark.parametrize("pixels", LIMITS.values(), ids=LIMITS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_numbers_at_the_limits_go_the_same_way(pixels: list[float]) -> None:
    rng = np.random.default_rng(2)
    for axis, shape in ((None, (24, 24)), (-1, (24, 24, 2))):
        image = rng.choice([0.0, 1.0, 2.0], shape)
        image[rng.random(shape) < 0.1] = pixels[0]
        image[rng.random(shape) < 0.1] = pixels[1]
        theirs, ours = (function(image, channel_axis=axis) for function in (skimage.feature.hog, hog))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_gradients_on_the_bounds_of_bins_vote_as_scikit_image_lets_them() -> None:
    for bins in range(1, 40):
        angles = np.pi * np.arange(8 * bins) / (4 * bins)
        for rows, columns in ((np.sin(angles), np.cos(angles)), (np.round(angles), np.full_like(angles, 2))):
            image = np.zeros((3, 3 * len(angles)))
            image[2, 1::3], image[1, 2::3] = rows, columns  # one gradient a cell
            arguments: dict[str, Any] = {"pixels_per_cell": (3, 3), "cells_per_block": (1, 1), "orientations": bins}
            theirs, ours = skimage.feature.hog(image, **arguments), hog(image, **arguments)
            assert abs(theirs - ours).max() <= 1e-9, bins


@pytest.mark.parametrize(
    ("image", "arguments", "says"),
    [
        (np.zeros((23, 24)), {}, "image is too small given .* 23 rows and 24 columns, and at least 24 and 24"),
        (np.zeros((24, 24)), {"block_norm": "Linf"}, "block_norm is 'Linf'; L1, L1-sqrt"),
        (np.zeros((24, 24, 3)), {}, "3 axes of pixels; 2 are wanted: `channel_axis`"),
        (np.zeros((24, 24)), {"channel_axis": -1}, "1 axes of pixels"),
        (np.zeros((24, 24), complex), {}, "complex"),
        (np.zeros((24, 24)), {"orientations": -1}, "orientations -1"),
        (np.zeros((24, 24, 3)), {"channel_axis": 5}, "out of bounds"),
    ],
)
def test_what_scikit_image_refuses_is_refused_with_what_is_wanted(image: Any, arguments: Any, says: str) -> None:
    for function in (skimage.feature.hog, hog):
        with pytest.raises(ValueError, match=says if function is hog else None):
            function(image, **arguments)
