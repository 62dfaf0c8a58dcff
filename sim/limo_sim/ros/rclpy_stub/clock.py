"""Times, durations, clocks and timers; a run's time begins at 0 and moves in steps of 20 ms."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

from limo_sim.ros.interfaces import message_class
from limo_sim.ros.rclpy_stub.context import current
from limo_sim.ros.rclpy_stub.offered import Offered


class ClockType(IntEnum):
    """Kinds of clocks; all of them show the arena's time here."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


class Duration:
    """A difference of times; `nanoseconds` holds it exactly."""

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        self.nanoseconds = int(seconds * 1e9) + int(nanoseconds)

    def to_msg(self) -> Any:
        """Return a builtin_interfaces/Duration."""
        sec, nanosec = divmod(self.nanoseconds, 10**9)
        return message_class("builtin_interfaces/msg/Duration")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any) -> Duration:
        """Read a builtin_interfaces/Duration."""
        return cls(seconds=0, nanoseconds=msg.sec * 10**9 + msg.nanosec)

    def __eq__(self, other: object) -> bool:
        return self.nanoseconds == other.nanoseconds if isinstance(other, Duration) else NotImplemented

    def __lt__(self, other: Duration) -> bool:
        return self.nanoseconds < other.nanoseconds

    def __le__(self, other: Duration) -> bool:
        return self.nanoseconds <= other.nanoseconds

    def __gt__(self, other: Duration) -> bool:
        return self.nanoseconds > other.nanoseconds

    def __ge__(self, other: Duration) -> bool:
        return self.nanoseconds >= other.nanoseconds

    def __hash__(self) -> int:
        return hash(self.nanoseconds)

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self.nanoseconds})"


class Time:
    """A point in time; `nanoseconds` since the run began."""

    def __init__(
        self, *, seconds: float = 0, nanoseconds: int = 0, clock_type: ClockType = ClockType.SYSTEM_TIME
    ) -> None:
        self.nanoseconds = int(seconds * 1e9) + int(nanoseconds)
        self.clock_type = clock_type

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Return whole seconds and the rest."""
        return divmod(self.nanoseconds, 10**9)

    def to_msg(self) -> Any:
        """Return a builtin_interfaces/Time."""
        sec, nanosec = self.seconds_nanoseconds()
        return message_class("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> Time:
        """Read a builtin_interfaces/Time."""
        return cls(nanoseconds=msg.sec * 10**9 + msg.nanosec, clock_type=clock_type)

    def __add__(self, other: Duration) -> Time:
        return Time(nanoseconds=self.nanoseconds + other.nanoseconds, clock_type=self.clock_type)

    def __sub__(self, other: Time | Duration) -> Any:
        difference = self.nanoseconds - other.nanoseconds
        if isinstance(other, Duration):
            return Time(nanoseconds=difference, clock_type=self.clock_type)
        self._comparable(other)
        return Duration(nanoseconds=difference)

    def _comparable(self, other: Time) -> None:
        if self.clock_type != other.clock_type:
            raise TypeError("times of different clocks cannot be compared or subtracted")

    def __eq__(self, other: object) -> bool:
        return self.nanoseconds == other.nanoseconds if isinstance(other, Time) else NotImplemented

    def __lt__(self, other: Time) -> bool:
        self._comparable(other)
        return self.nanoseconds < other.nanoseconds

    def __le__(self, other: Time) -> bool:
        self._comparable(other)
        return self.nanoseconds <= other.nanoseconds

    def __gt__(self, other: Time) -> bool:
        self._comparable(other)
        return self.nanoseconds > other.nanoseconds

    def __ge__(self, other: Time) -> bool:
        self._comparable(other)
        return self.nanoseconds >= other.nanoseconds

    def __hash__(self) -> int:
        return hash(self.nanoseconds)

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self.nanoseconds}, clock_type={self.clock_type.name})"


class Clock(Offered):
    """Tells the arena's time."""

    _not_offered = ("create_jump_callback", "sleep_until", "ros_time_is_active", "set_ros_time_override", "handle")

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = clock_type

    def now(self) -> Time:
        """Return the time."""
        return Time(nanoseconds=round(current().world.time * 1e9), clock_type=self.clock_type)

    def sleep_for(self, rel_time: Duration) -> bool:
        """Let time pass."""
        current().world.sleep(rel_time.nanoseconds * 1e-9)
        return True


class Timer(Offered):
    """Calls back again and again; after a blocked while, the calls that were missed are left out, as in ROS."""

    _not_offered = ("time_since_last_call", "time_until_next_call", "clock", "handle", "callback_group")

    def __init__(self, period_s: float, callback: Callable[[], Any], autostart: bool = True) -> None:
        self.callback = callback
        self.timer_period_ns = int(period_s * 1e9)
        self._period = max(period_s, 0.0)
        self._cancelled = not autostart
        self._due = current().world.time + self._period

    def is_ready(self) -> bool:
        """Whether the call is due."""
        return not self._cancelled and current().world.time >= self._due - 1e-9

    def take(self) -> None:
        """Set the next call."""
        now = current().world.time
        self._due += self._period
        if self._period > 0:
            while self._due <= now - 1e-9:
                self._due += self._period
        else:
            # A period of nothing calls at every step.
            self._due = now + 1e-6

    def cancel(self) -> None:
        """Call no more."""
        self._cancelled = True

    def reset(self) -> None:
        """Begin the period again, also after `cancel`."""
        self._cancelled = False
        self._due = current().world.time + self._period

    def is_canceled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def destroy(self) -> None:
        """Call no more."""
        self.cancel()
