"""What moves in the scan, without a box: people beside and behind, whom the camera does not show.

A group of returns as wide as two legs is followed from scan to scan. It counts once it has moved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import LIMO, RobotGeometry
from limo_hog.follow.sense.clearance import Points, lidar_at
from limo_hog.follow.sense.measurement import STATURE, Measurement
from limo_hog.follow.sense.observation import Mask, Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.association import Legs, Returns, distances
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.person import Person, predict


@dataclass(frozen=True, slots=True)
class Mover:
    """A group of returns that may be two legs."""

    track: Track  #: Position and velocity.
    began: tuple[float, float]  #: Where it was first, x and y in the odometry frame [m], and when [s].
    since: float
    felt: float  #: Stamp of the last scan that showed it [s].
    left: bool = False  #: Whether that place was seen to be empty since, or its present place before it came.
    way: float = 0.0  #: Its greatest distance from where it began [m].
    scans: int = 1  #: How many did, and for how many of these the camera looked there and showed no person [1].
    shown: int = 0
    #: Of the person whom the camera showed there last, and since when they are theirs [s]; None if it showed none.
    number: int | None = None
    named: float = math.inf
    stature: float = STATURE  #: Of that person [m].


@dataclass(frozen=True, slots=True)
class Movers:
    """Follows what moves in the scan.

    The end of what is seen of a wall, where a corner or a person hides the rest, moves as well; what it has moved from
    is still wall. So a group moves only when the place where it began is seen to be empty, or its place was before.
    """

    legs: Legs = field(default_factory=Legs)  #: How a group, or the legs of a tracked person, are found again.
    gap: float = param(0.3, "m", "Returns further apart than this are of two groups.")
    fewest_scans: int = param(4, "1", "Scans after which a group counts as moving.")
    least_way: float = param(0.25, "m", "Way from where it began, from which it counts as moving.")
    forget_s: float = param(0.5, "s", "A group is given up when a scan should have shown it for this time.")
    unseen_s: float = param(3.0, "s", "Where the lidar does not look, a group is predicted for this time.")
    looks: int = param(12, "1", "Scans without a person in the camera's view after which it is no more turned to.")
    beside: float = param(0.4, "m", "A person is this far from their own legs at most.")
    taken: float = param(0.35, "m", "A person must be nearer by this to other legs than to their own.")
    bodies: float = param(0.2, "m", "Two people who pass each other nearer than a body's width share their returns.")
    passing: float = param(0.3, "m/s", "Two people pass each other if their velocities differ by more than this.")
    nearer: float = param(0.15, "m", "A box is on other legs than a person's own if it is nearer to them by this.")
    robot: RobotGeometry = LIMO  #: Where the lidar sits.

    def update(
        self,
        movers: tuple[Mover, ...],
        returns: Returns,
        views: tuple[float, float],
        noise: Noise,
        grid: Grid,
        ground: Ground | None,
    ) -> tuple[Mover, ...]:
        """Return what may move after a scan; `views` is how far lidar and camera look to either side [rad].

        `grid` and `ground` tell what has stood for long, whose returns are not looked at, and what is empty; before the
        first map nothing moves.
        """
        points, (lidar, camera) = returns.points, views
        if ground is not None:
            points = points[~grid.is_near_blocked(ground, points, lasting=True)]
        kept: list[Mover] = []
        movers, claims = self._in_turn(movers)
        expected = [kalman.predict(mover.track, returns.stamp, noise) for mover in movers]
        legs = {mover.stature: self.legs.of(mover.stature) for mover in movers}
        strides = [legs[mover.stature] for mover in movers]
        found = self._corrected(strides, claims, expected, replace(returns, points=points), noise)
        for mover, place, track in zip(movers, expected, found, strict=True):
            if track is not None:
                way, shown = math.dist(track.place, mover.began), is_in_view(track, returns, camera, self.robot)
                mover = replace(mover, track=track, felt=returns.stamp, way=max(mover.way, way))
                kept.append(replace(mover, scans=mover.scans + 1, shown=mover.shown + shown))
                continue
            due = is_in_view(place, returns, lidar, self.robot, self.robot.lidar_yaw)
            if returns.stamp - mover.felt < (self.forget_s if due else self.unseen_s):
                kept.append(mover)
        if ground is not None and not all(map(attrgetter("left"), kept)):
            began, since = np.array([mover.began for mover in kept]), np.array([mover.since for mover in kept])
            # Somebody who walks straight at the lidar hides where they began, but not the free ground that they cross.
            here = np.array([mover.track.place for mover in kept])
            left = grid.is_free_since(ground, began, since) | grid.is_free_since(ground, here, since)
            kept = [replace(mover, left=True) if gone else mover for mover, gone in zip(kept, left, strict=True)]
        places = self._groups(returns)
        if ground is not None and len(places):
            places = places[~grid.is_blocked(ground, places, lasting=True)]
        reach = np.array([legs[mover.stature].radius for mover in kept])[:, None]
        new = (distances(places, [*map(attrgetter("track"), kept)]) > reach).all(axis=0)
        begun = [self._begin(place, returns, noise) for place in places[new]]
        return (*kept, *begun)

    def moving(self, movers: tuple[Mover, ...], since: float = -math.inf) -> list[Mover]:
        """Return those that have moved, and were measured after `since` [s]."""
        return [mover for mover in movers if mover.felt > since and self._has_moved(mover)]

    def walked(
        self,
        person: Person,
        movers: tuple[Mover, ...],
        returns: Returns,
        noise: Noise,
        is_ground: Callable[[Points], Mask] | None = None,
    ) -> Person:
        """Return a person brought up to a scan by the returns at their legs; unchanged where there are none.

        Returns nearer to legs of another that walk are left out: a passer-by would take the track along. Walking legs
        without a number count as another's only where the person's own legs were felt lately.
        """
        track, since = kalman.predict(person.track, returns.stamp, noise), returns.stamp - self.forget_s
        is_felt = any(mover.number == person.number and mover.felt > since for mover in movers)
        walking = [mover for mover in self.moving(movers, since) if mover.number != person.number]
        others = [mover.track for mover in walking if is_felt or mover.number is not None]
        points, legs = returns.points, self.legs.of(person.stature)
        (gaps,) = distances(points, [track])
        own = gaps < legs.radius
        if others:
            others = [kalman.predict(other, returns.stamp, noise) for other in others]
            if self._merged([track, *others])[0, 1:].any():
                # Their own legs go on as they went: `continued`.
                return person
            own &= gaps <= distances(points, others).min(axis=0)
        points = points[own]
        if is_ground is not None and len(points):
            points = points[~is_ground(points)]
        found = legs.corrected(track, points, returns.pose, noise)
        return person if found is None else replace(person, track=found, felt=returns.stamp)

    def felt(self, movers: tuple[Mover, ...], now: float) -> Points:
        """Return the places of what a scan has just shown, moving or not, float64 (N, 2) [m], odometry frame."""
        means = [mover.track.mean for mover in movers if now - mover.felt < self.forget_s]
        return np.array(means).reshape(-1, 4)[:, :2]

    def assign(
        self, movers: tuple[Mover, ...], seen: Sequence[Person], stamp: float, noise: Noise
    ) -> tuple[Mover, ...]:
        """Note whose legs they are: one mover to one person found by the camera, the nearest first."""
        pairs, seen = [], [predict(person, stamp, noise) for person in seen]
        felt = [(which, mover) for which, mover in enumerate(movers) if mover.felt == stamp]
        with_legs = {mover.number for _, mover in felt}
        for who, person in enumerate(seen):
            for which, mover in felt:
                gap, number = math.dist(person.track.place, mover.track.place), mover.number
                if gap < self.beside:
                    changes = number != person.number and (number is not None or person.number in with_legs)
                    pairs.append((gap + (self.taken if changes else 0.0), who, which))
        whose: dict[int, int] = {}
        for _, who, which in sorted(pairs):
            if which not in whose and who not in whose.values():
                whose[which] = who
        numbers = {seen[who].number for who in whose.values()}
        # What was taken for the person's legs until now, and is no more, was a piece of them, or begins again.
        kept = [
            named(mover, seen[whose[which]], stamp) if which in whose else mover
            for which, mover in enumerate(movers)
            if which in whose or mover.number not in numbers
        ]
        return tuple(kept)

    def others(
        self, moving: Sequence[Mover], people: list[Person], boxes: list[Measurement], pose: Odometry, noise: Noise
    ) -> set[tuple[int, int]]:
        """Return the pairs, person and box, of people whose own legs walk while the box is on other legs that walk."""
        pairs: set[tuple[int, int]] = set()
        if len(moving) < 2 or not people:
            return pairs
        places = [kalman.predict(mover.track, people[0].track.stamp, noise).place for mover in moving]
        for which, seen in enumerate(boxes):
            if seen.range is None:
                continue
            angle = pose.yaw + seen.bearing
            place = pose.x + seen.range * math.cos(angle), pose.y + seen.range * math.sin(angle)
            gaps = [(math.dist(place, at), mover.number) for at, mover in zip(places, moving, strict=True)]
            for who, person in enumerate(people):
                own = min((gap for gap, number in gaps if number == person.number), default=0.0)
                if min((gap for gap, number in gaps if number != person.number), default=math.inf) + self.nearer < own:
                    pairs.add((who, which))
        return pairs

    def continued(self, person: Person, movers: tuple[Mover, ...], stamp: float) -> Person:
        """Return a person whom the camera does not show, where the scan of a stamp [s] shows their legs."""
        own = [mover.track for mover in movers if mover.number == person.number and mover.felt == stamp]
        return replace(person, track=own[0], felt=stamp) if own and stamp > person.felt else person

    def _has_moved(self, mover: Mover) -> bool:
        return mover.left and mover.scans >= self.fewest_scans and mover.way > self.least_way

    def _corrected(
        self, legs: Sequence[Legs], claims: int, expected: Sequence[Track], returns: Returns, noise: Noise
    ) -> list[Track | None]:
        """Return each expected track, corrected by its own returns; None where it has none.

        Of the first `claims` tracks, known people's legs and what has moved, the nearest has a return. Two who pass
        through each other share their returns: both are moved by the error of their middle, and keep their velocities.
        """
        points, found = returns.points, list[Track | None]()
        gaps = distances(points, expected)
        near = gaps < np.array([leg.radius for leg in legs]).reshape(-1, 1)
        whose = np.where(near, gaps, np.inf)[:claims].argmin(axis=0) if claims else np.zeros(len(points), np.int64)
        free, merged = np.ones(len(points), bool), self._merged(expected[:claims])
        places = np.array([track.place for track in expected]).reshape(-1, 2)
        for index, leg in enumerate(legs):
            own, shift = free & near[index], np.zeros(2)
            if index < claims:
                own = near[index] & merged[index][whose]
                shift = places[index] - places[:claims][merged[index]].mean(axis=0)
            track = leg.corrected(expected[index], points[own] + shift, returns.pose, noise)
            if track is not None:
                free &= ~own | (distances(points, [track])[0] > leg.radius)
            found.append(track)
        return found

    def _merged(self, tracks: Sequence[Track]) -> NDArray[np.bool_]:
        """Return which of M tracks pass so near each other that returns cannot tell whose they are, bool (M, M)."""
        means = np.array([track.mean for track in tracks]).reshape(-1, 4)
        x, y, vx, vy = (means[:, None] - means).transpose(2, 0, 1)
        passing = (np.hypot(x, y) < self.bodies) & (np.hypot(vx, vy) > self.passing)
        return np.asarray(passing | np.eye(len(means), dtype=bool))

    def _in_turn(self, movers: tuple[Mover, ...]) -> tuple[tuple[Mover, ...], int]:
        """Return movers in the order in which they take returns, and how many of them have a claim to the nearest.

        That is known people's legs, then what has moved; what may be anything comes last.
        """
        claims = [mover for mover in movers if mover.number is not None]
        rest = list[Mover]()
        for mover in movers:
            if mover.number is None:
                (claims if self._has_moved(mover) else rest).append(mover)
        return (*claims, *rest), len(claims)

    def _groups(self, returns: Returns) -> Points:
        """Return the middle of each group of returns that is as wide as legs, float64 (N, 2) [m], odometry frame.

        A group beside which something nearer ends may be what that leaves to be seen of a wall.
        """
        points = returns.points
        if len(points) == 0:
            return points
        begins = np.ones(len(points), bool)
        x, y = points.T
        begins[1:] = np.hypot(x[1:] - x[:-1], y[1:] - y[:-1]) > self.gap
        group, (first,) = begins.cumsum() - 1, begins.nonzero()
        count = np.bincount(group)
        here, last = returns.pose, first + count - 1
        far = np.hypot(x - here.x, y - here.y)
        begun, ended = far[first[1:]], far[last[:-1]]
        legs = (count > 1) | (far[first] >= self.legs.sparse)
        legs[1:] &= ended >= begun
        legs[:-1] &= begun >= ended
        extent = np.maximum.reduceat(points, first) - np.minimum.reduceat(points, first)
        legs &= np.hypot(*extent.T) < self.legs.widest
        middle = np.stack([np.bincount(group, x) / count, np.bincount(group, y) / count], axis=1)
        near = np.hypot(middle[:, 0] - here.x, middle[:, 1] - here.y) < self.legs.reach
        return np.asarray(middle[legs & near])

    def _begin(self, place: Points, returns: Returns, noise: Noise) -> Mover:
        pose = returns.pose
        dx, dy = place[0] - pose.x, place[1] - pose.y
        far, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
        track = kalman.initiate(returns.stamp, bearing - pose.yaw, far, pose, self.legs.noise_at(far, noise, pose))
        return Mover(track, (float(place[0]), float(place[1])), returns.stamp, returns.stamp)


def named(mover: Mover, person: Person, stamp: float) -> Mover:
    """Return what the camera shows to be a person's legs: they are where the person is, at the same stamp.

    Where two pass each other, either may have the other's returns; a box tells them apart.
    """
    since = mover.named if mover.number == person.number else stamp
    return replace(mover, track=person.track, number=person.number, stature=person.stature, shown=0, named=since)


def is_in_view(track: Track, returns: Returns, half_view: float, robot: RobotGeometry, towards: float = 0.0) -> bool:
    """Whether a track's place, from the lidar, was at most `half_view` [rad] to either side of `towards`."""
    x, y = lidar_at(returns.pose, robot)
    off = math.atan2(track.mean[1] - y, track.mean[0] - x) - returns.pose.yaw
    return abs(math.remainder(off - towards, math.tau)) < half_view
