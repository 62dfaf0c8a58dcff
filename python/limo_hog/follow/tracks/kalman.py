"""An extended Kalman filter for one person: position and velocity in the plane, measured as bearing and range.

The state is in the odometry frame, so the robot's own motion does not enter it; a measurement is taken from the
robot's pose at the stamp of the image. Motion model: white acceleration, with a velocity that decays. See Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), 6.2 and 10.3.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Odometry

Array = NDArray[np.float64]

#: Where position, position and velocity, and velocity stand in a 4 x 4 matrix of the state.
_POSITION, _BOTH, _VELOCITY = (
    np.kron(np.array(part, float), np.eye(2))
    for part in (
        [[1, 0], [0, 0]],
        [[0, 1], [0, 0]],
        [[0, 0], [0, 1]],
    )
)
_CROSS = _BOTH + _BOTH.T


@dataclass(frozen=True, slots=True)
class Noise:
    """Process and measurement noise.

    Attributes
    ----------
    acceleration
        Square root of the spectral density of a person's acceleration [m/s^1.5]. A corner of the workshop's patrol
        changes the velocity by 1.06 m/s in about a second: 1.8 standard deviations.
    bearing
        Standard deviation of a measured bearing [rad]. Measured in the arena: the middle of a box strays by 2.7 px
        (far) to 6.4 px (1.75 m) of 448.6 px focal length, 0.006 to 0.014 rad; the rest allows for odometry.
    range
        Standard deviation of a measured range [m]. Chosen: half a body's depth, since the depth patch is on the
        front of the body, or beside it.
    velocity
        Standard deviation of each component of the velocity of a new track [m/s]: people stand or walk at 0.75 m/s.
    persistence
        Time constant with which an unmeasured velocity decays [s]. Chosen: half a side of the workshop's patrol.
    """

    acceleration: float = 0.6
    bearing: float = 0.02
    range: float = 0.15
    velocity: float = 0.6
    persistence: float = 4.0


@dataclass(frozen=True, slots=True)
class Track:
    """The estimate of one person's position and velocity.

    Attributes
    ----------
    stamp
        Time of the estimate [s].
    mean
        float64 (4,): x, y [m], vx, vy [m/s] in the odometry frame.
    covariance
        float64 (4, 4) of `mean`.
    """

    stamp: float
    mean: Array
    covariance: Array


def initiate(stamp: float, bearing: float, distance: float, pose: Odometry, noise: Noise) -> Track:
    """Begin a track from one measurement of bearing [rad] and distance [m], with zero velocity."""
    direction = pose.yaw + bearing
    x = pose.x + distance * math.cos(direction)
    y = pose.y + distance * math.sin(direction)
    # The position's covariance is the measurement's, turned from bearing and range into the odometry frame.
    turn = np.array(
        [
            [math.cos(direction), -distance * math.sin(direction)],
            [math.sin(direction), distance * math.cos(direction)],
        ]
    )
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = (turn * (noise.range**2, noise.bearing**2)) @ turn.T
    covariance[2, 2] = covariance[3, 3] = noise.velocity**2
    return Track(stamp, np.array([x, y, 0.0, 0.0]), covariance)


def predict(track: Track, stamp: float, noise: Noise) -> Track:
    """Predict the track for `stamp` [s].

    For an earlier stamp the mean moves back along the velocity and the covariance stays as it is.
    """
    dt = stamp - track.stamp
    if dt <= 0:
        x, y, vx, vy = track.mean
        return Track(stamp, np.array([x + dt * vx, y + dt * vy, vx, vy]), track.covariance)
    move, spread = _motion(dt, noise)
    return Track(stamp, move @ track.mean, move @ track.covariance @ move.T + spread)


@functools.lru_cache(maxsize=64)
def _motion(dt: float, noise: Noise) -> tuple[Array, Array]:
    """Return the transition of the state over `dt` [s] and the covariance it adds, float64 (4, 4) each, read only.

    All tracks of a frame are predicted for the same few stamps.
    """
    kept = math.exp(-dt / noise.persistence)
    move = _POSITION + (noise.persistence * (1 - kept)) * _BOTH + kept * _VELOCITY
    q = noise.acceleration**2
    spread = (q * dt**3 / 3) * _POSITION + (q * dt**2 / 2) * _CROSS + (q * dt) * _VELOCITY
    for matrix in (move, spread):
        matrix.flags.writeable = False
    return move, spread


def bearing_range(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return bearing and distance of the track from the robot [rad, m]."""
    dx, dy = track.mean[0] - pose.x, track.mean[1] - pose.y
    return wrap(math.atan2(dy, dx) - pose.yaw), math.hypot(dx, dy)


