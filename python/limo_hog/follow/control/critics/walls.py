"""The robot keeps off what stands around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class Walls:
    """Mean distance short of `clear` from the robot's centre to the nearest return, and more where it would touch."""

    weight: float = param(3.0, "1/m", "Cost of a metre.", 0, 100)
    clear: float = param(0.45, "m", "Distance wanted from the robot's centre.", 0, 3)
    touches: float = param(0.2, "m", "Nearer than this a corner of the robot may touch it.", 0, 1)
    contact: float = param(10.0, "m", "What that costs besides.", 0, 100)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        # Every third step will do: in .6 s the robot drives little more than its length.
        at = rollouts.poses[:, 1::3, :2].reshape(-1, 2)
        driven, away = (at**2).sum(axis=1), (situation.points**2).sum(axis=1)
        near = away < (np.sqrt(driven.max()) + self.clear) ** 2
        points, away = situation.points[near], away[near]
        if len(points) == 0:
            return np.zeros(len(rollouts.offs))
        gap = np.sqrt(np.maximum((away - 2 * at @ points.T).min(axis=1) + driven, 0.0)).reshape(len(rollouts.offs), -1)
        return np.asarray((np.maximum(self.clear - gap, 0.0) + self.contact * (gap < self.touches)).mean(axis=1))
