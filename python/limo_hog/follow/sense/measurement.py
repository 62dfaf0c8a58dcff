"""A detection as bearing, range and size, by the depth image; whether and where one is to be expected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.observation import Clothes, ColourSampling, Observation, clothes_in
from limo_hog.follow.sense.region import Region

#: What is nearer than this to a person's axis is the person's own [m]. Chosen: legs in mid-stride and an arm.
PERSON_RADIUS = 0.45
#: How fast people walk whom nothing shows [m/s]. Chosen: a brisk walk; the workshop's person walks at .75.
WALK = 1.0
#: Height of HOG's window, in statures: the person in it is 96 of 128 px high (Dalal and Triggs 2005).
WINDOW_PER_STATURE = 4 / 3
#: Stature of the workshop's person, and the most that anybody is taken to have [m].
STATURE, TALLEST = 0.9, 2.0


@dataclass(frozen=True, slots=True)
class Measurement:
    """One box, as seen from the robot."""

    bearing: float  #: From the robot's centre [rad, m]; range None where the depth is unknown.
    range: float | None
    height: int  #: Height of the box, and its middle below the image's [px].
    centre: float
    score: float  #: SVM margin.
    clothes: Clothes | None = None  #: What is worn in the box; None without a colour image.
    #: How far what is beside the box is behind its middle [m], by `stands_out`; None without depth.
    stands_out: float | None = None
    #: Height of the window of the whole person, and its middle below the image's, times the distance [px m]. By the
    #: stature in the depth image; without one, the box's.
    window: float = 0.0
    middle: float = 0.0
    #: Whether that is all of the person: at the image's edge people can only be taller than they show.
    whole: bool = True
    stature: float = 0.0  #: In the depth image [m]; 0 without one.

    def is_low(self, share: float) -> bool:
        """Whether the box sits too low on the person by this share of its height; true where that is not known."""
        if self.range is None or not self.window:
            return True
        return self.centre - self.middle / self.range > share * self.height


def measure(observation: Observation, robot: RobotGeometry) -> list[Measurement]:
    """Return every box as a measurement, in the boxes' order; the range is from the depth image."""
    measurements = []
    depths, found = observation.depth, observation.detections
    for index, (box, score) in enumerate(zip(found.windows, found.scores.tolist(), strict=True)):
        clothes = None if observation.clothes is None else observation.clothes[index]
        if clothes is not None and not np.isfinite(clothes).all():
            clothes = None
        column, row = box_centre(box)
        slope = (observation.width / 2 - column) / observation.focal_px
        height, centre = int(box[3]), row - observation.height / 2
        depth = None if depths is None else person_depth(depths, box)
        seen = Measurement(math.atan(slope), None, height, centre, score, clothes)
        if depths is not None and depth is not None:
            x, y, relief = robot.camera_x + depth, slope * depth, stands_out(depths, box)
            bearing, distance = math.atan2(y, x), math.hypot(x, y)
            top = top_row(depths, box, depth)
            stature = robot.camera_z + (observation.height / 2 - top) / observation.focal_px * depth
            window = WINDOW_PER_STATURE * stature * observation.focal_px
            middle = (robot.camera_z - stature / 2) * observation.focal_px
            sizes = window, middle, top > 0, stature
            seen = Measurement(bearing, distance, height, centre, score, clothes, relief, *sizes)
        measurements.append(seen)
    return measurements


def box_centre(box: NDArray[np.int32]) -> tuple[int, int]:
    """Return the centre [px] of an int32 (4,) box x, y, w, h."""
    x, y, w, h = box.tolist()
    return x + w // 2, y + h // 2


def person_depth(depth: NDArray[np.float32], box: NDArray[np.int32], side: int = 20) -> float | None:
    """Return how far away the person in a box is [m]: the median depth in its middle; None where that is unknown.

    Pixels that see past the person do not change it as long as they are less than half. `depth` is float32 (H, W) [m],
    not finite or <= 0 where unknown, `box` int32 (4,): x, y, w, h, and `side` the square's [px]; the workshop's is 20.
    """
    x, y = box_centre(box)
    half = side // 2
    patch = depth[max(y - half, 0) : max(y + half, 0), max(x - half, 0) : max(x + half, 0)]
    valid = patch[(patch > 0) & (patch < np.inf)]
    return median(valid) if valid.size else None


def median(values: NDArray[np.float32]) -> float:
    """Return the median of (N,) finite numbers, N > 0: as `numpy.median`, without the checks that take most of it."""
    half, values = len(values) // 2, values.copy()
    values.partition(half)
    if len(values) % 2:
        return float(values[half])
    return float((values[:half].max() + values[half]) / 2)


