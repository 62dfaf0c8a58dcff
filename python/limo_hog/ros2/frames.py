"""The robot's tree of frames for TF (REP-105): odom -> base_link -> camera, lidar and IMU."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO, RobotError, RobotGeometry
from limo_hog.follow.sense.observation import Odometry
from limo_hog.ros2 import messages

#: Where optical data of the camera really are: X right, Y down, Z forward (REP-103). The Limo's images are stamped with
#: `depth_link`, whose axes are x forward, y left, z up, as in its URDF.
OPTICAL_FRAME = "depth_optical_link"

#: The frame on the floor below the robot, where its tree has one (REP-120): heights count from there.
FLOOR_FRAME = "base_footprint"
#: A sensor that is turned by more than this is not level [1]: the cosine of 8°.
_LEVEL = 0.99

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


class Mounts:
    """Where sensors sit on a robot, from the messages of /tf_static."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[str, NDArray[np.float64]]] = {}

    def take(self, message: Any) -> None:
        """Take in a TFMessage."""
        for one in message.transforms:
            self._above[one.child_frame_id.lstrip("/")] = one.header.frame_id.lstrip("/"), _matrix(one.transform)

    def pose(self, base: str, frame: str) -> NDArray[np.float64] | None:
        """Return float64 (4, 4): from a sensor's frame to the robot's, on the floor; None where it is not known."""
        root, pose = self._in_root(frame)
        for origin in (FLOOR_FRAME, base):
            there, at = self._in_root(origin)
            if there == root:
                return np.asarray(np.linalg.inv(at) @ pose)
        return None

    def _in_root(self, frame: str) -> tuple[str, NDArray[np.float64]]:
        """Return the frame above all others, and the way there from `frame`."""
        pose, seen = np.eye(4), set()
        while frame in self._above and frame not in seen:
            seen.add(frame)
            frame, step = self._above[frame]
            pose = step @ pose
        return frame, pose

    def applied(self, robot: RobotGeometry, base: str, camera: str, lidar: str) -> tuple[RobotGeometry, frozenset[str]]:
        """Return a robot whose sensors sit where their frames do, and the names of the numbers that the frames have.

        What the robot's file says, and is not the Limo's, stays. Raises `RobotError` where a sensor is not level, or
        where it sits is out of range.
        """
        looks, scans = self.pose(base, camera), self.pose(base, lidar)
        found: dict[str, float] = {}
        if looks is not None:
            # The axis of a camera's frame that looks ahead is z in an optical frame, x in others (REP-103).
            if looks[0, [0, 2]].max() < _LEVEL:
                raise RobotError(f"/tf_static: the camera, {camera}, does not look level and straight ahead")
            found = {"camera_x": looks[0, 3], "camera_z": looks[2, 3]}
        if scans is not None:
            if scans[2, 2] < _LEVEL:
                raise RobotError(f"/tf_static: the lidar, {lidar}, is not level, or upside down")
            yaw = math.atan2(scans[1, 0], scans[0, 0])
            found |= {"lidar_x": scans[0, 3], "lidar_z": scans[2, 3], "lidar_yaw": yaw}
        new: dict[str, Any] = {
            name: float(value) for name, value in found.items() if getattr(robot, name) == getattr(LIMO, name)
        }
        return replace(robot, **new), frozenset(found)


def whence(file: RobotGeometry, framed: frozenset[str]) -> str:
    """Return where each number of where the sensors sit is from; `framed` are those that /tf_static has."""
    origins: dict[str, list[str]] = {}
    for name in ("camera_x", "camera_z", "lidar_x", "lidar_yaw"):
        said = getattr(file, name) != getattr(LIMO, name)
        origin = "the robot's file" if said else "/tf_static" if name in framed else "a Limo's"
        origins.setdefault(origin, []).append(name)
    if len(origins) == 1:
        return next(iter(origins))
    return " · ".join(f"{origin}: {', '.join(those)}" for origin, those in origins.items())


def _matrix(transform: Any) -> NDArray[np.float64]:
    """Return float64 (4, 4) of a geometry_msgs/Transform."""
    place, turn = transform.translation, transform.rotation
    w, x, y, z = np.array([turn.w, turn.x, turn.y, turn.z]) / (np.linalg.norm([turn.w, turn.x, turn.y, turn.z]) or 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), place.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), place.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), place.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _message(transforms: list[Any]) -> Any:
    message = messages.default_message("tf2_msgs/msg/TFMessage")
    message.transforms = transforms
    return message


def _transform(stamp: float, parent: str, child: str, place: Sequence[float], turn: Sequence[float]) -> Any:
    one = messages.stamped("geometry_msgs/msg/TransformStamped", stamp, parent)
    one.child_frame_id = child
    translation, rotation = one.transform.translation, one.transform.rotation
    translation.x, translation.y, translation.z = place
    rotation.x, rotation.y, rotation.z, rotation.w = turn
    return one
