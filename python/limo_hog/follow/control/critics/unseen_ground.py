"""The robot backs onto ground that was seen to be free and that nobody can have come to since: it cannot look there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class UnseenGround:
    """Share of the time in which the robot backs onto ground that is not known, or where somebody can be."""

    weight: float = param(6.0, "1", "Cost of backing so all the time.", 0, 100)
    blind_speed: float = param(0.2, "m/s", "So fast it may back where nobody can be.", 0, 1)
    stands: float = param(0.02, "m/s", "A slower robot stands.", 0, 1)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [1]."""
        cost, backs = rollouts.nothing, np.flatnonzero(rollouts.speeds.min(axis=1) < -self.stands)
        if len(backs):
            speeds = rollouts.speeds[backs, ::2]
            known, risky = situation.is_known_behind(rollouts.poses[backs, ::2])
            blind = (~known & (speeds < -self.blind_speed - self.stands)) | (risky & (speeds < -self.stands))
            cost[backs] = blind.mean(axis=1)
        return cost
