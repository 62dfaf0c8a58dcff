"""image_geometry: pixels and rays of a calibrated camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from limo_sim.ros.rclpy_stub.partial import PartialApi

#: Names of ROS 2's `PinholeCameraModel` that are not offered.
_MISSING = tuple(
    "rectifyImage rectifyPoint unrectifyPoint rectify_image rectify_point unrectify_point getDeltaU getDeltaV "
    "getDeltaX getDeltaY fullResolution fullIntrinsicMatrix fullProjectionMatrix tfFrame_ stamp_".split()
)


class PinholeCameraModel(PartialApi, missing=_MISSING):
    """A rectified pinhole camera, read from a CameraInfo; rays are optical: X right, Y down, Z forward."""

    def __init__(self) -> None:
        self.K: Any = None  #: intrinsic matrix (3, 3) [px]
        self.D: Any = None
        self.R: Any = None
        self.P: Any = None  #: projection matrix (3, 4) [px]
        self.width = self.height = 0  #: of its images [px]
        self.tf_frame = ""
        self.stamp: Any = None

    def fromCameraInfo(self, msg: Any) -> None:  # noqa: N802 — Humble's names
        """Read a CameraInfo."""
        self.K, self.R = np.array(msg.k).reshape(3, 3), np.array(msg.r).reshape(3, 3)
        self.P, self.D = np.array(msg.p).reshape(3, 4), np.array(msg.d)
        self.width, self.height = msg.width, msg.height
        self.tf_frame, self.stamp = msg.header.frame_id, msg.header.stamp

    def project3dToPixel(self, point: Any) -> tuple[float, float]:  # noqa: N802
        """Return the pixel (u, v) of a point (x, y, z) [m]; nan where it is in the camera's plane."""
        x, y, w = self.P @ np.array([*point, 1.0])
        return (float(x / w), float(y / w)) if w != 0 else (math.nan, math.nan)

    def projectPixelTo3dRay(self, uv: Any) -> tuple[float, float, float]:  # noqa: N802
        """Return the ray of length 1 through a pixel (u, v)."""
        ray = np.array([(uv[0] - self.cx()) / self.fx(), (uv[1] - self.cy()) / self.fy(), 1.0])
        x, y, z = ray / np.linalg.norm(ray)
        return float(x), float(y), float(z)

    # Humble's names and Jazzy's
    intrinsicMatrix = intrinsic_matrix = lambda model: model.K  # noqa: N815
    projectionMatrix = projection_matrix = lambda model: model.P  # noqa: N815
    distortionCoeffs = distortion_coeffs = lambda model: model.D  # noqa: N815
    rotationMatrix = rotation_matrix = lambda model: model.R  # noqa: N815

    def tfFrame(self) -> str:  # noqa: N802
        """Return the camera's frame."""
        return self.tf_frame

    def fx(self) -> float:
        """Return the focal length in columns [px]."""
        return float(self.P[0, 0])

    def fy(self) -> float:
        """Return the focal length in rows [px]."""
        return float(self.P[1, 1])

    def cx(self) -> float:
        """Return the principal point's column [px]."""
        return float(self.P[0, 2])

    def cy(self) -> float:
        """Return the principal point's row [px]."""
        return float(self.P[1, 2])

    def fovX(self) -> float:  # noqa: N802
        """Return the horizontal field of view [rad]."""
        return 2 * math.atan(self.width / (2 * self.fx()))

    def fovY(self) -> float:  # noqa: N802
        """Return the vertical field of view [rad]."""
        return 2 * math.atan(self.height / (2 * self.fy()))

    # Jazzy's names
    from_camera_info = fromCameraInfo
    project_3d_to_pixel = project3dToPixel
    project_pixel_to_3d_ray = projectPixelTo3dRay
