"""What one instant shows: the camera frame's detections, what people in them wear, and the other sensors' readings."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.parameters import param
from limo_hog.follow.sense.region import Region

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Clothes = Array
"""(2, 3): shirt and trousers; share of red, share of green and logarithm of the brightness, each in standard
deviations of `ColourSampling`."""


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of a planar lidar. Two scans are equal only if they are the same object."""

    stamp: float  #: When the turn was finished [s], on the clock of `Observation.stamp`.
    ranges: NDArray[np.float32]  #: float32 (N,) [m], counter-clockwise from `angle_min`; inf where nothing was hit.
    angle_min: float  #: Direction of the first and the last beam [rad], 0 straight ahead, counter-clockwise positive.
    angle_max: float
    range_min: float  #: Limits between which a range is valid [m].
    range_max: float
    #: bool (N,): the beams by which anything is measured; None where that is all of them.
    measured: Mask | None = None

    def looks_at(self, angles: Array) -> Mask:
        """Return whether each direction [rad] is measured, bool (N,)."""
        if self.measured is not None:
            beams = beams_at(angles, self.angle_min, self.angle_max, len(self.ranges)).astype(np.int64)
            return np.asarray(self.measured[np.clip(beams, 0, len(self.ranges) - 1)])
        middle, half_view = (self.angle_min + self.angle_max) / 2, (self.angle_max - self.angle_min) / 2
        return np.asarray(turn_between(angles, middle) <= half_view)

    def turned(self, yaw: float) -> Scan:
        """Return the scan of a lidar whose angle 0 looks `yaw` [rad] from straight ahead, by the robot's angles."""
        return replace(self, angle_min=self.angle_min + yaw, angle_max=self.angle_max + yaw) if yaw else self


def turn_between(some: Array, others: Array | float) -> Array:
    """Return how far it is to turn from some directions to others [rad], 0 … pi."""
    off = some - others
    return np.asarray(np.abs(off - math.tau * np.rint(off / math.tau)))


def beams_at(angles: Array, angle_min: float | Array, angle_max: float | Array, count: int | Array) -> Array:
    """Return which of a scan's `count` beams looks nearest to each angle [rad]; none where that is no index.

    The limits may be those of several scans, and lie beyond half a turn.
    """
    step = (angle_max - angle_min) / np.maximum(count - 1, 1)
    middle = (angle_min + angle_max) / 2
    return np.asarray(np.rint((angles - math.tau * np.rint((angles - middle) / math.tau) - angle_min) / step))


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
    """One image of the robot's camera."""

    stamp: float  #: When it was taken [s].
    image: NDArray[np.uint8]  #: uint8 (H, W, 3) BGR or (H, W).
    focal_px: float  #: Focal length of the camera [px].
    #: float32 (H, W), distance along the optical axis [m] of the same view; inf too far, -inf too near, NaN unknown
    #: (REP 118). None without a depth camera.
    depth: NDArray[np.float32] | None
    #: Of the newest depth image, which may belong to a later frame [s]; None for `stamp`.
    depth_stamp: float | None = field(default=None, kw_only=True)


@dataclass(frozen=True, slots=True)
class Sensors:
    """The newest readings beside the camera's: None without a lidar, without wheel encoders."""

    scan: Scan | None = None
    odometry: Odometry | None = None


