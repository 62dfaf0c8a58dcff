"""A detector that misses people in bursts and sees some where nothing is, as a scenario's `[detector]` asks for."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections, Detector
from limo_hog.follow.sense.region import Region, detect_in
from limo_sim.run.matching import NO_PERSON, person_of
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.scenario import DetectorFaults, Scenario
from limo_sim.world.truth import Truth
from limo_sim.world.variants import FALSE_STREAM, MISS_STREAM

S = TypeVar("S")

# What boxes on nothing look like. Measured: the 30 boxes that OpenCV's model finds, threshold 0, grouped, in 14
# photographs without people, each at 1, 1.5 and 2 times its size, and mirrored. Few, so that a single parameter was
# fitted to each quantity: the mean of log2(height / least height), the least one being HOG's own [px], and the mean
# margin of the SVM. Both are drawn from exponential distributions.
_FALSE_HEIGHT, _FALSE_OCTAVES, _FALSE_SCORE = 128.0, 0.44, 0.64

#: What benches/fit_detector.py measured on photographs, for each model of people.
FIT_FILE = Path(__file__).with_name("detector_fit.json")


@dataclass(frozen=True, slots=True)
class Curve:
    """Recall by height: top · σ(slope · log2(height / middle))."""

    top: float  #: recall of tall people, whom pose, clothes and background still hide [0 … 1]
    middle_px: float  #: height at which half of it is reached [px]
    slope: float  #: of the logistic function, for each doubling of the height

    def at(self, height: float) -> float:
        """Return the recall at a height [px]; a height of 0 stands for a person out of the image."""
        return self.top / (1.0 + math.exp(-self.slope * math.log2(max(height, 1.0) / self.middle_px)))


@dataclass(frozen=True, slots=True)
class Fit:
    """How a model of people does on photographs."""

    #: photographs, arena: recall of the detector on photographs, and its own in the arena
    photographs: Curve
    arena: Curve
    memory_s: float  #: time in which the correlation of a person's misses falls to 1/e [s]
    false_rate: float  #: mean number of false boxes in a frame

    def kept(self, height: float) -> float:
        """Return the share of what is found in the arena that is kept for people of a height [px], 0 … 1."""
        return min(1.0, self.photographs.at(height) / self.arena.at(height))


@cache
def fit_of(model: str) -> Fit:
    """Return the fit of "opencv" or "limo"."""
    table = json.loads(FIT_FILE.read_text(encoding="utf-8"))["models"][model]
    photographs, arena = (Curve(**table[place]) for place in ("photographs", "arena"))
    return Fit(photographs, arena, table["memory_s"], table["false_rate"])


class Missing(Generic[S]):
    """When one person is missed: by the state of a process with a step for each period of the camera, and a height."""

    def __init__(self, states: Iterator[S], is_missed: Callable[[S, float], bool]) -> None:
        self._states, self._is_missed = states, is_missed
        self._state, self._period = next(states), 0

    def at(self, period: int, height: float) -> bool:
        """Return whether the person, so high in the image [px], is missed in a period of the camera.

        No earlier period than the last one asked for.
        """
        for _ in range(period - self._period):
            self._state = next(self._states)
        self._period = max(period, self._period)
        return self._is_missed(self._state, height)


def _fitted(fit: Fit, rate_hz: float, random: np.random.Generator) -> Missing[float]:
    """Return the misses of a model's fit.

    Missed while a standard normal process with correlation exp(-t / memory) is above the quantile of the share kept at
    the person's height: that share is kept at every height, and misses come in bursts at all of them.
    """
    correlation = math.exp(-1.0 / (rate_hz * fit.memory_s))

    def values() -> Iterator[float]:
        value = float(random.standard_normal())
        while True:
            yield value
            value = correlation * value + math.sqrt(1.0 - correlation**2) * random.standard_normal()

    return Missing(values(), lambda value, height: NormalDist().cdf(value) >= fit.kept(height))


def _in_bursts(faults: DetectorFaults, rate_hz: float, random: np.random.Generator) -> Missing[bool]:
    """Return the misses of a Markov chain of two states, the same at every height.

    A burst is left with probability q = 1 / (its mean length in frames), and begins with q (1 - recall) / recall: the
    stationary share of found frames is `recall` (Gilbert's burst-noise channel, 1960).
    """
    leaves = min(1.0 / (faults.burst_s * rate_hz), 1.0) if faults.recall > 0 else 0.0
    begins = leaves * (1.0 - faults.recall) / faults.recall if faults.recall > 0 else 1.0

    def states() -> Iterator[bool]:
        missed = bool(random.random() >= faults.recall)
        while True:
            yield missed
            missed ^= bool(random.random() < (leaves if missed else begins))

    return Missing(states(), lambda missed, _: missed)


def misses_of(faults: DetectorFaults, rate_hz: float, people: int, seed: int) -> list[Missing[Any]]:
    """Return when each person of a run is missed by a camera of `rate_hz` [Hz]."""
    randoms = [np.random.default_rng([seed, MISS_STREAM, person]) for person in range(people)]
    if faults.misses_like == "none":
        return [_in_bursts(faults, rate_hz, random) for random in randoms]
    return [_fitted(fit_of(faults.misses_like), rate_hz, random) for random in randoms]


class FaultySearch:
    """Searches an arena's frames with the faults of its scenario; boxes on people of whom nothing is known pass.

    It stands in for `detect_in`. What it does depends on the seed and the number of the frame alone, so that another
    detector or controller meets the same misses and the same false boxes. `truth` returns what the newest frame shows.
    """

    def __init__(self, scenario: Scenario, seed: int, truth: Callable[[], Truth]) -> None:
        faults = scenario.detector
        self._seed, self._truth, self._rate = seed, truth, scenario.camera.rate_hz
        self._misses = misses_of(faults, self._rate, len(scenario.people), seed)
        self._false_rate = faults.false_rate if faults.misses_like == "none" else fit_of(faults.misses_like).false_rate

    def __call__(self, detector: Detector, image: NDArray[np.uint8], region: Region | None) -> Detections:
        """Find people in a region of the newest frame, or in all of it; best first."""
        found = detect_in(detector, image, region)
        truth = self._truth()
        period = round(truth.stamp * self._rate)
        kept = self._kept(found.windows, truth, period)
        boxes, scores = self._false(period)
        if region is not None:
            ends = boxes[:, :2] + boxes[:, 2:]
            inside = (boxes[:, 0] >= region.x) & (boxes[:, 1] >= region.y)
            inside &= (ends[:, 0] <= region.x + region.width) & (ends[:, 1] <= region.y + region.height)
            boxes, scores = boxes[inside], scores[inside]
            if region.scale < 1.0:
                # Boxes of a half-size search have even sizes, and are an even number of pixels from its corner.
                corner = np.array([region.x, region.y, 0, 0])
                boxes = (boxes - corner) // 2 * 2 + corner
        all_windows = np.concatenate([found.windows[kept], boxes.astype(np.int32)])
        all_scores = np.concatenate([found.scores[kept], scores])
        order = np.argsort(-all_scores, kind="stable")
        return replace(found, windows=all_windows[order], scores=all_scores[order])

    def _kept(self, boxes: NDArray[np.int32], truth: Truth, period: int) -> list[int]:
        """Return the boxes (N, 4) [px of the camera's image] that are on nobody, or on people who are not missed."""
        heights = [person.box[3] if person and person.box else 0.0 for person in truth.people]
        missed = [misses.at(period, height) for misses, height in zip(self._misses, heights, strict=True)]
        on = (person_of(box, truth.people) for box in boxes)
        return [index for index, person in enumerate(on) if person == NO_PERSON or not missed[person]]

    def _false(self, period: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return false boxes int64 (N, 4) in the camera's image [px] and their scores (N,)."""
        random = np.random.default_rng([self._seed, FALSE_STREAM, period])
        count = random.poisson(self._false_rate)
        height = np.minimum(_FALSE_HEIGHT * 2.0 ** random.exponential(_FALSE_OCTAVES, count), HEIGHT)
        width = height / 2
        x, y = random.random(count) * (WIDTH - width), random.random(count) * (HEIGHT - height)
        boxes = np.stack([x, y, width, height], axis=1)
        return boxes.astype(np.int64), random.exponential(_FALSE_SCORE, count)
