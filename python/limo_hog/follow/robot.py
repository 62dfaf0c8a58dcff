"""The robot's shape and where its sensors sit, in the base frame: x forward, y left, origin at the centre."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Body:
    """The Limo, from LCAS/limo_ros2's `limo_four_diff.xacro`; all lengths in metres.

    Attributes
    ----------
    half_length, half_width
        Half of the body's outline.
    camera_x, camera_z
        Where the camera sits, ahead of the centre and above the floor; it looks level and straight ahead.
    lidar_x
        Where the lidar sits, ahead of the centre.
    """

    half_length: float = 0.145
    half_width: float = 0.11
    camera_x: float = 0.084
    camera_z: float = 0.175
    lidar_x: float = 0.103


LIMO = Body()
