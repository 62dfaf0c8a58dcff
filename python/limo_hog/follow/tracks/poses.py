"""Where the robot was at the stamp of an image or a scan, which may be older than the newest odometry."""

from __future__ import annotations

import bisect
import math

from limo_hog.follow.sense.observation import Odometry


def pose_at(poses: tuple[Odometry, ...], stamp: float) -> Odometry:
    """Return the robot's pose at `stamp` [s].

    Interpolated between the two nearest of `poses`, which are oldest first. Before the first the robot is taken to
    have stood; after the last its speeds are taken to have lasted.
    """
    if not poses:
        return Odometry(stamp)
    last = poses[-1]
    if stamp == last.stamp:
        return last
    if stamp > last.stamp:
        ahead = stamp - last.stamp
        yaw = last.yaw + last.angular * ahead
        x = last.x + last.linear * ahead * math.cos(last.yaw)
        y = last.y + last.linear * ahead * math.sin(last.yaw)
        return Odometry(stamp, x, y, yaw, last.linear, last.angular)
    after = bisect.bisect_left(poses, stamp, key=lambda pose: pose.stamp)
    if after == 0:
        first = poses[0]
        return Odometry(stamp, first.x, first.y, first.yaw, last.linear, last.angular)
    one, other = poses[after - 1], poses[after]
    share = (stamp - one.stamp) / (other.stamp - one.stamp)
    yaw = one.yaw + share * math.remainder(other.yaw - one.yaw, math.tau)
    x, y = one.x + share * (other.x - one.x), one.y + share * (other.y - one.y)
    return Odometry(stamp, x, y, yaw, last.linear, last.angular)
