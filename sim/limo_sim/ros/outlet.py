"""The arena's readings as ROS 2 messages, each once, on the topics of the workshop."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from limo_hog.ros2 import frames, messages, names
from limo_sim.run.arena import Arena
from limo_sim.run.log import Passed
from limo_sim.sensing.camera import HEIGHT, WIDTH

#: A topic, and a function that makes its message: called only where the topic has readers.
Outgoing = tuple[str, Callable[[], Any]]


class Outlet:
    """Collects the readings that have arrived since the last call."""

    def __init__(self, arena: Arena) -> None:
        self._arena = arena
        self._camera = self._lidar = self._wheels = -math.inf

    def new(self, passed: Passed) -> list[Outgoing]:
        """Return the new messages: the clock first, depth before colour, so that a colour image finds its depth.

        `passed` is what the faster sensors read in the arena's last step.
        """
        arena, odometry = self._arena, passed.odometry
        out: list[Outgoing] = [(names.CLOCK, lambda: messages.clock(arena.time))]
        if self._wheels == -math.inf:  # the first call
            out.append((names.TF_STATIC, lambda: frames.static_transforms(arena.time, arena.robot)))
        for reading in passed.imu:
            make = partial(messages.imu, reading.stamp, reading.angular_velocity, reading.acceleration)
            out.append((names.IMU, make))
        scan, frame = arena.scan(), arena.frame()
        if odometry.stamp > self._wheels:
            self._wheels = odometry.stamp
            out.append((names.TF, lambda: frames.odometry_transform(odometry)))
            out.append((names.ODOMETRY, lambda: messages.odometry(odometry)))
        if scan.stamp > self._lidar:
            self._lidar = scan.stamp
            period = 1 / arena.scenario.lidar.rate_hz
            out.append((names.SCAN, lambda: messages.laser_scan(scan, period)))
        if frame.stamp > self._camera:
            self._camera = stamp = frame.stamp
            bent = arena.scenario.camera.k1, arena.scenario.camera.k2
            out += [
                (names.CAMERA_INFO, lambda: messages.camera_info(stamp, WIDTH, HEIGHT, frame.focal_px, bent)),
                (names.DEPTH_INFO, lambda: messages.camera_info(stamp, WIDTH, HEIGHT, frame.focal_px, bent)),
                (names.DEPTH, lambda: messages.image(stamp, frame.depth)),
                (names.DEPTH_LCAS, lambda: messages.image(stamp, frame.depth)),
                (names.IMAGE, lambda: messages.image(stamp, frame.image)),
                (names.IMAGE_COMPRESSED, lambda: messages.compressed_image(stamp, frame.image)),
            ]
        return out
