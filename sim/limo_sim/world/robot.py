"""A differential drive: limits of its wheels' speed and acceleration, and a watchdog that stops it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from limo_hog.follow.robot import Twist


@dataclass(slots=True)
class Drive:
    """Commands in, wheel speeds out."""

    separation: float  #: between the left and the right wheels [m]
    #: wheel_speed, wheel_acceleration: limits of each wheel [m/s, m/s²]
    wheel_speed: float
    wheel_acceleration: float
    #: The robot stops when no command has come for this long [s]; the next command arms the watchdog again.
    watchdog_s: float
    #: left, right: speeds of the wheels' rims [m/s]
    left: float = 0.0
    right: float = 0.0
    #: rejected, watchdog_stops: how many commands were not finite, and how often the watchdog stopped the robot
    rejected: int = 0
    watchdog_stops: int = 0
    twist: Twist = field(default_factory=Twist)  #: the robot's speeds while the wheels do not slip
    _wanted: Twist = field(default_factory=Twist)
    _commanded_at: float | None = None

    def command(self, twist: Twist, time: float) -> None:
        """Take a command at `time` [s]; one that is not finite stops the robot and is counted."""
        finite = is_finite(twist)
        self.rejected += not finite
        self._wanted = twist if finite else Twist()
        self._commanded_at = time

    def advance(self, time: float, dt: float) -> None:
        """Move the wheel speeds towards the command over the step that begins at `time` [s]."""
        if self._commanded_at is not None and time - self._commanded_at >= self.watchdog_s - 1e-9:
            self._wanted = Twist()
            self._commanded_at = None
            self.watchdog_stops += 1
        turn = self._wanted.angular * self.separation / 2
        wanted_left, wanted_right = self._wanted.linear - turn, self._wanted.linear + turn
        # a command too fast for one wheel is slowed as a whole, so that the robot keeps to its curve
        excess = max(abs(wanted_left), abs(wanted_right)) / self.wheel_speed
        if excess > 1.0:
            wanted_left, wanted_right = wanted_left / excess, wanted_right / excess
        most = self.wheel_acceleration * dt
        self.left += min(max(wanted_left - self.left, -most), most)
        self.right += min(max(wanted_right - self.right, -most), most)
        self.twist = twist_of(self.left, self.right, self.separation)


def is_finite(twist: Twist) -> bool:
    """Whether both speeds of a command are numbers: by any other the robot stands."""
    return math.isfinite(twist.linear) and math.isfinite(twist.angular)


def twist_of(left: float, right: float, separation: float) -> Twist:
    """Return the motion of the robot from that of its wheels' rims, as speeds [m/s] or as distances [m]."""
    return Twist((left + right) / 2, (right - left) / separation)


def integrate(x: float, y: float, yaw: float, forward: float, turn: float) -> tuple[float, float, float]:
    """Move a pose along the arc of `forward` metres that turns by `turn` [rad]."""
    chord = forward * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
    return x + chord * math.cos(yaw + turn / 2), y + chord * math.sin(yaw + turn / 2), yaw + turn
