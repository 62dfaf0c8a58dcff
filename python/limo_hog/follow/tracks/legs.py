"""Somebody's legs in the scan: what keeps a track alive where the camera is blind.

HOG needs room above the head: nearer than about 1.6 m, beside the image or between two frames, only the lidar tells
where a person is. It cannot tell a person from a chair, so it may carry on a track, never begin one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, scan_points, to_odometry
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, innovation, predicted, updated

#: Returns nearer than this to where a person should be are their legs [m].
_STRIDE = 0.35
#: Wider than this it is a wall or a piece of furniture [m].
_WIDEST = 0.55
#: Further away than this legs are too few beams wide to tell [m].
_REACH = 2.2
#: Standard deviation of the middle of two legs that walk [m].
_SPREAD = 0.1


@dataclass(frozen=True, slots=True)
class Returns:
    """What a scan has hit, float64 (N, 2) [m] in the odometry frame, and where the robot was."""

    stamp: float
    points: Points
    pose: Odometry


def returns_of(scan: Scan, pose: Odometry, body: RobotGeometry) -> Returns:
    """Take a scan into the odometry frame; `pose` is where the robot was when it was taken."""
    return Returns(scan.stamp, to_odometry(scan_points(scan, body), pose), pose)


def felt(track: Track, returns: Returns, noise: Noise) -> Track | None:
    """Return the track brought up to a scan and corrected by the legs in it; None where there are none."""
    track = predicted(track, returns.stamp, noise)
    pose = returns.pose
    distance = bearing_range(track, pose)[1]
    if distance > _REACH:
        return None
    legs = returns.points[np.hypot(*(returns.points - track.mean[:2]).T) < _STRIDE]
    if len(legs) < 2 or np.hypot(*np.ptp(legs, axis=0)) > _WIDEST:
        return None
    dx, dy = legs.mean(axis=0) - (pose.x, pose.y)
    spread = Noise(bearing=_SPREAD / max(distance, 0.3), range=_SPREAD)
    bearing = math.atan2(dy, dx) - pose.yaw
    return updated(track, innovation(track, bearing, math.hypot(dx, dy), pose, spread))
