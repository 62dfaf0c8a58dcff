"""An extended Kalman filter for one person: position and velocity in the plane, measured as bearing and range.

The state is in the odometry frame, so the robot's own motion does not enter it; a measurement is taken from the
robot's pose at the stamp of the image. Motion model: white acceleration, with a velocity that decays. See Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), 6.2 and 10.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.observation import Odometry

Mean: TypeAlias = tuple[float, float, float, float]
"""x, y [m], and the velocities u, v along them [m/s]."""

Covariance: TypeAlias = tuple[float, float, float, float, float, float, float, float, float, float]
"""Of x, y, u, v the upper triangle, by rows: xx, xy, xu, xv, yy, yu, yv, uu, uv, vv."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Process and measurement noise."""

    acceleration: float = param(0.6, "m/s^1.5", "Square root of the spectral density of a person's acceleration.")
    bearing: float = param(0.015, "rad", "Standard deviation of a measured bearing.")
    clocks: float = param(0.04, "s", "Standard deviation of the image's stamp, by the odometry's clock.")
    range: float = param(0.06, "m", "Standard deviation of a measured range.")
    velocity: float = param(0.6, "m/s", "Standard deviation of each component of a new track's velocity.")
    persistence: float = param(4.0, "s", "Time constant with which an unmeasured velocity decays.")

    def turning(self, rate: float) -> Noise:
        """Return the noise of a bearing measured while the robot turns at `rate` [rad/s]: its yaw is as late as clocks.

        Without it a person who stands seems to walk aside whenever the robot begins to turn.
        """
        return replace(self, bearing=math.hypot(self.bearing, self.clocks * rate))


@dataclass(frozen=True, slots=True)
class Track:
    """The estimate of one person's position and velocity."""

    stamp: float  #: Time of the estimate [s].
    #: x, y [m], vx, vy [m/s] in the odometry frame. Numbers: for four of them arrays cost several times as much.
    mean: Mean
    covariance: Covariance  #: Of `mean`.

    @property
    def place(self) -> tuple[float, float]:
        """X and y [m] in the odometry frame."""
        return self.mean[:2]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The covariance as a matrix, float64 (4, 4)."""
        xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = self.covariance
        return np.array(((xx, xy, xu, xv), (xy, yy, yu, yv), (xu, yu, uu, uv), (xv, yv, uv, vv)))


def initiate(stamp: float, bearing: float, distance: float, pose: Odometry, noise: Noise) -> Track:
    """Begin a track from one measurement of bearing [rad] and distance [m], with zero velocity."""
    # The position's covariance is the measurement's, turned from bearing and range into the odometry frame.
    cos, sin = math.cos(pose.yaw + bearing), math.sin(pose.yaw + bearing)
    turn = np.array([[cos, -distance * sin], [sin, distance * cos]])
    (xx, xy), (_, yy) = ((turn * (noise.range**2, noise.bearing**2)) @ turn.T).tolist()
    moves = noise.velocity**2
    mean = pose.x + distance * cos, pose.y + distance * sin, 0.0, 0.0
    return Track(stamp, mean, (xx, xy, 0.0, 0.0, yy, 0.0, 0.0, moves, 0.0, moves))


def predict(track: Track, stamp: float, noise: Noise) -> Track:
    """Predict the track for `stamp` [s]; for an earlier one the mean moves back, and the covariance stays."""
    dt = stamp - track.stamp
    if dt == 0:
        return track
    x, y, vx, vy = track.mean
    if dt < 0:
        return Track(stamp, (x + dt * vx, y + dt * vy, vx, vy), track.covariance)
    kept = math.exp(-dt / noise.persistence)
    far = noise.persistence * (1 - kept)
    q = noise.acceleration**2
    place, cross, speed = q * dt**3 / 3, q * dt**2 / 2, q * dt
    # The products of 4 x 4 matrices, written out: places, then what they have in common with velocities, then these.
    xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = track.covariance
    xx, yy = xx + 2 * far * xu + far * far * uu + place, yy + 2 * far * yv + far * far * vv + place
    xy = xy + far * (xv + yu) + far * far * uv
    xu, xv = kept * (xu + far * uu) + cross, kept * (xv + far * uv)
    yu, yv = kept * (yu + far * uv), kept * (yv + far * vv) + cross
    uu, uv, vv = kept * kept * uu + speed, kept * kept * uv, kept * kept * vv + speed
    mean = x + far * vx, y + far * vy, kept * vx, kept * vy
    return Track(stamp, mean, (xx, xy, xu, xv, yy, yu, yv, uu, uv, vv))


def bearing_range(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return bearing, within ±pi, and distance of the track from the robot [rad, m]."""
    x, y, _, _ = track.mean
    dx, dy = x - pose.x, y - pose.y
    return math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau), math.hypot(dx, dy)


