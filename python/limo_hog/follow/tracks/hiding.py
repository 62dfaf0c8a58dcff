"""People who were about and are not measured any more: where each of them can have walked to by now."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.measurement import WALK
from limo_hog.follow.sense.observation import Appearance, Clothes


class Other(NamedTuple):
    """Another person than the one followed: where they were last measured, odometry frame [m], and when [s]."""

    x: float
    y: float
    at: float
    clothes: Clothes | None = None  #: What they wear; None where only the scan showed them.


@dataclass(frozen=True, slots=True)
class Hiding:
    """Remembers other people."""

    remembers_s: float = param(59.0, "s", "How long people out of sight are remembered.", 0, 3600)
    unseen_s: float = param(0.8, "s", "A person not measured for longer is out of sight.", 0, 60)
    same: float = param(0.5, "m", "Nearer than this to where a person was is the same person.", 0, 5)
    walk: float = param(WALK, "m/s", "How fast people walk out of sight.", 0, 5)
    appearance: Appearance = field(default_factory=Appearance)  #: Compares clothes.

    def remember(
        self, others: tuple[Other, ...], seen: Sequence[Other], felt: Points, followed: Points, now: float
    ) -> tuple[Other, ...]:
        """Bring the other people up to `now` [s]; all places are in the odometry frame [m].

        `seen` are the others measured now, `felt` (N, 2) what the scan shows that may be the legs of those remembered,
        and `followed` (N, 2) where the person followed is, who may have been taken for another: none if that is
        unknown.
        """
        # Of a few places, lists are faster than arrays.
        own, legs = followed.tolist(), felt.tolist()
        left = [
            other
            for other in others
            if now - other.at < self.remembers_s and all(math.dist(place, other[:2]) > self.same for place in own)
        ]
        kept: list[Other] = []
        for person in seen:
            same = [
                (now - other.at, apart, which)
                for which, other in enumerate(left)
                if (apart := math.dist(other[:2], person[:2])) <= self._reach(other, now)
                and self.appearance.cost(other.clothes, person.clothes) <= self.appearance.other
            ]
            if same:
                # Somebody who was just measured, rather than one who was not for long and can be anywhere.
                before = left.pop(min(same)[2])
                person = person if person.clothes is not None else person._replace(clothes=before.clothes)
            kept.append(person)
        for lost in left:
            gap, x, y = min(((math.dist((x, y), lost[:2]), x, y) for x, y in legs), default=(math.inf, 0.0, 0.0))
            kept.append(lost._replace(x=x, y=y, at=now) if gap < self.same else lost)
        return tuple(kept)

    def circles(self, others: tuple[Other, ...], now: float) -> Points:
        """Return where people out of sight can be, float64 (H, 3): x, y and radius [m], odometry frame."""
        hidden = [(other.x, other.y, self._reach(other, now)) for other in others if now - other.at > self.unseen_s]
        return np.array(hidden).reshape(-1, 3)

    def _reach(self, other: Other, now: float) -> float:
        return self.same + self.walk * (now - other.at)
