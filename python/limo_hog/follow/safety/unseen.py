"""The ground behind the robot that no sensor shows now: how much of it was seen to be free shortly before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, places_behind, to_odometry
from limo_hog.follow.sense.observation import Odometry, Scan

#: Ground is looked at so far behind the outline, in such steps [m]. Chosen: from .6 m/s the robot stops within .51 m.
FARTHEST, STEP = 0.6, 0.1
_DEPTHS = tuple(np.arange(STEP, FARTHEST + 1e-9, STEP).tolist())
#: A beam must reach further than the ground it shows to be free by this [m]. Chosen: three standard deviations and more
#: of the lidar's .01 m.
BEYOND = 0.05


@dataclass(frozen=True, slots=True)
class Look:
    """A scan, and where the robot was."""

    scan: Scan
    pose: Odometry


def room_seen_behind(looks: Sequence[Look], pose: Odometry, robot: RobotGeometry) -> float:
    """Return how far behind the robot's outline the ground was seen to be free [m]; `FARTHEST` at most.

    Parameters
    ----------
    looks
        Scans of the last seconds. Ground that the robot covered when one was taken was free as well.
    pose
        Where the robot is now.
    robot
        Its outline and mounts.
    """
    if not looks:
        return 0.0
    places = to_odometry(places_behind(_DEPTHS, robot), pose)
    unseen = ~_were_free(places, looks, robot).any(axis=0).reshape(len(_DEPTHS), -1).all(axis=1)
    return _DEPTHS[int(np.argmax(unseen))] - STEP if unseen.any() else FARTHEST


def _were_free(points: Points, looks: Sequence[Look], robot: RobotGeometry) -> NDArray[np.bool_]:
    """Return for each of L looks and N points, odometry frame, whether a beam passed over it or the robot stood there.

    bool (L, N). All looks at once: one by one they took a millisecond.
    """
    numbers = [
        (
            *(look.pose.x, look.pose.y, math.cos(look.pose.yaw), math.sin(look.pose.yaw)),
            *(look.scan.angle_min, look.scan.angle_max, look.scan.range_min, look.scan.range_max),
            len(look.scan.ranges),
        )
        for look in looks
    ]
    x, y, cos, sin, angle_min, angle_max, range_min, range_max, count = np.array(numbers).T[:, :, None]
    dx, dy = points[:, 0] - x, points[:, 1] - y
    ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
    # Half a step of grace: the ground just behind the outline was under it a moment ago.
    covered = (np.abs(ahead) < robot.half_length + STEP / 2) & (np.abs(aside) < robot.half_width + STEP / 2)
    distance = np.hypot(ahead - robot.lidar_x, aside)
    angle = np.arctan2(aside, ahead - robot.lidar_x)
    beam = np.rint((angle - angle_min) / ((angle_max - angle_min) / np.maximum(count - 1, 1)))
    inside = (beam >= 0) & (beam < count)
    # The scans one after the other, and where each begins.
    begins = np.cumsum(count, axis=0) - count
    ranges = np.concatenate([look.scan.ranges for look in looks])[
        (begins + np.minimum(np.maximum(beam, 0), count - 1)).astype(np.int64)
    ]
    # A beam that is no number, or shorter than the lidar can measure, shows nothing.
    passed = inside & (ranges >= range_min) & (np.minimum(ranges, range_max) > distance + BEYOND)
    return np.asarray(covered | passed)
