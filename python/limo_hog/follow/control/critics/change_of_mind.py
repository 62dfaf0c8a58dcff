"""A manoeuvre begun is kept unless another is better by more than a little: two sides would be taken in turns."""

from __future__ import annotations

from dataclasses import dataclass

from limo_hog.follow.control.rollouts import DIRECT, Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class ChangeOfMind:
    """One for a command other than the one begun; where that is the goal's own, less."""

    weight: float = param(0.6, "1", "What another command must gain.", 0, 100)
    begins: float = param(0.15, "1", "Share of it that must be gained to leave the goal's own command.", 0, 1)
    direct: float = param(0.5, "1", "Share of it that the goal's own command must gain.", 0, 1)

    def cost(self, rollouts: Rollouts, _: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [1]."""
        if rollouts.kept == DIRECT:
            cost = rollouts.nothing + self.begins
            cost[0] = 0.0
        else:
            cost = rollouts.nothing + 1.0
            cost[0], cost[-1] = self.direct, 0.0
        return cost
