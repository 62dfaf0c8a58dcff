"""Of commands that are as good the easiest is taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class Effort:
    """Change of speed, and angle off the goal's direction."""

    weight: float = param(0.08, "s/m", "Cost of a change by 1 m/s, or of a radian.", 0, 100)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,)."""
        return np.abs(rollouts.wanted - situation.driven.linear) + np.abs(rollouts.offs)
