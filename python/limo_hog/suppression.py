"""Non-maximum suppression (NMS): one box for each person out of many overlapping hits.

Boxes are (N, 4) x, y, w, h [px], scores (N,), larger is surer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.floating[Any]] | NDArray[np.integer[Any]]
Scores = NDArray[np.floating[Any]]
#: Overlap of each of M boxes with each of N: float64 (M, N) in 0..1.
Overlap = Callable[[Boxes, Boxes], NDArray[np.float64]]

#: Boxes that `nms` decides on together; of 64 to 1024 the fastest for 100 to 10,000 boxes.
_CHUNK = 256


def intersection_over_union(some: Boxes, others: Boxes) -> NDArray[np.float64]:
    """Return the shared area over the area of both together: float64 (M, N) in 0..1; 0 for boxes without area."""
    shared, areas, other_areas = _areas(some, others)
    return _ratio(shared, areas + other_areas - shared)


def intersection_over_smaller(some: Boxes, others: Boxes) -> NDArray[np.float64]:
    """Return the shared area over the smaller box's: float64 (M, N) in 0..1; 0 for boxes without area.

    A box that lies inside another has 1, however small it is: a part of a person is no second person.
    """
    shared, areas, other_areas = _areas(some, others)
    smaller = np.minimum(areas, other_areas)
    # Rounding may leave a box that lies inside another a little more than its own area.
    return _ratio(np.minimum(shared, smaller), smaller)


def share_inside(some: Boxes, others: Boxes) -> NDArray[np.float64]:
    """Return the shared area over that of the first box: float64 (M, N) in 0..1; 0 for boxes without area."""
    shared, areas, _ = _areas(some, others)
    return _ratio(shared, np.broadcast_to(areas, shared.shape))


def nms(
    boxes: Boxes,
    scores: Scores,
    threshold: float,
    overlap: Overlap = intersection_over_union,
    most: int | None = None,
) -> NDArray[np.intp]:
    """Return the indices of the boxes to keep, best first (greedy NMS; of equal scores the first box wins).

    The best box is kept and removes every box whose `overlap` with it is above `threshold`; then the best of the
    rest, and so on, until there are `most`, if that is given.
    """
    waiting = np.argsort(-scores, kind="stable")
    kept = np.empty(0, np.intp)
    while waiting.size and (most is None or len(kept) < most):
        # The best few are decided on together: first by what is kept already, then among themselves.
        best, waiting = waiting[:_CHUNK], waiting[_CHUNK:]
        best = best[~(overlap(boxes[best], boxes[kept]) > threshold).any(axis=1)]
        removes = overlap(boxes[best], boxes[best]) > threshold
        stays = np.ones(len(best), np.bool_)
        for i in range(len(best)):
            if stays[i]:
                stays[i + 1 :] &= ~removes[i, i + 1 :]
        kept = np.concatenate([kept, best[stays]])
    return kept[:most]


def voted(
    boxes: Boxes, scores: Scores, kept: NDArray[np.intp], threshold: float, softness: float
) -> NDArray[np.float64]:
    """Return each kept box as the mean of all that overlap with it by `threshold` or more (IoU): float64 (K, 4).

    A box whose score is lower by d than the kept one's counts exp(-d / `softness`) (box voting: Gidaris and Komodakis
    2015, there with the scores for weights).
    """
    weights = np.exp((scores - scores[kept, None]) / softness)
    weights[intersection_over_union(boxes[kept], boxes) < threshold] = 0
    edges = np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]])
    means = weights @ edges / weights.sum(axis=1, keepdims=True)
    return np.hstack([means[:, :2], means[:, 2:] - means[:, :2]])


def _areas(some: Boxes, others: Boxes) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return shared areas (M, N), areas (M, 1) and (N,) [px²]."""
    x, y, w, h = np.asarray(some, np.float64).T[:, :, None]
    x2, y2, w2, h2 = np.asarray(others, np.float64).T
    width = np.minimum(x + w, x2 + w2) - np.maximum(x, x2)
    height = np.minimum(y + h, y2 + h2) - np.maximum(y, y2)
    return np.maximum(width, 0) * np.maximum(height, 0), w * h, w2 * h2


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    ratio: NDArray[np.float64] = np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0)
    return ratio
