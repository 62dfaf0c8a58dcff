"""The workshop's two controllers: drive to the box with the highest score, or hold a distance to the person.

Their state is whether a person was detected before; the numbers are the workshop's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.measurement import box_centre, person_depth, zone_of
from limo_hog.follow.sense.observation import Observation


@dataclass(frozen=True, slots=True)
class ApproachController:
    """Steer by the horizontal error of the best box, drive at one speed, stop without a box."""

    angular_gain: float = param(0.005, "rad/s/px", "Turn rate for each pixel off the middle.", 0, 0.05)
    dead_band_px: float = param(20.0, "px", "Errors smaller than this do not turn the robot.", 0, 320)
    linear_speed: float = param(0.2, "m/s", "Speed towards a person.", 0, 1)

    def start(self) -> bool:
        """Return the state before the first observation: no person detected yet."""
        return False

    def step(self, observation: Observation, state: bool) -> Decision[bool]:
        """Turn towards the best box, if there is one."""
        if len(observation.detections) == 0:
            return no_detection(state)
        target, error = best_box(observation)
        angular = 0.0 if abs(error) < self.dead_band_px else self.angular_gain * error
        return Decision(Twist(self.linear_speed, angular), True, Mode.FOLLOW, "driving towards a person", target)


@dataclass(frozen=True, slots=True)
class ProxemicController:
    """Two proportional controllers: the box to the middle of the image, the person to a distance."""

    target_distance: float = param(1.5, "m", "Distance to hold, by the depth image.", 0.1, 8)
    linear_gain: float = param(0.5, "1/s", "Speed of approach for each metre of error.", 0, 5)
    angular_gain: float = param(0.005, "rad/s/px", "Turn rate for each pixel of error.", 0, 0.05)
    max_linear: float = param(0.3, "m/s", "Limit of the speed, either way.", 0, 1)
    max_angular: float = param(0.8, "rad/s", "Limit of the turn rate, either way.", 0, 3)

    def start(self) -> bool:
        """Return the state before the first observation: no person detected yet."""
        return False

    def step(self, observation: Observation, state: bool) -> Decision[bool]:
        """Turn towards the best box and hold its distance; stop without a box or a distance."""
        if len(observation.detections) == 0:
            return no_detection(state)
        target, error = best_box(observation)
        box = observation.detections.windows[target]
        distance = None if observation.depth is None else person_depth(observation.depth, box)
        if distance is None:
            return Decision(Twist(), True, Mode.BLOCKED, "no depth at the person", target)
        linear = min(max(self.linear_gain * (distance - self.target_distance), -self.max_linear), self.max_linear)
        twist = Twist(linear, min(max(self.angular_gain * error, -self.max_angular), self.max_angular))
        return Decision(twist, True, Mode.FOLLOW, f"person in the {zone_of(distance).value} zone", target)


def best_box(observation: Observation) -> tuple[int, int]:
    """Return the index of the box with the highest score, and how far left of the image's middle it is [px]."""
    target = int(np.argmax(observation.detections.scores))
    return target, observation.width // 2 - box_centre(observation.detections.windows[target])[0]


def no_detection(detected_before: bool) -> Decision[bool]:
    """Stop, as both workshop controllers do without a box."""
    mode = Mode.LOST if detected_before else Mode.SEARCH
    return Decision(Twist(), detected_before, mode, "no person detected")
