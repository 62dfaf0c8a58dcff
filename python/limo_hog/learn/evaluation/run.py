"""Detectors run on labelled pictures, and the figures that say how good each is."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections, Detector
from limo_hog.learn.evaluation.curve import (
    Curve,
    Figures,
    Match,
    Outcomes,
    bootstrap,
    collect,
    curve,
    figures,
    threshold_at,
)
from limo_hog.learn.labels import LabelError, Picture, inside, sizes_of

#: With 50 objects the 95 % interval of a miss rate of .3 is ± .13.
_FEW = 50
#: Intersection over union from which a box is found (PASCAL VOC, Caltech).
MIN_IOU = 0.5
#: Sets of pictures for an interval, of which 1000 settle its ends to about .005, and the share of them inside it.
DRAWS, CONFIDENCE = 1000, 0.95
#: Heights that part the rows by height [px].
_HEIGHT_EDGES = (64, 96, 144, 216)


@dataclass(frozen=True)
class Rival:
    """A detector under its name."""

    name: str
    search: Detector  #: returns every hit that the curve is to have, however unsure
    #: The same with the threshold that a user would set: its time is taken. None: `search` is timed.
    timed: Detector | None = None


@dataclass(frozen=True)
class HeightRow:
    """How many objects from `low` to below `high` [px] there are, and the shares found at 0.1 and 1 FPPI."""

    low: float
    high: float
    objects: int
    recall_01: float
    recall_1: float


@dataclass(frozen=True)
class Evaluation:
    """One detector's figures."""

    name: str
    figures: Figures
    intervals: dict[str, tuple[float, float]]  #: of each figure, its lower and upper end
    #: threshold_01, threshold_1: least score with an FPPI of 0.1 or 1 at most
    threshold_01: float
    threshold_1: float
    ms: float  #: median time of a picture [ms], the detectors taking turns on each
    by_height: tuple[HeightRow, ...]
    curve: Curve = field(repr=False)
    outcomes: Outcomes = field(repr=False)
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = field(repr=False)
    matches: list[Match] = field(repr=False)


@dataclass(frozen=True)
class Difference:
    """How much a figure of the first detector is above another's, on the same draws of pictures."""

    name: str
    figure: str
    difference: float
    #: The difference's; where it does not hold 0, the difference is more than the choice of pictures.
    interval: tuple[float, float]


def evaluate(
    rivals: Sequence[Rival],
    pictures: Sequence[Picture],
    draws: int = DRAWS,
    done: Callable[[], None] = lambda: None,
) -> tuple[list[Picture], list[Evaluation]]:
    """Run every detector on every picture and return the pictures as used, and each detector's figures.

    An interval is of so many `draws` of the pictures; `done` is called after each picture. Raises `LabelError` where no
    labelled box lies in its picture; `ReadError` or `OSError` where a picture cannot be read: figures over the rest
    would be those of another set.
    """
    used: list[Picture] = []
    found: list[list[tuple[NDArray[np.float64], NDArray[np.float64]]]] = [[] for _ in rivals]
    times: list[list[float]] = [[] for _ in rivals]
    for picture in pictures:
        image = picture.read()
        used.append(inside(picture, (image.shape[1], image.shape[0])))
        for i, rival in enumerate(rivals):
            detections, ms = _timed(rival.search, image)
            if rival.timed is not None:
                _, ms = _timed(rival.timed, image)
            times[i].append(ms)
            found[i].append((detections.boxes.astype(np.float64), detections.scores))
        done()
    if not len(sizes_of(used)):
        raise LabelError(f"no labelled box lies inside of its picture, in {len(used)} pictures; at least one is wanted")
    labelled = [picture.arrays() for picture in used]
    return used, [
        _evaluation(rival.name, hits, labelled, float(np.median(ms)), draws)
        for rival, hits, ms in zip(rivals, found, times, strict=True)
    ]


def _timed(detector: Detector, image: NDArray[np.uint8]) -> tuple[Detections, float]:
    start = time.perf_counter()
    detections = detector.detect(image)
    return detections, 1e3 * (time.perf_counter() - start)


def _evaluation(
    name: str,
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    labelled: list[tuple[NDArray[np.float64], NDArray[np.bool_]]],
    ms: float,
    draws: int,
) -> Evaluation:
    outcomes, matches = collect(found, labelled, MIN_IOU)
    points = curve(outcomes)
    ends = _intervals(bootstrap(outcomes, draws, seed=0))
    thresholds = threshold_at(points, 0.1), threshold_at(points, 1.0)
    return Evaluation(
        name,
        figures(outcomes),
        dict(zip(Figures._fields, ends, strict=True)),
        *thresholds,
        ms,
        _by_height(outcomes, thresholds),
        points,
        outcomes,
        found,
        matches,
    )


def _intervals(draws: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return the lower and upper end of each figure of (draws, figures)."""
    tails = [50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)]
    return [(low, high) for low, high in np.nanpercentile(draws, tails, axis=0).T.tolist()]


def _by_height(outcomes: Outcomes, thresholds: tuple[float, float]) -> tuple[HeightRow, ...]:
    rows = []
    for low, high in zip((0.0, *_HEIGHT_EDGES), (*_HEIGHT_EDGES, float("inf")), strict=True):
        at = outcomes.found_at[(low <= outcomes.heights) & (outcomes.heights < high)]
        if len(at):
            rows.append(HeightRow(low, high, len(at), *(float((at >= t).mean()) for t in thresholds)))
    return tuple(rows)


def compare(first: Evaluation, other: Evaluation) -> list[Difference]:
    """Return how much the first detector's figures are above another's, with paired intervals."""
    ours, theirs = (bootstrap(evaluation.outcomes, DRAWS, seed=0) for evaluation in (first, other))
    return [
        Difference(other.name, figure, a - b, ends)
        for figure, a, b, ends in zip(
            Figures._fields, first.figures, other.figures, _intervals(ours - theirs), strict=True
        )
    ]


def few(objects: int) -> str:
    """Return a warning where figures come from too few objects to mean much, else nothing."""
    if objects >= _FEW:
        return ""
    return f"only {objects} object{'' if objects == 1 else 's'}: below {_FEW} these figures are mostly chance"


def as_json(used: Sequence[Picture], evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Return all figures as plain values; null where there is no threshold."""
    return {
        "pictures": len(used),
        "objects": sum(not box.ignored for picture in used for box in picture.boxes),
        "min_iou": MIN_IOU,
        "confidence": CONFIDENCE,
        "models": [_model_json(evaluation) for evaluation in evaluations],
        "differences": [
            {"model": d.name, "figure": d.figure, "difference": d.difference, "interval": list(d.interval)}
            for other in evaluations[1:]
            for d in compare(evaluations[0], other)
        ],
    }


def _model_json(evaluation: Evaluation) -> dict[str, Any]:
    return {
        "model": evaluation.name,
        **evaluation.figures._asdict(),
        "intervals": {figure: list(ends) for figure, ends in evaluation.intervals.items()},
        "threshold_01": _finite(evaluation.threshold_01),
        "threshold_1": _finite(evaluation.threshold_1),
        "ms": round(evaluation.ms, 3),
        "by_height": [vars(row) | {"high": _finite(row.high)} for row in evaluation.by_height],
        "curve": {name: values.tolist() for name, values in evaluation.curve._asdict().items()},
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
