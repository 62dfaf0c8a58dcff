"""A trained detector on disk: the file that OpenCV loads, and its card with what the numbers mean and where from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.atomic import json_text, write_text
from limo_hog.cv2_api import model_files
from limo_hog.cv2_api.geometry import Geometry
from limo_hog.detector import PeopleDetector
from limo_hog.learn.evaluation.run import DRAWS, Rival, evaluate
from limo_hog.learn.sources import TrainingData
from limo_hog.learn.training import Round, TrainingParameters
from limo_hog.learn.windows import WindowShape
from limo_hog.models import Calibration, Model

#: Where the curve of a trained detector ends; its margins are a little smaller than those of OpenCV's.
LEAST_SCORE = -1.2
#: Newton's steps of the calibration, and the least change that is worth one more.
_STEPS, _SETTLED = 50, 1e-10
#: Bins of the calibration error.
_BINS = 10


def write_model(path: Path, coefficients: NDArray[np.float64], shape: WindowShape, card: dict[str, Any]) -> None:
    """Write a detector and its card, whose name is the detector's with `.json` after it.

    Raises `OSError` where a file cannot be written; no part of it is left behind.
    """
    model_files.save(path, Geometry(winSize=shape.size), coefficients.astype(np.float32))
    write_text(path.with_name(f"{path.name}.json"), json_text(card, indent=2) + "\n")


def measure(done: Round, data: TrainingData, final: bool) -> dict[str, Any]:
    """Measure a round's detector on the labelled pictures held out; return nothing where there are none.

    What is returned are `threshold`, `calibration` and `figures` (LAMR, recall, AP) of a card.
    """
    if not data.validation:
        return {}
    weights = done.solution.coefficients.astype(np.float32)
    model = Model(Geometry(winSize=data.shape.size), weights, data.shape.object_box)
    detector = PeopleDetector(model=model, min_height=data.min_height, threshold=LEAST_SCORE)
    _, (evaluation,) = evaluate([Rival("trained", detector)], data.validation, DRAWS if final else 1)
    outcomes = evaluation.outcomes
    calibration = calibrate(outcomes.scores, outcomes.right)
    probabilities = calibration.probabilities(outcomes.scores)
    figures = {name: round(value, 4) for name, value in evaluation.figures._asdict().items()}
    return {
        # None but infinity means no detection at all, which 100 does as well.
        "threshold": round(evaluation.threshold_01, 4) if np.isfinite(evaluation.threshold_01) else 100.0,
        "calibration": calibration._asdict(),
        "figures": {
            "pictures": len(data.validation),
            "objects": int(outcomes.objects.sum()),
            "min_height": data.min_height,
            **figures,
            "lamr_interval": [round(end, 4) for end in evaluation.intervals["lamr"]],
            "calibration_error": round(calibration_error(probabilities, outcomes.right), 4),
        },
    }


def calibrate(scores: NDArray[np.float64], right: NDArray[np.bool_]) -> Calibration:
    """Fit P(right | score) = 1 / (1 + exp(−(slope · score + offset))) to float64 and bool (N,), by maximum likelihood.

    Platt's targets (1999) keep the slope finite where scores part right from wrong wholly: (n₊ + 1) / (n₊ + 2) and
    1 / (n₋ + 2). Newton's method with halved steps (Lin, Lin and Weng 2007).
    """
    count = int(right.sum())
    targets = np.where(right, (count + 1) / (count + 2), 1 / (len(right) - count + 2))
    features = np.stack([scores, np.ones(len(scores))], axis=1)
    found = np.zeros(2)

    def loss(at: NDArray[np.float64]) -> float:
        margins = features @ at
        return float((np.logaddexp(0, margins) - targets * margins).sum() + 0.5e-6 * (at @ at))

    for _ in range(_STEPS):
        p = 1 / (1 + np.exp(-np.clip(features @ found, -500, 500)))
        slope = features.T @ (p - targets) + 1e-6 * found
        step = np.linalg.solve((features.T * (p * (1 - p))) @ features + 1e-6 * np.eye(2), slope)
        size = 1.0
        while loss(found - size * step) > loss(found) and size > 1e-6:
            size /= 2
        found = found - size * step
        if float(np.abs(size * step).max()) < _SETTLED:
            break
    return Calibration(round(float(found[0]), 4), round(float(found[1]), 4))


def calibration_error(probabilities: NDArray[np.float64], right: NDArray[np.bool_]) -> float:
    """Return the mean distance of probability and share that is right over ten bins, weighted by what is in them."""
    bins = np.minimum((probabilities * _BINS).astype(int), _BINS - 1)
    gaps = [
        abs(float(probabilities[bins == i].mean() - right[bins == i].mean())) * int((bins == i).sum())
        for i in range(_BINS)
        if (bins == i).any()
    ]
    return sum(gaps) / max(1, len(right))


def make_card(
    measured: dict[str, Any], rounds: Sequence[dict[str, Any]], data: TrainingData, how: TrainingParameters
) -> dict[str, Any]:
    """Return the whole card: what `PeopleDetector` reads, figures, and what the detector was made of.

    It holds no date and no time, so that the same run writes the same card.
    """
    return {
        "made_by": f"limo-hog {version('limo-hog')}",
        "window": list(data.shape.size),
        "person_box": [round(share, 6) for share in data.shape.object_box],
        "min_height": data.min_height,
        **measured,
        "rounds": list(rounds),
        "data": [asdict(source) for source in data.sources],
        "parameters": asdict(how),
    }
