"""A person's legs in the scan: they keep a track alive where the camera does not show the person.

HOG needs space above the head: nearer than about 1.6 m, beside the image or between two frames, only the lidar tells
where a person is. It cannot tell a person from a chair, so it may continue a track and never begins one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, scan_points, to_odometry
from limo_hog.follow.sense.observation import Odometry, Scan
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, innovation, predict, update


@dataclass(frozen=True, slots=True)
class Returns:
    """A scan's returns in the odometry frame.

    Attributes
    ----------
    stamp
        Of the scan [s].
    points
        float64 (N, 2) [m].
    pose
        Where the robot was.
    """

    stamp: float
    points: Points
    pose: Odometry


def returns_of(scan: Scan, pose: Odometry, robot: RobotGeometry) -> Returns:
    """Take a scan into the odometry frame; `pose` is where the robot was when it was taken."""
    return Returns(scan.stamp, to_odometry(scan_points(scan, robot), pose), pose)


@dataclass(frozen=True, slots=True)
class Legs:
    """Finds a tracked person's legs in a scan.

    Attributes
    ----------
    radius
        Returns nearer than this to the predicted position are taken for legs [m]. Chosen: half a stride of 0.75 m.
    widest
        A wider group is a wall or a piece of furniture [m]. Chosen: in mid-stride the shins of a 0.9 m person are .3 m
        apart, an adult's .55 m.
    reach
        Further away legs are not looked for [m]. Chosen: at 2.2 m a shin of 5 cm is less than 2 of the Limo's beams.
    sigma
        Standard deviation of the middle of two walking legs from the person's axis [m]. Chosen: of one leg alone, where
        it hides the other, the axis is up to .17 m off.
    trail_s
        The middle of the legs is where the person was so long ago [s]: the shin that swings trails the trunk. Measured
        in the arena, 1,000 scans: .05 m at .85 m/s, .02 m at half of it.
    fewest
        So many returns at least [1].
    """

    radius: float = 0.35
    widest: float = 0.55
    reach: float = 2.2
    sigma: float = 0.1
    trail_s: float = 0.05
    fewest: int = 2

    def update(
        self,
        track: Track,
        returns: Returns,
        noise: Noise,
        is_ground: Callable[[Points], NDArray[np.bool_]] | None = None,
    ) -> Track | None:
        """Return the track predicted for the scan's stamp and corrected by its legs; None where there are none.

        `is_ground` tells of points (N, 2), odometry frame, which of them are on what is known to stand there: no legs.
        """
        track = predict(track, returns.stamp, noise)
        if bearing_range(track, returns.pose)[1] > self.reach:
            return None
        legs = returns.points.compress(distances(returns.points, track) < self.radius, axis=0)
        if is_ground is not None and len(legs):
            legs = legs[~is_ground(legs)]
        return self.corrected(track, legs, returns.pose, noise)

    def corrected(self, track: Track, legs: Points, pose: Odometry, noise: Noise) -> Track | None:
        """Return the track corrected by the returns (N, 2) near it, odometry frame; None where these are no legs.

        The track is predicted for the scan's stamp; `pose` is where the robot was then.
        """
        distance = bearing_range(track, pose)[1]
        if len(legs) < self.fewest or distance > self.reach:
            return None
        # Of a few points, lists are faster than arrays.
        xs, ys = legs.T.tolist()
        if math.hypot(max(xs) - min(xs), max(ys) - min(ys)) > self.widest:
            return None
        _, _, vx, vy = track.mean
        dx = sum(xs) / len(xs) + self.trail_s * vx - pose.x
        dy = sum(ys) / len(ys) + self.trail_s * vy - pose.y
        bearing = math.atan2(dy, dx) - pose.yaw
        return update(track, innovation(track, bearing, math.hypot(dx, dy), pose, self.noise_at(distance, noise)))

    def noise_at(self, distance: float, noise: Noise) -> Noise:
        """Return the noise with that of legs measured at a distance [m]."""
        return replace(noise, bearing=self.sigma / max(distance, 0.3), range=self.sigma)


def distances(points: Points, track: Track) -> NDArray[np.float64]:
    """Return the distance from a track to each of (N, 2) points, odometry frame, float64 (N,) [m]."""
    x, y, _, _ = track.mean
    return np.asarray(np.hypot(points[:, 0] - x, points[:, 1] - y))


def all_distances(points: Points, tracks: Sequence[Track]) -> NDArray[np.float64]:
    """Return `distances` of M tracks at once, float64 (M, N) [m]."""
    places = np.array([track.place for track in tracks]).reshape(-1, 2, 1)
    return np.asarray(np.hypot(points[:, 0] - places[:, 0], points[:, 1] - places[:, 1]))
