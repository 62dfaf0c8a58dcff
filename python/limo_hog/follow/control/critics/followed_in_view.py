"""The person followed should stay in the image, or where they are looked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.control.rollouts import Rollouts
from limo_hog.follow.control.situation import Situation
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Array, turn_between


@dataclass(frozen=True, slots=True)
class FollowedInView:
    """Mean angle of the person followed beyond `edge`, and a share of that off the middle."""

    weight: float = param(3.0, "1/rad", "Cost of a radian.", 0, 100)
    edge: float = param(0.5, "rad", "Further to either side than this the camera does not show a whole person.", 0, 2)
    share: float = param(0.1, "of 1", "Share that a radian off the middle counts for.", 0, 1)
    most: float = param(0.9, "rad", "Further off costs no more: out of the image is out of the image.", 0, 4)

    def cost(self, rollouts: Rollouts, situation: Situation) -> Array:
        """Return the cost of each rollout before its weight, float64 (K,) [rad]."""
        goal, times = rollouts.goal, rollouts.times
        if not goal.faces:
            return np.zeros(len(rollouts.offs))
        if situation.followed is None:
            off = turn_between(rollouts.poses[:, :, 2], goal.heading + goal.rate * times)
        else:
            to = rollouts.places[:, situation.followed] - rollouts.poses[:, :, :2]
            off = turn_between(np.arctan2(to[..., 1], to[..., 0]), rollouts.poses[:, :, 2])
        off = np.minimum(off, self.most)
        return np.asarray((self.share * off + np.maximum(off - self.edge, 0.0)).mean(axis=1))
