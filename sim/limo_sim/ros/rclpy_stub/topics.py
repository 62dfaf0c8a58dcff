"""Publishers and subscriptions."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from limo_hog.ros2 import names
from limo_sim.ros.interfaces import Message
from limo_sim.ros.lockstep.calls import PUBLISHED
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.context import Context
from limo_sim.ros.rclpy_stub.groups import CallbackGroup
from limo_sim.ros.rclpy_stub.partial import PartialApi
from limo_sim.ros.rclpy_stub.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: ROS 2's warning of a publisher and a subscription that do not match.
_UNMATCHED = (
    "New {} discovered on topic '{}', {} incompatible QoS. No messages will be {} it. Last incompatible policy: {}"
)


class InvalidHandle(Exception):  # noqa: N818 — rclpy's name
    """Something is used that was destroyed."""


class Publisher(
    PartialApi, missing=("assert_liveliness", "wait_for_all_acked", "handle", "event_handlers", "logger_name")
):
    """Sends messages of one type to one topic."""

    def __init__(self, msg_type: type[Message], topic: str, qos: QoSProfile, context: Context) -> None:
        self._context = context
        self.msg_type = msg_type
        self.topic_name = self.topic = topic
        self.qos_profile = qos
        self._kept: deque[Message] | None = None
        self._destroyed = False
        world = context.world
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self._kept = deque(maxlen=max(qos.depth, 1))
            world.kept.append((topic, self._kept))
        world.called("writers", topic)
        self._reliable = qos.reliability != ReliabilityPolicy.BEST_EFFORT
        if topic == names.COMMAND and not self._reliable:
            world.called("unmatched", _UNMATCHED.format("subscription", topic, "requesting", "sent to", "RELIABILITY"))
        world.writers.append(topic)

    def publish(self, msg: Message) -> None:
        """Send a message.

        Raises `TypeError` if it is of another type; `InvalidHandle` if the publisher was destroyed; `StubError` if it
        is a command that is not a number.
        """
        if not isinstance(msg, self.msg_type):
            raise TypeError(
                f"{self.topic} carries {self.msg_type.__name__}, came {type(msg).__name__}: "
                f"publish a {self.msg_type.__name__}"
            )
        if self._destroyed:
            raise InvalidHandle(f"the publisher of {self.topic} was destroyed")
        if self._kept is not None:
            self._kept.append(copy.deepcopy(msg))
        self._context.world.publish(self.topic, msg, reliable=self._reliable, kept=self._kept is not None)

    def get_subscription_count(self) -> int:
        """Return the number of subscriptions; the robot is one to /cmd_vel."""
        world = self._context.world
        return [reader.topic for reader in world.readers].count(self.topic) + (self.topic == names.COMMAND)

    def destroy(self) -> None:
        """End the publisher."""
        self._destroyed = True
        world = self._context.world
        world.kept = [one for one in world.kept if one[1] is not self._kept]
        if self.topic in world.writers:
            world.writers.remove(self.topic)


_CONTENT_FILTER = ("is_cft_enabled", "set_content_filter", "get_content_filter")


class Subscription(
    PartialApi, missing=("handle", "event_handlers", "raw", "logger_name", "CallbackType", *_CONTENT_FILTER)
):
    """Calls back with each message of a topic; the newest `depth` wait for a slow callback."""

    def __init__(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[[Any], Any],
        qos: QoSProfile,
        callback_group: CallbackGroup,
        context: Context,
    ) -> None:
        self._context = context
        self.msg_type = msg_type
        self.topic_name = self.topic = topic
        self.callback, self.callback_group = callback, callback_group
        self.qos_profile = qos
        keep_all = qos.history == HistoryPolicy.KEEP_ALL
        self._queue: deque[Message] = deque(maxlen=None if keep_all else max(qos.depth, 1))
        # As in ROS, a transient-local subscription gets no message from a volatile publisher.
        volatile = topic in names.TYPES and topic != names.TF_STATIC
        #: Whether it is given what was published before it, and whether it asks for reliable delivery.
        self.keeps = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.reliable = qos.reliability not in (ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.BEST_AVAILABLE)
        self._deaf = self.keeps and volatile
        if self._deaf and topic in PUBLISHED:
            warning = _UNMATCHED.format("publisher", topic, "offering", "received from", "DURABILITY")
            context.world.called("unmatched", warning)

    def offer(self, message: Message) -> None:
        """Queue a message, which is the subscription's own; the oldest gives way."""
        if not self._deaf:
            self._queue.append(message)

    def is_ready(self) -> bool:
        """Whether a message waits."""
        return bool(self._queue)

    def take(self) -> Callable[[], Any]:
        """Return the work of giving the oldest message to the callback."""
        message: Any = self._queue.popleft()
        if self.topic in (names.IMAGE, names.IMAGE_COMPRESSED):
            self._context.world.once("given")
        return partial(self.callback, message)

    def get_publisher_count(self) -> int:
        """Return how many publish on the topic, the arena being one."""
        return publishers_of(self.topic, self._context)

    def destroy(self) -> None:
        """End the subscription."""
        world = self._context.world
        if self in world.readers:
            world.readers.remove(self)


def publishers_of(topic: str, context: Context) -> int:
    """Return how many publish on a topic, the arena being one."""
    return context.world.writers.count(topic) + (topic in PUBLISHED)


def check_type(msg_type: Any) -> None:
    """Refuse what is no message type."""
    if not (isinstance(msg_type, type) and issubclass(msg_type, Message)):
        raise TypeError(f"want a message type such as geometry_msgs.msg.Twist, came {msg_type!r}")


def check_topic(topic: str, msg_type: type[Message]) -> None:
    """Refuse another type than that of the arena's topic; a command may have a stamp."""
    wanted = names.TYPES.get(topic)
    stamped = topic == names.COMMAND and msg_type._type_name == names.STAMPED_COMMAND_TYPE
    if wanted is not None and wanted != msg_type._type_name and not stamped:
        raise StubError(f"{topic} carries {wanted}, the script uses {msg_type._type_name}")
