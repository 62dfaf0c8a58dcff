"""The robot's tree of frames for TF (REP-105): odom -> base_link -> camera, lidar and IMU."""

from __future__ import annotations

import math
from typing import Any

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.observation import Odometry
from limo_hog.ros2 import messages

#: Where optical data of the camera really are: X right, Y down, Z forward (REP-103). The Limo's images are stamped with
#: `depth_link`, whose axes are x forward, y left, z up, as in its URDF.
OPTICAL_FRAME = "depth_optical_link"

#: A turn by -90° about z after one by -90° about x: optical axes in a frame with x forward (x, y, z, w).
_OPTICAL = (-0.5, 0.5, -0.5, 0.5)


def odometry_transform(reading: Odometry) -> Any:
    """Return the TFMessage of the robot's pose in `odom`."""
    turn = (0.0, 0.0, math.sin(reading.yaw / 2), math.cos(reading.yaw / 2))
    one = _transform(reading.stamp, messages.ODOMETRY_FRAME, messages.BASE_FRAME, (reading.x, reading.y, 0.0), turn)
    return _message([one])


def static_transforms(stamp: float, robot: RobotGeometry) -> Any:
    """Return the TFMessage of the frames that do not move on a robot; `stamp` in [s]."""
    base, level = messages.BASE_FRAME, (0.0, 0.0, 0.0, 1.0)
    camera, lidar = (robot.camera_x, 0.0, robot.camera_z), (robot.lidar_x, 0.0, robot.lidar_z)
    turned = (0.0, 0.0, math.sin(robot.lidar_yaw / 2), math.cos(robot.lidar_yaw / 2))
    return _message(
        [
            _transform(stamp, base, messages.CAMERA_FRAME, camera, level),
            _transform(stamp, messages.CAMERA_FRAME, OPTICAL_FRAME, (0.0, 0.0, 0.0), _OPTICAL),
            _transform(stamp, base, messages.LIDAR_FRAME, lidar, turned),
            _transform(stamp, base, messages.IMU_FRAME, (0.0, 0.0, 0.0), level),
        ]
    )


def _message(transforms: list[Any]) -> Any:
    message = messages.default_message("tf2_msgs/msg/TFMessage")
    message.transforms = transforms
    return message


def _transform(
    stamp: float,
    parent: str,
    child: str,
    translation: tuple[float, float, float],
    rotation: tuple[float, float, float, float],
) -> Any:
    one = messages.default_message("geometry_msgs/msg/TransformStamped")
    one.header.stamp, one.header.frame_id, one.child_frame_id = messages.to_time(stamp), parent, child
    place, turn = one.transform.translation, one.transform.rotation
    place.x, place.y, place.z = translation
    turn.x, turn.y, turn.z, turn.w = rotation
    return one
