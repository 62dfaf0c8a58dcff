"""Loggers: one line with its level, to wherever the run sends it."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from enum import IntEnum
from typing import Any

from limo_sim.ros.rclpy_stub.context import Context, default_context
from limo_sim.ros.rclpy_stub.partial import PartialApi


class LoggingSeverity(IntEnum):
    """Levels, the lowest first."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


_levels: dict[str, LoggingSeverity] = {}


def _speaker(level: LoggingSeverity) -> Callable[..., bool]:
    def speak(logger: Logger, message: object, **options: Any) -> bool:
        return logger._say(level, message, **options)

    speak.__qualname__ = f"Logger.{level.name.lower()}"  # as Python's own errors show it
    return speak


class Logger(PartialApi, missing=("log", "is_enabled_for", "get_logger_name")):
    """Speaks under a name."""

    def __init__(self, name: str, context: Context) -> None:
        self.name, self._context = name, context
        self._said: dict[tuple[str, int] | None, float] = {}

    def get_child(self, name: str) -> Logger:
        """Return a logger below this one."""
        return Logger(f"{self.name}.{name}", self._context)

    def set_level(self, level: LoggingSeverity) -> None:
        """Leave out what is below a level."""
        _levels[self.name] = LoggingSeverity(level)

    def get_effective_level(self) -> LoggingSeverity:
        """Return the level from which lines are shown."""
        return _levels.get(self.name, LoggingSeverity.INFO)

    def _say(
        self,
        level: LoggingSeverity,
        message: object,
        *,
        throttle_duration_sec: float = 0.0,
        once: bool = False,
        skip_first: bool = False,
        **_: Any,
    ) -> bool:
        if level < self.get_effective_level():
            return False
        world = self._context.world
        # A place in the script is throttled by itself, as in ROS.
        here = inspect.currentframe()
        caller = here and here.f_back and here.f_back.f_back
        place = caller and (caller.f_code.co_filename, caller.f_lineno)
        last = self._said.get(place)
        if throttle_duration_sec or once or skip_first:
            if last is not None and (once or world.time - last < throttle_duration_sec):
                return False
            self._said[place] = world.time
            if skip_first and last is None:
                return False
        world.link.tell("log", level.name, self.name, str(message))
        return True

    debug = _speaker(LoggingSeverity.DEBUG)
    info = _speaker(LoggingSeverity.INFO)
    warning = warn = _speaker(LoggingSeverity.WARN)
    error = _speaker(LoggingSeverity.ERROR)
    fatal = _speaker(LoggingSeverity.FATAL)


def get_logger(name: str) -> Logger:
    """Return a logger."""
    return Logger(name, default_context())


def set_logger_level(name: str, level: LoggingSeverity, detailed_error: bool = False) -> None:  # noqa: ARG001
    """Suppress the lines of a logger below a level."""
    get_logger(name).set_level(level)
