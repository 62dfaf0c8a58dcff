"""Follow a person: observations, controllers and the safety layer, without simulator or clock."""

from limo_hog.detections import Detector
from limo_hog.follow.control.naming import CONTROLLERS, controller_named
from limo_hog.follow.control.tracking import TrackingController
from limo_hog.follow.control.workshop import ApproachController, ProxemicController
from limo_hog.follow.decision import Controller, Decision, Mode
from limo_hog.follow.pipeline import Follower, FrameLog
from limo_hog.follow.robot import LIMO, RobotError, RobotGeometry, Twist, load_robot
from limo_hog.follow.safety import Guard
from limo_hog.follow.sense.measurement import Zone, person_depth, zone_of
from limo_hog.follow.sense.observation import Frame, Observation, Odometry, Scan, Sensors
from limo_hog.follow.sense.region import Region
from limo_hog.named_detectors import detector_named

__all__ = [
    "CONTROLLERS", "LIMO", "ApproachController", "Controller", "Decision", "Detector", "Follower", "Frame",
    "FrameLog", "Guard", "Mode", "Observation", "Odometry", "ProxemicController", "Region", "RobotError",
    "RobotGeometry", "Scan", "Sensors", "TrackingController", "Twist", "Zone", "controller_named",
    "detector_named", "load_robot", "person_depth", "zone_of",
]  # fmt: skip
