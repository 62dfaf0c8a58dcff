"""Thousands of generated geometries, parameters and images, side by side with OpenCV 4.14 in one process.

A combination is made of its seed alone, so a failure names all that is needed to see it again. The normal suite runs
the first seeds; `pytest -m slow tests/parity/test_sweep.py` runs them all.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
import skimage.data
from numpy.typing import NDArray

import limo_hog

QUICK_SEEDS, ALL_SEEDS, CHUNK = 200, 2400, 50
#: OpenCV clips block histograms at the value of the first block of the process, whatever a detector says.
CLIP = float(sys.argv[1]) if __name__ == "__main__" else 0.2
#: About the most values and windows of one `compute` call: larger strides are taken where it would be more.
ELEMENTS_MAX, WINDOWS_MAX = 2_000_000, 1_500

PEOPLE_MODELS = {
    3780: limo_hog.HOGDescriptor_getDefaultPeopleDetector(),
    1980: limo_hog.HOGDescriptor_getDaimlerPeopleDetector(),
}

Image = NDArray[np.uint8]
Pair = tuple[int, int]


@dataclass(frozen=True)
class Combination:
    """One geometry with what is asked of it."""

    seed: int
    geometry: tuple[Any, ...]
    image: Image
    svm: NDArray[np.float32]
    win_stride: Pair | None
    padding: Pair | None
    around: tuple[Pair, Pair]
    locations: list[Pair]
    scale: float

    def __str__(self) -> str:
        wanted = f"winStride {self.win_stride} padding {self.padding} around {self.around} scale {self.scale}"
        return (
            f"seed {self.seed}: HOGDescriptor{self.geometry}, image {self.image.shape} {self.image.strides}, {wanted}"
        )


@cache
def photographs() -> list[Image]:
    pictures: Any = skimage.data
    return [pictures.astronaut(), pictures.coffee(), pictures.rocket()]


def pair_of(rng: np.random.Generator, low: int, high: int) -> Pair:
    x, y = rng.integers(low, high, 2)
    return int(x), int(x if rng.random() < 0.5 else y)


def some_image(rng: np.random.Generator, width: int, height: int) -> Image:
    """Noise, few-valued noise (colour ties), a photograph's detail, or a flat picture; in any memory layout."""
    kind = rng.choice(["noise", "ties", "photograph", "flat"], p=[0.3, 0.15, 0.5, 0.05])
    if kind == "photograph":
        photograph = photographs()[rng.integers(3)]
        y, x = rng.integers(0, 100, 2)
        image = np.resize(photograph[y : y + height, x : x + width], (height, width, 3))
    else:
        top = {"noise": 256, "ties": 3, "flat": 1}[str(kind)]
        image = rng.integers(0, top, (height, width, 3), dtype=np.uint8)
    if rng.random() < 0.5:
        image = image[:, :, 1:2] if rng.random() < 0.2 else image[:, :, 1]
    layout = rng.choice(["C", "F", "flipped", "view", "read-only"])
    image = np.asarray(image, order="F") if layout == "F" else np.ascontiguousarray(image)
    if layout == "flipped":
        image = image[::-1, ::-1]
    elif layout == "view":
        image = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[::2, ::2]
    elif layout == "read-only":
        image.flags.writeable = False
    return image


def some_geometry(rng: np.random.Generator) -> tuple[Any, ...]:
    """Constructor arguments; OpenCV reads past the block's end where it has fewer than 4 elements."""
    shape = rng.random()
    if shape < 0.15:
        sizes: list[Pair] = [(64, 128) if shape < 0.1 else (48, 96), (16, 16), (8, 8), (8, 8)]
        nbins = 9
    else:
        cell = pair_of(rng, 2, 13)
        cells = pair_of(rng, 1, 4)
        block = (cell[0] * cells[0], cell[1] * cells[1])
        stride = (cell, block, pair_of(rng, 1, 17))[rng.integers(3)]
        blocks = pair_of(rng, 1, 6)
        win = (block[0] + (blocks[0] - 1) * stride[0], block[1] + (blocks[1] - 1) * stride[1])
        sizes = [win, block, stride, cell]
        nbins = int(rng.choice([1, 2, 3, 4, 7, 9, 9, 9, 12, 18, 31, 127, 128]))
        nbins = max(nbins, math.ceil(4 / (cells[0] * cells[1])))
    sigma = float(rng.choice([-1.0, 0.0, 0.7, 3.0, 12.0]))
    gamma, signed = (bool(flag) for flag in rng.integers(0, 2, 2))
    nlevels = int(rng.choice([1, 3, 64]))
    return (*sizes, nbins, 1, sigma, 0, CLIP, gamma, nlevels, signed)


