"""A manoeuvre begun is kept unless another is better by more than a little: two sides would be taken in turns."""

from __future__ import annotations

from dataclasses import dataclass

from limo_hog.follow.control.rollouts import DIRECT, Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class ChangeOfMind:
    """One for a command other than the one begun; back to the goal's own it is less."""

    weight: float = param(0.1, "1", "What another command must gain.", 0, 100)
    direct: float = param(0.5, "1", "Share of it that the goal's own command must gain.", 0, 1)

    def cost(self, rollouts: Rollouts, _: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [1]."""
        cost = rollouts.nothing + 1.0
        cost[0] = 0.0 if rollouts.kept == DIRECT else self.direct
        if rollouts.kept != DIRECT:
            cost[-1] = 0.0
        return cost
