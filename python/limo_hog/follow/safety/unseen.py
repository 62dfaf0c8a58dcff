"""The ground behind the robot that no sensor shows now: how much of it was seen to be free shortly before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, to_odometry
from limo_hog.follow.sense.observation import Odometry, Scan

#: Ground is looked at so far behind the outline, in such steps [m]. Chosen: from .4 m/s the robot stops within .26 m.
FARTHEST, STEP = 0.6, 0.1
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
    depths = np.arange(STEP, FARTHEST + 1e-9, STEP)
    across = np.array([-robot.half_width, 0.0, robot.half_width])
    x, y = np.meshgrid(-robot.half_length - depths, across, indexing="ij")
    ground = to_odometry(np.stack([x.ravel(), y.ravel()], axis=1), pose)
    seen = np.zeros(len(ground), bool)
    for look in reversed(looks):
        seen[~seen] = _was_free(ground[~seen], look, robot)
        if seen.all():
            return FARTHEST
    unseen = ~seen.reshape(x.shape).all(axis=1)
    return float(depths[int(np.argmax(unseen))] - STEP) if unseen.any() else FARTHEST


def _was_free(points: Points, look: Look, robot: RobotGeometry) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return for each point, odometry frame, whether a beam passed over it or the robot stood on it, bool (N,)."""
    scan, pose = look.scan, look.pose
    dx, dy = points[:, 0] - pose.x, points[:, 1] - pose.y
    ahead = math.cos(pose.yaw) * dx + math.sin(pose.yaw) * dy
    aside = math.cos(pose.yaw) * dy - math.sin(pose.yaw) * dx
    # Half a step of grace: the ground just behind the outline was under it a moment ago.
    covered = (np.abs(ahead) < robot.half_length + STEP / 2) & (np.abs(aside) < robot.half_width + STEP / 2)
    distance = np.hypot(ahead - robot.lidar_x, aside)
    angle = np.arctan2(aside, ahead - robot.lidar_x)
    step = (scan.angle_max - scan.angle_min) / max(len(scan.ranges) - 1, 1)
    beam = np.rint((angle - scan.angle_min) / step).astype(np.int64)
    inside = (beam >= 0) & (beam < len(scan.ranges))
    ranges = scan.ranges[np.clip(beam, 0, len(scan.ranges) - 1)]
    # A beam that is no number, or shorter than the lidar can measure, shows nothing.
    passed = inside & (ranges >= scan.range_min) & (np.minimum(ranges, scan.range_max) > distance + BEYOND)
    return np.asarray(covered | passed)
