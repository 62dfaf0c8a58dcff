"""The follower's loop: detect in the region, observe, decide behind the safety layer, keep region and state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from tests.follow.views import boxes, flat, scan, scan_of

from limo_hog.detections import Detections
from limo_hog.follow import Decision, Follower, Mode, Observation, Odometry, Region, Sensors, Twist

IMAGE = np.full((480, 640, 3), 90, np.uint8)
SENSORS = Sensors(448.6, None, scan())
REGION = Region(96, 32, 208, 192, 150.0)


@dataclass
class Detector:
    """Finds one box, or raises what it is given; notes the size of what it is shown."""

    fails: Exception | None = None
    shown: list[tuple[int, ...]] = field(default_factory=list)

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        self.shown.append(image.shape)
        if self.fails is not None:
            raise self.fails
        return boxes((10, 20, 64, 128))


@dataclass
class Driver:
    """Drives on, asks for a region, and notes what it is told."""

    told: list[Observation] = field(default_factory=list)

    def start(self) -> int:
        return 0

    def step(self, observation: Observation, state: int) -> Decision[int]:
        self.told.append(observation)
        return Decision(Twist(0.5, 0.1), state + 1, Mode.FOLLOW, f"step {state}", 0, REGION)


def test_the_region_a_decision_asks_for_is_searched_in_the_next_image_and_boxes_are_in_the_whole() -> None:
    detector, driver = Detector(), Driver()
    follower = Follower(driver, detector)
    first, second = follower.see(0.0, IMAGE, SENSORS), follower.see(0.1, IMAGE, SENSORS)
    assert detector.shown == [(480, 640, 3), (192, 208, 3)]
    assert (first.region, second.region) == (None, REGION)
    assert second.detections.boxes.tolist() == [[106, 52, 64, 128]]
    assert driver.told[1].region == REGION


def test_the_state_is_kept_from_image_to_image_and_is_not_handed_out() -> None:
    follower = Follower(Driver(), Detector())
    reasons = [follower.see(0.1 * k, IMAGE, SENSORS).decision.reason for k in range(3)]
    assert reasons == ["step 0", "step 1", "step 2"]
    assert follower.see(0.3, IMAGE, SENSORS).decision.state is None


def test_the_controller_is_told_what_the_sensors_say() -> None:
    driver = Driver()
    depth, turn, odometry = flat(3.0), scan(stamp=4.9), Odometry(4.95, 1.0)
    Follower(driver, Detector()).see(5.0, IMAGE, Sensors(400.0, depth, turn, odometry))
    told = driver.told[0]
    assert (told.stamp, told.width, told.height, told.focal_px) == (5.0, 640, 480, 400.0)
    assert told.depth is depth
    assert told.scan is turn
    assert told.odometry is odometry
    assert told.clothes is not None
    assert told.clothes.shape == (1, 2, 3)


def test_a_detector_that_raises_stops_the_robot_and_the_next_image_is_searched_whole() -> None:
    detector, driver = Detector(), Driver()
    follower = Follower(driver, detector)
    follower.see(0.0, IMAGE, SENSORS)
    detector.fails = RuntimeError("the GPU fell off the bus")
    failed = follower.see(0.1, IMAGE, SENSORS)
    assert failed.decision == Decision(Twist(), None, Mode.BLOCKED, "the detector failed: the GPU fell off the bus")
    assert failed.failure == failed.decision.reason
    assert len(failed.detections) == 0
    detector.fails = None
    again = follower.see(0.2, IMAGE, SENSORS)
    assert again.failure == ""
    assert again.decision.twist == Twist(0.5, 0.1)
    assert detector.shown[-1] == (480, 640, 3)
    assert len(driver.told) == 2


def test_every_command_passes_the_safety_layer() -> None:
    blocked = Follower(Driver(), Detector()).see(0.0, IMAGE, Sensors(448.6, None, scan_of([(0.6, 0.0)])))
    assert blocked.decision.twist == Twist(0.0, 0.1)
    assert blocked.decision.mode is Mode.BLOCKED


def test_between_images_a_newer_scan_counts_and_the_region_stays() -> None:
    detector = Detector()
    follower = Follower(Driver(), detector)
    follower.see(0.0, IMAGE, SENSORS)
    assert follower.recheck(0.1, scan(stamp=0.1), None).twist == Twist(0.5, 0.1)
    stopped = follower.recheck(0.2, scan_of([(0.6, 0.0)], 0.2), None)
    assert stopped.twist == Twist(0.0, 0.1)
    assert (stopped.target, stopped.region, stopped.state) == (None, None, None)
    follower.see(0.3, IMAGE, SENSORS)
    assert detector.shown[-1] == (192, 208, 3)


def test_before_the_first_image_the_robot_stands() -> None:
    decision = Follower(Driver(), Detector()).recheck(0.0, scan(), None)
    assert (decision.twist, decision.mode) == (Twist(), Mode.BLOCKED)


def test_the_time_of_detection_is_told() -> None:
    assert Follower(Driver(), Detector()).see(0.0, IMAGE, SENSORS).detect_ms > 0


def test_the_scans_between_two_slow_images_come_with_the_second() -> None:
    driver = Driver()
    follower = Follower(driver, Detector())
    follower.see(0.0, IMAGE, SENSORS)
    for stamp in (0.1, 0.2):
        follower.recheck(stamp, scan(stamp=stamp), Odometry(stamp, x=stamp))
    follower.see(0.3, IMAGE, SENSORS)
    follower.see(0.4, IMAGE, SENSORS)
    between = [[(seen.stamp, pose.x) for seen, pose in one.between] for one in driver.told]
    assert between == [[], [(0.1, 0.1), (0.2, 0.2)], []]
