"""A detector that misses people in bursts and sees some where nothing is, as a scenario's `[detector]` asks for."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import NormalDist
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.sense.detectors import Detector, Region
from limo_sim.run.matching import NO_PERSON, person_of
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.scenario import DetectorFaults
from limo_sim.world.truth import Truth
from limo_sim.world.variants import FALSE_STREAM, MISS_STREAM


@dataclass(frozen=True, slots=True)
class FalseBoxes:
    """What boxes on nothing look like.

    Measured: the 30 boxes that OpenCV's model finds, threshold 0, grouped, in 14 photographs without people, each at 1,
    1.5 and 2 times its size, and mirrored. Few, so that a single parameter was fitted to each quantity.

    Attributes
    ----------
    least_height
        Of a window [px]: HOG's own.
    octaves
        Mean of log2(height / least_height); heights are drawn from the exponential distribution of it.
    score
        Mean margin of the SVM, which is drawn from an exponential distribution.
    """

    least_height: float = 128.0
    octaves: float = 0.44
    score: float = 0.64


FALSE_BOXES = FalseBoxes()


#: What benches/fit_detector.py measured on photographs, for each model of people.
FIT_FILE = Path(__file__).with_name("detector_fit.json")


@dataclass(frozen=True, slots=True)
class Curve:
    """Recall by height: top · σ(slope · log2(height / middle)).

    Attributes
    ----------
    top
        Recall of tall people, whom pose, clothes and background still hide [0 … 1].
    middle_px
        Height at which half of it is reached [px].
    slope
        Of the logistic function, for each doubling of the height.
    """

    top: float
    middle_px: float
    slope: float

    def at(self, height: float) -> float:
        """Return the recall at a height [px]; a height of 0 stands for a person out of the image."""
        return self.top / (1.0 + math.exp(-self.slope * math.log2(max(height, 1.0) / self.middle_px)))


@dataclass(frozen=True, slots=True)
class Fit:
    """How a model of people does on photographs.

    Attributes
    ----------
    photographs, arena
        Recall of the detector on photographs, and its own in the arena.
    memory_s
        Time in which the correlation of a person's misses falls to 1/e [s].
    false_rate
        Mean number of false boxes in a frame.
    """

    photographs: Curve
    arena: Curve
    memory_s: float
    false_rate: float

    def kept(self, height: float) -> float:
        """Return the share of what is found in the arena that is kept for people of a height [px], 0 … 1."""
        return min(1.0, self.photographs.at(height) / self.arena.at(height))


@cache
def fit_of(model: str) -> Fit:
    """Return the fit of "opencv" or "limo"."""
    table = json.loads(FIT_FILE.read_text(encoding="utf-8"))["models"][model]
    photographs, arena = (Curve(**table[place]) for place in ("photographs", "arena"))
    return Fit(photographs, arena, table["memory_s"], table["false_rate"])


class Missing(Protocol):
    """When one person is missed."""

    def at(self, period: int, height: float) -> bool:
        """Return whether the person, so high in the image [px], is missed in a period of the camera.

        No earlier period than the last one asked for.
        """
        ...


class FittedMisses:
    """When one person is missed, by a model's fit.

    Missed while a standard normal process with correlation exp(-t / memory) is above the quantile of the share kept at
    the person's height: that share is kept at every height, and misses come in bursts at all of them.
    """

    def __init__(self, fit: Fit, rate_hz: float, random: np.random.Generator) -> None:
        self._fit, self._random = fit, random
        self._correlation = math.exp(-1.0 / (rate_hz * fit.memory_s))
        self._period = 0
        self._value = float(random.standard_normal())

    def at(self, period: int, height: float) -> bool:
        """Return whether the person is missed, see `Missing.at`."""
        for _ in range(period - self._period):
            new = math.sqrt(1.0 - self._correlation**2) * self._random.standard_normal()
            self._value = self._correlation * self._value + new
        self._period = max(period, self._period)
        return NormalDist().cdf(self._value) >= self._fit.kept(height)


class Misses:
    """When one person is missed: a Markov chain of two states, one step for each period of the camera.

    A burst is left with probability q = 1 / (its mean length in frames), and begins with q (1 - recall) / recall: the
    stationary share of found frames is `recall` (Gilbert's burst-noise channel, 1960).
    """

    def __init__(self, faults: DetectorFaults, rate_hz: float, random: np.random.Generator) -> None:
        self._random = random
        self._leaves = min(1.0 / (faults.burst_s * rate_hz), 1.0)
        self._begins = self._leaves * (1.0 - faults.recall) / faults.recall if faults.recall > 0 else 1.0
        if faults.recall == 0:
            self._leaves = 0.0
        self._period = 0
        self._missed = bool(random.random() >= faults.recall)

    def at(self, period: int, height: float) -> bool:
        """Return whether the person is missed, see `Missing.at`; the height makes no difference."""
        del height
        for _ in range(period - self._period):
            change = self._random.random() < (self._leaves if self._missed else self._begins)
            self._missed ^= bool(change)
        self._period = max(period, self._period)
        return self._missed


def misses_of(faults: DetectorFaults, rate_hz: float, people: int, seed: int) -> list[Missing]:
    """Return when each person of a run is missed by a camera of `rate_hz` [Hz]."""
    randoms = [np.random.default_rng([seed, MISS_STREAM, person]) for person in range(people)]
    if faults.model == "none":
        return [Misses(faults, rate_hz, random) for random in randoms]
    return [FittedMisses(fit_of(faults.model), rate_hz, random) for random in randoms]


class FaultyDetector:
    """A detector in an arena, with the faults of a scenario; boxes on people of whom nothing is known pass.

    What it does depends on the seed and the number of the frame alone, so that another detector or controller meets the
    same misses and the same false boxes.

    Parameters
    ----------
    detector
        Finds people in uint8 (H, W, 3) BGR images.
    faults
        What to add to its own.
    rate_hz
        Of the camera [Hz].
    people
        How many the scenario has.
    seed
        Of the run.
    """

    def __init__(self, detector: Detector, faults: DetectorFaults, rate_hz: float, people: int, seed: int) -> None:
        self._detector, self._rate, self._seed = detector, rate_hz, seed
        self._misses = misses_of(faults, rate_hz, people, seed)
        self._false_rate = faults.false_rate if faults.model == "none" else fit_of(faults.model).false_rate
        self._truth: Truth | None = None
        self._region: Region | None = None

    def face(self, truth: Truth, region: Region | None) -> None:
        """Say what the next image shows, and which part of the camera's image it is (None: all)."""
        self._truth, self._region = truth, region

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Find people in the image announced by `face`, or in that at a fraction of its size; best first."""
        if self._truth is None:
            raise RuntimeError("FaultyDetector.detect: no image announced, want a call of face() before")
        found = self._detector.detect(image)
        period = round(self._truth.stamp * self._rate)
        left, top, width, height = 0, 0, WIDTH, HEIGHT
        if self._region is not None:
            left, top, width, height = (
                self._region.x,
                self._region.y,
                self._region.width,
                self._region.height,
            )
        corner = np.array([left, top, 0, 0])
        # The follower searches near people at half size.
        shrink = round(height / image.shape[0])
        kept = self._kept(found.boxes * shrink + corner, self._truth, period)
        boxes, scores = self._false(period)
        inside = (boxes[:, 0] >= left) & (boxes[:, 1] >= top)
        inside &= (boxes[:, 0] + boxes[:, 2] <= left + width) & (boxes[:, 1] + boxes[:, 3] <= top + height)
        boxes = (boxes[inside] - corner) // shrink
        all_boxes = np.concatenate([found.boxes[kept], boxes.astype(np.int32)])
        all_scores = np.concatenate([found.scores[kept], scores[inside]])
        order = np.argsort(-all_scores, kind="stable")
        return Detections(all_boxes[order], all_scores[order], found.person_box, found.calibration)

    def _kept(self, boxes: NDArray[np.int32], truth: Truth, period: int) -> list[int]:
        """Return the boxes (N, 4) [px of the camera's image] that are on nobody, or on people who are not missed."""
        heights = [person.box[3] if person and person.box else 0.0 for person in truth.people]
        missed = [misses.at(period, height) for misses, height in zip(self._misses, heights, strict=True)]
        on: Sequence[int] = [person_of(box, truth.people) for box in boxes]
        return [index for index, person in enumerate(on) if person == NO_PERSON or not missed[person]]

    def _false(self, period: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return false boxes int64 (N, 4) in the camera's image [px] and their scores (N,)."""
        random = np.random.default_rng([self._seed, FALSE_STREAM, period])
        count = random.poisson(self._false_rate)
        height = FALSE_BOXES.least_height * 2.0 ** random.exponential(FALSE_BOXES.octaves, count)
        height = np.minimum(height, HEIGHT)
        width = height / 2
        x, y = random.random(count) * (WIDTH - width), random.random(count) * (HEIGHT - height)
        boxes = np.stack([x, y, width, height], axis=1)
        return boxes.astype(np.int64), random.exponential(FALSE_BOXES.score, count)
