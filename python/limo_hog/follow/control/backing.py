"""Backing off: onto ground that was seen to be free and that nobody can have come to since; nothing looks behind.

A person who is measured is given way to (`company`). One who was about and is not measured any more may have walked on:
where they can have come to by now, ground counts as free for a shorter time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.control.steer import Aim
from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.clearance import Margin, Points, places_behind, rooms_ahead, to_odometry
from limo_hog.follow.sense.measurement import WALK
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground

Poses: TypeAlias = NDArray[np.float64]
"""(..., 3): x, y [m], yaw [rad]."""


@dataclass(frozen=True, slots=True)
class Other:
    """Another person than the one followed.

    Attributes
    ----------
    x, y, at
        Where they were last measured, odometry frame [m], and when [s].
    """

    x: float
    y: float
    at: float


@dataclass(frozen=True, slots=True)
class Backing:
    """Decides whether to back, to look behind first, or to stand.

    Attributes
    ----------
    depths
        So far behind the outline the ground must be known [m]. Chosen: from .5 m/s the robot stops within .26 m, from
        .6 m/s within .33 m, by its whole brakes.
    offs
        To back, the robot faces one of these directions beside the person's [rad]. Chosen: they stay in the image, half
        of which is .62 rad wide.
    margins, shares
        The room is that within each of these margins, by these shares [1]. Chosen: what `Guard` keeps; and 6 cm more
        beside, since along a wall's end that is just outside of what `Guard` keeps an error of 4° stops the robot.
        The wider one alone ended one of 23 such runs with a contact.
    """

    # Chosen: a second less than `Guard.memory_s`, so that `Guard` does not slow the robot down on ground taken for
    # known.
    memory_s: float = param(
        59.0, "s", "How long ground seen to be free counts as known, and how long other people are remembered.", 0, 3600
    )
    # Chosen: at .75 m/s a person comes up from 3.5 m, the reach of the legs in the scan.
    hidden_memory_s: float = param(
        5.0, "s", "How long ground counts as known where a person out of sight can be by now.", 0, 600
    )
    # Chosen: as long as one is predicted, a body's width, a walk.
    unseen_s: float = param(0.8, "s", "A person not measured for longer than this is out of sight.", 0, 60)
    hidden_radius: float = param(0.5, "m", "A person out of sight can be this far from where they were.", 0, 5)
    hidden_speed: float = param(WALK, "m/s", "Speed at which a person out of sight may have walked on.", 0, 5)
    # Chosen: `Guard`'s limit.
    unseen_speed: float = param(
        0.2, "m/s", "Limit of the speed back onto ground that was not seen, where no person out of sight can be.", 0, 1
    )
    # Chosen: 82°, which shows the ground behind, in .7 s.
    glance_turn: float = param(3.0, "rad/s", "Turn rate to look behind before backing.", 0, 6)
    # Chosen: nearer, HOG would miss the head.
    glance_excess: float = param(
        0.25, "m", "How much too near a person must be for a look behind; until then the robot stands.", 0, 2
    )
    depths: tuple[float, ...] = (0.1, 0.2, 0.3)
    offs: tuple[float, ...] = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3, 0.4, -0.4, 0.5, -0.5)
    # Measured in 32 development runs of the corridor: with .5 m two end with a contact, with 1 m none; with .5 m a
    # radian a person comes as near as .32 m, with .2 m as .63 m.
    enough_room: float = param(1.0, "m", "More room behind than this gains nothing.", 0, 5)
    turn_cost: float = param(0.2, "m/rad", "Room behind that a radian beside the person's direction costs.", 0, 5)
    margins: tuple[Margin, ...] = (Margin(), Margin(beside=0.26))
    shares: tuple[float, ...] = (0.7, 0.3)

    def remember(
        self, others: tuple[Other, ...], seen: Points, felt: Points, followed: Points, now: float
    ) -> tuple[Other, ...]:
        """Bring the other people up to `now` [s].

        Parameters
        ----------
        others
            Those remembered.
        seen
            float64 (N, 2) [m], odometry frame: where others are measured now.
        felt
            float64 (M, 2) [m]: what the scan shows now that may be legs: of those remembered, not of more.
        followed
            float64 (1, 2) [m]: where the person followed is, who may have been taken for another; (0, 2) if unknown.
        """
        # Of a few places, lists are faster than arrays.
        own, legs = followed.tolist(), felt.tolist()
        left = [
            one
            for one in others
            if now - one.at < self.memory_s
            and all(math.dist(place, (one.x, one.y)) > self.hidden_radius for place in own)
        ]
        kept: list[Other] = []
        for x, y in seen.tolist():
            near = min(left, key=lambda one: self._gap(one, x, y, now), default=None)
            if near is not None and self._gap(near, x, y, now) <= 0:
                left.remove(near)
            kept.append(Other(x, y, now))
        for one in left:
            gap, x, y = min(((math.dist((x, y), (one.x, one.y)), x, y) for x, y in legs), default=(math.inf, 0.0, 0.0))
            kept.append(Other(x, y, now) if gap < self.hidden_radius else one)
        return tuple(kept)

    def can_hold_other(self, others: tuple[Other, ...], places: Points, now: float) -> NDArray[np.bool_]:
        """Return whether a person out of sight can be at each of (N, 2) places [m] in the odometry frame, bool (N,)."""
        can = np.zeros(len(places), bool)
        for one in self._out_of_sight(others, now):
            can |= np.hypot(places[:, 0] - one.x, places[:, 1] - one.y) < self._reach(one, now)
        return can

    def is_free_behind(
        self,
        poses: Poses,
        pose: Odometry,
        grid: Grid,
        ground: Ground | None,
        others: tuple[Other, ...],
        robot: RobotGeometry,
    ) -> NDArray[np.bool_]:
        """Return whether the ground behind the robot is known to be free when it is at poses in the base frame.

        `pose` is where the base frame is. Returns bool (...), as many as poses.
        """
        if ground is None:
            return np.ones(poses.shape[:-1], bool)
        behind = places_behind(self.depths, robot)
        cos, sin = np.cos(poses[..., 2, None]), np.sin(poses[..., 2, None])
        x = poses[..., 0, None] + behind[:, 0] * cos - behind[:, 1] * sin
        y = poses[..., 1, None] + behind[:, 0] * sin + behind[:, 1] * cos
        places = to_odometry(np.stack([x.ravel(), y.ravel()], axis=1), pose)
        within = np.where(self.can_hold_other(others, places, ground.stamp), self.hidden_memory_s, self.memory_s)
        known = grid.is_free_since(ground, places, ground.stamp - within)
        return np.asarray(known.reshape(x.shape).all(axis=-1))

    def heading(self, bearing: float, points: Points, robot: RobotGeometry) -> float:
        """Return the direction near a person's bearing to face while backing, by the room behind [rad].

        A robot that keeps facing a person who comes along a wall backs into the wall.

        Parameters
        ----------
        bearing
            Of the person [rad].
        points
            float64 (N, 2) [m], base frame: what stands around the robot.
        robot
            Its outline.
        """
        offs = np.array(self.offs)
        worth = -self.turn_cost * np.abs(offs)
        for share, margin in zip(self.shares, self.margins, strict=True):
            worth += share * np.minimum(rooms_ahead(-points, bearing + offs, margin, robot), self.enough_room)
        return bearing + self.offs[int(np.argmax(worth))]

    def is_blocked(self, pose: Odometry, grid: Grid, ground: Ground | None, robot: RobotGeometry) -> bool:
        """Whether the map shows something that lasts close behind: `Guard` remembers for a shorter time."""
        if ground is None:
            return False
        return bool(grid.is_blocked(ground, to_odometry(places_behind(self.depths, robot), pose), lasting=True).any())

    def blind_limit(self, others: tuple[Other, ...], pose: Odometry, robot: RobotGeometry, now: float) -> float:
        """Return how fast to back onto unknown ground [m/s]."""
        if not self._out_of_sight(others, now):
            return self.unseen_speed
        behind = to_odometry(places_behind(self.depths, robot), pose)
        return 0.0 if self.can_hold_other(others, behind, now).any() else self.unseen_speed

    def blindly(
        self, twist: Twist, limit: float, aim: Aim, too_far: float, walking: float, reason: str
    ) -> tuple[Twist, str]:
        """Return the command, and the reason, in place of one that backs onto unknown ground.

        Nobody who walks is turned away from: they may pass by, and `Company` gives way to them.

        Parameters
        ----------
        twist, reason
            The command, and why.
        limit
            By `blind_limit`.
        aim
            Where the person is.
        too_far
            How much further off the person is than they should be, negative for nearer [m].
        walking
            People faster than this walk [m/s].
        """
        if limit > 0:
            return replace(twist, linear=max(twist.linear, -limit)), reason
        walks = max(abs(aim.range_rate), abs(aim.bearing_rate) * aim.distance) > walking
        if walks or too_far > -self.glance_excess:
            return Twist(0.0, twist.angular), reason
        side = -1.0 if aim.bearing > 0 else 1.0
        return Twist(0.0, side * self.glance_turn), "looking behind before backing"

    def _out_of_sight(self, others: tuple[Other, ...], now: float) -> list[Other]:
        return [one for one in others if now - one.at > self.unseen_s]

    def _reach(self, one: Other, now: float) -> float:
        return self.hidden_radius + self.hidden_speed * (now - one.at)

    def _gap(self, one: Other, x: float, y: float, now: float) -> float:
        """Return how much further off a place is than a person can have walked [m]."""
        return math.hypot(x - one.x, y - one.y) - self._reach(one, now)
