"""The Limo: its outline, where its sensors and wheels sit, what its camera sees, and the command it is given.

Lengths are in the base frame: x forward, y left, z up, origin on the floor below the middle of the body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RobotGeometry:
    """Lengths of a robot [m], from LCAS/limo_ros2's `limo_four_diff.xacro`.

    Attributes
    ----------
    half_length, half_width
        Half of the body's outline.
    camera_x, camera_z
        Where the camera sits, ahead of the centre and above the floor; it looks level and straight ahead.
    field_of_view
        Horizontal field of view of the camera [rad].
    lidar_x, lidar_z
        Where the lidar sits, ahead of the centre and above the floor; its plane is level.
    wheel_separation
        Between the left and the right wheels, as the differential drive counts it.
    """

    half_length: float = 0.145
    half_width: float = 0.11
    camera_x: float = 0.084
    camera_z: float = 0.175
    field_of_view: float = 1.23918
    lidar_x: float = 0.103
    lidar_z: float = 0.111
    wheel_separation: float = 0.172

    def focal_px(self, width: int) -> float:
        """Return the camera's focal length for images of `width` [px]: 448.6 for 640."""
        return width / 2 / math.tan(self.field_of_view / 2)


LIMO = RobotGeometry()


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