@dataclass(frozen=True, slots=True)
class Observation:
    """One camera frame's detections with the other sensors' newest readings."""

    stamp: float  #: When the camera frame was taken [s].
    width: int  #: Size of the camera image [px].
    height: int
    focal_px: float  #: Focal length of the camera [px]; the principal point is the image centre.
    detections: Detections  #: People found in the frame, best first.
    region: Region | None = None  #: Part of the image that was searched; None where all of it was.
    #: float32 (height, width) [m] of the same view, not finite or <= 0 where unknown; or None.
    depth: NDArray[np.float32] | None = None
    scan: Scan | None = None  #: The newest lidar scan; None without a lidar.
    odometry: Odometry | None = None  #: The newest odometry; None without wheel encoders.
    fault: str = ""  #: Why the frame cannot be used, "" where it can; with a fault the robot stands still.
    #: float64 (N, 2, 3): what the person in each detection wears, by `clothes_in`; None without a colour image.
    clothes: Clothes | None = None
    #: Scans that came since the frame before, and where the robot was, oldest first: of a camera slower than the lidar.
    between: tuple[tuple[Scan, Odometry], ...] = ()
    #: float64 (N, 2) [m], base frame as of `odometry`: what earlier scans showed near the robot where the newest does
    #: not look. `Guard` fills it in; None without it.
    remembered: Array | None = None
    #: When the readings were at hand, on the robot's own clock [s], which is no sensor's; None where `now` serves.
    clock: float | None = None
    depth_stamp: float | None = None  #: Of the newest depth image that has come [s]; None for `stamp`.
    image: NDArray[np.uint8] | None = None  #: uint8 (height, width, 3) BGR or (height, width); None where not kept.
    now: float = field(init=False)  #: The newest stamp of all sensors [s]: a camera frame may arrive late.
    at: float = field(init=False)  #: When the readings were at hand, on the robot's own clock [s].

    def __post_init__(self) -> None:
        newest = self.stamp if self.scan is None else max(self.stamp, self.scan.stamp)
        newest = newest if self.odometry is None else max(newest, self.odometry.stamp)
        object.__setattr__(self, "now", newest)
        object.__setattr__(self, "at", newest if self.clock is None else self.clock)


def pose_at(poses: tuple[Odometry, ...], stamp: float) -> Odometry:
    """Return the robot's pose at `stamp` [s], interpolated between the nearest of `poses`, oldest first.

    Before the first the robot is taken to have stood; after the last its speeds are taken to have lasted.
    """
    if not poses:
        return Odometry(stamp)
    last = poses[-1]
    if stamp == last.stamp:
        return last
    if stamp > last.stamp:
        ahead = stamp - last.stamp
        x = last.x + last.linear * ahead * math.cos(last.yaw)
        y = last.y + last.linear * ahead * math.sin(last.yaw)
        return replace(last, stamp=stamp, x=x, y=y, yaw=last.yaw + last.angular * ahead)
    after = bisect.bisect_left(poses, stamp, key=attrgetter("stamp"))
    if after == 0:
        return replace(poses[0], stamp=stamp, linear=last.linear, angular=last.angular)
    before, behind = poses[after - 1], poses[after]
    share = (stamp - before.stamp) / (behind.stamp - before.stamp)
    yaw = before.yaw + share * math.remainder(behind.yaw - before.yaw, math.tau)
    x, y = before.x + share * (behind.x - before.x), before.y + share * (behind.y - before.y)
    linear = before.linear + share * (behind.linear - before.linear)
    return Odometry(stamp, x, y, yaw, linear, before.angular + share * (behind.angular - before.angular))


@dataclass(frozen=True, slots=True)
class ColourSampling:
    """Where in a detection window the clothes are, and how much their colours vary."""

    chest: tuple[float, float] = param((0.35, 0.07), "window heights", "Middle and half height of the shirt's patch.")
    hips: tuple[float, float] = param((0.54, 0.03), "window heights", "The same on the trousers.")
    half_width: float = param(0.04, "window heights", "Half the width of the patches.")
    dark: float = param(8.0, "of 255", "Added to each channel: the hue of black cloth is not the hue of noise.")
    red: float = param(0.05, "1", "Standard deviation of one cloth's share of red in other light.")
    green: float = param(0.05, "1", "The same of its share of green.")
    brightness: float = param(0.5, "1", "The same of the logarithm of its brightness.")


