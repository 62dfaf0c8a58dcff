"""Times, durations, clocks and timers; a run's time begins at 0 and moves in steps of 20 ms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import total_ordering
from typing import Any

from limo_sim.ros.interfaces import message_class
from limo_sim.ros.lockstep.calls import UNHEARD_AFTER
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.context import default_context
from limo_sim.ros.rclpy_stub.groups import CallbackGroup
from limo_sim.ros.rclpy_stub.partial import PartialApi


class ClockType(IntEnum):
    """Kinds of clocks; all of them show the arena's time here."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


@dataclass(init=False, order=True, unsafe_hash=True)
class Duration(PartialApi, missing=("get_c_duration",)):
    """A difference of times; `nanoseconds` holds it exactly."""

    nanoseconds: int

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

    def __str__(self) -> str:
        return f"{self.nanoseconds} nanoseconds"


@total_ordering
class Time:
    """A point in time; `nanoseconds` since the run began."""

    def __init__(
        self, *, seconds: float = 0, nanoseconds: int = 0, clock_type: ClockType = ClockType.SYSTEM_TIME
    ) -> None:
        self.nanoseconds = int(seconds * 1e9) + int(nanoseconds)
        if self.nanoseconds < 0:
            raise ValueError(f"a time is not negative, came {self.nanoseconds} ns")
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
        if not isinstance(other, Duration):
            return NotImplemented
        return Time(nanoseconds=self.nanoseconds + other.nanoseconds, clock_type=self.clock_type)

    def __sub__(self, other: Time | Duration) -> Any:
        difference = self.nanoseconds - other.nanoseconds
        if isinstance(other, Duration):
            return Time(nanoseconds=difference, clock_type=self.clock_type)
        self._comparable(other)
        return Duration(nanoseconds=difference)

    def _comparable(self, other: Time) -> int:
        if self.clock_type != other.clock_type:
            raise TypeError("times of different clocks cannot be compared or subtracted")
        return other.nanoseconds

    def __eq__(self, other: object) -> bool:
        return self.nanoseconds == self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __lt__(self, other: Time) -> bool:
        return self.nanoseconds < self._comparable(other) if isinstance(other, Time) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.nanoseconds)

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self.nanoseconds}, clock_type={self.clock_type.name})"


class Clock(PartialApi, missing=("create_jump_callback", "ros_time_is_active", "set_ros_time_override", "handle")):
    """Tells the arena's time."""

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = clock_type
        self._context = default_context()

    def now(self) -> Time:
        """Return the time."""
        return Time(nanoseconds=round(self._context.world.time * 1e9), clock_type=self.clock_type)

    def sleep_for(self, rel_time: Duration, context: Any = None) -> bool:  # noqa: ARG002 — rclpy's signature
        """Let time pass."""
        self._context.world.turns.sleep(rel_time.nanoseconds * 1e-9)
        return True

    def sleep_until(self, until: Time, context: Any = None) -> bool:  # noqa: ARG002 — rclpy's signature
        """Let time pass until a point in time."""
        world = self._context.world
        world.turns.sleep(until.nanoseconds * 1e-9 - world.time)
        return True


class Timer(PartialApi, missing=("handle",)):
    """Calls back again and again; after a blocked while, the calls that were missed are left out, as in ROS."""

    def __init__(
        self,
        callback: Callable[[], Any],
        callback_group: CallbackGroup | None,
        timer_period_ns: int,
        clock: Clock,
        *,
        context: Any = None,
        autostart: bool = True,
    ) -> None:
        self.callback, self.callback_group, self.clock = callback, callback_group, clock
        self.timer_period_ns = timer_period_ns
        self._period = max(timer_period_ns * 1e-9, 0.0)
        self._world = (context or default_context()).world
        self._called = self._world.time
        #: When the next call is due [s]; infinite where it is cancelled.
        self.due = self._world.time + self._period if autostart else math.inf

    def is_ready(self) -> bool:
        """Whether the call is due."""
        return self._world.time >= self.due - 1e-9

    def take(self) -> Callable[[], Any]:
        """Set the next call and return this one."""
        now = self._called = self._world.time
        self.due += self._period
        if self._period > 0:
            while self.due <= now - 1e-9:
                self.due += self._period
        else:
            # A period of nothing calls at every step.
            self.due = now + 1e-6
        return self.callback

    def cancel(self) -> None:
        """Call no more."""
        self.due = math.inf

    def reset(self) -> None:
        """Begin the period again, also after `cancel`."""
        self.due = self._world.time + self._period

    def is_canceled(self) -> bool:
        """Whether it was cancelled."""
        return math.isinf(self.due)

    def time_since_last_call(self) -> int:
        """Return the time since the last call, or since the start [ns]."""
        return round((self._world.time - self._called) * 1e9)

    def time_until_next_call(self) -> int | None:
        """Return the time until the next call [ns]; None where it is cancelled."""
        return None if self.is_canceled() else round((self.due - self._world.time) * 1e9)

    def destroy(self) -> None:
        """Call no more."""
        self.cancel()


class Rate:
    """Sleeps until the next period of a timer, which an executor in another thread must run, as in ROS."""

    def __init__(self, timer: Timer, *, context: Any = None) -> None:
        self._timer, self._context = timer, context or default_context()
        self._calls = 0
        timer.callback = self._call

    def _call(self) -> None:
        self._calls += 1

    def sleep(self) -> None:
        """Wait for the next period; raises `StubError` if nothing spins the node, where ROS would wait for ever."""
        world, before = self._context.world, self._calls
        patience = 2 * self._timer.timer_period_ns * 1e-9 + UNHEARD_AFTER
        if not world.turns.wait(lambda: self._calls != before, world.time + patience):
            raise StubError(
                f"Rate.sleep() has waited for {patience:g} s: its timer runs while the node spins. Spin it in another "
                "thread, threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start(), or use a timer"
            )

    def destroy(self) -> None:
        """End the rate."""
        self._timer.destroy()
