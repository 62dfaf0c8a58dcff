"""The figures of a detector agree with COCO's evaluation and with their definitions, computed slowly."""

import contextlib
import io
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pycocotools import mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from limo_hog.learn.evaluation.curve import bootstrap, collect, curve, figures, match, threshold_at

Found = list[tuple[NDArray[np.float64], NDArray[np.float64]]]
Labelled = list[tuple[NDArray[np.float64], NDArray[np.bool_]]]


def scene(seed: int, pictures: int = 30, equal_scores: bool = False) -> tuple[Found, Labelled]:
    """Pictures with objects, some to be ignored, and detections near them and elsewhere."""
    rng = np.random.default_rng(seed)
    found, labelled = [], []
    for _ in range(pictures):
        count = int(rng.integers(0, 6))
        boxes = np.column_stack([rng.uniform(0, 400, (count, 2)), rng.uniform(20, 90, (count, 2))])
        near = boxes[rng.integers(0, count, 2 * count)] + rng.normal(0, 9, (2 * count, 4)) if count else boxes
        alarms = np.column_stack([rng.uniform(0, 400, (3, 2)), rng.uniform(20, 90, (3, 2))])
        hits = np.concatenate([near, alarms])
        hits[:, 2:] = np.maximum(hits[:, 2:], 5)
        scores = np.append(rng.normal(1, 1, len(near)), rng.normal(0, 1, 3))
        if equal_scores:
            scores = np.round(scores, 1)
        order = np.argsort(-scores, kind="stable")
        found.append((hits[order], scores[order]))
        labelled.append((boxes, rng.random(count) < 0.15))
    return found, labelled


def cocos_average_precision(found: Found, labelled: Labelled) -> float:
    notes: list[dict[str, Any]] = []
    results: list[dict[str, Any]] = []
    for image, (boxes, ignored) in enumerate(labelled, start=1):
        for box, crowd in zip(boxes.tolist(), ignored.tolist(), strict=True):
            note = {"id": len(notes) + 1, "image_id": image, "category_id": 1, "bbox": box, "iscrowd": int(crowd)}
            notes.append(note | {"area": box[2] * box[3]})
    for image, (hits, scores) in enumerate(found, start=1):
        for box, score in zip(hits.tolist(), scores.tolist(), strict=True):
            results.append({"image_id": image, "category_id": 1, "bbox": box, "score": score})
    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        images = [{"id": image, "width": 500, "height": 500} for image in range(1, len(found) + 1)]
        truth.dataset = {"images": images, "categories": [{"id": 1, "name": "person"}], "annotations": notes}
        truth.createIndex()
        evaluation = COCOeval(truth, truth.loadRes(results), "bbox")
        evaluation.params.iouThrs = np.array([0.5])
        evaluation.params.maxDets = [1000]
        evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e10]], ["all"]
        evaluation.evaluate()
        evaluation.accumulate()
    return float(evaluation.eval["precision"].mean())


def slow_lamr(found: Found, labelled: Labelled) -> float:
    """The definition: every threshold tried, every picture matched anew by loops."""
    # COCO's overlaps: intersection over union, and where a box is ignored the hit's share in it.
    overlaps = [
        mask.iou(hits, boxes, ignored) if len(boxes) else np.empty((len(hits), 0))
        for (hits, _), (boxes, ignored) in zip(found, labelled, strict=True)
    ]
    points = []
    for threshold in sorted({float(s) for _, scores in found for s in scores}):
        right = wrong = 0
        for rows, (_, scores), (_, ignored) in zip(overlaps, found, labelled, strict=True):
            taken: set[int] = set()
            for row in rows[scores >= threshold]:
                near = [(row[i], i) for i in np.flatnonzero(~ignored).tolist() if i not in taken and row[i] >= 0.5]
                taken |= {max(near)[1]} if near else set()
                right += bool(near)
                wrong += not near and not (row[ignored] >= 0.5).any()
        points.append((wrong / len(found), right / sum(int((~ignored).sum()) for _, ignored in labelled)))
    misses = []
    for i in range(9):
        reference = 10 ** (-2 + 0.25 * i)
        recall = max((r for fppi, r in points if fppi <= reference + 1e-9), default=0.0)
        misses.append(max(1 - recall, 1e-10))
    return math.exp(sum(map(math.log, misses)) / 9)


