"""The workshop's first controller: turn towards the box with the highest score and drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo_hog.follow.decision import Decision, Mode
from limo_hog.follow.parameters import bounded
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.measurement import box_centre
from limo_hog.follow.sense.observation import Observation


@dataclass(frozen=True, slots=True)
class ApproachController:
    """Steer by the horizontal error of the best box, drive at one speed, stop without a box.

    The state is whether a person was detected before. The numbers are the workshop's.

    Attributes
    ----------
    angular_gain
        Turn rate for each pixel between the box and the middle of the image [rad/s/px].
    dead_band_px
        Errors smaller than this do not turn the robot [px].
    linear_speed
        Speed towards a person [m/s].
    """

    angular_gain: float = bounded(0.005, 0, 0.05)
    dead_band_px: float = bounded(20.0, 0, 320)
    linear_speed: float = bounded(0.2, 0, 1)

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


def best_box(observation: Observation) -> tuple[int, int]:
    """Return the index of the box with the highest score, and how far left of the image's middle it is [px]."""
    target = int(np.argmax(observation.detections.scores))
    return target, observation.width // 2 - box_centre(observation.detections.windows[target])[0]


def no_detection(detected_before: bool) -> Decision[bool]:
    """Stop, as both workshop controllers do without a box."""
    mode = Mode.LOST if detected_before else Mode.SEARCH
    return Decision(Twist(), detected_before, mode, "no person detected")
