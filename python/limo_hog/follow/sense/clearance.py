"""How much room the robot has: what the lidar and the depth camera say about the ground ahead and behind.

Points are float64 (N, 2): x forward, y left in the base frame [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.observation import Odometry, Scan

Points = NDArray[np.float64]

NO_POINTS: Points = np.empty((0, 2))

#: Ways around something [rad]: no further off than that the person stays in the picture.
_DETOURS = tuple(step * 0.08 for step in range(-6, 7))
#: Depth pixels looked at: every so many rows and columns. An ankle at 0.5 m is 40 px wide.
_DEPTH_STEP = 8
#: Depth pixels nearer to the floor than this are the floor [m].
_FLOOR = 0.05


def scan_points(scan: Scan, body: RobotGeometry) -> Points:
    """Return what the lidar has hit."""
    ranges = scan.ranges.astype(np.float64)
    angles = np.linspace(scan.angle_min, scan.angle_max, len(ranges))
    hit = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    x = body.lidar_x + ranges[hit] * np.cos(angles[hit])
    return np.stack([x, ranges[hit] * np.sin(angles[hit])], axis=1)


def depth_points(depth: NDArray[np.float32], focal_px: float, reach: float, body: RobotGeometry) -> Points:
    """Return what the depth camera sees above the floor and nearer than `reach` [m]."""
    height, width = depth.shape
    rows = np.arange(_DEPTH_STEP // 2, height, _DEPTH_STEP)
    columns = np.arange(_DEPTH_STEP // 2, width, _DEPTH_STEP)
    z = depth[np.ix_(rows, columns)].astype(np.float64)
    with np.errstate(invalid="ignore"):
        above_floor = body.camera_z - (rows[:, None] + 0.5 - height / 2) / focal_px * z
        near = np.isfinite(z) & (z > 0) & (z < reach) & (above_floor > _FLOOR)
    left = (width / 2 - columns[None, :] - 0.5) / focal_px * z
    return np.stack([body.camera_x + z[near], left[near]], axis=1)


@dataclass(frozen=True, slots=True)
class Margin:
    """The ground kept free around the robot's outline: an ellipse so far ahead (or behind) and beside [m]."""

    ahead: float = 0.6
    beside: float = 0.2


def room_ahead(points: Points, margin: Margin, body: RobotGeometry) -> float:
    """Return how far the robot can drive straight on before a point comes into the ground kept free [m].

    Negative where a point ahead is too near already, inf where nothing is in the way.
    """
    points = points[points[:, 0] > 0]
    beside = np.maximum(np.abs(points[:, 1]) - body.half_width, 0) / margin.beside
    in_the_way = beside < 1
    if not in_the_way.any():
        return math.inf
    gap = points[in_the_way, 0] - body.half_length
    return float(np.min(gap - margin.ahead * np.sqrt(1 - beside[in_the_way] ** 2)))


def room_behind(points: Points, margin: Margin, body: RobotGeometry) -> float:
    """Return how far the robot can drive straight back, as `room_ahead`."""
    return room_ahead(-points, margin, body)


def free_heading(
    points: Points, wanted: float, leaning: float, reach: float, margin: Margin, body: RobotGeometry
) -> float | None:
    """Return the direction nearest to `wanted` in which the robot can drive at least `reach` [rad, m].

    None where no direction has so much room.

    Parameters
    ----------
    points
        What is around, without who is driven to.
    wanted, leaning
        The straight direction, and the detour from it that is liked best [rad]: of two ways around something, the
        one already begun, or the one on which somebody walks away.
    reach
        How much room is enough.
    """
    for turn in sorted(_DETOURS, key=lambda turn: abs(turn) + 0.5 * abs(turn - leaning)):
        cos, sin = math.cos(wanted + turn), math.sin(wanted + turn)
        if room_ahead(points @ np.array([[cos, -sin], [sin, cos]]), margin, body) >= reach:
            return wanted + turn
    return None


def speed_within(room: float, braking: float, reaction: float) -> float:
    """Return the highest speed [m/s] that still stops within `room` [m].

    The robot drives on for `reaction` [s] before it brakes with `braking` [m/s²].
    """
    if room <= 0:
        return 0.0
    if math.isinf(room):
        return math.inf
    return -braking * reaction + math.sqrt((braking * reaction) ** 2 + 2 * braking * room)


def to_odometry(points: Points, pose: Odometry) -> Points:
    """Carry points from the base frame into the odometry frame."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    turned: Points = points @ np.array([[cos, sin], [-sin, cos]]) + (pose.x, pose.y)
    return turned


def from_odometry(points: Points, pose: Odometry) -> Points:
    """Carry points from the odometry frame into the base frame."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    turned: Points = (points - (pose.x, pose.y)) @ np.array([[cos, -sin], [sin, cos]])
    return turned
