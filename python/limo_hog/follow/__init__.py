"""What the follower sees and what it says: types and controllers, without simulator or clock."""

from __future__ import annotations

from limo_hog.follow.control.approach import ApproachController
from limo_hog.follow.control.distance import ProxemicController
from limo_hog.follow.control.naming import CONTROLLERS, controller_named
from limo_hog.follow.control.tracking import TrackingController
from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.safety.guard import Guard
from limo_hog.follow.sense.detectors import Detector, detector_named
from limo_hog.follow.sense.observation import Observation, Odometry, Scan
from limo_hog.follow.sense.ranging import Zone, zone_of
from limo_hog.follow.sense.region import Region
from limo_hog.follow.twist import Twist

__all__ = [
    "CONTROLLERS",
    "ApproachController",
    "Controller",
    "Decision",
    "Detector",
    "Guard",
    "Mode",
    "Observation",
    "Odometry",
    "ProxemicController",
    "Region",
    "Scan",
    "TrackingController",
    "Twist",
    "Zone",
    "controller_named",
    "detector_named",
    "zone_of",
]