def steps_of(combination: Combination, default_stride: Pair) -> tuple[Pair, Pair, bool]:
    """Window stride, padding as OpenCV rounds it, and whether its `detect` accepts the latter (§2)."""
    stride = combination.win_stride or default_stride
    block_stride = combination.geometry[2]
    common = [math.gcd(stride[i], block_stride[i]) for i in (0, 1)]
    asked = combination.padding or (0, 0)
    pad = [(max(asked[i], 0) + common[i] - 1) & -common[i] for i in (0, 1)]
    return stride, (pad[0], pad[1]), all(pad[i] % common[i] == 0 for i in (0, 1))


def window_fits(combination: Combination, default_stride: Pair) -> bool:
    """Where the padded image is smaller than the window OpenCV reads and writes foreign memory."""
    _, pad, _ = steps_of(combination, default_stride)
    height, width = combination.image.shape[:2]
    win = combination.geometry[0]
    return bool(width + 2 * pad[0] >= win[0] and height + 2 * pad[1] >= win[1])


def some_combination(seed: int) -> Combination:
    rng = np.random.default_rng(seed)
    geometry = some_geometry(rng)
    win, cell, block_stride = geometry[0], geometry[3], geometry[2]
    room = pair_of(rng, -20, 120)
    width, height = max(win[0] + room[0], 1), max(win[1] + room[1], 1)
    padding = (None, (0, 0), pair_of(rng, 0, 48), pair_of(rng, -8, 80))[rng.choice(4, p=[0.2, 0.1, 0.5, 0.2])]
    win_stride = (None, block_stride, cell, pair_of(rng, 1, 33), (100, 100))[rng.choice(5, p=[0.3, 0.2, 0.2, 0.2, 0.1])]
    size = limo_hog.HOGDescriptor(*geometry).getDescriptorSize()
    windows = (max(width - win[0] + 160, 1), max(height - win[1] + 160, 1))
    step = win_stride or cell
    while max(size, ELEMENTS_MAX // WINDOWS_MAX) * windows[0] * windows[1] / (step[0] * step[1]) > ELEMENTS_MAX:
        win_stride = step = (step[0] * 2 + 1, step[1] * 2)
    svm = rng.normal(0.0, 1.0, size + int(rng.integers(0, 2))).astype(np.float32)
    if size in PEOPLE_MODELS and rng.random() < 0.8:
        svm = PEOPLE_MODELS[size]
    return Combination(
        seed=seed,
        geometry=geometry,
        image=some_image(rng, width, height),
        svm=svm,
        win_stride=win_stride,
        padding=padding,
        around=(pair_of(rng, 4, 20), pair_of(rng, -4, 20)),
        locations=[pair_of(rng, -30, 120) for _ in range(6)],
        scale=float(rng.choice([1.02, 1.05, 1.1, 1.3, 2.0, 1.0, 0.5])),
    )


def both(combination: Combination) -> tuple[Any, Any]:
    ours: Any = limo_hog.HOGDescriptor(*combination.geometry)
    theirs: Any = cv2.HOGDescriptor(*combination.geometry)
    for hog in (ours, theirs):
        hog.setSVMDetector(combination.svm)
    return ours, theirs


def same(what: str, ours: Any, theirs: Any, tolerance: float) -> None:
    if isinstance(theirs, tuple) and theirs == ():
        assert isinstance(ours, tuple) and ours == (), f"{what}: {np.shape(ours)} where OpenCV has ()"
        return
    assert np.shape(ours) == theirs.shape, f"{what}: {np.shape(ours)} where OpenCV has {theirs.shape}"
    assert ours.dtype == theirs.dtype
    if tolerance:
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance, err_msg=what)
    else:
        np.testing.assert_array_equal(ours, theirs, err_msg=what)


