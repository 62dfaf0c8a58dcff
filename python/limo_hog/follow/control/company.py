"""Giving way: people are predicted, and of the commands the robot can carry out, one that stays clear of them is taken.

The dynamic window approach (Fox, Burgard and Thrun 1997), with obstacles that move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import bounded
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.twist import Twist


@dataclass(frozen=True, slots=True)
class Walker:
    """A person near the robot.

    Attributes
    ----------
    x, y, vx, vy
        Place and velocity in the base frame as it is now, which is taken to stand still [m, m/s].
    """

    x: float
    y: float
    vx: float
    vy: float


@dataclass(frozen=True, slots=True)
class Company:
    """Chooses a command that stays clear of people who come near.

    Attributes
    ----------
    horizon_s, step_s
        How far people are predicted, and in which steps [s]. Chosen: at 1.3 m/s a person comes from 3 m away.
    slowest
        People slower than this do not come [m/s]. Chosen: twice what a standing person's estimate strays.
    clear
        Distance wanted between the robot's outline and a person's axis [m]. Chosen: the .3 m of clearance asked for,
        half a trunk of .15 m, and .1 m for the prediction.
    wanted
        Of more distance than this nothing is gained [m]. Chosen: the edge of Hall's intimate zone, and half a trunk.
    walls
        Distance kept from everything else [m]. Chosen: `Guard` keeps more ahead and behind, where it can.
    speeds, turns
        Commands compared [m/s, rad/s]. Chosen: what the drive can do; `Guard` limits the way back to .4 m/s.
    unseen
        Speed back onto ground that was not seen lately [m/s]: that of `Guard`.
    acceleration
        Of each wheel [m/s²]: the Limo's.
    ease
        What a change of speed by 1 m/s is worth [m]. Chosen: a decimetre of clearance.
    """

    horizon_s: float = bounded(2.4, 0, 10)
    step_s: float = 0.2
    slowest: float = bounded(0.3, 0, 2)
    clear: float = bounded(0.55, 0, 3)
    wanted: float = 0.7
    walls: float = 0.1
    speeds: tuple[float, ...] = (-0.4, -0.2, 0.0, 0.3, 0.6)
    unseen: float = -0.2
    acceleration: float = 1.0
    turns: tuple[float, ...] = (-2.2, -1.1, 0.0, 1.1, 2.2)
    ease: float = 0.1

    def command(
        self,
        wanted: Twist,
        now: Twist,
        walkers: Sequence[Walker],
        points: Points,
        robot: RobotGeometry,
        may_back: bool = True,
    ) -> Twist | None:
        """Return the command to give way with; None where the wanted one stays clear of everybody.

        Parameters
        ----------
        wanted, now
            What the robot would do, and what its wheels do.
        walkers
            The people near it.
        points
            float64 (N, 2) [m], base frame: what the lidar sees; people in it count as they stand.
        robot
            The robot's outline.
        may_back
            Whether the ground behind the robot is known to be free.
        """
        people = np.array([(one.x, one.y, one.vx, one.vy) for one in walkers]).reshape(-1, 4)
        coming = np.hypot(people[:, 2], people[:, 3]) > self.slowest
        # Those who come no nearer than they are, whatever the robot does, need no way.
        coming &= (people[:, :2] * people[:, 2:]).sum(axis=1) < 0
        if not coming.any():
            return None
        people = people[coming]
        commands = np.array(
            [(wanted.linear, wanted.angular), *((speed, turn) for speed in self.speeds for turn in self.turns)]
        )
        # `Guard` lets nothing drive back faster.
        commands[0, 0] = max(wanted.linear, self.speeds[0])
        if not may_back:
            commands[:, 0] = np.maximum(commands[:, 0], self.unseen)
        poses = self._driven(commands, now, robot)
        gaps = self._gaps(poses, people, robot)
        if gaps[0] > self.clear:
            return None
        others = points[np.hypot(*(points[:, None] - people[None, :, :2]).transpose(2, 0, 1)).min(axis=1) > 0.45]
        near = others[np.hypot(*others.T) < 1.5][::2]
        room = self._room(poses, near, robot)
        effort = self.ease * (np.abs(commands - commands[0]) @ (1.0, 0.1))
        worth = np.minimum(gaps, self.wanted) - effort
        worth[room < self.walls] -= 2.0
        best = int(np.argmax(worth))
        return Twist(float(commands[best, 0]), float(commands[best, 1]))

    def _driven(self, commands: NDArray[np.float64], now: Twist, robot: RobotGeometry) -> NDArray[np.float64]:
        """Return where each of K commands leads in T steps: float64 (K, T, 3), x, y [m] and yaw [rad].

        Each wheel changes its speed at `acceleration`, so that a robot that also has to turn about its direction of
        travel turns later.
        """
        times = np.arange(self.step_s, self.horizon_s + 1e-9, self.step_s)
        half = robot.wheel_separation / 2
        most = self.acceleration * times
        # After the first half the robot drives straight on: a turn is to get out of the way, not to come back.
        wheels = []
        for side in (-half, half):
            begun = now.linear + side * now.angular
            turning = commands[:, :1] + side * commands[:, 1:]
            wanted = np.where(times < self.horizon_s / 2, turning, commands[:, :1])
            wheels.append(begun + np.clip(wanted - begun, -most, most))
        linear, angular = (wheels[0] + wheels[1]) / 2, (wheels[1] - wheels[0]) / robot.wheel_separation
        yaw = np.clip(np.cumsum(angular, axis=1) * self.step_s, -math.pi / 2, math.pi / 2)
        x = np.cumsum(linear * np.cos(yaw), axis=1) * self.step_s
        y = np.cumsum(linear * np.sin(yaw), axis=1) * self.step_s
        return np.stack([x, y, yaw], axis=2)

    def _gaps(
        self, poses: NDArray[np.float64], people: NDArray[np.float64], robot: RobotGeometry
    ) -> NDArray[np.float64]:
        """Return for each of K commands the least distance from the outline to a person's axis [m], float64 (K,)."""
        times = np.arange(1, poses.shape[1] + 1) * self.step_s
        places = people[:, None, :2] + times[None, :, None] * people[:, None, 2:]
        return np.asarray(_outline_gap(poses[:, :, None], places.transpose(1, 0, 2)[None], robot).min(axis=(1, 2)))

    def _room(self, poses: NDArray[np.float64], points: Points, robot: RobotGeometry) -> NDArray[np.float64]:
        """Return for each of K commands the least distance from the outline to a point [m], float64 (K,)."""
        if len(points) == 0:
            return np.full(len(poses), np.inf)
        return np.asarray(_outline_gap(poses[:, ::2, None], points[None, None], robot).min(axis=(1, 2)))


def _outline_gap(poses: NDArray[np.float64], places: NDArray[np.float64], robot: RobotGeometry) -> NDArray[np.float64]:
    """Return the distance from the robot's rectangle at poses (..., 3) to places (..., 2) [m]."""
    dx, dy = places[..., 0] - poses[..., 0], places[..., 1] - poses[..., 1]
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    ahead = np.maximum(np.abs(cos * dx + sin * dy) - robot.half_length, 0.0)
    beside = np.maximum(np.abs(cos * dy - sin * dx) - robot.half_width, 0.0)
    return np.asarray(np.hypot(ahead, beside))
