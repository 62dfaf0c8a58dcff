"""How near a rollout comes to people, and whether it touches one of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array


@dataclass(frozen=True, slots=True)
class Room:
    """Mean distance short of `clear` to the nearest person, and the highest chance of a contact.

    The nearest person is this far off but for an error that grows with time, taken to have the logistic distribution.
    """

    weight: float = param(12.0, "1/m", "Cost of a metre.", 0, 100)
    clear: float = param(0.65, "m", "Distance wanted from the outline to a person's axis.", 0, 3)
    touches: float = param(0.2, "m", "Nearer than this the robot touches the person.", 0, 1)
    contact: float = param(2.0, "m", "What a sure contact costs besides.", 0, 100)
    error: float = param(0.05, "m", "Scale of the error of the distance now.", 0.001, 1)
    spread: float = param(0.1, "m/s", "How fast that scale grows.", 0, 1)
    fades_s: float = param(1.5, "s", "Time constant with which the future counts less.", 0.1, 60)

    def short(self, rollouts: Rollouts, people: list[int], situation: Situation) -> Array:
        """Return the cost of each rollout by the people in these rows, float64 (K,) [m]."""
        if not people:
            return np.zeros(len(rollouts.offs))
        # From the robot's outline, negative inside it.
        robot, places, poses = situation.robot, rollouts.places[:, people], rollouts.poses[:, :, None]
        dx, dy = places[..., 0] - poses[..., 0], places[..., 1] - poses[..., 1]
        cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        ahead = np.abs(cos * dx + sin * dy) - robot.half_length
        beside = np.abs(cos * dy - sin * dx) - robot.half_width
        outside = np.hypot(np.maximum(ahead, 0.0), np.maximum(beside, 0.0))
        gaps = (outside + np.minimum(np.maximum(ahead, beside), 0.0)).min(axis=2)
        fade, scale = np.exp(-rollouts.times / self.fades_s), self.error + self.spread * rollouts.times
        chance = (1 - np.tanh((gaps - self.touches) / scale / 2)) / 2
        short = (np.maximum(self.clear - gaps, 0.0) * fade).mean(axis=1)
        return np.asarray(short + self.contact * (chance * fade).max(axis=1))
