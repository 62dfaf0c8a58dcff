"""A run as ROS 2 messages on the workshop's topics."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo_hog.ros2 import messages
from limo_hog.ros2.bag import bag_writer
from limo_hog.ros2.findings import detections_message
from limo_hog.ros2.names import CAMERA_INFO, COMMAND, DEPTH, DETECTIONS, IMAGE, ODOMETRY, SCAN
from limo_sim.run.log import Step, Watch
from limo_sim.world.scenario import Camera


@contextmanager
def recorded(path: Path, camera: Camera) -> Iterator[Watch]:
    """Give a function that records a step: what was sensed, what was found in it, and then the command.

    `camera` says how the lens bends.
    """
    with bag_writer(path) as write:
        stamps: dict[str, float] = {}

        def once(topic: str, stamp: float) -> bool:
            fresh = stamps.get(topic) != stamp
            stamps[topic] = stamp
            return fresh

        def watch(step: Step) -> None:
            log, frame = step.log, step.log.frame
            now, scan, odometry = log.time, log.sensors.scan, log.sensors.odometry
            if scan is not None and once(SCAN, scan.stamp):
                write(SCAN, now, messages.laser_scan(scan))
            if odometry is not None and once(ODOMETRY, odometry.stamp):
                write(ODOMETRY, now, messages.odometry(odometry))
            if frame is not None and frame.depth is not None:
                height, width = frame.image.shape[:2]
                write(
                    CAMERA_INFO,
                    now,
                    messages.camera_info(frame.stamp, width, height, frame.focal_px, (camera.k1, camera.k2)),
                )
                write(DEPTH, now, messages.image(frame.stamp, frame.depth))
                write(IMAGE, now, messages.image(frame.stamp, frame.image))
                found = detections_message(frame.stamp, log.detections, messages.CAMERA_FRAME)
                write(DETECTIONS, now, found)
            write(COMMAND, now, messages.twist(log.decision.twist))

        yield watch
