"""Nodes, and what they publish and subscribe to."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from limo_hog.ros2 import names
from limo_sim.ros.interfaces import Message
from limo_sim.ros.lockstep.world import StubError
from limo_sim.ros.rclpy_stub.clock import Clock, ClockType, Timer
from limo_sim.ros.rclpy_stub.context import current
from limo_sim.ros.rclpy_stub.logger import Logger
from limo_sim.ros.rclpy_stub.offered import Offered
from limo_sim.ros.rclpy_stub.parameters import Parameter, Parameters, SetParametersResult
from limo_sim.ros.rclpy_stub.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, to_profile


class NotInitializedException(Exception):  # noqa: N818 — rclpy's name
    """A node was made before `rclpy.init`."""


class CallbackGroup:
    """A label for callbacks: they are run one after the other in any case."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Callbacks of which one runs at a time."""


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks that may run at once; here they do not."""


class Publisher(Offered):
    """Sends messages of one type to one topic."""

    _not_offered = ("assert_liveliness", "wait_for_all_acked", "handle", "event_handlers", "logger_name")

    def __init__(self, msg_type: type[Message], topic: str, qos: QoSProfile) -> None:
        self.msg_type = msg_type
        self.topic_name = self.topic = topic
        self.qos_profile = qos

    def publish(self, msg: Message) -> None:
        """Send a message.

        Raises
        ------
        TypeError
            If it is of another type.
        StubError
            If it is a command that is not a number.
        """
        if not isinstance(msg, self.msg_type):
            raise TypeError(
                f"{self.topic} carries {self.msg_type.__name__}, came {type(msg).__name__}: "
                f"publish a {self.msg_type.__name__}"
            )
        current().world.publish(self.topic, msg)

    def get_subscription_count(self) -> int:
        """Return the number of subscriptions; the robot is one to /cmd_vel."""
        world = current().world
        return sum(reader.topic == self.topic for reader in world.readers) + (self.topic == names.COMMAND)

    def destroy(self) -> None:
        """Nothing is kept open."""


class Subscription(Offered):
    """Calls back with each message of a topic; the newest `depth` wait for a slow callback."""

    _not_offered = ("get_publisher_count", "handle", "event_handlers", "callback_group", "raw", "logger_name")

    def __init__(self, msg_type: type[Message], topic: str, callback: Callable[[Any], Any], qos: QoSProfile) -> None:
        self.msg_type = msg_type
        self.topic_name = self.topic = topic
        self.callback = callback
        self.qos_profile = qos
        keep_all = qos.history == HistoryPolicy.KEEP_ALL
        self._queue: deque[Message] = deque(maxlen=None if keep_all else max(qos.depth, 1))
        # As in ROS, a transient-local subscription gets no message from a volatile publisher.
        self._deaf = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL and topic in names.TYPES

    def offer(self, message: Message) -> None:
        """Queue a message; the oldest gives way."""
        if not self._deaf:
            self._queue.append(message)

    def is_ready(self) -> bool:
        """Whether a message waits."""
        return bool(self._queue)

    def take(self) -> Message:
        """Return the oldest message that waits."""
        if self.topic in (names.IMAGE, names.IMAGE_COMPRESSED):
            current().world.calls.images += 1
        return self._queue.popleft()

    def destroy(self) -> None:
        """End the subscription."""
        world = current().world
        if self in world.readers:
            world.readers.remove(self)


#: Options of rclpy's Node that change nothing here.
_WITHOUT_EFFECT = (
    *("context", "enable_rosout", "rosout_qos_profile", "start_parameter_services", "enable_logger_service"),
)


class Node(Offered):
    """What a script derives its node from."""

    _not_offered = (
        *("create_client", "create_service", "create_rate", "create_guard_condition", "executor", "handle", "context"),
        *("waitables", "services", "clients", "guards", "add_waitable", "destroy_client", "destroy_service"),
        *("get_node_names", "get_service_names_and_types", "get_publishers_info_by_topic"),
        *("get_subscriptions_info_by_topic", "describe_parameter", "list_parameters", "undeclare_parameter"),
        *("set_parameters_atomically", "get_parameters_by_prefix", "wait_for_node"),
    )

    def __init__(
        self,
        node_name: str,
        *,
        namespace: str | None = None,
        parameter_overrides: list[Parameter] | None = None,
        cli_args: list[str] | None = None,
        use_global_arguments: bool = True,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        **options: Any,
    ) -> None:
        unknown = ", ".join(repr(name) for name in options if name not in _WITHOUT_EFFECT)
        if unknown:
            raise TypeError(f"rclpy's Node has no option {unknown}")
        context = current()
        if not context.is_initialized:
            raise NotInitializedException("rclpy.init() has not been called")
        if cli_args is not None:
            raise StubError("limo-hog run does not offer Node(cli_args=...): give the arguments after --ros-args")
        arguments = context.arguments
        self._remaps = arguments.remaps if use_global_arguments else {}
        self._name = self._remaps.get("__node", node_name)
        self._namespace = "/" + self._remaps.get("__ns", namespace or "").strip("/")
        overrides = arguments.parameters_of(self._name, self._namespace) if use_global_arguments else {}
        overrides = {p.name: p.value for p in parameter_overrides or ()} | overrides
        context.world.calls.nodes.setdefault(self._name, context.world.line())
        self._parameters = Parameters(
            overrides,
            context.world.parameters,
            declares_overrides=automatically_declare_parameters_from_overrides,
            allows_undeclared=allow_undeclared_parameters,
        )
        if not self._parameters.has("use_sim_time"):
            self._parameters.declare("use_sim_time", False)
        self._logger = Logger(self.get_fully_qualified_name().strip("/").replace("/", "."))
        self._clock = Clock(clock_type=ClockType.ROS_TIME)
        self.default_callback_group = MutuallyExclusiveCallbackGroup()
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._timers: list[Timer] = []

    def get_name(self) -> str:
        """Return the node's name."""
        return self._name

    def get_namespace(self) -> str:
        """Return the node's namespace."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """Return namespace and name."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_logger(self) -> Logger:
        """Return the node's logger."""
        return self._logger

    def get_clock(self) -> Clock:
        """Return the node's clock."""
        return self._clock

    @property
    def publishers(self) -> Iterable[Publisher]:
        """The node's publishers."""
        return iter(self._publishers)

    @property
    def subscriptions(self) -> Iterable[Subscription]:
        """The node's subscriptions."""
        return iter(self._subscriptions)

    @property
    def timers(self) -> Iterable[Timer]:
        """The node's timers."""
        return iter(self._timers)

    def resolve_topic_name(self, topic: str) -> str:
        """Return a topic's full name, after the command line's remaps."""
        topic = self._remaps.get(topic, topic)
        if topic.startswith("~"):
            topic = f"{self.get_fully_qualified_name()}/{topic[1:].lstrip('/')}"
        elif not topic.startswith("/"):
            topic = f"{self._namespace.rstrip('/')}/{topic}"
        return self._remaps.get(topic, topic)

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int, **_: Any
    ) -> Publisher:
        """Return a new publisher of a topic."""
        _check_type(msg_type)
        publisher = Publisher(msg_type, self.resolve_topic_name(topic), to_profile(qos_profile))
        _check_topic(publisher.topic, msg_type)
        self._publishers.append(publisher)
        world = current().world
        world.calls.writers.setdefault(publisher.topic, world.line())
        return publisher

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[[Any], Any],
        qos_profile: QoSProfile | int,
        **_: Any,
    ) -> Subscription:
        """Return a new subscription to a topic."""
        _check_type(msg_type)
        subscription = Subscription(msg_type, self.resolve_topic_name(topic), callback, to_profile(qos_profile))
        _check_topic(subscription.topic, msg_type)
        self._subscriptions.append(subscription)
        current().world.subscribe(subscription)
        return subscription

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
        callback_group: CallbackGroup | None = None,  # noqa: ARG002 — rclpy's signature
        clock: Clock | None = None,  # noqa: ARG002
        autostart: bool = True,
    ) -> Timer:
        """Call back every so many seconds."""
        timer = Timer(float(timer_period_sec), callback, autostart)
        self._timers.append(timer)
        return timer

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """End a publisher."""
        return _take_out(self._publishers, publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """End a subscription."""
        subscription.destroy()
        return _take_out(self._subscriptions, subscription)

    def destroy_timer(self, timer: Timer) -> bool:
        """End a timer."""
        timer.cancel()
        return _take_out(self._timers, timer)

    def destroy_node(self) -> None:
        """End everything the node has."""
        for subscription in self._subscriptions:
            subscription.destroy()
        self._publishers, self._subscriptions, self._timers = [], [], []

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:  # noqa: ARG002
        """Return every topic of the arena and of the script."""
        topics = names.TYPES | current().world.published
        return [(name, [kind]) for name, kind in sorted(topics.items())]

    def count_publishers(self, topic_name: str) -> int:
        """Return how many publish on a topic, the arena being one."""
        own = sum(publisher.topic == topic_name for publisher in self._publishers)
        return own + (topic_name in names.TYPES and topic_name != names.COMMAND)

    def count_subscribers(self, topic_name: str) -> int:
        """Return how many listen to a topic, the robot being one."""
        readers = current().world.readers
        return sum(reader.topic == topic_name for reader in readers) + (topic_name == names.COMMAND)

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default."""
        return self._parameters.declare(name, value, descriptor, ignore_override)

    def declare_parameters(
        self, namespace: str, parameters: Iterable[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Declare several parameters, each (name, default) or (name, default, descriptor)."""
        prefix = f"{namespace}." if namespace else ""
        declared = []
        for name, *rest in parameters:
            default, descriptor = (*rest, None, None)[:2]
            declared.append(self._parameters.declare(prefix + name, default, descriptor, ignore_override))
        return declared

    def has_parameter(self, name: str) -> bool:
        """Whether a parameter is declared."""
        return self._parameters.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Return a declared parameter."""
        return self._parameters.get(name)

    def get_parameters(self, names: list[str]) -> list[Parameter]:
        """Return several declared parameters."""
        return [self._parameters.get(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Return a parameter, or something else where it is not declared."""
        if self._parameters.has(name):
            return self._parameters.get(name)
        return alternative_value or Parameter(name)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Change declared parameters."""
        return self._parameters.set(parameter_list)

    def add_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        """Ask before a parameter changes."""
        self._parameters.callbacks.insert(0, callback)


def _check_type(msg_type: Any) -> None:
    if not (isinstance(msg_type, type) and issubclass(msg_type, Message)):
        raise TypeError(f"want a message type such as geometry_msgs.msg.Twist, came {msg_type!r}")


def _check_topic(topic: str, msg_type: type[Message]) -> None:
    wanted = names.TYPES.get(topic)
    if wanted is not None and wanted != msg_type._type_name:
        raise StubError(f"{topic} carries {wanted}, the script uses {msg_type._type_name}")


def _take_out(items: list[Any], item: Any) -> bool:
    if item not in items:
        return False
    items.remove(item)
    return True
