"""A walking person as a point that keeps its velocity, for a while: a Kalman filter of four states.

The track lives in the odometry frame, so the robot's own motion drops out of it by itself; a measurement is a
bearing and a range as seen from the robot's pose at the moment the picture was taken. See Bar-Shalom, Li and
Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), 6.2 and 10.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Odometry

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Noise:
    """How far people and sensors stray from the model.

    Attributes
    ----------
    acceleration
        Spectral density of a person's changes of velocity, as a standard deviation [m/s^1.5].
    bearing, range
        Standard deviations of a measurement [rad, m].
    velocity
        Standard deviation of the speed of somebody just found [m/s].
    persistence
        How long somebody keeps walking, unseen: time constant of the velocity's decay [s].
    """

    acceleration: float = 0.6
    bearing: float = 0.02
    range: float = 0.15
    velocity: float = 0.6
    persistence: float = 4.0


@dataclass(frozen=True, slots=True)
class Track:
    """Where somebody is and how they walk.

    Attributes
    ----------
    stamp
        When [s].
    mean
        float64 (4,): x, y [m], vx, vy [m/s] in the odometry frame.
    covariance
        float64 (4, 4) of `mean`.
    """

    stamp: float
    mean: Array
    covariance: Array


def found(stamp: float, bearing: float, distance: float, pose: Odometry, noise: Noise) -> Track:
    """Begin a track from one measurement: standing still until seen to walk."""
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
    covariance[:2, :2] = turn @ np.diag([noise.range**2, noise.bearing**2]) @ turn.T
    covariance[2:, 2:] = noise.velocity**2 * np.eye(2)
    return Track(stamp, np.array([x, y, 0.0, 0.0]), covariance)


def predicted(track: Track, stamp: float, noise: Noise) -> Track:
    """Let the person walk on until `stamp`; to an earlier one they walk back, and nothing grows more certain."""
    dt = stamp - track.stamp
    if dt <= 0:
        x, y, vx, vy = track.mean
        return Track(stamp, np.array([x + dt * vx, y + dt * vy, vx, vy]), track.covariance)
    eye = np.eye(2)
    kept = math.exp(-dt / noise.persistence)
    move = np.eye(4)
    move[:2, 2:] = noise.persistence * (1 - kept) * eye
    move[2:, 2:] = kept * eye
    q = noise.acceleration**2
    spread = np.block([[q * dt**3 / 3 * eye, q * dt**2 / 2 * eye], [q * dt**2 / 2 * eye, q * dt * eye]])
    return Track(stamp, move @ track.mean, move @ track.covariance @ move.T + spread)


def bearing_range(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return where the person is as seen from the robot [rad, m]."""
    dx, dy = track.mean[0] - pose.x, track.mean[1] - pose.y
    return wrapped(math.atan2(dy, dx) - pose.yaw), math.hypot(dx, dy)


def rates(track: Track, pose: Odometry) -> tuple[float, float]:
    """Return how fast the person's walk alone changes bearing and range [rad/s, m/s]."""
    dx, dy, vx, vy = track.mean - (pose.x, pose.y, 0.0, 0.0)
    distance = max(math.hypot(dx, dy), 1e-3)
    return float(dx * vy - dy * vx) / distance**2, float(dx * vx + dy * vy) / distance


@dataclass(frozen=True, slots=True)
class Innovation:
    """What a measurement says beyond the prediction: difference, its covariance, the model's Jacobian.

    `spread` are the variances of the measurement alone.
    """

    difference: Array
    covariance: Array
    jacobian: Array
    spread: Array

    @property
    def distance2(self) -> float:
        """Squared Mahalanobis distance: chi-squared with one degree of freedom for each measured number."""
        return float(self.difference @ np.linalg.solve(self.covariance, self.difference))

    @property
    def vagueness(self) -> float:
        """How much more than the measurement the prediction leaves open: logarithm of the ratio of their volumes."""
        return float(np.linalg.slogdet(self.covariance)[1] - np.log(self.spread).sum())


def innovation(track: Track, bearing: float, distance: float | None, pose: Odometry, noise: Noise) -> Innovation:
    """Compare a measurement with the track at the same stamp; `distance` None measures the bearing alone."""
    expected_bearing, expected_range = bearing_range(track, pose)
    dx, dy = track.mean[0] - pose.x, track.mean[1] - pose.y
    r2 = max(expected_range**2, 1e-6)
    r = math.sqrt(r2)
    jacobian = np.array([[-dy / r2, dx / r2, 0.0, 0.0], [dx / r, dy / r, 0.0, 0.0]])
    spread = np.array([noise.bearing**2, noise.range**2])
    difference = np.array([wrapped(bearing - expected_bearing), (distance or 0.0) - expected_range])
    if distance is None:
        jacobian, spread, difference = jacobian[:1], spread[:1], difference[:1]
    return Innovation(difference, jacobian @ track.covariance @ jacobian.T + np.diag(spread), jacobian, spread)


def updated(track: Track, seen: Innovation) -> Track:
    """Correct the track by a measurement."""
    gain = np.linalg.solve(seen.covariance, seen.jacobian @ track.covariance).T
    covariance = track.covariance - gain @ seen.covariance @ gain.T
    mean = track.mean + gain @ seen.difference
    return replace(track, mean=mean, covariance=(covariance + covariance.T) / 2)


def wrapped(angle: float) -> float:
    """Return the same angle within ±pi [rad]."""
    return math.remainder(angle, math.tau)
