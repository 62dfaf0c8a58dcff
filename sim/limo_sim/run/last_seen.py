"""What a policy is told instead of images: where a person was last seen, and the robot's motion, as nine numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Odometry

#: Numbers in a state.
SIZE = 9


@dataclass(frozen=True, slots=True)
class Scale:
    """What 1 stands for in a state and in an action."""

    #: linear, angular: speed and turn rate of an action of 1 [m/s, rad/s]: the limits of the tracking controller.
    linear: float = 0.7
    angular: float = 1.5
    range_m: float = 8.0  #: the depth camera's reach [m]
    #: An older sighting is no older than this [s]. Chosen: half of the time after which a run has failed.
    age_s: float = 5.0
    person: float = 1.5  #: speed of a person [m/s]. Chosen: a brisk walk is 1.4.
    #: Share by which a new difference of places changes the person's velocity [1]. Chosen: ranges stray by about 5 cm
    #: from frame to frame, which is 0.5 m/s; this leaves 0.15.
    smoothing: float = 0.2
    gap_s: float = 0.5  #: after a longer gap the velocity begins anew [s]


SCALE = Scale()


@dataclass(frozen=True, slots=True)
class LastSeen:
    """Where a person was last seen, and how the person moved then, in the odometry's frame [s, m, m, m/s, m/s]."""

    stamp: float
    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0


def sighted(bearing: float, distance: float, stamp: float, odometry: Odometry, before: LastSeen | None) -> LastSeen:
    """Return a sighting from bearing and distance, seen from the robot's centre [rad, m], and the one before it."""
    direction = odometry.yaw + bearing
    x, y = odometry.x + distance * math.cos(direction), odometry.y + distance * math.sin(direction)
    if before is None or not 0.0 < stamp - before.stamp <= SCALE.gap_s:
        return LastSeen(stamp, x, y)
    dt, share = stamp - before.stamp, SCALE.smoothing
    vx, vy = (x - before.x) / dt, (y - before.y) / dt
    return LastSeen(stamp, x, y, before.vx + share * (vx - before.vx), before.vy + share * (vy - before.vy))


def state_of(last: LastSeen | None, seen: bool, now: float, odometry: Odometry) -> NDArray[np.float32]:
    """Return a state, float32 (9,), each number in -1 … 1.

    0: 1 where the person was seen in the newest frame (`seen`), else 0. 1, 2: cosine and sine of the bearing of the
    last sighting, from where the robot is now. 3: its distance. 4: its age. 5, 6: how the person moved, forward and to
    the left of the robot. 7, 8: speed and turn rate of the robot. The unit of each is in `Scale`. Before the first
    sighting 1, 2, 5 and 6 are 0, and 3 and 4 are 1.
    """
    moves = odometry.linear / SCALE.linear, odometry.angular / SCALE.angular
    if last is None:
        return np.clip((0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, *moves), -1.0, 1.0).astype(np.float32)
    dx, dy = last.x - odometry.x, last.y - odometry.y
    distance = math.hypot(dx, dy)
    cos, sin = math.cos(odometry.yaw), math.sin(odometry.yaw)
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    forward, sideways = cos * last.vx + sin * last.vy, cos * last.vy - sin * last.vx
    unit = max(distance, 1e-6)
    place = ahead / unit, left / unit, distance / SCALE.range_m, (now - last.stamp) / SCALE.age_s
    person = forward / SCALE.person, sideways / SCALE.person
    return np.clip((float(seen), *place, *person, *moves), -1.0, 1.0).astype(np.float32)