def clothes_in(image: NDArray[np.uint8], boxes: NDArray[np.int32]) -> Clothes:
    """Return what the person in each box wears, float64 (N, 2, 3); NaN where that is out of the image.

    `image` is uint8 (H, W, 3), BGR, or (H, W), in which all clothes are gray; `boxes` are windows int32 (N, 4) [px].
    """
    sampling, worn = ColourSampling(), np.full((len(boxes), 2, 3), np.nan)
    # An array of another shape is a fault; the safety layer reports it and stops the robot.
    for index, (x, y, w, h) in enumerate(boxes.tolist() if boxes.shape[1:] == (4,) else ()):
        middle, half = x + w / 2, max(sampling.half_width * h, 1)
        columns = slice(max(round(middle - half), 0), max(round(middle + half), 0))
        for part, (centre, reach) in enumerate((sampling.chest, sampling.hips)):
            rows = slice(max(round(y + (centre - reach) * h), 0), max(round(y + (centre + reach) * h), 0))
            patch = image[rows, columns]
            if patch.size:
                blue, green, red = np.broadcast_to(np.median(patch, axis=(0, 1)), 3) + sampling.dark
                total = blue + green + red
                worn[index, part] = red / total, green / total, np.log(total)
    worn /= np.array([sampling.red, sampling.green, sampling.brightness])
    return worn


@dataclass(frozen=True, slots=True)
class Appearance:
    """Compares and learns clothes."""

    max_shirt: float = param(16.0, "chi² of 3", "The most that a shirt can add to the cost.")
    max_trousers: float = param(9.0, "chi² of 3", "The most that trousers can add.")
    other: float = param(12.0, "chi²", "A larger cost means another person.")
    rate: float = param(0.05, "1", "Share by which a confirmed person's clothes move towards those in a new box.")

    memory: float = param(0.95, "1", "Share of the variance that is kept from box to box.")
    least: float = param(0.16, "1", "Lower limit of the variance that is believed.")
    odd: float = param(4.0, "1", "The most that a box can show of the variance, times that known: it may be another's.")

    def cost(self, known: Clothes | None, seen: Clothes | None, variance: float = 1.0, *, slips: bool = True) -> float:
        """Return how much the colours in a box differ from known clothes [chi-squared].

        At most `max_shirt` + `max_trousers`; 0 where either is unknown. `variance` is what boxes of one person have,
        times that of `ColourSampling`. A box that is too low shows trousers in the place of the shirt: where it may
        have slipped, the smaller cost of both readings counts.
        """
        if known is None or seen is None:
            return 0.0
        shirt, trousers = known.tolist()
        seen_shirt, seen_trousers = seen.tolist()
        of_trousers = min(chi_squared(trousers, seen_trousers) / variance, self.max_trousers)
        cost = min(chi_squared(shirt, seen_shirt) / variance, self.max_shirt) + of_trousers
        slipped = min(chi_squared(trousers, seen_shirt) / variance, self.max_shirt) + of_trousers
        return min(cost, slipped) if slips else cost

    def learn(self, known: Clothes | None, seen: Clothes | None, variance: float = 1.0) -> Clothes | None:
        """Move known clothes towards those in a box; a shirt or trousers that clearly differ are left out."""
        if known is None or seen is None:
            return known if seen is None else seen
        return mixed(known, seen, self.rate, (self.max_shirt * variance, self.max_trousers * variance))

    def varied(self, variance: float, known: Clothes | None, seen: Clothes | None) -> float:
        """Return the variance after one more box of a person in known clothes."""
        if known is None or seen is None:
            return variance
        off = min(float(((seen - known) ** 2).mean()), self.odd * variance)
        return max(self.memory * variance + (1.0 - self.memory) * off, self.least)


def mixed(known: Clothes, seen: Clothes, rate: float, most: float | tuple[float, float]) -> Clothes:
    """Move known clothes by a share towards those seen, but for parts that differ by `most` [chi-squared] or more."""
    same = ((seen - known) ** 2).sum(axis=1) < most
    return np.asarray(known + rate * same[:, None] * (seen - known))


def chi_squared(known: list[float], seen: list[float]) -> float:
    """Return chi-squared of the three numbers of a shirt or of trousers."""
    (a, b, c), (x, y, z) = known, seen
    return (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2