@pytest.mark.parametrize("seed", range(5))
def test_average_precision_is_cocos(seed: int) -> None:
    ap = figures(collect(*scene(seed))[0]).ap
    assert ap == pytest.approx(cocos_average_precision(*scene(seed)), abs=1e-6) and 0.2 < ap < 0.95


@pytest.mark.parametrize("equal_scores", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_log_average_miss_rate_is_its_definition(seed: int, equal_scores: bool) -> None:
    found, labelled = scene(seed, pictures=15, equal_scores=equal_scores)
    lamr = figures(collect(found, labelled)[0]).lamr
    assert lamr == pytest.approx(slow_lamr(found, labelled), abs=1e-6) and 0.1 < lamr < 0.95


def test_a_box_is_found_once_and_by_the_surest() -> None:
    boxes = np.array([[0, 0, 10, 20], [100, 0, 10, 20]], np.float64)
    hits = np.array([[0, 0, 10, 22], [0, 0, 10, 20], [50, 50, 10, 20]], np.float64)
    pairs = match(hits, boxes, np.zeros(2, np.bool_))
    assert pairs.detections.tolist() == [0, -1, -1] and pairs.boxes.tolist() == [0, -1]


def test_what_lies_in_an_ignored_box_is_neither_right_nor_wrong() -> None:
    boxes = np.array([[0, 0, 100, 100]], np.float64)
    hits = np.array([[10, 10, 20, 40], [95, 10, 20, 40]], np.float64)
    pairs = match(hits, boxes, np.ones(1, np.bool_))
    assert pairs.detections.tolist() == [-2, -1]
    outcomes, _ = collect([(hits, np.array([2.0, 1.0]))], [(boxes, np.ones(1, np.bool_))])
    assert outcomes.objects.tolist() == [0] and outcomes.right.tolist() == [False]


def test_whoever_finds_everyone_has_no_miss_rate_and_whoever_finds_nobody_has_all() -> None:
    boxes = np.array([[5, 5, 20, 40]], np.float64)
    nothing = (np.empty((0, 4)), np.empty(0))
    plain = [(boxes, np.zeros(1, np.bool_))] * 4
    best, _ = collect([(boxes, np.array([1.0]))] * 4, plain)
    worst, _ = collect([nothing] * 4, plain)
    assert figures(best)._asdict() == {"lamr": pytest.approx(1e-10), "recall_01": 1, "recall_1": 1, "ap": 1}
    assert figures(worst) == (1, 0, 0, 0)
    assert curve(worst).recall.tolist() == [] and threshold_at(curve(worst), 0.1) == math.inf


def test_the_threshold_at_an_fppi_gives_that_many_false_alarms() -> None:
    points = curve(collect(*scene(7))[0])
    at = points.thresholds.tolist().index(threshold_at(points, 0.5))
    assert points.fppi[at] <= 0.5 < points.fppi[at + 1]


def test_intervals_are_those_of_pictures_drawn_one_by_one() -> None:
    found, labelled = scene(3, pictures=12)
    outcomes, _ = collect(found, labelled)
    drawn = bootstrap(outcomes, draws=40, seed=5)
    assert np.array_equal(drawn, bootstrap(outcomes, draws=40, seed=5))
    weights = np.random.default_rng(5).multinomial(12, np.full(12, 1 / 12), size=40)
    for row, counts in zip(drawn[:5], weights[:5], strict=True):
        chosen = np.repeat(np.arange(12), counts)
        again, _ = collect([found[i] for i in chosen], [labelled[i] for i in chosen])
        # AP may differ in the order of equal scores: a picture that was drawn twice is there twice.
        assert figures(again)[:3] == pytest.approx(row[:3], abs=1e-12)
