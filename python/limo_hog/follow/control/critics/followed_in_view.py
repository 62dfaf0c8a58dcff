"""The person followed should stay in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class FollowedInView:
    """Mean angle by which the person followed is off the middle of the image."""

    weight: float = param(1.5, "1/rad", "Cost of a radian.", 0, 100)
    free: float = param(0.15, "rad", "So far to either side costs nothing.", 0, 2)
    most: float = param(1.0, "rad", "Further off costs no more: out of the image is out of the image.", 0, 4)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [rad]."""
        if situation.followed is None or not rollouts.goal.faces:
            return rollouts.nothing
        off = rollouts.offs_to(rollouts.places[:, situation.followed])
        return np.asarray(np.minimum(np.maximum(off - self.free, 0.0), self.most).mean(axis=1))
