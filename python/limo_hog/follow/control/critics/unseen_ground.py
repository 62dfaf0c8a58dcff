"""The robot does not back onto ground to which somebody out of sight can have come since it was seen to be free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class UnseenGround:
    """Share of the time in which it backs onto ground where somebody can be; the near future counts most."""

    weight: float = param(6.0, "cost", "Cost of backing so all the time.", 0, 100)
    unknown: float = param(0.3, "of 1", "Share that ground counts for that was not seen at all.", 0, 1)
    fresh_s: float = param(5.0, "s", "How long nobody can have come to ground seen free, for this critic.", 0, 60)
    stands: float = param(0.02, "m/s", "A slower robot stands.", 0, 1)
    fades_s: float = param(1.2, "s", "Time constant with which the future counts less.", 0.1, 60)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [1]."""
        cost, backs = np.zeros(len(rollouts.offs)), np.flatnonzero(rollouts.speeds.min(axis=1) < -self.stands)
        if len(backs):
            known, risky = situation.is_known_behind(rollouts.poses[backs, ::2], self.fresh_s)
            onto = np.where(risky, 1.0, self.unknown * ~known) * (rollouts.speeds[backs, ::2] < -self.stands)
            cost[backs] = (onto * np.exp(-rollouts.times[::2] / self.fades_s)).mean(axis=1)
        return cost
