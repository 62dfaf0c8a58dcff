"""Executors: they advance the arena until a callback is due, and call one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from limo_sim.ros.lockstep.world import StubError
from limo_sim.ros.rclpy_stub.context import Context, current
from limo_sim.ros.rclpy_stub.node import Node


class ExternalShutdownException(Exception):  # noqa: N818 — rclpy's name
    """The context was shut down during a wait."""


class Executor:
    """Runs the callbacks of its nodes: timers first, then subscriptions, in the order they were made."""

    def __init__(self, num_threads: int | None = None, *, context: Any = None) -> None:  # noqa: ARG002
        self._nodes: list[Node] = []
        self._is_shutdown = False

    def add_node(self, node: Node) -> bool:
        """Add a node; False if it was added before."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        return True

    def remove_node(self, node: Node) -> None:
        """Remove a node."""
        if node in self._nodes:
            self._nodes.remove(node)

    def get_nodes(self) -> list[Node]:
        """Return the nodes."""
        return list(self._nodes)

    def shutdown(self, timeout_sec: float | None = None) -> bool:  # noqa: ARG002 — rclpy's signature
        """End `spin`."""
        self._is_shutdown = True
        return True

    def spin(self) -> None:
        """Run callbacks until the run is over or `rclpy.shutdown` was called."""
        context = current()
        while context.ok() and not self._is_shutdown:
            self._wait(context, math.inf)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for it no longer than `timeout_sec` of the arena's time.

        A poll that finds nothing to do lets one step of the arena pass, else a polling loop would stand still.
        """
        context = current()
        if not context.ok():
            raise ExternalShutdownException("rclpy was shut down, or the run is over")
        self._wait(context, math.inf if timeout_sec is None or timeout_sec < 0 else timeout_sec)

    def spin_until_future_complete(self, *_: Any, **__: Any) -> None:
        """Refuse: services and actions are not offered."""
        raise StubError("limo-hog run does not offer spin_until_future_complete")

    def _wait(self, context: Context, timeout: float) -> None:
        world = context.world
        world.calls.spun = True
        deadline = world.time + timeout
        waited = False
        while not world.over:
            callback, arguments = self._next()
            if callback is not None:
                world.call(callback, *arguments)
                return
            if waited and world.time >= deadline - 1e-9:
                return
            world.advance()
            waited = True

    def _next(self) -> tuple[Callable[..., Any] | None, tuple[Any, ...]]:
        for node in self._nodes:
            for timer in node.timers:
                if timer.is_ready():
                    timer.take()
                    return timer.callback, ()
        for node in self._nodes:
            for subscription in node.subscriptions:
                if subscription.is_ready():
                    return subscription.callback, (subscription.take(),)
        return None, ()


class SingleThreadedExecutor(Executor):
    """One callback at a time."""


class MultiThreadedExecutor(Executor):
    """One callback at a time here, too: lock step has no threads."""


def spin(node: Node, executor: Executor | None = None) -> None:
    """Run a node's callbacks until the run is over."""
    executor = executor or SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


def spin_once(node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None) -> None:
    """Run one callback of a node."""
    executor = executor or SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin_once(timeout_sec=timeout_sec)
