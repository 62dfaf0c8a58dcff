"""Two ways to make one box of many, besides OpenCV's grouping.

Boxes are (N, 4) x, y, w, h [px], scores (N,), larger is surer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.floating[Any]] | NDArray[np.integer[Any]]
Scores = NDArray[np.floating[Any]]


def overlaps(box: NDArray[Any], boxes: Boxes) -> NDArray[np.float64]:
    """Return the intersection over union of one box (4,) with each of `boxes`: float64 (N,) in 0..1."""
    corner, corners = box[:2] + box[2:], boxes[:, :2] + boxes[:, 2:]
    sides = np.minimum(corner, corners) - np.maximum(box[:2], boxes[:, :2])
    shared = np.clip(sides, 0, None).astype(np.float64).prod(axis=1)
    union = float(np.prod(box[2:])) + boxes[:, 2:].astype(np.float64).prod(axis=1) - shared
    share: NDArray[np.float64] = np.divide(shared, union, out=np.zeros(len(boxes)), where=union > 0)
    return share


def suppress(boxes: Boxes, scores: Scores, overlap: float) -> NDArray[np.intp]:
    """Return the indices of the boxes to keep, best first.

    The best box goes first and takes with it every box that overlaps it by more than `overlap`; then the best of
    the rest, and so on.
    """
    waiting = np.argsort(-scores, kind="stable")
    kept = []
    while waiting.size:
        best, rest = waiting[0], waiting[1:]
        kept.append(best)
        waiting = rest[overlaps(boxes[best], boxes[rest]) <= overlap]
    return np.array(kept, np.intp)


def soften(
    boxes: Boxes, scores: Scores, sigma: float, threshold: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the indices of the boxes to keep, best first, and their lowered scores.

    Each box that is taken lowers the others' scores by exp(-overlap² / sigma), so that somebody half hidden behind
    somebody else stays; boxes that fall below `threshold` go. (Bodla et al., Soft-NMS, ICCV 2017.) A margin may be
    negative; lowering multiplies what it has above `threshold`.
    """
    above = scores.astype(np.float64) - threshold
    waiting = np.flatnonzero(above >= 0)
    kept: list[int] = []
    left: list[float] = []
    # Less than a twentieth of the best is nobody.
    least = 0.05 * float(above.max(initial=0.0))
    while waiting.size:
        first = int(np.argmax(above[waiting]))
        best = int(waiting[first])
        kept.append(best)
        left.append(float(above[best]) + threshold)
        waiting = np.delete(waiting, first)
        above[waiting] *= np.exp(-(overlaps(boxes[best], boxes[waiting]) ** 2) / sigma)
        waiting = waiting[above[waiting] > least]
    return np.array(kept, np.intp), np.array(left)
