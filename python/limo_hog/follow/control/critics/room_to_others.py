"""The robot keeps off other people, who give way as well: what they will do in two seconds hardly counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.critics.room import Room
from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class RoomToOthers(Room):
    """Room to those of the others who come nearer.

    A robot that takes people never to give way freezes among them (Trautman and Krause 2010).
    """

    clear: float = param(0.35, "m", "Distance wanted from the outline to a person's axis.", 0, 3)
    contact: float = param(1.0, "m", "What a sure contact costs besides.", 0, 100)
    spread: float = param(0.02, "m/s", "How fast the error's scale grows: they see the robot.", 0, 1)
    fades_s: float = param(1.2, "s", "Time constant with which the future counts less.", 0.1, 60)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        x, y, vx, vy = situation.people.T
        # Those who walk away, or touch the robot already, are not fled from: they walk on by themselves.
        comes = (x * vx + y * vy < 0) & (np.hypot(x, y) > self.touches + situation.robot.half_length)
        comes[[] if situation.followed is None else situation.followed] = False
        return self.short(rollouts, np.flatnonzero(comes).tolist(), situation)
