"""The run a script belongs to: nodes hand it down to all they make."""

from __future__ import annotations

import sys
from typing import Any

from limo_hog.ros2.arguments import RosArguments, parse_ros_arguments
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.world import World


class Context:
    """The state that `rclpy.init` makes and `rclpy.shutdown` ends."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.is_initialized = False
        self.arguments = RosArguments()
        #: The executor of `rclpy.spin` without one.
        self.executor: Any = None

    @property
    def world(self) -> World:
        """The run, for the script's own threads.

        Raises `StubError` in a thread that the script did not start with `threading.Thread`.
        """
        if self._world.turns.seat() is None:
            raise StubError(
                "limo-hog run offers rclpy in the main thread and in those of threading.Thread, not in a pool's"
            )
        return self._world

    def init(self, args: list[str] | None) -> None:
        """Begin, with the command line's arguments unless others are given."""
        if self.is_initialized:
            raise RuntimeError("rclpy.init() has been called before, without rclpy.shutdown()")
        self.arguments = parse_ros_arguments(sys.argv if args is None else list(args))
        self.is_initialized = True

    def shutdown(self) -> None:
        """End; raises `RuntimeError` if it has not begun, or has ended."""
        if not self.is_initialized:
            raise RuntimeError("rclpy.shutdown() has been called before, or rclpy.init() was not")
        self.is_initialized = False
        self.executor = None

    def ok(self) -> bool:
        """Whether nodes may go on."""
        return self.is_initialized and not self.world.over


#: As in rclpy, the context of calls that name none, such as `rclpy.ok()`; None outside a run.
_default: Context | None = None


def enter(context: Context) -> None:
    """Set the default context when a run begins."""
    global _default
    _default = context


def default_context() -> Context:
    """Return the default context, for what a script calls without a node; raises `StubError` outside a run."""
    if _default is None:
        raise StubError("this rclpy works inside `limo-hog run` alone")
    return _default
