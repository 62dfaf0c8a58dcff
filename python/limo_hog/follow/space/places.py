"""Where a lost person may be by now: particles that walk on as people do, and end where the lidar looks through them.

A bootstrap filter (Gordon, Salmond and Smith 1993) of the person's position and velocity. What it measures is mostly
that nobody is there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, lidar_at
from limo_hog.follow.sense.observation import Array, Mask, Odometry, Scan, beams_at
from limo_hog.follow.space.grid import Grid, Ground


@dataclass(frozen=True, slots=True)
class Places:
    """Where the person may be."""

    stamp: float  #: Time of the estimate [s].
    points: Points  #: float64 (N, 2) [m, m/s], odometry frame: each as likely as the others.
    velocities: Array
    seed: int = 0  #: Of the next step's random numbers.


@dataclass(frozen=True, slots=True)
class Wandering:
    """How people walk on unseen."""

    count: int = param(150, "1", "Of particles.")
    walk: float = param(0.5, "m/s", "Speed of a person who sets out again.")
    stays: float = param(0.2, "1", "Share of the particles that stand at the beginning.")
    turn: float = param(0.8, "rad/√s", "Square root of the spectral density of the heading.")
    change_s: float = param(6.0, "s", "Mean time after which a person stands still or sets out.")
    body: float = param(0.2, "m", "A beam passes a particle, or ends before it, if its range differs by more.")
    width: float = param(0.3, "m", "The beams within this width tell whether a person is there, or hidden.")
    far: float = param(4.0, "m", "Beams that pass do not tell further away.")
    found: float = param(0.15, "1", "Chance that the camera finds a person in one frame who is not hidden.")

    def start(self, stamp: float, mean: tuple[float, ...], covariance: Array, seed: int) -> Places:
        """Begin with a track: `mean` is x, y, vx, vy in the odometry frame, `covariance` (4, 4) its."""
        random = np.random.default_rng([seed, 0])
        drawn = random.multivariate_normal(mean, covariance, self.count, method="cholesky")
        velocities = drawn[:, 2:]
        velocities[: round(self.stays * self.count)] = 0.0
        return Places(stamp, drawn[:, :2], velocities, 1)

    def walk_on(self, places: Places, stamp: float, grid: Grid, ground: Ground) -> Places:
        """Let time pass until `stamp` [s], which is later; nobody walks through what is occupied."""
        dt, random = stamp - places.stamp, np.random.default_rng([places.seed, 1])
        count = len(places.points)
        velocities = places.velocities.copy()
        change = random.random(count) < dt / self.change_s
        stands = np.hypot(*velocities.T) < 0.05
        heading = random.uniform(-math.pi, math.pi, count)
        fresh = self.walk * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        velocities[change & stands] = fresh[change & stands]
        velocities[change & ~stands] = 0.0
        turn = self.turn * math.sqrt(dt) * random.standard_normal(count)
        (u, v), (cos, sin) = velocities.T, (np.cos(turn), np.sin(turn))
        velocities = np.stack([cos * u - sin * v, sin * u + cos * v], axis=1)
        points = places.points + dt * velocities
        # Not through a wall: the middle of the way counts too, since a step may be longer than the wall is thick.
        blocked = grid.is_blocked(ground, points) | grid.is_blocked(ground, (points + places.points) / 2)
        points[blocked] = places.points[blocked]
        speed = np.hypot(*velocities[blocked].T)[:, None]
        velocities[blocked] = speed / self.walk * fresh[blocked]
        return Places(stamp, points, velocities, places.seed + 1)

    def look(
        self, places: Places, scan: Scan, shown: Mask, moving: Array, pose: Odometry, robot: RobotGeometry
    ) -> Places | None:
        """Remove places where the person was not found, in favour of the others; None where no place is left.

        Nobody is where the beams of the newest scan, taken at `pose`, pass; `shown`, bool (N,), are the places that the
        camera shows, without a person in them, unless something nearer hides them. A person who is not there may be
        what moves nearest to there in the scan: `moving`, float64 (M, 4), x, y, vx, vy.
        """
        random = np.random.default_rng([places.seed, 2])
        passed, hidden = self.beams_to(places.points, scan, pose, robot)
        kept = ~passed & (~shown | hidden | (random.random(len(shown)) > self.found))
        if kept.all():
            return places
        points, velocities = places.points.copy(), places.velocities.copy()
        if len(moving):
            gaps = np.hypot(*(points[:, None] - moving[None, :, :2]).transpose(2, 0, 1))
            goes = ~kept & (gaps.min(axis=1) < self.far)
            points[goes], velocities[goes] = np.split(moving[gaps.argmin(axis=1)[goes]], 2, axis=1)
            kept |= goes
        left = np.flatnonzero(kept)
        if len(left) == 0:
            return None
        chosen = np.concatenate([left, left[random.integers(len(left), size=(~kept).sum())]])
        return Places(places.stamp, points[chosen], velocities[chosen], places.seed)

    def beams_to(self, points: Points, scan: Scan, pose: Odometry, robot: RobotGeometry) -> tuple[Mask, Mask]:
        """Return for each point, bool (N,) each, whether all beams near it pass, and whether one ends before it."""
        dx, dy = (points - lidar_at(pose, robot)).T
        distance = np.maximum(np.hypot(dx, dy), 0.05)
        count, offsets = len(scan.ranges), np.arange(-20, 21)
        step = (scan.angle_max - scan.angle_min) / max(count - 1, 1)
        beam = beams_at(np.arctan2(dy, dx) - pose.yaw, scan.angle_min, scan.angle_max, count).astype(np.int64)
        half = np.minimum(np.ceil(np.arctan(self.width / 2 / distance) / step), 20).astype(np.int64)
        inside = (beam - half >= 0) & (beam + half < count)
        near = np.abs(offsets) <= half[:, None]
        beyond = np.where(near, scan.ranges[np.clip(beam[:, None] + offsets, 0, count - 1)], np.inf) - distance[:, None]
        passed = inside & (distance < self.far) & (beyond > self.body).all(axis=1)
        return passed, inside & (beyond < -self.body).any(axis=1)
