"""What moves in the scan, without a box: people beside and behind, whom the camera does not show.

A group of returns as wide as two legs is followed from scan to scan. It counts once it has moved: walls, furniture and
people who stand are nothing to be predicted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.legs import Legs, Returns
from limo_hog.follow.tracks.person import Person


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
    number
        Of the person whose legs they are; None while that is not known.
    """

    track: Track
    began: tuple[float, float]
    felt: float
    scans: int = 1
    number: int | None = None


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
    open
        Beams that return nothing over so much show no wall [rad]. Chosen: seven beams of the Limo's lidar.
    fewest_scans, least_way
        It counts as moving after so many scans, so far from where it began [1, m]. Chosen: half a second; more than the
        middle of the legs of a person who shifts from one to the other moves.
    forget_s
        It is given up when a scan should have shown it for so long [s]. Chosen: four scans; one leg hides the other.
    unseen_s
        Where the lidar does not look, it is predicted for so long [s]. Chosen: at a walk, past the blind angle behind.
    beside
        A person is this far from their legs at most [m]. Chosen: as `Legs.radius`, and the error of the depth.
    robot
        Where the lidar sits.
    """

    legs: Legs = field(default_factory=lambda: Legs(reach=3.5))
    gap: float = 0.3
    open: float = 0.1
    fewest_scans: int = 4
    least_way: float = 0.25
    forget_s: float = 0.5
    unseen_s: float = 3.0
    beside: float = 0.4
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
        free = np.ones(len(points), bool)
        if grid is not None and ground is not None:
            free = ~grid.is_blocked(ground, points, lasting=True)
        kept: list[Mover] = []
        for mover in movers:
            track = self.legs.update(mover.track, replace(returns, points=points[free]), noise)
            if track is not None:
                kept.append(replace(mover, track=track, felt=returns.stamp, scans=mover.scans + 1))
                free &= np.hypot(*(points - track.mean[:2]).T) > self.legs.radius
            elif returns.stamp - mover.felt < self._patience(mover, returns, half_view):
                kept.append(mover)
        begun = [
            self._begin(points[legs].mean(axis=0), returns, noise)
            for legs in self._groups(returns, half_view)
            if free[legs].all()
        ]
        return (*kept, *begun)

    def assign(self, movers: tuple[Mover, ...], seen: Sequence[Person], stamp: float) -> tuple[Mover, ...]:
        """Note whose legs they are: one mover to one person found by the camera, the nearest first."""
        pairs = []
        for who, person in enumerate(seen):
            for which, mover in enumerate(movers):
                gap = math.dist(person.track.mean[:2], mover.track.mean[:2])
                if mover.felt == stamp and gap < self.beside:
                    pairs.append((gap, who, which))
        numbers: dict[int, int] = {}
        for _, who, which in sorted(pairs):
            if which not in numbers and seen[who].number not in numbers.values():
                numbers[which] = seen[who].number
        return tuple(
            replace(mover, number=numbers[which])
            if which in numbers
            else replace(mover, number=None)
            if mover.number in numbers.values()
            else mover
            for which, mover in enumerate(movers)
        )

    def continued(self, person: Person, movers: tuple[Mover, ...], returns: Returns, noise: Noise) -> Person:
        """Return a person whom the camera does not show, brought up to a scan that shows their legs."""
        legs = [one for one in movers if one.number == person.number and one.felt == returns.stamp]
        if not legs or returns.stamp <= person.felt:
            return person
        track, pose = kalman.predict(person.track, returns.stamp, noise), returns.pose
        dx, dy = (legs[0].track.mean[:2] - (pose.x, pose.y)).tolist()
        distance, sigma = math.hypot(dx, dy), self.legs.sigma
        noise = replace(noise, bearing=sigma / max(distance, 0.3), range=sigma)
        fit = kalman.innovation(track, math.atan2(dy, dx) - pose.yaw, distance, pose, noise)
        return replace(person, track=kalman.update(track, fit), felt=returns.stamp)

    def moving(self, movers: tuple[Mover, ...]) -> list[Mover]:
        """Return those that have moved."""
        return [
            one
            for one in movers
            if one.scans >= self.fewest_scans and math.dist(one.track.mean[:2], one.began) > self.least_way
        ]

    def felt(self, movers: tuple[Mover, ...], now: float) -> Points:
        """Return the places of what a scan has just shown, moving or not, float64 (N, 2) [m], odometry frame."""
        places = [one.track.mean[:2] for one in movers if now - one.felt < self.forget_s]
        return np.array(places).reshape(-1, 2)

    def _patience(self, mover: Mover, returns: Returns, half_view: float) -> float:
        if is_in_view(kalman.predict(mover.track, returns.stamp, Noise()), returns, half_view, self.robot):
            return self.forget_s
        return self.unseen_s

    def _groups(self, returns: Returns, half_view: float) -> list[slice]:
        """Return the groups of returns that are as wide as legs and stand before what is beside them."""
        points, pose = returns.points, returns.pose
        if len(points) == 0:
            return []
        dx, dy = (points - (pose.x, pose.y)).T
        ends = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) > self.gap) + 1
        # A piece of wall that shows past something nearer, or at a grazing angle, moves along as the robot does. Where
        # many beams return nothing there is nothing nearer; beyond the lidar's view there may be.
        far = np.concatenate([[0.0], np.hypot(dx, dy), [0.0]])
        turn = np.array([kalman.wrap(off) for off in np.arctan2(dy, dx) - pose.yaw])
        open_from = np.abs(np.diff(turn, prepend=-half_view, append=half_view)) > self.open
        before = open_from | (far[:-1] > far[1:])
        after = open_from | (far[1:] > far[:-1])
        groups = []
        for first, end in itertools.pairwise([0, *ends, len(points)]):
            is_near = end - first >= self.legs.fewest and far[first + 1] < self.legs.reach
            wide = np.hypot(*np.ptp(points[first:end], axis=0))
            if is_near and wide < self.legs.widest and before[first] and after[end]:
                groups.append(slice(first, end))
        return groups

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
