"""Topics over DDS, as ROS 2 Humble and Jazzy name, type and encode them, and the node that they belong to."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from limo_hog.extras import needed
from limo_hog.ros2 import names
from limo_hog.ros2.arguments import NodeNames
from limo_hog.ros2.messages import Field, MessageError, deserialize, fields_of, serialize, typestore
from limo_hog.ros2.network import BusError, network

with needed(by="ROS 2 over the network"):
    from cyclonedds import builtin
    from cyclonedds.core import DDSStatus, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.core import InstanceState as Instance
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct, types
    from cyclonedds.internal import InvalidSample
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

#: ROS 2's prefix of topics in DDS.
_PREFIX = "rt"
#: Time in which a new reader takes the images that a killed one has not confirmed [s]. Chosen: ten of 2 MB take .5 s.
_CATCH_UP = 1.0


@dataclass(frozen=True, slots=True)
class Endpoints:
    """A topic as others offer it: of each that publishes and that subscribes its ROS type and quality of service."""

    publishers: list[tuple[str, str]] = field(default_factory=list)
    subscriptions: list[tuple[str, str]] = field(default_factory=list)

    @property
    def types(self) -> list[str]:
        """All ROS types; there should be one."""
        return sorted({kind for kind, _ in (*self.publishers, *self.subscriptions)})


@cache
def dds_type(type_name: str) -> Any:
    """Return the DDS type of a ROS message; its bytes are rosbags'.

    Its samples hold a ROS message in `message`; None in place of one that could not be read.
    """
    package, _, name = type_name.split("/")
    fields = {field.name: _dds_field(field) for field in fields_of(type_name)}
    made: Any = make_idl_struct(f"{name}_", f"{package}.msg.dds_.{name}_", fields)

    def hold(self: Any, message: Any) -> None:
        self.message = message

    def write(self: Any, *_: Any, **__: Any) -> bytes:
        return serialize(self.message)

    def read(data: bytes, *_: Any, **__: Any) -> Any:
        try:
            return made(deserialize(bytes(data), type_name))
        except MessageError:
            # A foreign writer's mistake must not end the reader; it is counted where it is taken.
            return made(None)

    made.__init__ = hold
    made.serialize = write
    made.deserialize = staticmethod(read)
    # Of a sample that only says that its writer has gone, nothing is read.
    made.deserialize_key = staticmethod(lambda *_, **__: made(None))
    return made


def _dds_field(field: Field) -> Any:
    if field.is_message:
        item = dds_type(field.item)
    elif field.item in ("uint8", "char", "byte", "octet"):
        # As idlc does it: with uint8 the type information crashes readers of Cyclone DDS 0.10.
        item = types.byte
    else:
        item = {"bool": bool, "string": str}.get(field.item) or getattr(types, field.item)
    generic: Any = types
    if field.length is None:
        return item
    return generic.array[item, field.length] if field.length else generic.sequence[item]


def _qos(type_name: str, depth: int, *, reliable: bool = True, kept: bool = False) -> Qos:
    """Return a quality of service as ROS 2's; with "" for the type it names no hash."""
    # ROS 2 Jazzy and later tell each other the type's hash in this way.
    typehash = (Policy.Userdata(f"typehash={typestore().hash_rihs01(type_name)};".encode()),) if type_name else ()
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        # A writer that ends says nothing of its topic's instance, as in ROS 2: Fast DDS reads that message for ever.
        Policy.WriterDataLifecycle(autodispose=False),
        *typehash,
    )


