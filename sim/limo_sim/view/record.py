"""A run as ROS 2 messages on the workshop's topics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo_hog.ros2 import messages, names
from limo_hog.ros2.bag import bag_writer
from limo_hog.ros2.findings import detections_message
from limo_hog.ros2.frames import odometry_transform, static_transforms
from limo_sim.run.log import Step, Watch
from limo_sim.world.scenario import Scenario


@contextmanager
def recorded(path: Path, scenario: Scenario) -> Iterator[Watch]:
    """Give a function that records a step of a run: what was sensed, what was found in it, and then the command."""
    with bag_writer(path) as write:
        scanned = read = -math.inf
        began = False

        def watch(step: Step) -> None:
            nonlocal scanned, read, began
            log, frame = step.log, step.log.frame
            now, scan = log.time, log.sensors.scan
            for time, odometry, imu in step.passed:
                write(names.CLOCK, time, messages.clock(time))
                if not began:
                    began = True
                    write(names.TF_STATIC, time, static_transforms(time, scenario.robot.geometry))
                for reading in imu:
                    write(names.IMU, time, messages.imu(reading.stamp, reading.angular_velocity, reading.acceleration))
                if odometry.stamp > read:
                    read = odometry.stamp
                    write(names.TF, time, odometry_transform(odometry))
                    write(names.ODOMETRY, time, messages.odometry(odometry))
            if scan is not None and scan.stamp > scanned:
                scanned = scan.stamp
                write(names.SCAN, now, messages.laser_scan(scan))
            if frame is not None and frame.depth is not None:
                height, width = frame.image.shape[:2]
                bent = scenario.camera.k1, scenario.camera.k2
                write(names.CAMERA_INFO, now, messages.camera_info(frame.stamp, width, height, frame.focal_px, bent))
                write(names.DEPTH, now, messages.image(frame.stamp, frame.depth))
                write(names.IMAGE, now, messages.image(frame.stamp, frame.image))
                found = detections_message(frame.stamp, log.detections, messages.CAMERA_FRAME)
                write(names.DETECTIONS, now, found)
            write(names.COMMAND, now, messages.twist(log.decision.twist))

        yield watch