def rates(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return the rates of bearing and range due to the person's velocity alone [rad/s, m/s]."""
    x, y, vx, vy = track.mean
    dx, dy = x - pose.x, y - pose.y
    distance = max(math.hypot(dx, dy), 1e-3)
    return (dx * vy - dy * vx) / distance**2, (dx * vx + dy * vy) / distance


@dataclass(frozen=True, slots=True)
class Innovation:
    """A measurement of bearing and range compared with the prediction."""

    bearing: float  #: Measured less predicted [rad, m]; range None where only the bearing is measured.
    range: float | None
    #: How bearing and range change with x and y [rad/m, 1]; with the velocity they do not.
    by_bearing: tuple[float, float]
    by_range: tuple[float, float]
    covariance: tuple[float, float, float]  #: Of the two differences: bearing, both, range [rad², rad m, m²].
    variances: tuple[float, float]  #: Of the measurement alone: bearing, range [rad², m²].

    @property
    def distance2(self) -> float:
        """Squared Mahalanobis distance: chi-squared with one degree of freedom for each measured number."""
        (a, b, d), x, y = self.covariance, self.bearing, self.range
        if y is None:
            return x * x / a
        return (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)

    @property
    def log_volume_ratio(self) -> float:
        """Logarithm of det(covariance) over the measurement's own: 0 for a certain prediction.

        It penalises a track not measured for long, whose large gate would match any measurement.
        """
        (a, b, d), (of_bearing, of_range) = self.covariance, self.variances
        if self.range is None:
            return math.log(a / of_bearing)
        return math.log((a * d - b * b) / (of_bearing * of_range))


def innovation(track: Track, bearing: float, distance: float | None, pose: Odometry, noise: Noise) -> Innovation:
    """Compare a measurement with the track at the same stamp; `distance` None measures the bearing alone."""
    x, y, _, _ = track.mean
    dx, dy = x - pose.x, y - pose.y
    expected = math.hypot(dx, dy)
    r2 = max(expected**2, 1e-6)
    r = math.sqrt(r2)
    (bx, by), (rx, ry) = by_bearing, by_range = (-dy / r2, dx / r2), (dx / r, dy / r)
    xx, xy, _, _, yy, *_ = track.covariance
    of_bearing, of_range = variances = noise.bearing**2, noise.range**2
    covariance = (
        bx * bx * xx + 2 * bx * by * xy + by * by * yy + of_bearing,
        bx * rx * xx + (bx * ry + by * rx) * xy + by * ry * yy,
        rx * rx * xx + 2 * rx * ry * xy + ry * ry * yy + of_range,
    )
    turned = math.remainder(bearing - math.remainder(math.atan2(dy, dx) - pose.yaw, math.tau), math.tau)
    further = None if distance is None else distance - expected
    return Innovation(turned, further, by_bearing, by_range, covariance, variances)


def update(track: Track, measured: Innovation) -> Track:
    """Correct the track by a measurement."""
    (to_x, to_y), (a, b, d), turned = measured.by_bearing, measured.covariance, measured.bearing
    xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = track.covariance
    # Covariances of the state with bearing and range, and from these the gain.
    bx, by, bu, bv = to_x * xx + to_y * xy, to_x * xy + to_y * yy, to_x * xu + to_y * yu, to_x * xv + to_y * yv
    if measured.range is None:
        rx = ry = ru = rv = lx = ly = lu = lv = further = 0.0
        kx, ky, ku, kv = bx / a, by / a, bu / a, bv / a
    else:
        (to_x, to_y), further, det = measured.by_range, measured.range, a * d - b * b
        rx, ry, ru, rv = to_x * xx + to_y * xy, to_x * xy + to_y * yy, to_x * xu + to_y * yu, to_x * xv + to_y * yv
        kx, lx = (d * bx - b * rx) / det, (a * rx - b * bx) / det
        ky, ly = (d * by - b * ry) / det, (a * ry - b * by) / det
        ku, lu = (d * bu - b * ru) / det, (a * ru - b * bu) / det
        kv, lv = (d * bv - b * rv) / det, (a * rv - b * bv) / det
    x, y, u, v = track.mean
    place = x + kx * turned + lx * further, y + ky * turned + ly * further
    velocity = u + ku * turned + lu * further, v + kv * turned + lv * further
    # What is left of the covariance, a row of the upper triangle in each line.
    of_x = xx - kx * bx - lx * rx, xy - kx * by - lx * ry, xu - kx * bu - lx * ru, xv - kx * bv - lx * rv
    of_y = yy - ky * by - ly * ry, yu - ky * bu - ly * ru, yv - ky * bv - ly * rv
    of_u = uu - ku * bu - lu * ru, uv - ku * bv - lu * rv
    return Track(track.stamp, (*place, *velocity), (*of_x, *of_y, *of_u, vv - kv * bv - lv * rv))


def loosened(track: Track, place: float, speed: float) -> Track:
    """Return the track with these standard deviations added to each part of its place and its velocity [m, m/s]."""
    xx, xy, xu, xv, yy, yu, yv, uu, uv, vv = track.covariance
    place2, speed2 = place**2, speed**2
    covariance = xx + place2, xy, xu, xv, yy + place2, yu, yv, uu + speed2, uv, vv + speed2
    return Track(track.stamp, track.mean, covariance)
