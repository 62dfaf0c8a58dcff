"""A controller whose robot may not drive or turn faster than its owner says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Observation

S = TypeVar("S")


@dataclass(frozen=True)
class Limited(Generic[S]):
    """Slows a controller's commands; the arc that they drive stays the same.

    Attributes
    ----------
    controller
        Whose commands are slowed.
    max_speed
        Highest speed, forwards and backwards [m/s].
    max_turn
        Highest turn rate [rad/s].
    """

    controller: Controller[S]
    max_speed: float = math.inf
    max_turn: float = math.inf

    def start(self) -> S:
        """Return the controller's state before the first observation."""
        return self.controller.start()

    def step(self, observation: Observation, state: S) -> Decision[S]:
        """Decide as the controller does, slower where it is too fast."""
        decision = self.controller.step(observation, state)
        twist = decision.twist
        over = max(1.0, abs(twist.linear) / self.max_speed, abs(twist.angular) / self.max_turn)
        return replace(decision, twist=Twist(twist.linear / over, twist.angular / over))
