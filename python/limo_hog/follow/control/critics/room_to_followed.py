"""The robot keeps off the person followed, who is taken to walk straight on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class RoomToFollowed:
    """Mean distance short of `clear` to the person followed, and more from where it would touch them."""

    weight: float = param(12.0, "1/m", "Cost of a metre.", 0, 100)
    clear: float = param(0.65, "m", "Distance wanted from the outline to the person's axis.", 0, 3)
    touches: float = param(0.2, "m", "Nearer than this is taken for a contact.", 0, 1)
    contact: float = param(3.0, "m", "What a contact costs besides.", 0, 100)
    fades_s: float = param(2.5, "s", "Time constant with which the future counts less.", 0.1, 60)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        if situation.followed is None:
            return rollouts.nothing
        own = rollouts.places[:, situation.followed, None]
        gap = rollouts.gaps(own, situation.robot)[..., 0]
        short = np.maximum(self.clear - gap, 0.0) + self.contact * np.logical_or.accumulate(gap < self.touches, axis=1)
        return np.asarray((short * np.exp(-rollouts.times / self.fades_s)).mean(axis=1))
