"""Topics over DDS, as ROS 2 Humble and Jazzy name, type and encode them; loopback alone unless told otherwise.

ROS_DOMAIN_ID chooses the domain. CYCLONEDDS_URI, where it is set, replaces the loopback configuration.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed
from limo_hog.ros2.messages import Field, MessageError, deserialize, fields_of, serialize, typestore

with needed(by="ROS 2 over the network"):
    from cyclonedds import builtin
    from cyclonedds.core import InstanceState as Instance
    from cyclonedds.core import Listener, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct, types
    from cyclonedds.internal import InvalidSample
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

#: Discovery by unicast to this machine's own ports: loopback has no multicast.
LOOPBACK = """
<CycloneDDS><Domain id="any">
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
    <MaxMessageSize>65500B</MaxMessageSize>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <SPDPInterval>1s</SPDPInterval>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""

#: ROS 2's prefix of topics in DDS.
_PREFIX = "rt"


class BusError(LimoHogError):
    """The ROS 2 network cannot be used as asked, or no camera image comes over it."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """A topic as others offer it: its ROS type, and how many publish and subscribe."""

    type_name: str
    publishers: int
    subscriptions: int


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
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        # ROS 2 Jazzy and later tell each other the type's hash in this way.
        Policy.Userdata(f"typehash={typestore().hash_rihs01(type_name)};".encode()),
    )


class Publisher:
    """Sends messages of one topic."""

    def __init__(self, participant: Any, topic: str, type_name: str, depth: int, *, kept: bool) -> None:
        self._type = dds_type(type_name)
        qos = _qos(type_name, depth, kept=kept)
        self._writer = DataWriter(participant, Topic(participant, _PREFIX + topic, self._type), qos=qos)

    @property
    def has_readers(self) -> bool:
        """Whether anybody listens."""
        return bool(self._writer.get_matched_subscriptions())

    def publish(self, message: Any) -> None:
        """Send a message."""
        self._writer.write(self._type(message))


class _Mismatch(Listener):
    """Notes that a publisher offers less than the reader asks for."""

    def __init__(self) -> None:
        self.seen = False
        super().__init__()  # type: ignore[no-untyped-call]

    def on_requested_incompatible_qos(self, reader: Any, status: Any) -> None:  # noqa: ARG002 — Listener's signature
        """Note it; DDS calls from a thread of its own."""
        self.seen = True


class Subscription:
    """Receives messages of one topic.

    Reliable, until a publisher turns up that is not, as the drivers of lidars and cameras: a reliable reader would
    hear nothing of it.

    Attributes
    ----------
    dropped
        How many samples were no message of the topic's type.
    """

    def __init__(
        self, participant: Any, wakers: WaitSet, topic: str, type_name: str, depth: int, *, kept: bool
    ) -> None:
        self._participant, self._wakers, self._type_name, self._depth = participant, wakers, type_name, depth
        self._kept = kept
        self._topic = Topic(participant, _PREFIX + topic, dds_type(type_name))
        self._mismatch = _Mismatch()
        self.dropped = 0
        self._open(reliable=True)

    def _open(self, *, reliable: bool) -> None:
        qos = _qos(self._type_name, self._depth, reliable=reliable, kept=self._kept)
        listener = self._mismatch if reliable else None
        self._reader = DataReader(self._participant, self._topic, qos=qos, listener=listener)
        self._unread = ReadCondition(self._reader, ViewState.Any | SampleState.NotRead | Instance.Any)
        self._wakers.attach(self._unread)

    def take(self) -> list[Any]:
        """Return the messages that have come since, oldest first."""
        if self._mismatch.seen:
            self._mismatch.seen = False
            self._wakers.detach(self._unread)
            self._open(reliable=False)
        samples = self._reader.take(N=max(self._depth, 1))
        messages = [sample.message for sample in samples if not isinstance(sample, InvalidSample)]
        good = [message for message in messages if message is not None]
        self.dropped += len(messages) - len(good)
        return good


class Bus:
    """A participant of the ROS 2 network.

    Raises
    ------
    BusError
        If ROS_DOMAIN_ID is no domain, or DDS does not start.
    """

    def __init__(self) -> None:
        text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
        if not text.isdecimal() or int(text) > 232:
            raise BusError(f"ROS_DOMAIN_ID is {text!r}; wanted is a number from 0 to 232")
        self.domain = int(text)
        self._domain = None if os.environ.get("CYCLONEDDS_URI") else _domain(self.domain)
        try:
            self._participant = DomainParticipant(self.domain)
        except Exception as error:
            raise BusError(f"DDS does not start in domain {self.domain}: {error}") from error
        self._wakers = WaitSet(self._participant)

    def publisher(self, topic: str, type_name: str, depth: int = 10, *, kept: bool = False) -> Publisher:
        """Begin to publish; of what is `kept` (transient local), later readers get the last `depth` messages."""
        return Publisher(self._participant, topic, type_name, depth, kept=kept)

    def subscription(self, topic: str, type_name: str, depth: int = 10, *, kept: bool = False) -> Subscription:
        """Begin to listen; `wait` wakes up for it. With `kept`, what a publisher kept before comes, too."""
        return Subscription(self._participant, self._wakers, topic, type_name, depth, kept=kept)

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
        reader = builtin.BuiltinDataReader(self._participant, builtin.BuiltinTopicDcpsSubscription)
        return {
            _ros_type(sample.type_name)
            for sample in reader.read(1000)
            if sample.sample_info.instance_state == Instance.Alive and sample.topic_name == _PREFIX + topic
        }

    def _endpoints(self, readers: list[Any]) -> dict[str, Endpoints]:
        counts: dict[str, tuple[str, list[int]]] = {}
        for index, reader in enumerate(readers):
            for sample in reader.read(1000):
                alive = sample.sample_info.instance_state == Instance.Alive
                if not alive or not sample.topic_name.startswith(f"{_PREFIX}/"):
                    continue
                name, kind = sample.topic_name.removeprefix(_PREFIX), _ros_type(sample.type_name)
                known = counts.setdefault(name, (kind, [0, 0]))
                known[1][index] += 1
        return {name: Endpoints(kind, *numbers) for name, (kind, numbers) in sorted(counts.items())}


def _ros_type(type_name: str) -> str:
    """Return ROS's name of a type: "geometry_msgs::msg::dds_::Twist_" is "geometry_msgs/msg/Twist"."""
    return type_name.replace("::", "/").replace("/dds_/", "/").removesuffix("_")


@cache
def _domain(number: int) -> Any:
    # One configuration a domain and process: the second would be an error.
    return Domain(number, LOOPBACK)
