"""Many runs on all cores, and the statistics of their score cards."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from statistics import NormalDist, fmean, stdev
from typing import TypeVar

import limo_hog
from limo_hog.exceptions import LimoHogError
from limo_hog.named_detectors import detector_named
from limo_hog.signals import end_with
from limo_sim.run.baselines import controller_of
from limo_sim.run.episode import run_episode, score
from limo_sim.run.score import ScoreCard
from limo_sim.world.scenario import Scenario

R = TypeVar("R")
C = TypeVar("C")

#: Figures of a score card that are summed up, in the order they are shown.
MEASURES = tuple(
    "success in_view kept_up detected best_box_wrong pixel_error_mean distance_rms_error_m zone_social found_again "
    "time_to_find_again_s follows_first identity_switches clearance_min_m intrusion_intimate intrusion_personal "
    "intrusion_social contacts_person contacts_wall path_wrong_m mean_abs_domega jerk_mean first_detection_s "
    "detect_ms_mean".split()
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
    robot: str | None = None


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean over seeds with half the width of its 95 % interval (None for a single run), and the worst runs."""

    mean: float
    interval: float | None
    least: float
    most: float

    @property
    def is_sure(self) -> bool:
        """Whether the interval leaves out 0."""
        return self.interval is not None and abs(self.mean) > self.interval

    def written(self, name: str, factor: float, style: str) -> tuple[str, str]:
        """Return what a table shows of a figure of this name: the mean, and "± " with the interval or nothing.

        Of the clearance the worst run counts, which has no interval. A `style` that begins with "+" is that of a
        difference.
        """
        if name == "clearance_min_m" and not style.startswith("+"):
            return format(self.least, style), ""
        interval = "" if self.interval is None else f"± {format(factor * self.interval, style.removeprefix('+'))}"
        return format(factor * self.mean, style), interval


@dataclass(frozen=True, slots=True)
class Summary:
    """The statistics of one scenario, or group of them, and controller over seeds; None where nothing was measured."""

    scenario: str
    controller: str
    runs: int
    measures: dict[str, Estimate | None]


@dataclass(frozen=True, slots=True)
class Comparison:
    """How far a controller's figures lie above those of another in the same scenarios and seeds.

    The differences are taken run by run, so that what a seed makes harder for both cancels. Where the interval of one
    leaves out 0, the difference is more than the choice of seeds.
    """

    scenario: str
    controller: str
    against: str
    pairs: int
    differences: dict[str, Estimate | None]


def play(run: Run) -> ScoreCard:
    """Play a run in this process, on one core."""
    import cv2  # there already: the arena's camera needs it

    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    controller = controller_of(run.controller, run.target)
    names = (run.controller, run.detector)
    scenario, detector = Scenario.load(run.scenario, run.robot), detector_named(run.detector)
    return score(run_episode(scenario, controller, detector, run.seconds, run.seed, names=names))


class WorkerError(LimoHogError):
    """A worker process ended before its run did."""


def in_processes(task: Callable[[R], C], runs: Sequence[R], workers: int) -> Iterator[tuple[R, C]]:
    """Do a task for each run on `workers` processes; yields each run with the answer, in the order in which they end.

    The processes end with this one, whatever ends it, and at once where the caller takes no more. Raises `WorkerError`
    where a process was killed, after the cards of all runs that have ended.
    """
    # Fresh processes: threads of the detector do not survive a fork.
    context = get_context("spawn")
    alive, kept_open = context.Pipe(duplex=False)
    missing = 0
    with alive, kept_open:
        pool = ProcessPoolExecutor(workers, context, end_with, (alive,))
        try:
            runs_of = {pool.submit(task, run): run for run in runs}
            for done in as_completed(runs_of):
                if isinstance(done.exception(), BrokenProcessPool):
                    missing += 1
                else:
                    yield runs_of[done], done.result()
        except BaseException:
            kept_open.close()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    if missing:
        killed = "a worker process was killed, perhaps for want of memory"
        raise WorkerError(f"{killed}: {missing} of {len(runs)} runs are missing; fewer --workers need less")


def summarise(cards: Sequence[ScoreCard], groups: Mapping[str, str] | None = None) -> list[Summary]:
    """Sum up the cards of each scenario and controller, in the order these first occur.

    With the group of each scenario, each group is summed up instead, its scenarios counting alike. The mean over a
    group is taken seed by seed, and the interval is that of the seeds.
    """
    return [
        Summary(label, controller, len(group), {name: _estimate(_values(group, name)) for name in MEASURES})
        for (label, controller), group in _grouped(cards, groups).items()
    ]


def compare(cards: Sequence[ScoreCard], against: str, groups: Mapping[str, str] | None = None) -> list[Comparison]:
    """Compare every other controller with `against`, scenario by scenario or group by group, as `summarise` does."""
    grouped = _grouped(cards, groups)
    comparisons = []
    for (label, controller), group in grouped.items():
        if controller == against or (label, against) not in grouped:
            continue
        others = grouped[label, against]
        differences: dict[str, Estimate | None] = {}
        for name in MEASURES:
            mine, theirs = _values(group, name), _values(others, name)
            differences[name] = _estimate({run: mine[run] - theirs[run] for run in mine if run in theirs})
        pairs = len({(card.scenario, card.seed) for card in group} & {(card.scenario, card.seed) for card in others})
        comparisons.append(Comparison(label, controller, against, pairs, differences))
    return comparisons


def _grouped(cards: Sequence[ScoreCard], groups: Mapping[str, str] | None) -> dict[tuple[str, str], list[ScoreCard]]:
    """Return the cards by scenario, or by group, and controller."""
    grouped: dict[tuple[str, str], list[ScoreCard]] = {}
    for card in cards:
        label = card.scenario if groups is None else groups[card.scenario]
        grouped.setdefault((label, card.controller), []).append(card)
    return grouped


def _values(cards: Sequence[ScoreCard], name: str) -> dict[tuple[str, int], float]:
    """Return a figure by scenario and seed, where there is one."""
    return {(card.scenario, card.seed): float(value) for card in cards if (value := getattr(card, name)) is not None}


def _estimate(values: Mapping[tuple[str, int], float]) -> Estimate | None:
    """Estimate from the mean over the scenarios of each seed; None without values."""
    seeds: dict[int, list[float]] = {}
    for (_, seed), value in values.items():
        seeds.setdefault(seed, []).append(value)
    return estimate([fmean(seeds[seed]) for seed in sorted(seeds)]) if seeds else None


def estimate(values: Sequence[float]) -> Estimate:
    """Return the mean of independent values and half the width of its 95 % interval, by Student's t."""
    mean, count = fmean(values), len(values)
    if count < 2:
        return Estimate(mean, None, mean, mean)
    return Estimate(mean, _student(count - 1) * stdev(values) / math.sqrt(count), min(values), max(values))


def _student(freedom: int) -> float:
    """Return the 97.5 % quantile of Student's t: the normal one with Cornish and Fisher's first two corrections."""
    z = NormalDist().inv_cdf(0.975)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    return z + first / freedom + second / freedom**2
