"""The robot keeps off the person followed, who is taken to walk straight on."""

from __future__ import annotations

from dataclasses import dataclass

from limo_hog.follow.control.critics.room import Room
from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class RoomToFollowed(Room):
    """Room to the person followed; a contact costs more than to lose sight of them."""

    contact: float = param(4.5, "m", "What a sure contact costs besides.", 0, 100)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        return self.short(rollouts, [] if situation.followed is None else [situation.followed], situation)
