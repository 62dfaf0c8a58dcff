"""IoU and soft suppression agree with their definitions."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from limo_hog.suppression import overlaps, soften, suppress


def test_overlap_is_intersection_over_union() -> None:
    boxes = np.array([[0, 0, 10, 10], [5, 0, 10, 10], [20, 20, 5, 5], [0, 0, 0, 0]])
    assert overlaps(boxes[0], boxes) == pytest.approx([1.0, 50 / 150, 0.0, 0.0])


def test_suppression_keeps_what_opencvs_keeps() -> None:
    random = np.random.default_rng(1)
    boxes = np.concatenate([random.integers(0, 80, (200, 2)), random.integers(20, 60, (200, 2))], axis=1)
    scores = random.permutation(200) / 200 + 0.001
    theirs = cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), 0.0, 0.4)
    assert suppress(boxes, scores, 0.4).tolist() == list(theirs)


def test_nothing_suppressed_is_nothing_kept() -> None:
    empty = np.empty((0, 4), np.int32)
    assert suppress(empty, np.empty(0), 0.5).size == 0
    assert soften(empty, np.empty(0), 0.5, 0.0)[0].size == 0


def test_soft_suppression_lowers_neighbours_and_keeps_strangers() -> None:
    boxes = np.array([[0, 0, 10, 10], [2, 0, 10, 10], [50, 0, 10, 10]])
    kept, scores = soften(boxes, np.array([2.0, 1.5, 1.0]), 0.5, 0.0)
    assert kept.tolist() == [0, 2, 1]
    assert scores == pytest.approx([2.0, 1.0, 1.5 * np.exp(-((80 / 120) ** 2) / 0.5)])


def test_soft_suppression_drops_what_is_left_of_a_copy() -> None:
    boxes = np.array([[0, 0, 10, 10]] * 2)
    kept, _ = soften(boxes, np.array([2.0, 0.1]), 0.1, 0.0)
    assert kept.tolist() == [0]
