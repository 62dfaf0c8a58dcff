"""What a command is decided by: built once a step, in the base frame as of the newest stamp."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.clearance import Points, from_odometry, places_behind, to_odometry
from limo_hog.follow.sense.measurement import PERSON_RADIUS
from limo_hog.follow.sense.observation import Array, Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.routes import along

#: Ground behind the robot is looked at so far behind its outline [m]: from .6 m/s it stops within .33 m.
DEPTHS = (0.1, 0.2, 0.3)
#: Something this near to a line of sight hides what is behind it [m]. Chosen: half the width of a person.
HIDES = 0.12
#: How long ground that was seen free counts as known [s]: a second less than `Guard.memory_s`.
KNOWN_S = 59.0


@dataclass(frozen=True, slots=True)
class Situation:
    """The robot, the people and the ground."""

    now: float  #: The newest stamp [s]; where the robot is then, odometry frame, and what its wheels do.
    pose: Odometry
    driven: Twist
    robot: RobotGeometry  #: Its geometry and limits; its wheels' acceleration as learnt [m/s²].
    acceleration: float
    period: float  #: The time to the next command, and what the image will be late then [s].
    late_s: float
    people: Array  #: float64 (N, 4): x, y [m], vx, vy [m/s] of everybody.
    followed: int | None  #: The row of the person followed.
    points: Points  #: float64 (M, 2) [m]: what stands around the robot, without people who are predicted.
    grid: Grid  #: The map; None before the first scan.
    ground: Ground | None
    hiding: Array  #: float64 (H, 3): where people out of sight can be, `Hiding.circles`.

    @property
    def mapped(self) -> Ground:
        """The ground, where it is known that there is a map."""
        if self.ground is None:
            raise ValueError("there is no map yet: ask for `ground`")
        return self.ground

    @property
    def is_alone(self) -> bool:
        """Whether nobody but the person followed is known to be about."""
        return len(self.people) == (self.followed is not None) and not len(self.hiding)

    def is_known_behind(self, poses: Array, fresh_s: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return whether ground behind poses (..., 3) was seen free, and if somebody can be where not, bool (...).

        Where people out of sight can be, it must have been seen so within `fresh_s` [s].
        """
        if self.ground is None:
            return np.ones(poses.shape[:-1], bool), np.zeros(poses.shape[:-1], bool)
        behind = places_behind(DEPTHS, self.robot)
        cos, sin = np.cos(poses[..., 2, None]), np.sin(poses[..., 2, None])
        x = poses[..., 0, None] + behind[:, 0] * cos - behind[:, 1] * sin
        y = poses[..., 1, None] + behind[:, 0] * sin + behind[:, 1] * cos
        places = to_odometry(np.stack([x.ravel(), y.ravel()], axis=1), self.pose)
        hides = (np.hypot(*(places[:, None] - self.hiding[:, :2]).transpose(2, 0, 1)) < self.hiding[:, 2]).any(axis=1)
        known = self.grid.is_free_since(self.ground, places, self.ground.stamp - np.where(hides, fresh_s, KNOWN_S))
        known, risky = known.reshape(x.shape), (hides & ~known).reshape(x.shape)
        return np.asarray(known.all(axis=-1)), np.asarray(risky.any(axis=-1))

    def is_hidden(self, bearings: Array, distances: Array) -> NDArray[np.bool_]:
        """Return whether something that stands hides each of (N,) places from the robot [rad, m], bool (N,)."""
        (x, y), cos, sin = self.points.T, np.cos(bearings)[:, None], np.sin(bearings)[:, None]
        ahead, aside = x * cos + y * sin, y * cos - x * sin
        before = (ahead > 0) & (ahead < distances[:, None] - PERSON_RADIUS)
        return np.asarray((before & (np.abs(aside) < HIDES)).any(axis=1))

    def is_behind(self, place: tuple[float, float]) -> bool:
        """Whether something that lasts is between the robot and a place in the odometry frame [m]."""
        here, there = np.array([[self.pose.x, self.pose.y]]), np.array([place])
        return self.ground is not None and not self.grid.sees(self.ground, here, there, lasting=True)[0, 0]

    def bearing_of(self, x: float, y: float) -> float:
        """Return the direction of a place in the odometry frame [rad]."""
        return math.remainder(math.atan2(y - self.pose.y, x - self.pose.x) - self.pose.yaw, math.tau)


def carried(people: Array, pose: Odometry) -> Array:
    """Carry places and velocities (N, 4) from the odometry frame into the base frame of a robot at `pose`."""
    turned = from_odometry((people - (pose.x, pose.y, 0.0, 0.0)).reshape(-1, 2), Odometry(yaw=pose.yaw))
    return turned.reshape(-1, 4)


@dataclass(frozen=True, slots=True)
class Goal:
    """Where the robot should be, looking where."""

    heading: float  #: Direction to drive in and to face now [rad], and how it changes [rad/s].
    rate: float = 0.0
    speed: float = 0.0  #: Best speed now, and once the distance is right [m/s].
    speed_later: float = 0.0
    #: float64 (T, 2) [m]: the place to be near, after each step of a rollout; None to drive nowhere.
    places: Points | None = None
    keeps: float = 0.0  #: The distance to hold from it, from the robot's centre [m].
    turn_limit: float = math.inf  #: Highest turn rate [rad/s].
    faces: bool = True  #: Whether it matters that the person followed stays in the image.


def goal_along(way: Points, situation: Situation, ahead: float, speed: float, times: Array) -> Goal:
    """Return the goal to drive along a way (N, 2) [m] at a speed [m/s], facing its point so far `ahead` [m]."""
    heading = situation.bearing_of(*along(way, situation.pose, np.array([ahead]))[0])
    places = from_odometry(along(way, situation.pose, speed * times), situation.pose)
    return Goal(heading, 0.0, speed, speed, places, faces=False)