def rates(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return the rates of bearing and range due to the person's velocity alone [rad/s, m/s]."""
    dx, dy, vx, vy = track.mean - (pose.x, pose.y, 0.0, 0.0)
    distance = max(math.hypot(dx, dy), 1e-3)
    return float(dx * vy - dy * vx) / distance**2, float(dx * vx + dy * vy) / distance


@dataclass(frozen=True, slots=True)
class Innovation:
    """A measurement compared with the prediction, of m = 1 (bearing) or 2 numbers (bearing, range).

    Attributes
    ----------
    difference
        float64 (m,): measured less predicted [rad, m].
    covariance
        float64 (m, m) of `difference`.
    jacobian
        float64 (m, 4): of the measurement by the state.
    variances
        float64 (m,): of the measurement alone.
    """

    difference: Array
    covariance: Array
    jacobian: Array
    variances: Array

    @property
    def distance2(self) -> float:
        """Squared Mahalanobis distance: chi-squared with one degree of freedom for each measured number."""
        if len(self.difference) == 1:
            return float(self.difference[0] ** 2 / self.covariance[0, 0])
        # A 2 x 2 system by Cramer's rule: numpy's solver takes ten times as long.
        (a, b), (_, d) = self.covariance.tolist()
        x, y = self.difference.tolist()
        return float((d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b))

    @property
    def log_volume_ratio(self) -> float:
        """Logarithm of det(covariance) over the measurement's own: 0 for a certain prediction.

        A track that has not been measured for long has a large gate and would match any measurement; this is the
        term of the log-likelihood that penalises it.
        """
        if len(self.variances) == 1:
            return math.log(self.covariance[0, 0] / self.variances[0])
        (a, b), (_, d) = self.covariance.tolist()
        return math.log((a * d - b * b) / (self.variances[0] * self.variances[1]))


def innovation(track: Track, bearing: float, distance: float | None, pose: Odometry, noise: Noise) -> Innovation:
    """Compare a measurement with the track at the same stamp; `distance` None measures the bearing alone."""
    expected_bearing, expected_range = bearing_range(track, pose)
    dx, dy = track.mean[0] - pose.x, track.mean[1] - pose.y
    r2 = max(expected_range**2, 1e-6)
    r = math.sqrt(r2)
    jacobian = np.array([[-dy / r2, dx / r2, 0.0, 0.0], [dx / r, dy / r, 0.0, 0.0]])
    variances = np.array([noise.bearing**2, noise.range**2])
    difference = np.array([wrap(bearing - expected_bearing), (distance or 0.0) - expected_range])
    if distance is None:
        jacobian, variances, difference = jacobian[:1], variances[:1], difference[:1]
    covariance = jacobian @ track.covariance @ jacobian.T
    covariance.flat[:: len(variances) + 1] += variances
    return Innovation(difference, covariance, jacobian, variances)


def update(track: Track, measured: Innovation) -> Track:
    """Correct the track by a measurement."""
    gain = np.linalg.solve(measured.covariance, measured.jacobian @ track.covariance).T
    covariance = track.covariance - gain @ measured.covariance @ gain.T
    mean = track.mean + gain @ measured.difference
    return replace(track, mean=mean, covariance=(covariance + covariance.T) / 2)


def wrap(angle: float) -> float:
    """Return the same angle within ±pi [rad]."""
    return math.remainder(angle, math.tau)
