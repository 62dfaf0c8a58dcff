"""The robot keeps off other people, who give way as well: what they will do in two seconds hardly counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Array, Situation
from limo_hog.follow.parameters import param


@dataclass(frozen=True, slots=True)
class RoomToOthers:
    """Mean distance short of `clear` to the nearest of the others, and more from where it would touch them.

    A robot that takes people never to give way freezes among them (Trautman and Krause 2010).
    """

    weight: float = param(12.0, "1/m", "Cost of a metre.", 0, 100)
    clear: float = param(0.35, "m", "Distance wanted from the outline to a person's axis.", 0, 3)
    touches: float = param(0.2, "m", "Nearer than this is taken for a contact.", 0, 1)
    contact: float = param(3.0, "m", "What a contact costs besides.", 0, 100)
    fades_s: float = param(1.2, "s", "Time constant with which the future counts less.", 0.1, 60)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        x, y, vx, vy = situation.people.T
        # Who walks away, or touches the robot already, is not fled from: they walk on by themselves.
        comes = (x * vx + y * vy < 0) & (np.hypot(x, y) > self.touches + situation.robot.half_length)
        comes[[] if situation.followed is None else situation.followed] = False
        others = rollouts.places[:, comes]
        if others.shape[1] == 0:
            return rollouts.nothing
        gap = rollouts.gaps(others, situation.robot).min(axis=2)
        short = np.maximum(self.clear - gap, 0.0) + self.contact * np.logical_or.accumulate(gap < self.touches, axis=1)
        return np.asarray((short * np.exp(-rollouts.times / self.fades_s)).mean(axis=1))
