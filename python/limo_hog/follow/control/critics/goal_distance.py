"""A rollout should bring the robot to the distance it keeps, as fast as the goal's own command with a free way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class GoalDistance:
    """Mean error of the distance to the goal's place, beyond that of the goal's own command if nothing held it.

    Without a place, the mean distance from where the robot is.
    """

    weight: float = param(2.0, "1/m", "Cost of a metre.", 0, 100)

    def cost(self, rollouts: Rollouts, _: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [m]."""
        goal = rollouts.goal
        if goal.places is None:
            return np.asarray(np.hypot(rollouts.poses[..., 0], rollouts.poses[..., 1]).mean(axis=1))
        gaps = np.hypot(*(goal.places - rollouts.poses[:, :, :2]).transpose(2, 0, 1))
        best = np.abs(np.hypot(*(goal.places - rollouts.free).T) - goal.keeps).mean()
        return np.asarray(np.maximum(np.abs(gaps - goal.keeps).mean(axis=1) - best, 0.0))
