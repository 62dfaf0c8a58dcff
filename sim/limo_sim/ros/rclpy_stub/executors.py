"""Executors: they run what is due node by node, timers first, then subscriptions, answers and requests, as made."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from limo_sim.ros.lockstep.turns import ExternalShutdownException, at_once
from limo_sim.ros.rclpy_stub.context import default_context
from limo_sim.ros.rclpy_stub.future import Future, Task
from limo_sim.ros.rclpy_stub.groups import CallbackGroup
from limo_sim.ros.rclpy_stub.node import Node
from limo_sim.ros.rclpy_stub.partial import PartialApi

#: Threads of a MultiThreadedExecutor without a number. In ROS as many as the computer has processors; here always the
#: same, since a run must not depend on the computer. Chosen: a workshop's laptop has four.
_THREADS = 4
#: Names of rclpy's `Executor` that are not offered.
_MISSING = tuple(
    "wait_for_ready_callbacks spin_once_until_future_complete can_execute create_timer add_to_context "
    "guard_condition create_future".split()
)


def _may_run(entity: Any) -> bool:
    return bool(entity.is_ready() and entity.callback_group.can_execute(entity))


def _ended(future: Future) -> bool:
    return future.done() or future.cancelled()


async def _holding(group: CallbackGroup, coroutine: Any) -> None:
    try:
        await coroutine
    finally:
        group.running -= 1


class Executor(PartialApi, missing=_MISSING):
    """Runs the callbacks of its nodes, one at a time."""

    def __init__(self, *, context: Any = None) -> None:
        self.context = context or default_context()
        self._nodes: list[Node] = []
        self._tasks: list[Task] = []
        self._is_shutdown = self._spins = False
        #: What is due: timers, subscriptions, clients, services and tasks.
        self._round: list[Any] = []
        #: What a callback in a thread has raised.
        self._failure: BaseException | None = None

    def add_node(self, node: Node) -> bool:
        """Add a node, which leaves the executor it had; False if it was added before."""
        if node in self._nodes:
            return False
        if node.executor is not None:
            node.executor.remove_node(node)
        self._nodes.append(node)
        node.executor = self
        return True

    def remove_node(self, node: Node) -> None:
        """Remove a node."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.executor = None

    def get_nodes(self) -> list[Node]:
        """Return the nodes."""
        return list(self._nodes)

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Run a function or a coroutine while the executor spins; the task gets its result."""
        task = Task(callback, args, kwargs, executor=self)
        self._tasks.append(task)
        return task

    def shutdown(self, timeout_sec: float | None = None, *, wait_for_threads: bool = True) -> bool:  # noqa: ARG002 — rclpy's signature
        """End `spin`."""
        self._is_shutdown = True
        return True

    def wake(self) -> None:
        """Look again for what is due; this happens by itself here."""

    def spin(self) -> None:
        """Run callbacks until the run is over or `rclpy.shutdown` was called."""
        while self.context.ok() and not self._is_shutdown:
            self._once(math.inf)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for it no longer than `timeout_sec` of the arena's time.

        A poll that finds nothing to do lets one step of the arena pass, else a polling loop would stand still.
        """
        if not self.context.ok():
            raise ExternalShutdownException("rclpy was shut down, or the run is over")
        self._once(math.inf if timeout_sec is None or timeout_sec < 0 else timeout_sec)

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until a future is done, or simulated time is up."""
        world = self.context.world
        until = math.inf if timeout_sec is None or timeout_sec < 0 else world.time + timeout_sec
        while self.context.ok() and not self._is_shutdown and not _ended(future) and world.time < until - 1e-9:
            self._once(until - world.time, lambda: _ended(future))

    def _once(self, timeout: float, enough: Callable[[], bool] = lambda: False) -> None:
        """Wait for something that is due, and run it."""
        context, world = self.context, self.context.world
        world.once("spun")
        if self._spins:
            raise RuntimeError(
                "Executor is already spinning: a callback of it, or another thread, spins it again; in a callback, "
                "use add_done_callback or await the future"
            )
        self._spins = True
        try:
            polls, before = False, world.advances

            def wanted() -> bool:
                ended = world.over or not context.is_initialized or self._is_shutdown or self._failure is not None
                return ended or bool(self._ready()) or (polls and world.advances > before) or enough()

            polls = timeout <= 0 and not wanted()
            until, wakes = (math.inf, at_once) if polls else (world.time + timeout, self._wakes)
            world.turns.wait(wanted, until, wakes)
            if self._failure is not None:
                raise self._failure
            due = None if world.over else self._next()
            if due is not None:
                self._run(due.callback_group, due.take())
        finally:
            self._spins = False

    def _run(self, group: CallbackGroup, work: Callable[[], Any]) -> None:
        """Run a callback; one written as a coroutine becomes a task, which holds its group to the end, as in ROS."""
        made, world = None, self.context.world
        group.running += 1
        try:
            made = world.call(work)
        finally:
            if not hasattr(made, "send"):
                group.running -= 1
        if hasattr(made, "send"):
            world.call(self.create_task(_holding(group, made)).take())

    def _ready(self) -> list[Any]:
        """Return what may run now: tasks first, the newest of them before the others."""
        due: list[Any] = []
        if self._tasks:
            self._tasks = [task for task in self._tasks if not _ended(task)]
            due += [task for task in reversed(self._tasks) if task.is_ready()]
        return due + [entity for node in self._nodes for entity in node.entities if _may_run(entity)]

    def _wakes(self) -> float:
        """Return when the next timer is due [s]."""
        return min((timer.due for node in self._nodes for timer in node.timers), default=math.inf)

    def _next(self) -> Any:
        """Return what runs next: as in ROS, what is due together runs once each before any of it runs again."""
        for _ in range(2):
            while self._round:
                entity = self._round.pop(0)
                if _may_run(entity):
                    entity.executor = self
                    return entity
            self._round = self._ready()
        return None


class SingleThreadedExecutor(Executor):
    """One callback at a time, in the thread that spins."""


class MultiThreadedExecutor(Executor):
    """Each callback in a thread of its own: where one waits, others go on, as their groups allow."""

    def __init__(self, num_threads: int | None = None, *, context: Any = None) -> None:
        super().__init__(context=context)
        self._threads = num_threads or _THREADS
        self._running = 0

    def _ready(self) -> list[Any]:
        return super()._ready() if self._running < self._threads else []

    def _run(self, group: CallbackGroup, work: Callable[[], Any]) -> None:
        self._running += 1
        group.running += 1  # before the thread has its first turn

        def run() -> None:
            try:
                group.running -= 1
                super(MultiThreadedExecutor, self)._run(group, work)
            except Exception as error:
                self._failure = error
            finally:
                self._running -= 1

        threading.Thread(target=run, daemon=True).start()


def global_executor() -> Executor:
    """Return the executor of `rclpy.spin` without one: one for each context."""
    executor: Executor = default_context().executor or SingleThreadedExecutor()
    default_context().executor = executor
    return executor


@contextmanager
def _serving(node: Node, executor: Executor | None) -> Iterator[Executor]:
    executor = executor or global_executor()
    executor.add_node(node)
    try:
        yield executor
    finally:
        executor.remove_node(node)


def spin(node: Node, executor: Executor | None = None) -> None:
    """Run a node's callbacks until the run is over."""
    with _serving(node, executor) as serving:
        serving.spin()


def spin_once(node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None) -> None:
    """Run one callback of a node."""
    with _serving(node, executor) as serving:
        serving.spin_once(timeout_sec=timeout_sec)


def spin_until_future_complete(
    node: Node, future: Future, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Run a node's callbacks until a future is done, or simulated time is up."""
    with _serving(node, executor) as serving:
        serving.spin_until_future_complete(future, timeout_sec)
