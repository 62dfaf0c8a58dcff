"""Non-maximum suppression agrees with its definitions and with OpenCV's."""

import time
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.models import PERSON_BOX
from limo_hog.suppression import intersection_over_smaller, intersection_over_union, nms, voted

Boxes = NDArray[np.int_]


def crowd(count: int, people: int, seed: int = 0) -> tuple[Boxes, NDArray[np.float64]]:
    """Hits around some places, as a detector finds them; few scores are equal."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 1500, (people, 2))[rng.integers(0, people, count)] + rng.integers(-12, 13, (count, 2))
    sides = np.outer(rng.uniform(1, 2, count), (64, 128)).astype(int)
    return np.concatenate([corners, sides], axis=1), np.round(rng.random(count), 3)


def greedy(boxes: Boxes, scores: NDArray[Any], threshold: float, smaller: bool) -> list[int]:
    """The definition, box by box."""
    kept: list[int] = []
    for i in sorted(range(len(boxes)), key=lambda i: (-scores[i], i)):
        for j in kept:
            (ax, ay, aw, ah), (bx, by, bw, bh) = boxes[i].tolist(), boxes[j].tolist()
            shared = max(0, min(ax + aw, bx + bw) - max(ax, bx)) * max(0, min(ay + ah, by + bh) - max(ay, by))
            whole = min(aw * ah, bw * bh) if smaller else aw * ah + bw * bh - shared
            if shared / whole > threshold:
                break
        else:
            kept.append(i)
    return kept


def test_overlap_is_shared_area_over_the_union_or_over_the_smaller() -> None:
    boxes = np.array([[0, 0, 10, 10], [5, 0, 10, 10], [10, 0, 10, 10], [3, 3, 0, 0], [2, 2, 5, 4]])
    assert intersection_over_union(boxes[:1], boxes) == pytest.approx(np.array([[1, 50 / 150, 0, 0, 0.2]]))
    assert intersection_over_smaller(boxes[:1], boxes) == pytest.approx(np.array([[1, 0.5, 0, 0, 1]]))
    assert intersection_over_union(boxes, boxes[:2]).shape == (5, 2)


@pytest.mark.parametrize("count", [0, 1, 2, 255, 256, 257, 700])
@pytest.mark.parametrize("threshold", [0.0, 0.3, 0.65, 1.0])
def test_nms_keeps_what_its_definition_keeps(count: int, threshold: float) -> None:
    boxes, scores = crowd(count, 1 + count // 20)
    for smaller, measure in enumerate((intersection_over_union, intersection_over_smaller)):
        assert nms(boxes, scores, threshold, measure).tolist() == greedy(boxes, scores, threshold, bool(smaller))


def test_nms_keeps_what_opencvs_keeps() -> None:
    boxes, scores = crowd(60, 8)
    scores += np.random.default_rng(1).random(60) * 1e-4  # OpenCV orders equal scores in its own way
    theirs = cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), 0.0, 0.4)
    assert nms(boxes, scores, 0.4).tolist() == list(theirs)


def test_thousands_of_hits_are_suppressed_at_once() -> None:
    boxes, scores = crowd(5000, 100)
    start = time.process_time()
    nms(boxes, scores, 0.65, intersection_over_smaller)
    # 5 ms on a quiet machine; box by box it is seconds.
    assert time.process_time() - start < 0.2


def test_boxes_that_overlap_vote_on_where_a_person_stands_the_better_the_more() -> None:
    boxes = np.array([[0, 0, 40, 80], [8, 4, 40, 80], [200, 0, 40, 80]], float)
    equal = voted(boxes, np.array([1.0, 1.0, 3.0]), np.array([2, 0]), 0.5, 0.3)
    np.testing.assert_allclose(equal, [[200, 0, 40, 80], [4, 2, 40, 80]])
    (lower,) = voted(boxes, np.array([1.0, 0.7, 3.0]), np.array([0]), 0.5, 0.3)
    np.testing.assert_allclose(lower[:2], np.array([8, 4]) * np.exp(-1) / (1 + np.exp(-1)))
    assert voted(boxes, np.zeros(3), np.empty(0, np.intp), 0.5, 0.3).shape == (0, 4)


def test_a_window_around_a_persons_box_is_the_one_that_the_box_is_inside_of() -> None:
    windows = np.array([[10.0, -20.0, 64.0, 128.0], [3.5, 7.25, 100.0, 90.0]])
    np.testing.assert_allclose(PERSON_BOX.around(PERSON_BOX.inside(windows)), windows)
