"""How readings travel from a sensor to whoever asks: taken at a rate, late by a latency, sometimes lost."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Exposure(Generic[S]):
    """The state a sensor saw, and the running number of the reading."""

    index: int
    state: S


class Channel(Generic[S]):
    """A sensor's way to its reader; `newest` is the last exposure that has arrived.

    The first exposure is there at once, so that there is always one to read.
    """

    def __init__(
        self,
        rate_hz: float,
        steps_per_second: int,
        first: S,
        *,
        latency_s: float = 0.0,
        drop_probability: float = 0.0,
        drops: np.random.Generator | None = None,
    ) -> None:
        self._rate = rate_hz / steps_per_second
        self._late = round(latency_s * steps_per_second)
        self._drop_probability = drop_probability
        self._drops = drops
        self._underway: deque[tuple[int, Exposure[S]]] = deque()
        self._index = 0
        self.newest = Exposure(0, first)

    def advance(self, step: int, state: S) -> None:
        """Expose when it is time, and let arrive what is due."""
        index = int(step * self._rate + 1e-9)
        if index > self._index:
            self._index = index
            lost = self._drops is not None and self._drops.random() < self._drop_probability
            if not lost:
                self._underway.append((step + self._late, Exposure(index, state)))
        while self._underway and self._underway[0][0] <= step:
            self.newest = self._underway.popleft()[1]
