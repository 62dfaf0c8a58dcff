"""What can be wrong with an observation: the checks that stop the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Observation, Odometry, Scan


def find_fault(observation: Observation, last_stamp: float | None) -> str:
    """Return what is wrong with an observation, in one line; "" if nothing is.

    Parameters
    ----------
    observation
        The sensors' readings and the detections.
    last_stamp
        Stamp of the observation before [s]; None for the first.
    """
    if observation.fault:
        return observation.fault
    if not math.isfinite(observation.stamp):
        return f"the frame's stamp is {observation.stamp}, not a time"
    if last_stamp is not None and observation.stamp < last_stamp:
        return f"time runs backwards: a frame of {observation.stamp:.3f} s after one of {last_stamp:.3f} s"
    return _boxes(observation) or _depth(observation) or scan_fault(observation.scan) or _odometry(observation.odometry)


def _boxes(observation: Observation) -> str:
    boxes, scores = observation.detections.boxes, observation.detections.scores
    if boxes.ndim != 2 or boxes.shape[1] != 4 or len(boxes) != len(scores):
        return f"boxes {boxes.shape} and scores {scores.shape} do not belong together"
    if not all(map(math.isfinite, scores.tolist())):
        return "a box has a score that is not a number"
    clothes = observation.clothes
    if clothes is not None and clothes.shape != (len(boxes), 2, 3):
        return f"clothes {clothes.shape} and boxes {boxes.shape} do not belong together"
    for x, y, w, h in boxes.tolist():
        inside = 0 <= x + w / 2 < observation.width and 0 <= y + h / 2 < observation.height
        if not inside or w <= 0 or h <= 0:
            return f"box ({x}, {y}, {w}, {h}) lies outside the {observation.width}x{observation.height} image"
    return ""


#: One in so many rows and columns of the depth image is looked at first [px].
_STEP = 40


def _any_valid(depth: NDArray[np.float32]) -> bool:
    return bool(np.any(np.isfinite(depth) & (depth > 0)))


def _depth(observation: Observation) -> str:
    depth = observation.depth
    if depth is None:
        return ""
    if depth.shape != (observation.height, observation.width):
        return f"the depth image is {depth.shape}, the camera's {(observation.height, observation.width)}"
    # Among a few pixels one is nearly always valid; to look at all takes a tenth of the follower's time.
    if not _any_valid(depth[::_STEP, ::_STEP]) and not _any_valid(depth):
        return "the depth image has no valid pixel"
    return ""


def scan_fault(scan: Scan | None) -> str:
    """Return what is wrong with a scan, in one line; "" if nothing is, or if there is none.

    A range below `range_min` is no measurement, inf is a beam that met nothing (REP-117, sensor_msgs/LaserScan).
    """
    if scan is None:
        return ""
    if scan.ranges.size == 0:
        return "the scan is empty"
    if not math.isfinite(scan.stamp):
        return f"the scan's stamp is {scan.stamp}, not a time"
    if not -math.inf < scan.angle_min < scan.angle_max < math.inf:
        return f"the scan's angles, {scan.angle_min} to {scan.angle_max} rad, do not go from right to left"
    if not scan.range_min < scan.range_max or not (scan.ranges >= scan.range_min).any():
        return f"the scan has no valid range from {scan.range_min} to {scan.range_max} m"
    return ""


def _odometry(odometry: Odometry | None) -> str:
    if odometry is None:
        return ""
    values = (odometry.x, odometry.y, odometry.yaw, odometry.linear, odometry.angular)
    return "" if all(math.isfinite(value) for value in values) else "the odometry is not a number"
