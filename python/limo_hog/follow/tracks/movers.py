"""What moves in the scan, without a box: people beside and behind, whom the camera does not show.

A group of returns as wide as two legs is followed from scan to scan. It counts once it has moved: walls, furniture and
people who stand are nothing to be predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.legs import Legs, Returns


@dataclass(frozen=True, slots=True)
class Mover:
    """A group of returns that may be two legs.

    Attributes
    ----------
    track
        Position and velocity.
    began
        Where it was first, x and y in the odometry frame [m].
    felt
        Stamp of the last scan that showed it [s].
    scans
        How many did [1].
    """

    track: Track
    began: tuple[float, float]
    felt: float
    scans: int = 1


@dataclass(frozen=True, slots=True)
class Movers:
    """Follows what moves in the scan.

    Attributes
    ----------
    legs
        How a group is found again: further off than a followed person's legs, since nothing else shows it. At 3.5 m two
        shins are two beams.
    gap
        Returns further apart than this are of two groups [m]. Chosen: in mid-stride the shins of a .9 m person.
    fewest_scans, least_way
        It counts as moving after so many scans, so far from where it began [1, m]. Chosen: half a second; more than the
        middle of the legs of a person who shifts from one to the other moves.
    forget_s
        It is given up when a scan should have shown it for so long [s]. Chosen: four scans; one leg hides the other.
    unseen_s
        Where the lidar does not look, it is predicted for so long [s]. Chosen: at a walk, past the blind angle behind.
    robot
        Where the lidar sits.
    """

    legs: Legs = field(default_factory=lambda: Legs(reach=3.5))
    gap: float = 0.3
    fewest_scans: int = 4
    least_way: float = 0.25
    forget_s: float = 0.5
    unseen_s: float = 3.0
    robot: RobotGeometry = LIMO

    def update(
        self,
        movers: tuple[Mover, ...],
        returns: Returns,
        half_view: float,
        noise: Noise,
        grid: Grid | None = None,
        ground: Ground | None = None,
    ) -> tuple[Mover, ...]:
        """Return what may move after a scan, whose lidar looks `half_view` [rad] to either side.

        `grid` and `ground` tell what has stood for long: its returns are not looked at.
        """
        points = returns.points
        if grid is not None and ground is not None:
            points = points[~grid.is_blocked(ground, points, lasting=True)]
        kept: list[Mover] = []
        for mover in movers:
            track = self.legs.update(mover.track, replace(returns, points=points), noise)
            if track is not None:
                kept.append(replace(mover, track=track, felt=returns.stamp, scans=mover.scans + 1))
                points = points[np.hypot(*(points - track.mean[:2]).T) > self.legs.radius]
            elif returns.stamp - mover.felt < self._patience(mover, returns, half_view):
                kept.append(mover)
        begun = [self._begin(place, returns, noise) for place in self._groups(points, returns)]
        return (*kept, *begun)

    def moving(self, movers: tuple[Mover, ...]) -> list[Mover]:
        """Return those that have moved."""
        return [
            one
            for one in movers
            if one.scans >= self.fewest_scans and math.dist(one.track.mean[:2], one.began) > self.least_way
        ]

    def _patience(self, mover: Mover, returns: Returns, half_view: float) -> float:
        if is_in_view(kalman.predict(mover.track, returns.stamp, Noise()), returns, half_view, self.robot):
            return self.forget_s
        return self.unseen_s

    def _groups(self, points: Points, returns: Returns) -> list[Points]:
        """Return the middle of each group of returns that is as wide as legs, float64 (2,) [m], odometry frame."""
        if len(points) == 0:
            return []
        begins = np.hypot(*np.diff(points, axis=0).T) > self.gap
        group = np.concatenate([[0], np.cumsum(begins)])
        first = np.concatenate([[0], np.flatnonzero(begins) + 1])
        count = np.bincount(group)
        middle = np.stack([np.bincount(group, weights=column) / count for column in points.T], axis=1)
        wide = np.hypot(*(np.maximum.reduceat(points, first) - np.minimum.reduceat(points, first)).T)
        far = np.hypot(*(middle - (returns.pose.x, returns.pose.y)).T)
        legs = (count >= self.legs.fewest) & (far < self.legs.reach) & (wide < self.legs.widest)
        return list(middle[legs])

    def _begin(self, place: Points, returns: Returns, noise: Noise) -> Mover:
        pose = returns.pose
        far, bearing = (
            math.hypot(place[0] - pose.x, place[1] - pose.y),
            math.atan2(place[1] - pose.y, place[0] - pose.x),
        )
        sigma = self.legs.sigma
        legs_noise = replace(noise, bearing=sigma / max(far, 0.3), range=sigma)
        track = kalman.initiate(returns.stamp, bearing - pose.yaw, far, pose, legs_noise)
        return Mover(track, (float(place[0]), float(place[1])), returns.stamp)


def is_in_view(track: Track, returns: Returns, half_view: float, robot: RobotGeometry) -> bool:
    """Whether the lidar looked at a track's place, `half_view` [rad] to either side of straight ahead."""
    pose = returns.pose
    x = pose.x + robot.lidar_x * math.cos(pose.yaw)
    y = pose.y + robot.lidar_x * math.sin(pose.yaw)
    return abs(kalman.wrap(math.atan2(track.mean[1] - y, track.mean[0] - x) - pose.yaw)) < half_view
