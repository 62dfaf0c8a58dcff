"""The newest reading of every sensor, from ROS 2 messages: what belongs to one camera image, live or recorded."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.observation import Frame, Odometry, Scan, Sensors
from limo_hog.ros2 import messages
from limo_hog.ros2.messages import MessageError

#: A depth image belongs to a camera image if their stamps differ by no more than this [s]: half the period of the
#: workshop's cameras, so that the depth image of the frame before, 0.1 s older, is never taken for it.
SLOP = 0.05
#: So many depth images are kept [1], each for as many camera images: at 30 Hz one may be 0.3 s late and still find its
#: own; and what is left of a depth camera that died serves no camera whose clock is late.
_DEPTHS = 10

#: Encodings of a depth image: metres as float32, millimetres as uint16.
DEPTH_ENCODINGS = ("32FC1", "16UC1")
#: Encodings of a camera image.
CAMERA_ENCODINGS = ("bgr8", "rgb8", "bgra8", "rgba8", "mono8", "mono16", "yuv422_yuy2")


class Senses:
    """Takes in sensor messages, ours or rclpy's, and tells what was known when a camera image was taken."""

    def __init__(self, robot: RobotGeometry = LIMO) -> None:
        self._robot = robot
        self.focal_px: float | None = None  #: of the camera [px]; None until its calibration has come
        #: The newest of each; None before the first.
        self.scan: Scan | None = None
        self.odometry: Odometry | None = None
        self._depths: deque[tuple[float, NDArray[np.float32], int]] = deque(maxlen=_DEPTHS)
        self._images = 0

    def take(self, message: Any) -> None:
        """Take in a CameraInfo, LaserScan, Odometry or depth Image; other types are left alone.

        Raises `MessageError` where the message contradicts itself, or an Image is not a depth image.
        """
        kind = messages.type_of(message)
        if kind == "sensor_msgs/msg/CameraInfo":
            focal_px = float(message.k[0])
            # An uncalibrated driver publishes zeros.
            if math.isfinite(focal_px) and focal_px > 0:
                self.focal_px = focal_px
        elif kind == "sensor_msgs/msg/LaserScan":
            self.scan = messages.to_scan(message)
        elif kind == "nav_msgs/msg/Odometry":
            self.odometry = messages.to_odometry(message)
        elif kind == "sensor_msgs/msg/Image":
            self._depths.append((stamp_of(message), _metres(message), self._images))

    def newest(self, stamp: float) -> float:
        """Return the newest of the stamps of an image, of the scan and of the odometry [s]."""
        others = [reading.stamp for reading in (self.scan, self.odometry) if reading is not None]
        return max([stamp, *others])

    @property
    def sensors(self) -> Sensors:
        """The newest scan and odometry."""
        return Sensors(self.scan, self.odometry)

    def present(self, *, without_lidar: bool = False) -> str:
        """Return which senses have come beside a camera's first image, in one line.

        NO is a lidar without which the robot does not drive.
        """
        there = {
            "camera_info": self.focal_px is not None,
            "depth": bool(self._depths),
            "scan": self.scan is not None,
            "odom": self.odometry is not None,
        }
        told = {name: "yes" if came else "no" for name, came in there.items()}
        if not (there["scan"] or without_lidar):
            told["scan"] = "NO"
        if self.focal_px is None:
            told["camera_info"] += f", {math.degrees(self._robot.field_of_view):.0f}° wide is assumed"
        return " · ".join(["camera yes", *(f"{name} {answer}" for name, answer in told.items())])

    def frame(self, stamp: float, image: NDArray[np.uint8]) -> Frame:
        """Return the frame of a camera image, uint8 (H, W, 3) or (H, W), taken at `stamp` [s].

        Its depth image is the nearest by stamp, if it is of the same size and at most `SLOP` off.
        """
        fitting = [
            (abs(at - stamp), depth)
            for at, depth, images in self._depths
            if depth.shape == image.shape[:2] and self._images - images < _DEPTHS
        ]
        self._images += 1
        gap, depth = min(fitting, key=lambda pair: pair[0], default=(math.inf, None))
        focal_px = self._robot.focal_px(image.shape[1]) if self.focal_px is None else self.focal_px
        newest = self._depths[-1][0] if self._depths else None
        return Frame(stamp, image, focal_px, depth if gap <= SLOP else None, depth_stamp=newest)


def stamp_of(message: Any) -> float:
    """Return when a message was taken, by its header [s]."""
    return messages.to_seconds(message.header.stamp)


def picture_of(message: Any) -> NDArray[np.uint8]:
    """Return the pixels of a camera's Image or CompressedImage, uint8 (H, W, 3) BGR; gray is given three channels.

    Raises `MessageError` where the message contradicts itself, or its encoding is none of a camera's.
    """
    if messages.type_of(message) == "sensor_msgs/msg/CompressedImage":
        pixels: NDArray[Any] = messages.decompressed(message)
    else:
        pixels = messages.pixels_of(message)
        if message.encoding in ("yuv422_yuy2", "yuyv"):
            with needed(by=f"{message.encoding} images"):
                import cv2
            return cv2.cvtColor(pixels, cv2.COLOR_YUV2BGR_YUY2).astype(np.uint8, copy=False)
        if message.encoding in ("rgb8", "rgba8"):
            pixels = pixels[..., 2::-1]
        elif message.encoding in ("bgra8", "8UC4"):
            pixels = pixels[..., :3]
        elif message.encoding == "mono16":
            pixels = (pixels >> 8).astype(np.uint8)
    if pixels.dtype != np.uint8 or pixels.shape[2:] not in ((), (3,)):
        raise MessageError(f"a camera image in {message.encoding!r} is not read: want {', '.join(CAMERA_ENCODINGS)}")
    return np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else np.ascontiguousarray(pixels)


def _metres(message: Any) -> NDArray[np.float32]:
    if message.encoding not in DEPTH_ENCODINGS:
        raise MessageError(f"a depth image of {message.encoding!r} is not read: want {' or '.join(DEPTH_ENCODINGS)}")
    depth = messages.pixels_of(message)
    return (depth / 1000.0 if depth.dtype.kind == "u" else depth).astype(np.float32, copy=False)
