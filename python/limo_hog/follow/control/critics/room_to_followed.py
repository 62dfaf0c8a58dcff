"""The robot keeps off the person followed, who is taken to walk straight on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class RoomToFollowed:
    """Mean distance short of `clear` to the person followed; what is far off in time counts less."""

    weight: float = param(12.0, "1/m", "Cost of a metre.", 0, 100)
    clear: float = param(0.65, "m", "Distance wanted from the outline to the person's axis.", 0, 3)
    fades_s: float = param(2.5, "s", "Time constant with which the future counts less.", 0.1, 60)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        if situation.followed is None:
            return rollouts.nothing
        own = rollouts.places[:, situation.followed, None]
        short = np.maximum(self.clear - rollouts.gaps(own, situation.robot)[..., 0], 0.0)
        return np.asarray((short * np.exp(-rollouts.times / self.fades_s)).mean(axis=1))
