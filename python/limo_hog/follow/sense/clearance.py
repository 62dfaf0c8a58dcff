"""The free space around the robot: by the lidar, by the depth image, and behind it by the scans of shortly before.

Points are float64 (N, 2): x forward, y left in the base frame [m].
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.observation import Array, Frame, Mask, Odometry, Scan, beams_at

Points = Array

NO_POINTS: Points = np.empty((0, 2))


@functools.lru_cache(maxsize=8)
def beam_directions(angle_min: float, angle_max: float, count: int) -> Points:
    """Return the unit vectors of a scan's beams, float64 (N, 2), read only: the same for every scan of a lidar."""
    angles = np.linspace(angle_min, angle_max, count)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    directions.flags.writeable = False
    return directions


def lidar_at(pose: Odometry, robot: RobotGeometry) -> tuple[float, float]:
    """Return where the lidar of a robot at `pose` is, x and y [m] in the odometry frame."""
    return pose.x + robot.lidar_x * math.cos(pose.yaw), pose.y + robot.lidar_x * math.sin(pose.yaw)


@functools.lru_cache(maxsize=8)
def places_behind(depths: tuple[float, ...], robot: RobotGeometry) -> Points:
    """Return three places across the robot at each of D depths behind its outline [m], (D · 3, 2), read only."""
    far, side = np.meshgrid(depths, (-robot.half_width, 0.0, robot.half_width), indexing="ij")
    places: Points = np.stack([-robot.half_length - far.ravel(), side.ravel()], axis=1)
    places.flags.writeable = False
    return places


@functools.lru_cache(maxsize=8)
def scan_points(scan: Scan, robot: RobotGeometry) -> Points:
    """Return the valid returns of a scan, read only: controller, tracker and `Guard` all ask for them."""
    ranges = scan.ranges.astype(np.float64)
    # False for a range that is no number.
    hit = np.flatnonzero((ranges >= scan.range_min) & (ranges <= scan.range_max) & (ranges < np.inf))
    points: Points = ranges[hit, None] * beam_directions(scan.angle_min, scan.angle_max, len(ranges))[hit]
    points[:, 0] += robot.lidar_x
    points.flags.writeable = False
    return points


