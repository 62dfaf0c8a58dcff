"""A detection as a measurement: bearing and range from the robot's centre."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.appearance import Clothes
from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.sense.ranging import box_centre, person_depth, stands_out, top_row

#: Height of HOG's window, in statures: the person in it is 96 of 128 px high (Dalal and Triggs 2005).
WINDOW_PER_STATURE = 4 / 3


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
    window, middle
        Height of the window of the whole person, and its middle below the image's, times the distance [px m]. By the
        stature in the depth image; without one, the box's.
    whole
        Whether that is all of the person: at the image's edge people can only be taller than they show.
    clothes
        What is worn in the box; None without a colour image.
    stands_out
        How far what is beside the box is behind its middle [m], by `stands_out`; None without depth.
    """

    bearing: float
    range: float | None
    height: int
    centre: float
    score: float
    clothes: Clothes | None = None
    stands_out: float | None = None
    window: float = 0.0
    middle: float = 0.0
    whole: bool = True

    def is_low(self, share: float) -> bool:
        """Whether the box sits too low on the person by this share of its height; true where that is not known."""
        if self.range is None or not self.window:
            return True
        return self.centre - self.middle / self.range > share * self.height


def measure(observation: Observation, robot: RobotGeometry) -> list[Measurement]:
    """Return every box as a measurement, in the boxes' order; the range is from the depth image."""
    measurements = []
    depths = observation.depth
    for index, (box, score) in enumerate(observation.detections):
        clothes = None if observation.clothes is None else observation.clothes[index]
        if clothes is not None and not np.isfinite(clothes).all():
            clothes = None
        column, row = box_centre(box)
        slope = (observation.width / 2 - column) / observation.focal_px
        height, centre = int(box[3]), row - observation.height / 2
        depth = None if depths is None else person_depth(depths, box)
        if depths is None or depth is None:
            measurements.append(Measurement(math.atan(slope), None, height, centre, score, clothes))
            continue
        x, y, relief = robot.camera_x + depth, slope * depth, stands_out(depths, box)
        bearing, distance = math.atan2(y, x), math.hypot(x, y)
        seen = Measurement(bearing, distance, height, centre, score, clothes, relief)
        top = top_row(depths, box, depth)
        stature = robot.camera_z + (observation.height / 2 - top) / observation.focal_px * depth
        window = WINDOW_PER_STATURE * stature * observation.focal_px
        middle = (robot.camera_z - stature / 2) * observation.focal_px
        measurements.append(replace(seen, window=window, middle=middle, whole=top > 0))
    return measurements
