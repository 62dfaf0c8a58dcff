"""Backing off: only onto ground that was seen to be free lately, since nothing looks behind the robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.control.steer import Aim
from limo_hog.follow.parameters import bounded
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, to_odometry
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.twist import Twist


@dataclass(frozen=True, slots=True)
class Backing:
    """Decides whether to back, to look behind first, or to stand.

    Attributes
    ----------
    lately_s
        Ground that was not seen to be free within this is unknown [s]. Chosen: at .75 m/s a person comes up from 3.5 m,
        the reach of the legs in the scan.
    blind_speed, alone_s
        So fast at most it backs onto unknown ground [m/s], if nobody but the person followed was measured for so long
        [s]; else not at all. Chosen: the limit of `Guard`; a person who was near half a minute ago may be behind now.
    glance_turn, glance_from
        Turn rate to look behind before backing, and how much too near a person must be for that [rad/s, m]. Chosen:
        82°, which shows the ground behind, in .7 s; a body's depth. Until then it stands.
    depths
        So far behind the outline the ground must be known [m]. Chosen: from .4 m/s the robot stops within .26 m.
    """

    lately_s: float = bounded(5.0, 0, 600)
    blind_speed: float = bounded(0.2, 0, 1)
    alone_s: float = bounded(30.0, 0, 3600)
    glance_turn: float = bounded(3.0, 0, 6)
    glance_from: float = bounded(0.15, 0, 2)
    depths: tuple[float, ...] = (0.1, 0.2, 0.3)

    def is_known(self, places: Points, pose: Odometry, grid: Grid, ground: Ground | None) -> NDArray[np.bool_]:
        """Return whether the ground at places, float64 (N, 2) [m] in the base frame, was seen to be free, bool (N,)."""
        if ground is None:
            return np.ones(len(places), bool)
        return grid.is_free_since(ground, to_odometry(places, pose), ground.stamp - self.lately_s)

    def is_known_behind(
        self, bearing: float, pose: Odometry, grid: Grid, ground: Ground | None, robot: RobotGeometry
    ) -> bool:
        """Whether the ground is known that is behind the robot when it faces a bearing [rad]."""
        far, side = np.meshgrid(self.depths, (-robot.half_width, 0.0, robot.half_width))
        behind = np.stack([-robot.half_length - far.ravel(), side.ravel()], axis=1)
        return bool(self.is_known(behind, replace(pose, yaw=pose.yaw + bearing), grid, ground).all())

    def stands_behind(self, pose: Odometry, grid: Grid, ground: Ground | None, robot: RobotGeometry) -> bool:
        """Whether the map shows something that lasts close behind: `Guard` remembers it for a shorter time."""
        if ground is None:
            return False
        far, side = np.meshgrid(self.depths, (-robot.half_width, 0.0, robot.half_width))
        behind = np.stack([-robot.half_length - far.ravel(), side.ravel()], axis=1)
        return bool(grid.is_blocked(ground, to_odometry(behind, pose), lasting=True).any())

    def blind_limit(self, others_at: float, now: float) -> float:
        """Return how fast to back onto unknown ground [m/s]; `others_at` is when another person was measured [s]."""
        return 0.0 if now - others_at < self.alone_s else self.blind_speed

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
        if walks or too_far > -self.glance_from:
            return Twist(0.0, twist.angular), reason
        side = -1.0 if aim.bearing > 0 else 1.0
        return Twist(0.0, side * self.glance_turn), "looking behind before backing"
