"""A detection as a measurement: bearing and range from the robot's centre."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.appearance import Clothes
from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.sense.ranging import box_centre, person_depth


@dataclass(frozen=True, slots=True)
class Measurement:
    """One box, as seen from the robot.

    Attributes
    ----------
    bearing, range
        From the robot's centre [rad, m]; range None where the depth is unknown.
    height, centre
        Height of the box, and its middle below the image's [px].
    score
        SVM margin.
    clothes
        What is worn in the box; None without a colour image.
    """

    bearing: float
    range: float | None
    height: int
    centre: float
    score: float
    clothes: Clothes | None = None


def measure(observation: Observation, robot: RobotGeometry) -> list[Measurement]:
    """Return every box as a measurement, in the boxes' order; the range is from the depth image."""
    measurements = []
    for index, (box, score) in enumerate(observation.detections):
        clothes = None if observation.clothes is None else observation.clothes[index]
        if clothes is not None and not np.isfinite(clothes).all():
            clothes = None
        column, row = box_centre(box)
        slope = (observation.width / 2 - column) / observation.focal_px
        height, centre = int(box[3]), row - observation.height / 2
        depth = None if observation.depth is None else person_depth(observation.depth, box)
        if depth is None:
            measurements.append(Measurement(math.atan(slope), None, height, centre, score, clothes))
            continue
        x, y = robot.camera_x + depth, slope * depth
        measurements.append(Measurement(math.atan2(y, x), math.hypot(x, y), height, centre, score, clothes))
    return measurements
