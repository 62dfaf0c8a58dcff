"""Many runs on all cores, and the statistics of their score cards."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from statistics import NormalDist, fmean, stdev

import limo_hog
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.run.catalogue import load
from limo_sim.run.episode import run_episode
from limo_sim.run.score import ScoreCard, score

#: Figures of a score card that are summed up, in the order they are shown.
MEASURES = (
    "success",
    "in_view",
    "detected",
    "best_box_wrong",
    "pixel_error_mean",
    "distance_rms_error_m",
    "zone_social",
    "found_again",
    "follows_first",
    "identity_switches",
    "clearance_min_m",
    "contacts_person",
    "contacts_wall",
    "path_wrong_m",
    "mean_abs_domega",
    "jerk_mean",
    "first_detection_s",
    "detect_ms_mean",
)


@dataclass(frozen=True, slots=True)
class Run:
    """One run, with everything by name, so that it can be sent to another process."""

    scenario: str
    controller: str
    detector: str
    seed: int
    seconds: float
    target: float | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean over seeds with half the width of its 95 % interval (None for a single run), and the worst runs."""

    mean: float
    interval: float | None
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class Summary:
    """The statistics of one scenario and controller over seeds; None where no run had anything to measure."""

    scenario: str
    controller: str
    runs: int
    measures: dict[str, Estimate | None]


def play(run: Run) -> ScoreCard:
    """Play a run in this process, on one core."""
    import cv2  # there already: the arena's camera needs it

    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    controller = controller_named(run.controller, run.target)
    names = (run.controller, run.detector)
    scenario, detector = load(run.scenario), detector_named(run.detector)
    return score(run_episode(scenario, controller, detector, run.seconds, run.seed, names=names))


def play_all(runs: Sequence[Run], workers: int) -> Iterator[tuple[Run, ScoreCard]]:
    """Play runs on `workers` processes; yields each run with its card, in the order in which they end."""
    # Fresh processes: threads of the detector do not survive a fork.
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        try:
            runs_of = {pool.submit(play, run): run for run in runs}
            for done in as_completed(runs_of):
                yield runs_of[done], done.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def summarise(cards: Sequence[ScoreCard]) -> list[Summary]:
    """Sum up the cards of each scenario and controller, in the order these first occur."""
    groups: dict[tuple[str, str], list[ScoreCard]] = {}
    for card in cards:
        groups.setdefault((card.scenario, card.controller), []).append(card)
    return [
        Summary(scenario, controller, len(group), {name: _estimate(group, name) for name in MEASURES})
        for (scenario, controller), group in groups.items()
    ]


def estimate(values: Sequence[float]) -> Estimate:
    """Return the mean of independent values and half the width of its 95 % interval, by Student's t."""
    mean, count = fmean(values), len(values)
    if count < 2:
        return Estimate(mean, None, mean, mean)
    return Estimate(mean, _student(count - 1) * stdev(values) / math.sqrt(count), min(values), max(values))


def _estimate(cards: Sequence[ScoreCard], name: str) -> Estimate | None:
    values = [float(value) for card in cards if (value := getattr(card, name)) is not None]
    return estimate(values) if values else None


def _student(freedom: int) -> float:
    """Return the 97.5 % quantile of Student's t: the normal one with Cornish and Fisher's first two corrections."""
    z = NormalDist().inv_cdf(0.975)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    return z + first / freedom + second / freedom**2
