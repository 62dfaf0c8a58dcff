"""Loggers: one line with its level, to wherever the run sends it."""

from __future__ import annotations

import inspect
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

    def debug(self, message: object, **options: Any) -> bool:
        """Log a line of level DEBUG."""
        return self._say(LoggingSeverity.DEBUG, message, **options)

    def info(self, message: object, **options: Any) -> bool:
        """Log a line of level INFO."""
        return self._say(LoggingSeverity.INFO, message, **options)

    def warning(self, message: object, **options: Any) -> bool:
        """Say that something is odd."""
        return self._say(LoggingSeverity.WARN, message, **options)

    warn = warning

    def error(self, message: object, **options: Any) -> bool:
        """Say that something went wrong."""
        return self._say(LoggingSeverity.ERROR, message, **options)

    def fatal(self, message: object, **options: Any) -> bool:
        """Say that nothing works any more."""
        return self._say(LoggingSeverity.FATAL, message, **options)

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


def get_logger(name: str) -> Logger:
    """Return a logger."""
    return Logger(name, default_context())


def set_logger_level(name: str, level: LoggingSeverity, detailed_error: bool = False) -> None:  # noqa: ARG001
    """Suppress the lines of a logger below a level."""
    get_logger(name).set_level(level)
