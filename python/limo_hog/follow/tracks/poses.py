"""Where the robot was at the stamp of an image or a scan, which may be older than the newest odometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Odometry


def pose_at(poses: tuple[Odometry, ...], stamp: float) -> Odometry:
    """Return the robot's pose at `stamp` [s].

    Interpolated between the two nearest of `poses`, which are oldest first. Before the first the robot is taken to
    have stood; after the last its speeds are taken to have lasted.
    """
    if not poses:
        return Odometry(stamp)
    last = poses[-1]
    if stamp >= last.stamp:
        ahead = stamp - last.stamp
        yaw = last.yaw + last.angular * ahead
        x = last.x + last.linear * ahead * math.cos(last.yaw)
        y = last.y + last.linear * ahead * math.sin(last.yaw)
        return replace(last, stamp=stamp, x=x, y=y, yaw=yaw)
    stamps = np.array([pose.stamp for pose in poses])
    columns: NDArray[np.float64] = np.array([(pose.x, pose.y, pose.yaw) for pose in poses])
    columns[:, 2] = np.unwrap(columns[:, 2])
    x, y, yaw = (float(np.interp(stamp, stamps, column)) for column in columns.T)
    return replace(last, stamp=stamp, x=x, y=y, yaw=yaw)
