"""Thousands of generated geometries, parameters and images, side by side with OpenCV 4.14 in one process.

A combination is made of its seed alone, so a failure names all that is needed to see it again. The normal suite runs
the first seeds; `pytest -m slow tests/parity/test_sweep.py` runs them all.
"""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.parity.goldens.case import coefficients
from tests.searches import Draw, Search, some_search

import limo_hog

QUICK_SEEDS, ALL_SEEDS, CHUNK = 200, 2400, 50
#: OpenCV clips block histograms at the value of the first block of the process, whatever a detector says.
CLIP = float(sys.argv[1]) if __name__ == "__main__" else 0.2


def both(s: Search) -> tuple[Any, Any]:
    ours: Any = limo_hog.HOGDescriptor(*s.geometry)
    theirs: Any = cv2.HOGDescriptor(*s.geometry)
    for hog in (ours, theirs):
        hog.setSVMDetector(coefficients(s.detector, limo_hog, ours.getDescriptorSize()))
    return ours, theirs


def same(what: str, ours: Any, theirs: Any, tolerance: float) -> None:
    assert type(ours) is type(theirs) and np.shape(ours) == np.shape(theirs), f"{what}: {ours}, OpenCV has {theirs}"
    if not isinstance(theirs, tuple):
        assert ours.dtype == theirs.dtype
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance, err_msg=what)


def same_gradient(s: Search) -> None:
    ours, theirs = (hog.computeGradient(s.image(), None, None, *s.around) for hog in both(s))
    same("gradient", ours[0], theirs[0], 1e-4)
    same("bins", ours[1], theirs[1], 0)


def same_descriptors(s: Search) -> None:
    for locations in (None, s.locations):
        found, expected = (hog.compute(s.image(), s.win_stride, s.padding, locations) for hog in both(s))
        same(f"descriptors at {locations or 'all'}", found, expected, 1e-5)


def same_hits(s: Search) -> None:
    hogs, image = both(s), s.image()
    for where in (s.locations, None)[: 1 + s.steps("detect")[1]]:
        scores = hogs[1].detect(image, -1e9, s.win_stride, s.padding, where)[1]
        # At a score itself (a hit) and just above it (none).
        middle = float(np.median(scores)) if len(scores) else 0.0
        for threshold in (-1e9, middle, math.nextafter(middle, math.inf)):
            found, expected = (hog.detect(image, threshold, s.win_stride, s.padding, where) for hog in hogs)
            same(f"places of hits at {threshold}", found[0], expected[0], 0)
            same(f"weights of hits at {threshold}", found[1], expected[1], 1e-5)


def same_people(s: Search) -> None:
    hogs, image = both(s), s.image()
    arguments = (s.win_stride, s.padding, s.scale)
    weights = hogs[1].detectMultiScale(image, -1e9, *arguments, 0)[1]
    threshold = float(Draw(s.seed).choice(weights)) if len(weights) else 0.0
    groupings: list[tuple[float, float, bool]] = [(threshold, 0, False), (threshold, 1, False), (threshold, 2.7, False)]
    # The density of mean-shift is one only where all weights are positive; its time grows with the cube of the hits,
    # and for windows of a few pixels it takes minutes, in OpenCV too.
    strong = max(float(np.sort(weights)[-40:][0]), 0.01) if len(weights) else math.inf
    if min(s.geometry[0]) >= 16 and 0 < np.count_nonzero(np.asarray(weights) >= strong) <= 60:
        groupings.append((strong, 0.1, True))
    for hit, group, mean_shift in groupings:
        found, expected = (hog.detectMultiScale(image, hit, *arguments, group, mean_shift) for hog in hogs)
        what = f"at {hit} grouped by {group}, mean-shift {mean_shift}"
        same(f"rectangles {what}", found[0], expected[0], 0)
        same(f"weights {what}", found[1], expected[1], 1e-5)


def same_groups(s: Search) -> None:
    draw = Draw(s.seed)
    rects = [(*draw.pair(0, 40), *draw.pair(10, 50)) for _ in range(draw.randint(1, 30))]
    arguments: Any = rects, draw.randint(0, 3), draw.choice((0.2, 0.05, 1.0))
    found, expected = limo_hog.groupRectangles(*arguments), cv2.groupRectangles(*arguments)
    same("groups", found[0], expected[0], 0)
    same("members", found[1], expected[1], 0)


def differences(seed: int) -> Iterator[str]:
    s = some_search(seed, CLIP)
    checks: list[Callable[[Search], None]] = [same_groups, same_gradient]
    if s.fits("detect"):
        checks += [same_descriptors, same_hits]
    if s.fits("detectMultiScale") and s.steps("detectMultiScale")[1]:
        checks.append(same_people)
    for check in checks:
        try:
            check(s)
        except (AssertionError, cv2.error, limo_hog.HogError) as error:  # noqa: PERF203 - one failed check hides no other
            yield f"{s}, image {s.image().strides}\n{check.__name__}: {type(error).__name__}: {error}"


SLOW = [pytest.param(first, marks=pytest.mark.slow) for first in range(QUICK_SEEDS, ALL_SEEDS, CHUNK)]


@pytest.mark.parametrize("first", [*range(0, QUICK_SEEDS, CHUNK), *SLOW])
def test_generated_combinations_are_as_in_opencv(first: int) -> None:
    found = [text for seed in range(first, first + CHUNK) for text in differences(seed)]
    assert not found, f"{len(found)} of {CHUNK} combinations differ; the first:\n{found[0]}"


@pytest.mark.parametrize("clip", [0.05, 0.5, 1.5])
def test_other_clipping_values_are_as_in_opencv(clip: float) -> None:
    command = [sys.executable, "-m", "tests.parity.test_sweep", str(clip)]
    run = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stderr


if __name__ == "__main__":
    cv2.setNumThreads(1)
    cv2.HOGDescriptor((64, 128), (16, 16), (8, 8), (8, 8), 9, 1, -1.0, 0, CLIP).compute(np.zeros((128, 64), np.uint8))
    test_generated_combinations_are_as_in_opencv(0)
