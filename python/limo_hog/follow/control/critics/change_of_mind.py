"""A manoeuvre begun is kept unless another is better by more than a little: two sides would be taken in turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class ChangeOfMind:
    """One for a command other than the one begun, and more the further its direction is from that one's."""

    weight: float = param(0.1, "cost", "What another command must gain.", 0, 100)
    turned: float = param(1.5, "1/rad", "What each radian to the direction of the command begun costs besides.", 0, 10)

    def cost(self, rollouts: Rollouts, _: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [1]."""
        begun = rollouts.begun
        cost = 1.0 + self.turned * np.abs(rollouts.offs - rollouts.offs[begun])
        cost[begun] = 0.0
        return np.asarray(cost)
