"""Calls timed in turn, so that whatever slows the machine down slows them all."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """Milliseconds of a call: the least, and the median."""

    min: float
    p50: float


def race(calls: Sequence[Callable[[], object]], seconds: float, least: int = 5, most: int = 200) -> list[Timing]:
    """Time each call once a round, in turn, after one call of each that does not count.

    The race lasts for `seconds`, with at least `least` and at most `most` rounds.
    """
    times: list[list[float]] = [[] for _ in calls]
    for call in calls:
        call()
    gc.disable()
    start = time.perf_counter()
    try:
        while len(times[0]) < least or (len(times[0]) < most and time.perf_counter() - start < seconds):
            for call, spent in zip(calls, times, strict=True):
                before = time.perf_counter()
                call()
                spent.append(1e3 * (time.perf_counter() - before))
    finally:
        gc.enable()
    return [Timing(min(spent), statistics.median(spent)) for spent in times]
