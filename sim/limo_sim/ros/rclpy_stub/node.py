"""Nodes: what a script derives its own from."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from limo_hog.ros2 import names
from limo_hog.ros2.arguments import RosArguments
from limo_sim.ros.interfaces import Message
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub import naming
from limo_sim.ros.rclpy_stub.clock import Clock, ClockType, Rate, Timer
from limo_sim.ros.rclpy_stub.context import default_context
from limo_sim.ros.rclpy_stub.groups import CallbackGroup, MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from limo_sim.ros.rclpy_stub.logger import Logger
from limo_sim.ros.rclpy_stub.parameters import Parameter, Parameters, SetParametersResult
from limo_sim.ros.rclpy_stub.partial import PartialApi
from limo_sim.ros.rclpy_stub.qos import QoSProfile, qos_profile_services_default, to_profile
from limo_sim.ros.rclpy_stub.services import Client, Service
from limo_sim.ros.rclpy_stub.topics import Publisher, Subscription, check_topic, check_type, publishers_of


class NotInitializedException(Exception):  # noqa: N818 — rclpy's name
    """A node was made before `rclpy.init`."""


#: Options of rclpy's Node that change nothing here.
_WITHOUT_EFFECT = "context enable_rosout rosout_qos_profile start_parameter_services enable_logger_service".split()
#: Names of rclpy's `Node` that are not offered.
_MISSING = tuple(
    "create_guard_condition destroy_guard_condition guards handle context wait_for_node waitables add_waitable "
    "remove_waitable set_descriptor describe_parameter describe_parameters list_parameters get_parameter_types "
    "get_parameter_type set_parameters_atomically PARAM_REL_TOL get_service_names_and_types get_node_names "
    "count_clients count_services get_publishers_info_by_topic get_subscriptions_info_by_topic "
    "get_fully_qualified_node_names get_publisher_names_and_types_by_node "
    "get_subscriber_names_and_types_by_node get_service_names_and_types_by_node "
    "get_client_names_and_types_by_node get_node_names_and_namespaces "
    "get_node_names_and_namespaces_with_enclaves add_pre_set_parameters_callback "
    "remove_pre_set_parameters_callback add_post_set_parameters_callback remove_post_set_parameters_callback "
    "ParameterInput".split()
)


class Node(PartialApi, missing=_MISSING):
    """What a script derives its node from."""

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
        context = self._context = default_context()
        if not context.is_initialized:
            raise NotInitializedException("rclpy.init() has not been called")
        if cli_args is not None:
            raise StubError("limo-hog run does not offer Node(cli_args=...): give the arguments after --ros-args")
        arguments = context.arguments
        self._names = (arguments if use_global_arguments else RosArguments()).named(node_name, namespace or "")
        naming.checked(self._names.name, naming.InvalidNodeNameException)
        naming.checked(self._names.namespace, naming.InvalidNamespaceException)
        overrides = {p.name: p.value for p in parameter_overrides or ()} | self._names.parameters
        context.world.called("nodes", self._names.name)
        self._parameters = Parameters(
            overrides,
            context.world.parameters,
            declares_overrides=automatically_declare_parameters_from_overrides,
            allows_undeclared=allow_undeclared_parameters,
        )
        if not self.has_parameter("use_sim_time"):
            self._parameters.declare("use_sim_time", False)
        self._logger = Logger(self.get_fully_qualified_name().strip("/").replace("/", "."), context)
        self._clock = Clock(clock_type=ClockType.ROS_TIME)
        self.default_callback_group = MutuallyExclusiveCallbackGroup()
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._timers: list[Timer] = []
        self._services: list[Service] = []
        self._clients: list[Client] = []
        #: The executor that runs the node's callbacks; None before it is spun.
        self.executor: Any = None

    def get_name(self) -> str:
        """Return the node's name."""
        return self._names.name

    def get_namespace(self) -> str:
        """Return the node's namespace."""
        return self._names.namespace

    def get_fully_qualified_name(self) -> str:
        """Return namespace and name."""
        return self._names.full

    def get_logger(self) -> Logger:
        """Return the node's logger."""
        return self._logger

    def get_clock(self) -> Clock:
        """Return the node's clock."""
        return self._clock

    publishers = property(lambda self: iter(self._publishers), doc="The node's publishers.")
    subscriptions = property(lambda self: iter(self._subscriptions), doc="The node's subscriptions.")
    timers = property(lambda self: iter(self._timers), doc="The node's timers.")
    services = property(lambda self: iter(self._services), doc="The services the node offers.")
    clients = property(lambda self: iter(self._clients), doc="The node's clients.")

    @property
    def entities(self) -> tuple[Any, ...]:
        """All that has callbacks, in the order in which executors run them."""
        return (*self._timers, *self._subscriptions, *self._clients, *self._services)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return a topic's full name, after the command line's remaps unless `only_expand`."""
        naming.checked(topic, naming.InvalidTopicNameException)
        return self._names.expand(topic) if only_expand else self._names.resolve(topic)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Return a service's full name, after the command line's remaps unless `only_expand`."""
        name = naming.checked(service, naming.InvalidServiceNameException)
        return self.resolve_topic_name(name, only_expand=only_expand)

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int, **_: Any
    ) -> Publisher:
        """Return a new publisher of a topic."""
        check_type(msg_type)
        publisher = Publisher(msg_type, self.resolve_topic_name(topic), to_profile(qos_profile), self._context)
        check_topic(publisher.topic, msg_type)
        self._publishers.append(publisher)
        return publisher

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[[Any], Any],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        raw: bool = False,
        **_: Any,
    ) -> Subscription:
        """Return a new subscription to a topic."""
        check_type(msg_type)
        if raw:
            raise StubError("limo-hog run does not offer create_subscription(raw=True): callbacks get messages")
        group = callback_group or self.default_callback_group
        name, qos = self.resolve_topic_name(topic), to_profile(qos_profile)
        subscription = Subscription(msg_type, name, callback, qos, group, self._context)
        check_topic(subscription.topic, msg_type)
        self._subscriptions.append(subscription)
        group.add_entity(subscription)
        self._context.world.subscribe(subscription)
        return subscription

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], Any],
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Call back every so many seconds."""
        nanoseconds = int(float(timer_period_sec) * 1e9)
        group, clock = callback_group or self.default_callback_group, clock or self._clock
        timer = Timer(callback, group, nanoseconds, clock, context=self._context, autostart=autostart)
        group.add_entity(timer)
        self._timers.append(timer)
        return timer

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """Return what sleeps until the next of so many periods a second; another thread must spin the node."""
        if frequency <= 0:
            raise ValueError(f"the frequency must be greater than 0, came {frequency}")
        timer = self.create_timer(1.0 / frequency, lambda: None, ReentrantCallbackGroup(), clock)
        return Rate(timer, context=self._context)

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Answer requests by `callback(request, response)`, which returns the response."""
        _check_service(srv_type)
        name, group = self.resolve_service_name(srv_name), callback_group or self.default_callback_group
        service = Service(srv_type, (srv_name, name), callback, group, qos_profile, self._context)
        group.add_entity(service)
        self._services.append(service)
        self._context.world.services[name] = service
        self._context.world.called("services", name)
        return service

    def create_client(
        self,
        srv_type: Any,
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Client:
        """Return what sends requests to a service."""
        _check_service(srv_type)
        name, group = self.resolve_service_name(srv_name), callback_group or self.default_callback_group
        client = Client(srv_type, (srv_name, name), qos_profile, group, self._context)
        group.add_entity(client)
        self._clients.append(client)
        self._context.world.called("clients", name)
        return client

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """End a publisher."""
        return _destroyed(self._publishers, publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """End a subscription."""
        return _destroyed(self._subscriptions, subscription)

    def destroy_timer(self, timer: Timer) -> bool:
        """End a timer."""
        return _destroyed(self._timers, timer)

    def destroy_rate(self, rate: Rate) -> bool:
        """End a rate."""
        return self.destroy_timer(rate._timer)

    def destroy_service(self, service: Service) -> bool:
        """End a service."""
        return _destroyed(self._services, service)

    def destroy_client(self, client: Client) -> bool:
        """End a client."""
        return _destroyed(self._clients, client)

    def destroy_node(self) -> None:
        """End everything the node has."""
        for entity in (*self._publishers, *self._subscriptions, *self._services):
            entity.destroy()
        self._publishers, self._subscriptions, self._timers = [], [], []
        self._services, self._clients = [], []
        if self.executor is not None:
            self.executor.remove_node(self)

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:  # noqa: ARG002
        """Return every topic of the arena and of the script."""
        topics = names.TYPES | self._context.world.published
        return [(name, [kind]) for name, kind in sorted(topics.items())]

    def count_publishers(self, topic_name: str) -> int:
        """Return how many publish on a topic, the arena being one."""
        return publishers_of(topic_name, self._context)

    def count_subscribers(self, topic_name: str) -> int:
        """Return how many listen to a topic, the robot being one."""
        readers = self._context.world.readers
        return [reader.topic for reader in readers].count(topic_name) + (topic_name == names.COMMAND)

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
        return name in self._parameters.values

    def get_parameter(self, name: str) -> Parameter:
        """Return a declared parameter."""
        return self._parameters.get(name)

    def get_parameters(self, names: list[str]) -> list[Parameter]:
        """Return several declared parameters."""
        return [self._parameters.get(name) for name in names]

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Return the parameters `prefix.name`, by name without the prefix."""
        start = f"{prefix}." if prefix else ""
        known = self._parameters.values.items()
        return {name.removeprefix(start): parameter for name, parameter in known if name.startswith(start)}

    def undeclare_parameter(self, name: str) -> None:
        """Forget a declared parameter."""
        self._parameters.forget(name)

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Return a parameter, or something else where it is not declared."""
        return self._parameters.values.get(name) or alternative_value or Parameter(name)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Change declared parameters."""
        return self._parameters.set(parameter_list)

    def add_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        """Ask before a parameter changes."""
        self._parameters.callbacks.insert(0, callback)

    def remove_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        """Ask no more; refuses a callback that was not added."""
        self._parameters.callbacks.remove(callback)


def create_node(node_name: str, **options: Any) -> Node:
    """Return a plain node."""
    return Node(node_name, **options)


def _check_service(srv_type: Any) -> None:
    if not (hasattr(srv_type, "Request") and hasattr(srv_type, "Response")):
        raise TypeError(f"want a service type such as std_srvs.srv.Trigger, came {srv_type!r}")


def _destroyed(items: list[Any], item: Any) -> bool:
    item.destroy()
    if item not in items:
        return False
    items.remove(item)
    return True
