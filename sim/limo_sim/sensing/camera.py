"""The pinhole camera: its geometry, and what one exposure yields.

Camera frame: X right, Y down, Z forward [m]; whole numbers are pixel centres, the principal
point is the image centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.observation import Frame
from limo_sim.world.truth import Truth

WIDTH, HEIGHT = 640, 480
CENTRE_X, CENTRE_Y = (WIDTH - 1) / 2, (HEIGHT - 1) / 2


@dataclass(frozen=True)
class CameraPose:
    """Where the camera is in the arena's frame and which way it looks, level [m, m, rad]; by default a Limo's."""

    x: float
    y: float
    yaw: float
    height: float = LIMO.camera_z  #: above the floor [m]
    focal_px: float = LIMO.focal_px(WIDTH)  #: its focal length [px]

    @classmethod
    def on_robot(cls, robot: RobotGeometry, x: float, y: float, yaw: float) -> CameraPose:
        """Return the camera of a robot whose base centre is at (x, y, yaw)."""
        place = x + robot.camera_x * math.cos(yaw), y + robot.camera_x * math.sin(yaw)
        return cls(*place, yaw, robot.camera_z, robot.focal_px(WIDTH))

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """Float64 (3, 3): arena directions to camera directions."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[sin, -cos, 0.0], [0.0, 0.0, -1.0], [cos, sin, 0.0]])

    def ahead_of(self, x: float, y: float) -> tuple[float, float]:
        """Return how far a place is to the right of the camera and ahead of it [m]."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = x - self.x, y - self.y
        return sin * dx - cos * dy, cos * dx + sin * dy

    def to_camera(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take points (N, 3) from the arena's frame to the camera's [m]."""
        return np.asarray((points - np.array([self.x, self.y, self.height])) @ self.rotation.T)


@dataclass(frozen=True, slots=True, eq=False)
class TrueFrame(Frame):
    """One exposure of the colour and the depth camera, 640 x 480, and the arena at that instant."""

    depth: NDArray[np.float32]
    truth: Truth
