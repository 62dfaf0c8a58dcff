"""What the wheels of a differential drive make of a command: each reaches its speed at a limited acceleration.

Told to drive off and to turn at once, both wheels speed up alike until they near their speeds, and the robot drives
straight on meanwhile. A command is therefore cut down to what the wheels reach in time, and the turn comes first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import bounded
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.twist import Twist

Array = NDArray[np.float64]
Speeds = TypeVar("Speeds", float, Array)


@dataclass(frozen=True, slots=True)
class Wheels:
    """Learns how fast the wheels change their speeds, and asks for no more.

    Attributes
    ----------
    acceleration
        Of each wheel, until it is measured [m/s²]: the Limo's.
    least
        A lower measured one is not believed [m/s²]: `Guard` may have held the robot. Chosen: half of the weakest drive
        that was tried.
    raise_share, lower_share
        Share by which a measurement above, and one below, moves what is believed [1]. Chosen: a wheel that was slower
        may have been held; one that was faster was able to be.
    reserve
        A command may ask for so much more than the wheels reach before the next [1]. Chosen: the next command may be
        half a period late, and stronger wheels than believed show.
    """

    acceleration: float = bounded(1.0, 0.05, 10)
    least: float = 0.15
    raise_share: float = 0.5
    lower_share: float = 0.15
    reserve: float = 1.5

    def learn(self, believed: float, sent: Twist, before: Odometry, after: Odometry, robot: RobotGeometry) -> float:
        """Return the wheels' acceleration [m/s²] after one more period.

        Parameters
        ----------
        believed
            As learnt so far [m/s²].
        sent
            The command between the two readings of the wheels.
        before, after
            The readings.
        robot
            Where the wheels are.
        """
        seconds = after.stamp - before.stamp
        if seconds <= 0:
            return believed
        half = robot.wheel_separation / 2
        for side in (-half, half):
            begun, ended = before.linear + side * before.angular, after.linear + side * after.angular
            asked = sent.linear + side * sent.angular - begun
            measured = abs(ended - begun) / seconds
            if measured > believed:
                believed += self.raise_share * (measured - believed)
            elif abs(asked) > believed * seconds and measured > self.least:
                believed += self.lower_share * (measured - believed)
        return believed

    def within_reach(
        self, wanted: Twist, now: Twist, acceleration: float, period: float, robot: RobotGeometry
    ) -> Twist:
        """Return the command that comes nearest to the wanted one within a period [s], the turn first."""
        most = acceleration * self.reserve * period
        return Twist(*advanced(wanted.linear, wanted.angular, now.linear, now.angular, most, robot))


def stoppable_turn(off: Speeds, acceleration: float, robot: RobotGeometry) -> Speeds:
    """Return the turn rate [rad/s], positive, from which the wheels stop within an angle `off` [rad] of either sign."""
    return np.sqrt(2 * acceleration / (robot.wheel_separation / 2) * np.abs(off))  # type: ignore[no-any-return]


def advanced(
    linear: float, angular: float, now_linear: float, now_angular: float, most: float, robot: RobotGeometry
) -> tuple[float, float]:
    """Return the speeds after each wheel has changed its own by `most` [m/s] at most: the turn first, then the drive.

    `linear`, `angular` are wanted, `now_linear`, `now_angular` the present ones [m/s, rad/s].
    """
    half = robot.wheel_separation / 2
    turn = min(max(angular - now_angular, -most / half), most / half)
    left = most - half * abs(turn)
    return now_linear + min(max(linear - now_linear, -left), left), now_angular + turn


def all_advanced(
    linear: Array, angular: Array, now_linear: Array, now_angular: Array, most: float, robot: RobotGeometry
) -> tuple[Array, Array]:
    """Return what `advanced` does, for many commands at once: float64 (N,) each."""
    half = robot.wheel_separation / 2
    turn = np.minimum(np.maximum(angular - now_angular, -most / half), most / half)
    left = most - half * np.abs(turn)
    return now_linear + np.minimum(np.maximum(linear - now_linear, -left), left), now_angular + turn