#: Where a detection window shows a person's chest: first and last row looked at [window heights]; half the width of the
#: strip in the middle, and inner and outer edge of the two beside it, from the middle [window widths].
_TOP, _BOTTOM, _CHEST, _INNER, _OUTER = 0.27, 0.5, 0.06, 0.36, 0.46
#: Depth taken where the camera sees none [m], and share of pixels that must be valid for a depth to be known.
_BEYOND_M, _KNOWN = 20.0, 0.2


def stands_out(depth: NDArray[np.float32], box: NDArray[np.int32]) -> float | None:
    """Return how far the surroundings of a box are behind its middle [m]; None where the depth does not tell.

    The inverse depth of a plane is linear in the image, so the plane through the strips left and right of the person
    has, in the middle between them, the mean of their inverse depths. A picture on a wall is in that plane, seen from
    whatever side: 0. `depth` is float32 (H, W) [m], `box` int32 (4,): x, y, w, h [px].
    """
    x, y, w, h = box.tolist()
    band = depth[max(round(y + _TOP * h), 0) : max(round(y + _BOTTOM * h), 0)]
    centre = x + w / 2
    depths = []
    for left, right in (-_CHEST, _CHEST), (-_OUTER, -_INNER), (_INNER, _OUTER):
        strip = band[:, max(round(centre + left * w), 0) : max(round(centre + right * w), 0)]
        valid = strip[(strip > 0) & (strip < np.inf)]
        known = median(valid) if valid.size > _KNOWN * strip.size else _BEYOND_M
        depths.append(known if strip.size else None)
    middle, *sides = depths
    inverse = [1.0 / side for side in sides if side is not None]
    if middle is None or not inverse:
        return None
    return len(inverse) / sum(inverse) - middle


@dataclass(frozen=True, slots=True)
class Outline:
    """How a person's outline is followed upwards in the depth image."""

    half_width: float = param(0.08, "window widths", "Half the width of the strip looked at.")
    least_half_px: int = param(4, "px", "And at least this.")
    tolerance: float = param(0.35, "m", "Depth within which a pixel is the person's.")
    share: float = param(0.25, "1", "Part of a row's valid pixels that must be the person's.")
    gap_px: int = param(5, "px", "Rows without the person that end the outline.")


def top_row(depth: NDArray[np.float32], box: NDArray[np.int32], person: float) -> int:
    """Return the highest image row [px] of the person in a box; 0 where they reach the image's edge or beyond.

    `depth` is float32 (H, W) [m], `box` int32 (4,): x, y, w, h [px], `person` the depth of the person [m].
    """
    (column, row), outline = box_centre(box), Outline()
    half = max(round(outline.half_width * int(box[2])), outline.least_half_px)
    # A copy by columns: the sums over a row's few pixels are sums of long vectors.
    strip = np.ascontiguousarray(depth[: max(row, 1), max(column - half, 0) : max(column + half, 1)].T)
    with np.errstate(invalid="ignore"):
        near = (np.abs(strip - person) < outline.tolerance).sum(axis=0, dtype=np.int16)
    known = ((strip > 0) & (strip < np.inf)).sum(axis=0, dtype=np.int16)
    gap = 0
    for at, empty in enumerate((near < np.maximum(outline.share * known, 1))[::-1].tolist(), 1):
        gap = gap + 1 if empty else 0
        if gap == outline.gap_px:
            return len(near) - at + gap
    return 0


