"""The velocity command of a ground robot."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Twist:
    """What a differential-drive robot is told to do; the default is to stop.

    Attributes
    ----------
    linear
        Forward speed [m/s], along the robot's x axis.
    angular
        Turn rate [rad/s] about the robot's z axis, counter-clockwise positive.
    """

    linear: float = 0.0
    angular: float = 0.0

    @property
    def is_finite(self) -> bool:
        """Whether both speeds are numbers a motor can be given."""
        return math.isfinite(self.linear) and math.isfinite(self.angular)