def completed(scan: Scan, frame: Frame, odometry: Odometry | None, robot: RobotGeometry) -> Scan:
    """Return a scan all round: where the lidar does not look, what the depth image's middle row shows.

    That row lies in the plane of a level camera, at the height of people's shins. The scan stays as it is where the
    lidar looks wherever the camera does, and without depth. Angles are the robot's.
    """
    if frame.depth is None:
        return scan
    row = frame.depth[len(frame.depth) // 2].astype(np.float64)
    left = (len(row) / 2 - np.arange(len(row)) - 0.5) / frame.focal_px
    if scan.looks_at(np.arctan(left[[0, -1]])).all():
        return scan
    step = (scan.angle_max - scan.angle_min) / max(len(scan.ranges) - 1, 1)
    count = max(math.floor(math.tau / step), len(scan.ranges))
    ranges = np.full(count, np.nan)
    known = (row > 0) & (row < np.inf)
    here, late = odometry or Odometry(), scan.stamp - frame.stamp
    moved = Odometry(x=here.linear * late, yaw=here.angular * late)
    points = from_odometry(np.stack([robot.camera_x + row, left * row], axis=1)[known], moved) - (robot.lidar_x, 0.0)
    angle_max = scan.angle_min + step * (count - 1)
    beams = beams_at(np.arctan2(points[:, 1], points[:, 0]), scan.angle_min, angle_max, count).astype(np.int64)
    np.fmin.at(ranges, beams % count, np.hypot(*points.T))
    ranges[: len(scan.ranges)] = scan.ranges
    measured = ~np.isnan(ranges)
    measured[: len(scan.ranges)] = True
    return replace(scan, ranges=ranges.astype(np.float32), angle_max=angle_max, measured=measured)


@functools.lru_cache(maxsize=8)
def _pixel_slopes(height: int, width: int, step: int, focal_px: float) -> tuple[Array, Array]:
    """Return how far down, (R, 1), and left, (C,), every so many rows and columns look [m/m]; the same for a camera."""
    rows, columns = (np.arange(step // 2, size, step) for size in (height, width))
    down, left = (rows[:, None] + 0.5 - height / 2) / focal_px, (width / 2 - columns - 0.5) / focal_px
    return np.asarray(down, np.float64), np.asarray(left, np.float64)


@dataclass(frozen=True, slots=True)
class DepthGrid:
    """Which depth pixels are looked at."""

    step: int = param(8, "px", "Distance of the rows and columns that are looked at.")
    floor: float = param(0.05, "m", "Points lower than this are the floor.")

    def points(self, depth: NDArray[np.float32], focal_px: float, reach: float, robot: RobotGeometry) -> Points:
        """Return what the depth camera sees above the floor and nearer than `reach` [m] to the camera."""
        down, left = _pixel_slopes(*depth.shape, self.step, focal_px)
        z = depth[self.step // 2 :: self.step, self.step // 2 :: self.step].astype(np.float64)
        with np.errstate(invalid="ignore"):
            above_floor = robot.camera_z - down * z
            (seen,) = ((z > 0) & (z < reach) & (above_floor > self.floor)).ravel().nonzero()
        ahead = z.ravel()[seen]
        return np.stack([robot.camera_x + ahead, left[seen % z.shape[1]] * ahead], axis=1)


@dataclass(frozen=True, slots=True)
class Margin:
    """The ground kept free around the robot's outline, a quarter of an ellipse at each corner."""

    ahead: float = param(0.6, "m", "In the direction of travel.")
    beside: float = param(0.2, "m", "To either side.")


def rooms_ahead(points: Points, headings: Array, margin: Margin, robot: RobotGeometry) -> Array:
    """Return how far the robot, turned to each of H headings [rad], can drive until a point is too near, float64 (H,).

    In metres: negative where a point ahead is too near already, inf where nothing is in the way. Backwards: `-points`.
    """
    (x, y), cos, sin = points.T, np.cos(headings)[:, None], np.sin(headings)[:, None]
    ahead, beside = cos * x + sin * y, np.abs(cos * y - sin * x) - robot.half_width
    share = np.maximum(beside, 0) / margin.beside
    room = ahead - robot.half_length - margin.ahead * np.sqrt(np.maximum(1 - share**2, 0))
    return np.asarray(np.where((ahead > 0) & (beside < margin.beside), room, np.inf).min(axis=1, initial=np.inf))


def speed_within(room: float, braking: float, reaction: float) -> float:
    """Return the highest speed [m/s] that still stops within `room` [m].

    The robot drives on for `reaction` [s] before it brakes with `braking` [m/s²]: the v that solves v·reaction +
    v²/(2·braking) = room.
    """
    if room <= 0:
        return 0.0
    return -braking * reaction + math.sqrt((braking * reaction) ** 2 + 2 * braking * room)


def to_odometry(points: Points, pose: Odometry) -> Points:
    """Carry points from the base frame into the odometry frame."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + (pose.x, pose.y))


def from_odometry(points: Points, pose: Odometry) -> Points:
    """Carry points from the odometry frame into the base frame."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.asarray((points - (pose.x, pose.y)) @ np.array([[cos, -sin], [sin, cos]]))


#: Ground is looked at so far behind the outline, in such steps [m]. Chosen: from .6 m/s the robot stops within .51 m.
FARTHEST_BEHIND, STEP_BEHIND = 0.6, 0.1
_DEPTHS_BEHIND = tuple(np.arange(STEP_BEHIND, FARTHEST_BEHIND + 1e-9, STEP_BEHIND).tolist())
#: A beam must reach further than the ground it shows to be free by this [m]. Chosen: three standard deviations and more
#: of the lidar's .01 m.
BEAM_BEYOND = 0.05


@dataclass(frozen=True, slots=True)
class Look:
    """A scan, and where the robot was."""

    scan: Scan
    pose: Odometry


def room_seen_behind(looks: Sequence[Look], pose: Odometry, robot: RobotGeometry) -> float:
    """Return how far behind the outline ground was seen free in `looks`, or lay under the robot [m]; 0.6 at most."""
    if not looks:
        return 0.0
    places = to_odometry(places_behind(_DEPTHS_BEHIND, robot), pose)
    unseen = ~_were_free(places, looks, robot).any(axis=0).reshape(len(_DEPTHS_BEHIND), -1).all(axis=1)
    return _DEPTHS_BEHIND[int(np.argmax(unseen))] - STEP_BEHIND if unseen.any() else FARTHEST_BEHIND


def _were_free(points: Points, looks: Sequence[Look], robot: RobotGeometry) -> Mask:
    """Return whether a beam of each look passed over each point, or the robot stood there, bool (L, N): all at once."""
    scans, poses = [look.scan for look in looks], [look.pose for look in looks]
    limits = [(scan.angle_min, scan.angle_max, scan.range_min, scan.range_max, len(scan.ranges)) for scan in scans]
    turned = [(pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)) for pose in poses]
    x, y, cos, sin = np.array(turned).T[:, :, None]
    angle_min, angle_max, range_min, range_max, count = np.array(limits).T[:, :, None]
    dx, dy = points[:, 0] - x, points[:, 1] - y
    ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
    # Half a step of grace: the ground just behind the outline was under it a moment ago.
    grace = STEP_BEHIND / 2
    covered = (np.abs(ahead) < robot.half_length + grace) & (np.abs(aside) < robot.half_width + grace)
    distance = np.hypot(ahead - robot.lidar_x, aside)
    angle = np.arctan2(aside, ahead - robot.lidar_x)
    beam = beams_at(angle, angle_min, angle_max, count)
    inside = (beam >= 0) & (beam < count)
    # The scans one after the other, and where each begins.
    begins = np.cumsum(count, axis=0) - count
    at = (begins + np.minimum(np.maximum(beam, 0), count - 1)).astype(np.int64)
    ranges = np.concatenate([scan.ranges for scan in scans])[at]
    # A beam that is no number, or shorter than the lidar can measure, shows nothing.
    passed = inside & (ranges >= range_min) & (np.minimum(ranges, range_max) > distance + BEAM_BEYOND)
    return np.asarray(covered | passed)
