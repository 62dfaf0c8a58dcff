"""How good detections are: which are right, the DET curve, log-average miss rate, average precision.

Miss rate over false positives per image (FPPI) as Dollár, Wojek, Schiele and Perona, "Pedestrian Detection: An
Evaluation of the State of the Art" (PAMI 2012); average precision as COCO's (101 points).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog.suppression import intersection_over_union, share_inside

#: FPPI at which the log-average miss rate looks: nine, evenly spread over 10⁻²…10⁰ in the logarithm (Dollár 2012).
LAMR_FPPI = np.logspace(-2, 0, 9)
#: A miss rate of 0 has no logarithm (Dollár's toolbox has this value, too).
_LEAST_MISS_RATE = 1e-10
#: Shares of false positives a floating-point comparison may be off.
_SLACK = 1e-9


class Match(NamedTuple):
    """What became of one picture's detections and boxes."""

    #: int (D,): index of the box found, -1 for a false alarm, -2 for a detection that does not count.
    detections: NDArray[np.intp]
    boxes: NDArray[np.intp]  #: int (N,): index of the detection that found it, -1 where none did


def match(
    found: NDArray[np.float64], boxes: NDArray[np.float64], ignored: NDArray[np.bool_], min_iou: float = 0.5
) -> Match:
    """Pair detections, float64 (D, 4) x, y, w, h [px], best first, with labelled boxes, (N, 4), some of them ignored.

    A detection takes the box it overlaps most (IoU) of those still free, if that is `min_iou` or more. What is left
    over and lies, by `min_iou` of its own area or more, in an ignored box, bool (N,), does not count.
    """
    iou = intersection_over_union(found, boxes)
    within = share_inside(found, boxes)
    of_detection = np.full(len(found), -1, np.intp)
    of_box = np.full(len(boxes), -1, np.intp)
    for i in range(len(found)):
        free = np.where((of_box < 0) & ~ignored, iou[i], -1.0)
        best = int(free.argmax()) if len(boxes) else -1
        if best >= 0 and free[best] >= min_iou:
            of_detection[i], of_box[best] = best, i
        elif (ignored & (within[i] >= min_iou)).any():
            of_detection[i] = -2
    return Match(of_detection, of_box)


@dataclass(frozen=True, slots=True)
class Outcomes:
    """What a detector did on a set of pictures: all that the figures are computed from."""

    #: scores, right, picture: float64, bool and int (D,): each detection that counts, best first; whether it is right;
    #: its picture's index.
    scores: NDArray[np.float64]
    right: NDArray[np.bool_]
    picture: NDArray[np.intp]
    objects: NDArray[np.intp]  #: int (P,): how many boxes each picture has
    #: float64 (N,): the score at which each box was found, picture by picture; -inf where it was not.
    found_at: NDArray[np.float64]
    heights: NDArray[np.float64]  #: float64 (N,): the height of each box [px]


def collect(
    found: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
    labelled: Sequence[tuple[NDArray[np.float64], NDArray[np.bool_]]],
    min_iou: float = 0.5,
) -> tuple[Outcomes, list[Match]]:
    """Match every picture's detections and put them together.

    Of each picture `found` has boxes float64 (D, 4) and scores (D,), best first, `labelled` boxes float64 (N, 4) and
    which are ignored, bool (N,).
    """
    matches = []
    scores, right, picture, found_at = [], [], [], []
    for i, ((found_boxes, found_scores), (boxes, ignored)) in enumerate(zip(found, labelled, strict=True)):
        pairs = match(found_boxes, boxes, ignored, min_iou)
        matches.append(pairs)
        counts = pairs.detections != -2
        scores.append(found_scores[counts])
        right.append(pairs.detections[counts] >= 0)
        picture.append(np.full(int(counts.sum()), i, np.intp))
        of_box = pairs.boxes[~ignored]
        at = np.full(len(of_box), -np.inf)
        at[of_box >= 0] = found_scores[of_box[of_box >= 0]]
        found_at.append(at)
    # Stable, so that of equal scores the earlier picture's goes first, as in COCO's evaluation.
    all_scores = _joined(scores, np.float64)
    order = np.argsort(-all_scores, kind="stable")
    outcomes = Outcomes(
        all_scores[order],
        _joined(right, np.bool_)[order],
        _joined(picture, np.intp)[order],
        np.array([int((~ignored).sum()) for _, ignored in labelled], np.intp),
        _joined(found_at, np.float64),
        _joined([boxes[~ignored, 3] for boxes, ignored in labelled], np.float64),
    )
    return outcomes, matches