def same_gradient(c: Combination) -> None:
    ours, theirs = (hog.computeGradient(c.image, None, None, *c.around) for hog in both(c))
    same("gradient", ours[0], theirs[0], 1e-4)
    same("bins", ours[1], theirs[1], 0)


def same_descriptors(c: Combination) -> None:
    ours, theirs = both(c)
    for locations in (None, c.locations):
        found, expected = (hog.compute(c.image, c.win_stride, c.padding, locations) for hog in (ours, theirs))
        same(f"descriptors at {locations or 'all'}", found, expected, 1e-5)


def same_hits(c: Combination) -> None:
    ours, theirs = both(c)
    locations: list[Any] = [c.locations]
    if steps_of(c, c.geometry[3])[2]:
        locations.append(None)
    for where in locations:
        scores = theirs.detect(c.image, -1e9, c.win_stride, c.padding, where)[1]
        # At a score itself (a hit) and just above it (none).
        middle = float(np.median(scores)) if len(scores) else 0.0
        for threshold in (-1e9, middle, math.nextafter(middle, math.inf)):
            found, expected = (hog.detect(c.image, threshold, c.win_stride, c.padding, where) for hog in (ours, theirs))
            same(f"places of hits at {threshold}", found[0], expected[0], 0)
            same(f"weights of hits at {threshold}", found[1], expected[1], 1e-5)


def same_people(c: Combination) -> None:
    ours, theirs = both(c)
    arguments = (c.win_stride, c.padding, c.scale)
    weights = theirs.detectMultiScale(c.image, -1e9, *arguments, 0)[1]
    rng = np.random.default_rng(c.seed)
    threshold = float(rng.choice(weights)) if len(weights) else 0.0
    groupings: list[tuple[float, float, bool]] = [(threshold, 0, False), (threshold, 1, False), (threshold, 2.7, False)]
    # The density of mean-shift is one only where all weights are positive; its time grows with the cube of the hits.
    strong = max(float(np.sort(weights)[-40:][0]), 0.01) if len(weights) else math.inf
    if 0 < np.count_nonzero(np.asarray(weights) >= strong) <= 60:
        groupings.append((strong, 0.1, True))
    for hit_threshold, group_threshold, mean_shift in groupings:
        found, expected = (
            hog.detectMultiScale(c.image, hit_threshold, *arguments, group_threshold, mean_shift)
            for hog in (ours, theirs)
        )
        what = f"at {hit_threshold} grouped by {group_threshold}, mean-shift {mean_shift}"
        same(f"rectangles {what}", found[0], expected[0], 0)
        same(f"weights {what}", found[1], expected[1], 1e-5)


@contextmanager
def catching() -> Iterator[list[Exception]]:
    caught: list[Exception] = []
    try:
        yield caught
    except (AssertionError, cv2.error, limo_hog.HogError) as error:
        caught.append(error)


def differences(seed: int) -> Iterator[str]:
    c = some_combination(seed)
    checks = [same_gradient]
    if window_fits(c, c.geometry[3]):
        checks += [same_descriptors, same_hits]
    if window_fits(c, c.geometry[2]) and steps_of(c, c.geometry[2])[2]:
        checks.append(same_people)
    for check in checks:
        with catching() as caught:
            check(c)
        for error in caught:
            yield f"{c}\n{check.__name__}: {type(error).__name__}: {error}"


def expect_no_difference(first: int) -> None:
    found = [text for seed in range(first, first + CHUNK) for text in differences(seed)]
    assert not found, f"{len(found)} of {CHUNK} combinations differ; the first:\n{found[0]}"


@pytest.mark.parametrize("first", range(0, QUICK_SEEDS, CHUNK))
def test_generated_combinations_are_as_in_opencv(first: int) -> None:
    expect_no_difference(first)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(QUICK_SEEDS, ALL_SEEDS, CHUNK))
def test_all_generated_combinations_are_as_in_opencv(first: int) -> None:
    expect_no_difference(first)


@pytest.mark.parametrize("clip", [0.05, 0.5, 1.5])
def test_other_clipping_values_are_as_in_opencv(clip: float) -> None:
    run = subprocess.run([sys.executable, __file__, str(clip)], capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stderr


if __name__ == "__main__":
    cv2.setNumThreads(1)
    cv2.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, CLIP).compute(np.zeros((128, 64), np.uint8))
    expect_no_difference(0)
