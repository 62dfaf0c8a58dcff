"""The run a script belongs to."""

from __future__ import annotations

import sys
from typing import Any

from limo_hog.ros2.arguments import RosArguments, parse_ros_arguments
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.world import World


class Context:
    """The state that `rclpy.init` makes and `rclpy.shutdown` ends."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.is_initialized = False
        self.arguments = RosArguments()
        #: The executor of `rclpy.spin` without one.
        self.executor: Any = None

    def init(self, args: list[str] | None) -> None:
        """Begin, with the command line's arguments unless others are given."""
        if self.is_initialized:
            raise RuntimeError("rclpy.init() has been called before, without rclpy.shutdown()")
        self.arguments = parse_ros_arguments(sys.argv if args is None else list(args))
        self.is_initialized = True

    def shutdown(self) -> None:
        """End.

        Raises
        ------
        RuntimeError
            If it has not begun, or has ended.
        """
        if not self.is_initialized:
            raise RuntimeError("rclpy.shutdown() has been called before, or rclpy.init() was not")
        self.is_initialized = False
        self.executor = None

    def ok(self) -> bool:
        """Whether nodes may go on."""
        return self.is_initialized and not self.world.over


_world: World | None = None


def enter(world: World | None) -> None:
    """Set the run that scripts belong to; None when it is over."""
    global _world
    _world = world


def current() -> Context:
    """Return the context of the program that calls.

    Raises
    ------
    StubError
        Outside a run, or in a thread that the script did not start with `threading.Thread`.
    """
    if _world is None:
        raise StubError("this rclpy works inside `limo-hog run` alone")
    seat = _world.turns.seat()
    if seat is None:
        raise StubError(
            "limo-hog run offers rclpy in the main thread and in those of threading.Thread, not in a pool's"
        )
    context: Context = seat.owner
    return context