class _Graph:
    """Tells the network which node a participant is, and which readers and writers are its: `ros_discovery_info`."""

    def __init__(self, participant: Any, node: NodeNames) -> None:
        def struct(name: str, **fields: Any) -> Any:
            return make_idl_struct(f"{name}_", f"rmw_dds_common.msg.dds_.{name}_", fields)

        # Humble's numbers have 24 bytes, of which 8 are zero; it takes no others.
        self._size = 24 if os.environ.get("ROS_DISTRO") == "humble" else 16
        generic: Any = types
        self._gid = struct("Gid", data=generic.array[types.byte, self._size])
        gids = generic.sequence[self._gid]
        self._info = struct(
            "NodeEntitiesInfo", node_namespace=str, node_name=str, reader_gid_seq=gids, writer_gid_seq=gids
        )
        kind = struct("ParticipantEntitiesInfo", gid=self._gid, node_entities_info_seq=generic.sequence[self._info])
        topic = Topic(participant, "ros_discovery_info", kind)
        self._writer = DataWriter(participant, topic, qos=_qos("", 1, kept=True))
        self._kind, self._node, self._own = kind, node, bytes(participant.guid.bytes)
        self.readers: list[bytes] = []
        self.writers: list[bytes] = []
        self.announce()

    def announce(self) -> None:
        """Tell the readers and writers there are now."""

        def number(guid: bytes) -> Any:
            return self._gid(data=list(guid.ljust(self._size, b"\0")))

        info = self._info(
            node_namespace=self._node.namespace,
            node_name=self._node.name,
            reader_gid_seq=[number(guid) for guid in self.readers],
            writer_gid_seq=[number(guid) for guid in self.writers],
        )
        self._writer.write(self._kind(gid=number(self._own), node_entities_info_seq=[info]))


class Publisher:
    """Sends messages of one topic."""

    def __init__(self, participant: Any, graph: _Graph, topic: str, type_name: str, depth: int, *, kept: bool) -> None:
        self._type = dds_type(type_name)
        qos = _qos(type_name, depth, kept=kept)
        self._writer = DataWriter(participant, Topic(participant, _PREFIX + topic, self._type), qos=qos)
        graph.writers.append(bytes(self._writer.guid.bytes))
        graph.announce()
        self._is_image = type_name == "sensor_msgs/msg/Image"
        self._readers: set[int] = set()
        self._met = -math.inf  # when the newest reader was met [s]

    @property
    def has_readers(self) -> bool:
        """Whether anybody listens."""
        return bool(self._writer.get_matched_subscriptions())

    def publish(self, message: Any) -> None:
        """Send a message; an image is left out while a new reader still gets older ones.

        One that replaced an image of which Fast DDS has a part would leave it in an endless loop.
        """
        if not (self._is_image and self._reader_catches_up()):
            self._writer.write(self._type(message))

    def _reader_catches_up(self) -> bool:
        readers, now = set(self._writer.get_matched_subscriptions()), time.monotonic()
        if not readers <= self._readers:
            self._met = now
        self._readers = readers
        if now - self._met > _CATCH_UP:
            return False
        try:
            return not self._writer.wait_for_acks(1)
        except AttributeError:
            # Cyclone DDS 11.0.1 looks for the number of this very outcome in the wrong class.
            return True


class Subscription:
    """Receives messages of one topic.

    Reliable, until a publisher turns up that is not, as the drivers of lidars and cameras: a reliable reader would
    hear nothing of it.
    """

    def __init__(
        self, participant: Any, graph: _Graph, wakers: WaitSet, topic: str, type_name: str, depth: int, *, kept: bool
    ) -> None:
        self._participant, self._wakers, self._type_name, self._depth = participant, wakers, type_name, depth
        self._graph, self._kept = graph, kept
        self._topic = Topic(participant, _PREFIX + topic, dds_type(type_name))
        self.dropped = 0  #: how many samples were no message of the topic's type
        self._guid: bytes | None = None
        self._open(reliable=True)

    def _open(self, *, reliable: bool) -> None:
        qos = _qos(self._type_name, self._depth, reliable=reliable, kept=self._kept)
        self._reader, self._reliable = DataReader(self._participant, self._topic, qos=qos), reliable
        self._unread = ReadCondition(self._reader, ViewState.Any | SampleState.NotRead | Instance.Any)
        self._wakers.attach(self._unread)
        before, self._guid = self._guid, bytes(self._reader.guid.bytes)
        self._graph.readers = [one for one in self._graph.readers if one != before] + [self._guid]
        self._graph.announce()

    def take(self) -> list[Any]:
        """Return the messages that have come since, oldest first."""
        if self._reliable and self._reader.take_status(DDSStatus.RequestedIncompatibleQos):
            self._wakers.detach(self._unread)
            self._open(reliable=False)
        samples = self._reader.take(N=max(self._depth, 1))
        messages = [sample.message for sample in samples if not isinstance(sample, InvalidSample)]
        good = [message for message in messages if message is not None]
        self.dropped += len(messages) - len(good)
        return good


