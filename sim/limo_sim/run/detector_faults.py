"""A detector that misses people in bursts and sees some where nothing is, as a scenario's `[detector]` asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.sense.detectors import Detector
from limo_hog.follow.sense.region import Region
from limo_sim.run.matching import NO_PERSON, person_of
from limo_sim.sensing.camera import HEIGHT, WIDTH
from limo_sim.world.scenario import DetectorFaults
from limo_sim.world.truth import Truth

# Streams of the run's generator; the arena's sensors have 0 … 5.
_MISS_STREAM, _FALSE_STREAM = 6, 7


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

    def at(self, period: int) -> bool:
        """Return whether the person is missed in a period of the camera, no earlier than the last one asked for."""
        for _ in range(period - self._period):
            change = self._random.random() < (self._leaves if self._missed else self._begins)
            self._missed ^= bool(change)
        self._period = max(period, self._period)
        return self._missed


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
        self._detector, self._faults, self._rate, self._seed = detector, faults, rate_hz, seed
        self._misses = [
            Misses(faults, rate_hz, np.random.default_rng([seed, _MISS_STREAM, person])) for person in range(people)
        ]
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
        missed = [misses.at(period) for misses in self._misses]
        on: Sequence[int] = [person_of(box, truth.people) for box in boxes]
        return [index for index, person in enumerate(on) if person == NO_PERSON or not missed[person]]

    def _false(self, period: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return false boxes int64 (N, 4) in the camera's image [px] and their scores (N,)."""
        random = np.random.default_rng([self._seed, _FALSE_STREAM, period])
        count = random.poisson(self._faults.false_rate)
        height = FALSE_BOXES.least_height * 2.0 ** random.exponential(FALSE_BOXES.octaves, count)
        height = np.minimum(height, HEIGHT)
        width = height / 2
        x, y = random.random(count) * (WIDTH - width), random.random(count) * (HEIGHT - height)
        boxes = np.stack([x, y, width, height], axis=1)
        return boxes.astype(np.int64), random.exponential(FALSE_BOXES.score, count)
