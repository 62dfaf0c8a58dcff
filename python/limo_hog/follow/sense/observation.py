"""All that a controller may base a decision on: one camera frame's detections and the other sensors' readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.sense.appearance import Clothes, clothes_in
from limo_hog.follow.sense.region import Region


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of a planar lidar. Two scans are equal only if they are the same object.

    Attributes
    ----------
    stamp
        When the turn was finished [s], on the clock of `Observation.stamp`.
    ranges
        float32 (N,) [m], counter-clockwise from `angle_min`; inf where nothing was hit.
    angle_min, angle_max
        Direction of the first and the last beam [rad], 0 straight ahead, counter-clockwise positive.
    range_min, range_max
        Limits between which a range is valid [m].
    """

    stamp: float
    ranges: NDArray[np.float32]
    angle_min: float
    angle_max: float
    range_min: float
    range_max: float


@dataclass(frozen=True, slots=True)
class Odometry:
    """The robot's pose by its wheels, in the start frame [m, rad], and its speeds [m/s, rad/s].

    `stamp` is on the clock of `Observation.stamp` [s]; a camera frame may be older.
    """

    stamp: float = 0.0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    linear: float = 0.0
    angular: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One image of the robot's camera.

    Attributes
    ----------
    stamp
        When it was taken [s].
    image
        uint8 (H, W, 3) BGR or (H, W).
    focal_px
        Focal length of the camera [px].
    depth
        float32 (H, W), distance along the optical axis [m] of the same view; inf too far, -inf too near, NaN unknown
        (REP 118). None without a depth camera.
    """

    stamp: float
    image: NDArray[np.uint8]
    focal_px: float
    depth: NDArray[np.float32] | None


@dataclass(frozen=True, slots=True)
class Sensors:
    """The newest readings beside the camera's: None without a lidar, without wheel encoders."""

    scan: Scan | None = None
    odometry: Odometry | None = None


@dataclass(frozen=True, slots=True)
class Observation:
    """One camera frame's detections with the other sensors' newest readings.

    Attributes
    ----------
    stamp
        When the camera frame was taken [s].
    width, height
        Size of the camera image [px].
    focal_px
        Focal length of the camera [px]; the principal point is the image centre.
    detections
        People found in the frame, best first.
    region
        Part of the image that was searched; None where all of it was.
    depth
        float32 (height, width) [m] of the same view, not finite or <= 0 where unknown; or None.
    scan
        The newest lidar scan; None without a lidar.
    odometry
        The newest odometry; None without wheel encoders.
    fault
        Why the frame cannot be used, "" where it can; with a fault the robot stands still.
    clothes
        float64 (N, 2, 3): what the person in each detection wears, by `clothes_in`; None without a colour image.
    between
        Scans that came since the frame before, and where the robot was, oldest first: of a camera slower than the
        lidar.
    remembered
        float64 (N, 2) [m], base frame as of `odometry`: what earlier scans showed near the robot where the newest does
        not look. `Guard` fills it in; None without it.
    """

    stamp: float
    width: int
    height: int
    focal_px: float
    detections: Detections
    region: Region | None = None
    depth: NDArray[np.float32] | None = None
    scan: Scan | None = None
    odometry: Odometry | None = None
    fault: str = ""
    clothes: Clothes | None = None
    between: tuple[tuple[Scan, Odometry], ...] = ()
    remembered: NDArray[np.float64] | None = None

    @property
    def now(self) -> float:
        """The newest stamp of all sensors [s]: a camera frame may arrive late."""
        scan, odometry = self.scan, self.odometry
        newest = self.stamp if scan is None else max(self.stamp, scan.stamp)
        return newest if odometry is None else max(newest, odometry.stamp)


def observed(
    frame: Frame,
    sensors: Sensors,
    detections: Detections,
    region: Region | None = None,
    fault: str = "",
    between: tuple[tuple[Scan, Odometry], ...] = (),
) -> Observation:
    """Return the observation of a frame and what was found in it: its size and people's clothes are filled in."""
    height, width = frame.image.shape[:2]
    clothes = clothes_in(frame.image, detections.boxes)
    return Observation(
        frame.stamp,
        width,
        height,
        frame.focal_px,
        detections,
        region,
        frame.depth,
        sensors.scan,
        sensors.odometry,
        fault,
        clothes,
        between,
    )
