"""What the wheels can do: their acceleration is learnt, and no more is asked of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry, Twist
from limo_hog.follow.sense.observation import Odometry


@dataclass(frozen=True, slots=True)
class Wheels:
    """Learns how fast the wheels change their speeds, and asks for no more."""

    acceleration: float = param(1.0, "m/s²", "Of each wheel, until it is measured: the Limo's.", 0.05, 10)
    least: float = param(0.15, "m/s²", "A lower measured one is not believed: `Guard` may have held the robot.")
    raise_share: float = param(0.5, "1", "Share by which a higher measurement moves what is believed.")
    lower_share: float = param(0.15, "1", "Share by which a lower one does: a slower wheel may have been held.")
    reserve: float = param(1.5, "1", "A command may ask for this much of what the wheels reach before the next.")

    def learn(self, believed: float, sent: Twist, before: Odometry, after: Odometry, robot: RobotGeometry) -> float:
        """Return the wheels' acceleration [m/s²], so far `believed`, after `sent` between two readings of them."""
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

    def within_reach(self, asked: Twist, now: Twist, acceleration: float, period: float, robot: RobotGeometry) -> Twist:
        """Return the command nearest to `asked` that wheels that do `now` reach in a period [s]: the turn first."""
        most, half = acceleration * self.reserve * period, robot.wheel_separation / 2
        turn = min(max(asked.angular - now.angular, -most / half), most / half)
        left = most - half * abs(turn)
        return Twist(now.linear + min(max(asked.linear - now.linear, -left), left), now.angular + turn)


def turn_acceleration(acceleration: float, robot: RobotGeometry) -> float:
    """Return how fast the robot's turn rate changes [rad/s²] with wheels of an acceleration [m/s²]."""
    return acceleration / (robot.wheel_separation / 2)


def stoppable_turn(off: float, acceleration: float, robot: RobotGeometry) -> float:
    """Return the turn rate [rad/s], positive, from which the wheels stop within an angle `off` [rad] of either sign."""
    return math.sqrt(2 * turn_acceleration(acceleration, robot) * abs(off))
