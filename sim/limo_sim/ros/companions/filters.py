"""message_filters: messages of several topics, put together by their stamps."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

from limo_sim.ros.interfaces import Message
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.node import Node
from limo_sim.ros.rclpy_stub.qos import QoSProfile


class SimpleFilter:
    """Something that hands messages on."""

    def __init__(self) -> None:
        self.callbacks: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

    def registerCallback(self, cb: Callable[..., Any], *args: Any) -> int:  # noqa: N802 — ROS's name
        """Call back with what comes, and with `args` after it."""
        self.callbacks.append((cb, args))
        return len(self.callbacks) - 1

    def signalMessage(self, *msg: Any) -> None:  # noqa: N802 — ROS's name
        """Hand on."""
        for callback, arguments in self.callbacks:
            callback(*msg, *arguments)


class Subscriber(SimpleFilter):
    """A subscription as a filter."""

    def __init__(
        self, node: Node, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int = 10, **_: Any
    ) -> None:
        super().__init__()
        self.topic = topic
        self.sub = node.create_subscription(msg_type, topic, self.signalMessage, qos_profile)

    def getTopic(self) -> str:  # noqa: N802 — ROS's name
        """Return the topic."""
        return self.topic


class ApproximateTimeSynchronizer(SimpleFilter):
    """Hands on one message of each input when their stamps differ by no more than `slop` [s]; each is used once."""

    def __init__(
        self, fs: Sequence[SimpleFilter], queue_size: int, slop: float, allow_headerless: bool = False
    ) -> None:
        super().__init__()
        if allow_headerless:
            raise StubError("limo-hog run does not offer allow_headerless=True: messages are paired by their stamps")
        self._slop_ns = round(slop * 1e9)
        self._queue_size = queue_size
        self._queues: list[dict[int, Any]] = [{} for _ in fs]
        for index, source in enumerate(fs):
            source.registerCallback(self._add, index)

    def _add(self, message: Any, index: int) -> None:
        stamp = message.header.stamp
        nanoseconds = stamp.sec * 10**9 + stamp.nanosec
        queue = self._queues[index]
        queue[nanoseconds] = message
        while len(queue) > self._queue_size:
            del queue[min(queue)]
        if not all(self._queues):
            return
        # The nearest stamp of each other input makes the tightest set with this message.
        chosen = [
            nanoseconds if candidates is queue else min(candidates, key=lambda at: (abs(at - nanoseconds), at))
            for candidates in self._queues
        ]
        if max(abs(a - b) for a, b in itertools.product(chosen, chosen)) > self._slop_ns:
            return
        self.signalMessage(*(queue.pop(at) for queue, at in zip(self._queues, chosen, strict=True)))


class TimeSynchronizer(ApproximateTimeSynchronizer):
    """Hands on messages whose stamps are equal."""

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        super().__init__(fs, queue_size, 0.0)
