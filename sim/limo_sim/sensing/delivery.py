"""Delivery of readings from a sensor: taken at a rate, delayed by a latency, sometimes lost."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

S = TypeVar("S")

#: Added to a number of readings before it is rounded down, against the rounding of rates such as 0.2 a step.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Exposure(Generic[S]):
    """The state in which a reading is taken, and the reading's running number."""

    index: int
    state: S


class Channel(Generic[S]):
    """The delivery of one sensor's readings; `newest` is the last exposure that has been delivered.

    The first exposure is delivered at once, so that there always is one.
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
        self._pending: deque[tuple[int, Exposure[S]]] = deque()
        self._index = 0
        self.newest = Exposure(0, first)

    def advance(self, step: int, state: S) -> None:
        """Take a reading when one is due, and deliver those whose latency has passed."""
        index = int(step * self._rate + _ROUNDING)
        if index > self._index:
            self._index = index
            lost = self._drops is not None and self._drops.random() < self._drop_probability
            if not lost:
                self._pending.append((step + self._late, Exposure(index, state)))
        while self._pending and self._pending[0][0] <= step:
            self.newest = self._pending.popleft()[1]