@dataclass(frozen=True, slots=True)
class Visibility:
    """Where HOG finds people."""

    smallest_window: float = param(128, "px", "Height of the model's window, and so of the smallest person's.")
    near: float = param(1.7, "m", "Nearer than this a person is often missed, and boxes are on parts of the body.")
    widest: float = param(1.2, "rad", "Larger bearings are out of any image.")
    shown: float = param(0.48, "window heights", "Part of each half of a window that must be shown.")
    cut: float = param(0.06, "window heights", "Share that a kept distance may cut off at the top.")
    occluder: float = param(0.5, "m", "Something nearer than the person by more than this hides them.")
    body: float = param(0.25, "m", "What is as far away as a person to within this is their body.")
    reach: float = param(0.2, "window heights", "Their body is no further aside than this from where it is expected.")
    nearest: float = param(0.4, "m", "Of a person nearer to the camera it shows no clothes.")

    def least_distance(self, window: float, centre: float, image_height: int) -> float:
        """Return how near a person may be with their window in the image, but for `cut` of it [m].

        `window` and `centre` are those of `Person`, `image_height` is the camera's [px].
        """
        return ((0.5 - self.cut) * window - centre) / (image_height / 2)

    def expected(
        self, bearing: float, distance: float, window: float, centre: float, observation: Observation, confirmed: bool
    ) -> bool:
        """Whether a person's whole window should be in the part of the image that was searched.

        The person is at a bearing [rad] and a distance [m] from the robot's centre; `window` and `centre` as in
        `Person`. Near by, the head and the space HOG wants above it are out of the image: that excuses a miss of a
        `confirmed` person, and not of a track that has yet to prove itself.
        """
        height = window / max(distance, 0.3)
        part = observation.region
        searched = part or Region(0, 0, observation.width, observation.height, height)
        smallest = self.smallest_window / (part.scale if part else 1.0)
        if abs(bearing) > self.widest or not smallest <= height <= searched.height:
            return False
        column = observation.width / 2 - observation.focal_px * math.tan(bearing)
        middle = observation.height / 2 + centre / max(distance, 0.3)
        cut_off = not self.shown * height <= middle <= observation.height - self.shown * height
        if confirmed and (cut_off or distance < self.near):
            return False
        if not searched.holds(column):
            return False
        if observation.depth is None:
            return True
        there = person_depth(observation.depth, np.array([column, middle, 0, 0], np.int32))
        return there is None or there >= distance - self.occluder

    def glimpse(
        self, place: tuple[float, float], window: float, centre: float, observation: Observation, robot: RobotGeometry
    ) -> Clothes | None:
        """Return what a person wears who was not found at a place [m], base frame; None where nobody is to be seen.

        The depth image must show something as far away; `window` and `centre` as in `Person`.
        """
        ahead, aside = place[0] - robot.camera_x, place[1]
        image, depth = observation.image, observation.depth
        if image is None or depth is None or ahead < self.nearest:
            return None
        height, column = window / ahead, observation.width / 2 - observation.focal_px * aside / ahead
        middle = observation.height / 2 + centre / ahead
        chest = round(middle + (ColourSampling().chest[0] - 0.5) * height)
        if not 0 <= chest < observation.height:
            return None
        left = max(round(column - self.reach * height), 0)
        strip = depth[chest, left : max(round(column + self.reach * height), 0)]
        near = np.zeros(len(strip) + 2, bool)
        near[1:-1] = np.abs(strip - ahead) < self.body
        bodies = left + np.flatnonzero(near[1:] != near[:-1]).reshape(-1, 2).mean(axis=1)
        if len(bodies) == 0:
            return None
        column = bodies[np.abs(bodies - column).argmin()]
        there = person_depth(depth, np.array([column, chest, 0, 0], np.int32), 10)
        if there is None or abs(there - ahead) > self.body:
            return None
        box = np.array([[column - height / 4, middle - height / 2, height / 2, height]]).astype(np.int32)
        worn = clothes_in(image, box)[0]
        return worn if np.isfinite(worn).all() else None


@dataclass(frozen=True, slots=True)
class RegionSize:
    """How large a region is around the expected window."""

    widths: float = param(2.0, "window widths", "Width of a region.")
    heights: float = param(1.25, "window heights", "Height of a region.")
    grid: int = param(16, "px", "Sides are multiples of this, so that buffers are used again.")
    most: float = param(0.7, "1", "Of a region larger than this share of the image all is searched.")
    widest: float = param(1.2, "rad", "Larger bearings are out of any image.")
    nearest: float = param(0.3, "m", "A nearer person fills the image.")

    def around(
        self, bearing: float, distance: float, window: float, centre: float, image: Observation
    ) -> Region | None:
        """Return where to look for a person expected at a bearing [rad] and a distance [m] from the camera.

        `window` and `centre` as in `Person`; `image` is one of the camera's. None where the person is not in it, or the
        region would be most of it.
        """
        if abs(bearing) > self.widest or distance < self.nearest:
            return None
        expected = window / distance
        width, height = image.width, image.height
        x = width / 2 - image.focal_px * math.tan(bearing)
        y = height / 2 + centre / distance
        if not 0 <= x < width:
            return None
        left, right = self._span(x, self.widths * expected / 2, width)
        top, bottom = self._span(y, self.heights * expected, height)
        if (right - left) * (bottom - top) > self.most * width * height:
            return None
        return Region(left, top, right - left, bottom - top, expected)

    def _span(self, middle: float, length: float, limit: int) -> tuple[int, int]:
        low = max(0, math.floor((middle - length / 2) / self.grid) * self.grid)
        high = min(limit, math.ceil((middle + length / 2) / self.grid) * self.grid)
        return low, max(high, low)


class Zone(str, Enum):
    """Hall's zones of personal space (The Hidden Dimension, 1966), nearest first."""

    INTIMATE = "intimate"
    PERSONAL = "personal"
    SOCIAL = "social"
    PUBLIC = "public"


#: Where each zone but the last ends [m].
ZONE_ENDS = {Zone.INTIMATE: 0.45, Zone.PERSONAL: 1.2, Zone.SOCIAL: 3.6}


def zone_of(distance: float) -> Zone:
    """Return the zone of a person `distance` [m] away."""
    return next((zone for zone, end in ZONE_ENDS.items() if distance <= end), Zone.PUBLIC)
