"""The number of threads changes the time a search takes, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

import limo_hog


@pytest.fixture
def image() -> NDArray[np.uint8]:
    """Coarse noise: weak hits all over the pyramid at a low threshold."""
    noise = np.random.default_rng(20).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    return noise.repeat(5, axis=0).repeat(5, axis=1)


@pytest.fixture(autouse=True)
def threads_as_before() -> Iterator[None]:
    yield
    limo_hog.set_num_threads(0)


@pytest.mark.parametrize("group_threshold", [0, 1])
def test_rectangles_are_the_same_with_1_2_and_8_threads_a_hundred_times(
    image: NDArray[np.uint8], group_threshold: int
) -> None:
    hog = limo_hog.HOGDescriptor()
    hog.setSVMDetector(limo_hog.HOGDescriptor_getDefaultPeopleDetector())
    answers = []
    for run in range(100):
        limo_hog.set_num_threads((1, 2, 8)[run % 3])
        rects, weights = hog.detectMultiScale(image, hitThreshold=-2.4, scale=1.2, groupThreshold=group_threshold)
        answers.append((np.asarray(rects).tolist(), np.asarray(weights).tolist()))
    assert len(answers[0][0]) > 3
    assert all(answer == answers[0] for answer in answers)


def test_one_detector_serves_many_threads_at_once(image: NDArray[np.uint8]) -> None:
    detector = limo_hog.PeopleDetector(threshold=-2.4, scale=1.2, min_height=None, nms="group")
    alone = detector.detect(image)
    with ThreadPoolExecutor(8) as pool:
        for together in pool.map(detector.detect, [image] * 16):
            np.testing.assert_array_equal(together.boxes, alone.boxes)
            np.testing.assert_array_equal(together.scores, alone.scores)


def test_the_number_of_threads_is_what_was_set() -> None:
    limo_hog.set_num_threads(3)
    assert limo_hog.get_num_threads() == 3
    limo_hog.set_num_threads(0)
    assert limo_hog.get_num_threads() >= 1