class Bus:
    """A node of the ROS 2 network, which others see in `ros2 node list`.

    The workshop's topics are in the node's namespace, but for TF and the clock, and have the names that its arguments
    give them. Raises `BusError` if the environment asks for no network that ROS 2 knows, or DDS does not start.
    """

    def __init__(self, node: NodeNames | None = None) -> None:
        self.node = NodeNames("limo_hog") if node is None else node
        self.network = network(os.environ)  #: what it can reach; as text, for messages
        if self.network.configuration is not None:
            _domain(self.network.domain, self.network.configuration)
        try:
            # As ROS 2's participants do: the enclave of a network without security.
            self._participant = DomainParticipant(self.network.domain, qos=Qos(Policy.Userdata(b"enclave=/;")))
        except Exception as error:
            raise BusError(f"DDS does not start in {self.network}: {error}") from error
        self._wakers = WaitSet(self._participant)
        self._graph = _Graph(self._participant, self.node)

    def publisher(self, topic: str, type_name: str, depth: int = 10, *, kept: bool = False) -> Publisher:
        """Begin to publish; of what is `kept` (transient local), later readers get the last `depth` messages."""
        topic = names.resolved(self.node, topic)
        return Publisher(self._participant, self._graph, topic, type_name, depth, kept=kept)

    def subscription(self, topic: str, type_name: str, depth: int = 10, *, kept: bool = False) -> Subscription:
        """Begin to listen; `wait` wakes up for it. With `kept`, what a publisher kept before comes, too."""
        topic = names.resolved(self.node, topic)
        return Subscription(self._participant, self._graph, self._wakers, topic, type_name, depth, kept=kept)

    def wait(self, seconds: float) -> None:
        """Return when a subscription has something, or after so long."""
        self._wakers.wait(duration(microseconds=max(int(seconds * 1e6), 1)))

    def topics(
        self, seconds: float = 1.5, enough: Callable[[dict[str, Endpoints]], bool] | None = None
    ) -> dict[str, Endpoints]:
        """Return what is offered, by topic, after looking around for so long, or when `enough` is found."""
        readers = [
            builtin.BuiltinDataReader(self._participant, kind)
            for kind in (builtin.BuiltinTopicDcpsPublication, builtin.BuiltinTopicDcpsSubscription)
        ]
        until = time.monotonic() + seconds
        while True:
            found = self._endpoints(readers)
            if time.monotonic() > until or (enough is not None and enough(found)):
                return found
            time.sleep(0.05)

    def subscribed_types(self, topic: str) -> set[str]:
        """Return the ROS types with which others subscribe to a topic, as known now."""
        ends = self.topics(0.0, enough=lambda _: True).get(names.resolved(self.node, topic), Endpoints())
        return {kind for kind, _ in ends.subscriptions}

    def _endpoints(self, readers: list[Any]) -> dict[str, Endpoints]:
        found: dict[str, Endpoints] = {}
        for index, reader in enumerate(readers):
            for sample in reader.read(1000):
                alive = sample.sample_info.instance_state == Instance.Alive
                if not alive or not sample.topic_name.startswith(f"{_PREFIX}/"):
                    continue
                name, qos = sample.topic_name.removeprefix(_PREFIX), sample.qos
                qualities = (type(qos[policy]).__name__ for policy in (Policy.Reliability, Policy.Durability))
                # "geometry_msgs::msg::dds_::Twist_" is ROS's "geometry_msgs/msg/Twist".
                kind = sample.type_name.replace("::", "/").replace("/dds_/", "/").removesuffix("_")
                one = kind, ", ".join(quality.rpartition(".")[2] for quality in qualities)
                ends = found.setdefault(name, Endpoints())
                (ends.publishers, ends.subscriptions)[index].append(one)
        return dict(sorted(found.items()))


@cache
def _domain(number: int, configuration: str) -> Any:
    # One configuration a domain and process: the second would be an error.
    return Domain(number, configuration)