def _joined(parts: list[NDArray], dtype: type) -> NDArray:  # type: ignore[type-arg]  # any dtype, given beside
    return np.concatenate(parts).astype(dtype) if parts else np.empty(0, dtype)


class Curve(NamedTuple):
    """Points of the DET curve, by falling threshold: float64 (K,) each."""

    thresholds: NDArray[np.float64]  #: least score that counts as a detection
    recall: NDArray[np.float64]  #: share of the boxes that are found
    fppi: NDArray[np.float64]  #: false positives per image
    precision: NDArray[np.float64]  #: share of the detections that are right


class Figures(NamedTuple):
    """The figures that sum up a curve; all are better the larger, but `lamr`."""

    #: Log-average miss rate: geometric mean of the miss rates at nine FPPI over 10⁻²…10⁰, each with the largest recall
    #: whose FPPI is not above it.
    lamr: float
    #: recall_01, recall_1: largest recall with an FPPI of 0.1 or 1 at most
    recall_01: float
    recall_1: float
    ap: float  #: average precision, COCO's at the IoU of the matching


def curve(outcomes: Outcomes) -> Curve:
    """Return the DET curve: a point for each distinct score, since no threshold parts equal scores."""
    ends = _last_of_equals(outcomes.scores)
    right = np.cumsum(outcomes.right)[ends]
    wrong = np.cumsum(~outcomes.right)[ends]
    return Curve(
        outcomes.scores[ends],
        right / max(1, int(outcomes.objects.sum())),
        wrong / max(1, len(outcomes.objects)),
        right / np.maximum(right + wrong, 1),
    )


def threshold_at(points: Curve, fppi: float) -> float:
    """Return the least threshold with at most `fppi` false positives per image; infinity where none has."""
    allowed = int((points.fppi <= fppi * (1 + _SLACK)).sum())
    return float(points.thresholds[allowed - 1]) if allowed else float("inf")


def figures(outcomes: Outcomes) -> Figures:
    """Return the figures of a set of pictures."""
    weights = np.ones((1, len(outcomes.objects)), np.int64)
    return Figures(*_weighted_figures(outcomes, weights)[0].tolist())


def bootstrap(outcomes: Outcomes, draws: int, seed: int) -> NDArray[np.float64]:
    """Return the figures of `draws` sets of as many pictures, drawn with replacement: float64 (draws, 4).

    For one seed and number of pictures the sets are the same, so that two detectors can be compared draw by draw.
    """
    pictures = len(outcomes.objects)
    weights = np.random.default_rng(seed).multinomial(pictures, np.full(pictures, 1 / pictures), size=draws)
    # A few draws at once bound the memory.
    parts = np.array_split(weights, max(1, draws * max(1, len(outcomes.scores)) // 2_000_000))
    return np.concatenate([_weighted_figures(outcomes, part) for part in parts])


def _last_of_equals(scores: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.flatnonzero(np.append(scores[1:] != scores[:-1], True)) if len(scores) else np.empty(0, np.intp)


def _weighted_figures(outcomes: Outcomes, weights: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the figures (draws, 4) with each picture taken as often as `weights` (draws, pictures) says."""
    each = weights[:, outcomes.picture]
    right = np.cumsum(each * outcomes.right, axis=1)
    wrong = np.cumsum(each * ~outcomes.right, axis=1)
    objects, pictures = weights @ outcomes.objects, weights.sum(axis=1)
    ends = _last_of_equals(outcomes.scores)
    rows = []
    for i in range(len(weights)):
        if not objects[i]:
            rows.append([np.nan] * 4)
            continue
        recall = np.append(0.0, right[i, ends] / objects[i])
        # How many points of the curve have at most so many false positives.
        allowed = np.append(LAMR_FPPI, [0.1, 1.0]) * pictures[i] * (1 + _SLACK)
        at = recall[np.searchsorted(wrong[i, ends], allowed, side="right")]
        lamr = np.exp(np.log(np.maximum(1 - at[:9], _LEAST_MISS_RATE)).mean())
        rows.append([lamr, at[9], at[10], _average_precision(right[i], wrong[i], int(objects[i]))])
    return np.array(rows, np.float64).reshape(-1, 4)


def _average_precision(right: NDArray[np.int64], wrong: NDArray[np.int64], objects: int) -> float:
    """Mean over 101 recalls of the best precision at that recall or a higher one (COCO)."""
    recall, precision = right / objects, right / np.maximum(right + wrong, 1)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    at = np.searchsorted(recall, np.linspace(0, 1, 101), side="left")
    return float(np.append(best, 0.0)[at].mean())
