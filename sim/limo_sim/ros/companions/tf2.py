"""tf2_ros: the tree of frames, listened to, looked up, and published."""

from __future__ import annotations

import bisect
import math
from typing import Any

from limo_hog.ros2 import names
from limo_sim.ros.companions.quaternions import IDENTITY, Rigid, rigid_of, slerp
from limo_sim.ros.companions.tf2_geometry import TRANSFORMS
from limo_sim.ros.interfaces import Message, message_class
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.rclpy_stub.clock import Duration, Time
from limo_sim.ros.rclpy_stub.context import default_context
from limo_sim.ros.rclpy_stub.groups import ReentrantCallbackGroup
from limo_sim.ros.rclpy_stub.node import Node
from limo_sim.ros.rclpy_stub.partial import PartialApi
from limo_sim.ros.rclpy_stub.qos import DurabilityPolicy, QoSProfile


class TransformException(Exception):  # noqa: N818 — tf2's names
    """There is no such transform."""


class LookupException(TransformException):
    """A frame does not exist."""


class ConnectivityException(TransformException):
    """Two frames belong to different trees."""


class ExtrapolationException(TransformException):
    """The transform is not known at that time."""


class InvalidArgumentException(TransformException):
    """A frame's name is malformed."""


class TimeoutException(TransformException):
    """It took too long."""


#: Newest transforms of one child frame, by time [ns]; a frame that does not move has its one at None.
_Track = list[tuple[int, Rigid]]
#: Names of ROS 2's `Buffer` that are not offered.
_MISSING = tuple(
    "lookup_transform_full lookup_transform_full_async lookup_transform_async transform_full "
    "can_transform_full wait_for_transform_async wait_for_transform_full_async all_frames_as_yaml "
    "set_transform_callback get_latest_common_time".split()
)


class Buffer(PartialApi, missing=_MISSING):
    """Keeps the transforms of the last seconds and combines them."""

    def __init__(self, cache_time: Duration | None = None, node: Node | None = None) -> None:  # noqa: ARG002
        self._kept_ns = 10 * 10**9 if cache_time is None else cache_time.nanoseconds
        self._moving: dict[str, _Track] = {}
        self._fixed: dict[str, Rigid] = {}
        self._parents: dict[str, str] = {}

    def set_transform(self, transform: Any, authority: str) -> None:  # noqa: ARG002 — tf2's signature
        """Take in a TransformStamped."""
        child = self._take(transform)
        stamp, track = transform.header.stamp, self._moving.setdefault(child, [])
        at = int(stamp.sec * 10**9 + stamp.nanosec)
        self._fixed.pop(child, None)
        index = bisect.bisect_left(track, at, key=lambda entry: entry[0])
        if index < len(track) and track[index][0] == at:
            track[index] = (at, _rigid(transform))
        else:
            track.insert(index, (at, _rigid(transform)))
        while track[-1][0] - track[0][0] > self._kept_ns:
            del track[0]

    def set_transform_static(self, transform: Any, authority: str) -> None:  # noqa: ARG002 — tf2's signature
        """Take in a TransformStamped that holds for good."""
        self._fixed[self._take(transform)] = _rigid(transform)

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time, timeout: Duration | None = None
    ) -> Message:
        """Return the TransformStamped that carries coordinates of `source_frame` to `target_frame`.

        `Time()` is the newest time at which all of it is known; `timeout` is how long to wait for it, while another
        thread or callback group listens. Raises `TransformException` if it is not known: `LookupException`,
        `ConnectivityException` or `ExtrapolationException`.
        """
        self._wait(target_frame, source_frame, time, timeout)
        rigid, at = self._between(target_frame, source_frame, time)
        made: Any = message_class("geometry_msgs/msg/TransformStamped")()
        made.header.stamp = Time(nanoseconds=at).to_msg()
        made.header.frame_id, made.child_frame_id = target_frame, source_frame
        place, turn = made.transform.translation, made.transform.rotation
        place.x, place.y, place.z = (float(value) for value in rigid.translation)
        turn.x, turn.y, turn.z, turn.w = (float(value) for value in rigid.rotation)
        return made  # type: ignore[no-any-return]

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Time,
        timeout: Duration | None = None,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Whether `lookup_transform` would succeed; with `return_debug_tuple` also why not."""
        self._wait(target_frame, source_frame, time, timeout)
        why = self._why_not(target_frame, source_frame, time)
        return (not why, why) if return_debug_tuple else not why

    def transform(
        self, object_stamped: Any, target_frame: str, timeout: Duration | None = None, new_type: Any = None
    ) -> Message:
        """Return a PointStamped, PoseStamped or Vector3Stamped in another frame, at its own time."""
        if new_type is not None:
            raise StubError("limo-hog run does not offer Buffer.transform(new_type=...)")
        carry = TRANSFORMS.get(getattr(object_stamped, "_type_name", ""))
        if carry is None:
            raise StubError(f"limo-hog run does not offer Buffer.transform of a {type(object_stamped).__name__}")
        header = object_stamped.header
        found = self.lookup_transform(target_frame, header.frame_id, Time.from_msg(header.stamp), timeout)
        carried: Message = carry(object_stamped, found)
        return carried

    def clear(self) -> None:
        """Forget everything."""
        self._moving, self._fixed, self._parents = {}, {}, {}

    def all_frames_as_string(self) -> str:
        """Return each frame with its parent."""
        lines = [f"Frame {child} exists with parent {parent}." for child, parent in self._parents.items()]
        return "\n".join(lines)

    def _take(self, transform: Any) -> str:
        child: str = transform.child_frame_id.lstrip("/")
        parent: str = transform.header.frame_id.lstrip("/")
        if not child or not parent or child == parent:
            raise InvalidArgumentException(f"a transform from {child!r} to {parent!r} is none")
        self._parents[child] = parent
        return child

    def _why_not(self, target: str, source: str, time: Time) -> str:
        try:
            self._between(target, source, time)
        except TransformException as error:
            return str(error)
        return ""

    def _wait(self, target: str, source: str, time: Time, timeout: Duration | None) -> None:
        if timeout is not None and timeout.nanoseconds > 0:
            world = default_context().world
            until = world.time + timeout.nanoseconds * 1e-9
            world.turns.wait(lambda: not self._why_not(target, source, time), until)

    def _between(self, target: str, source: str, time: Time) -> tuple[Rigid, int]:
        ways = [self._to_root(frame) for frame in (target, source)]
        if ways[0][-1] != ways[1][-1]:
            raise ConnectivityException(
                f"could not find a connection between {target!r} and {source!r}: they are in different trees"
            )
        meeting = next(frame for frame in ways[0] if frame in ways[1])
        up, down = (way[: way.index(meeting)] for way in ways)
        at = time.nanoseconds
        if at == 0:
            tracks = [self._moving[frame] for frame in (*up, *down) if frame not in self._fixed]
            at = min((track[-1][0] for track in tracks), default=0)
        to_meeting = [IDENTITY, IDENTITY]
        for side, frames in enumerate((up, down)):
            for frame in frames:
                to_meeting[side] = self._at(frame, at).after(to_meeting[side])
        return to_meeting[0].inverse().after(to_meeting[1]), at

    def _to_root(self, frame: str) -> list[str]:
        frame = frame.lstrip("/")
        known = {*self._parents, *self._parents.values()}
        if frame not in known:
            raise LookupException(f"frame {frame!r} does not exist; known are {', '.join(sorted(known))}")
        way = [frame]
        while way[-1] in self._parents:
            way.append(self._parents[way[-1]])
            if way[-1] in way[:-1]:
                raise ConnectivityException(f"the frames {', '.join(way)} are each other's parents")
        return way

    def _at(self, child: str, at: int) -> Rigid:
        if child in self._fixed:
            return self._fixed[child]
        track = self._moving[child]
        first, last = track[0][0], track[-1][0]
        if not first <= at <= last:
            where, limit = ("past", first) if at < first else ("future", last)
            raise ExtrapolationException(
                f"{child!r} is asked for at {at * 1e-9:.3f} s, but its transforms are from {first * 1e-9:.3f} to "
                f"{last * 1e-9:.3f} s: {abs(at - limit) * 1e-9:.3f} s into the {where}"
            )
        index = bisect.bisect_left(track, at, key=lambda entry: entry[0])
        (after, b) = track[index]
        if after == at:
            return b
        before, a = track[index - 1]
        share = (at - before) / (after - before)
        return Rigid(a.translation + share * (b.translation - a.translation), slerp(a.rotation, b.rotation, share))


class TransformListener:
    """Fills a buffer from /tf and /tf_static."""

    def __init__(
        self,
        buffer: Buffer,
        node: Node,
        *,
        spin_thread: bool = False,
        qos: QoSProfile | int | None = None,
        static_qos: QoSProfile | int | None = None,
    ) -> None:
        if spin_thread:
            raise StubError("limo-hog run does not offer TransformListener(spin_thread=True): spin the node instead")
        kind, group = message_class("tf2_msgs/msg/TFMessage"), ReentrantCallbackGroup()
        self.buffer, self.node = buffer, node
        self.tf_sub = node.create_subscription(kind, names.TF, self._moving, qos or 100, callback_group=group)
        self.tf_static_sub = node.create_subscription(
            kind, names.TF_STATIC, self._fixed, static_qos or _STATIC, callback_group=group
        )

    def _moving(self, message: Any) -> None:
        for transform in message.transforms:
            self.buffer.set_transform(transform, "")

    def _fixed(self, message: Any) -> None:
        for transform in message.transforms:
            self.buffer.set_transform_static(transform, "")

    def unregister(self) -> None:
        """Listen no more."""
        self.node.destroy_subscription(self.tf_sub)
        self.node.destroy_subscription(self.tf_static_sub)


class TransformBroadcaster:
    """Publishes transforms that change."""

    def __init__(self, node: Node, qos: QoSProfile | int = 100) -> None:
        self.pub_tf = node.create_publisher(message_class("tf2_msgs/msg/TFMessage"), names.TF, qos)

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 — tf2's name
        """Publish one TransformStamped, or several."""
        several = list(transform) if isinstance(transform, list | tuple) else [transform]
        self.pub_tf.publish(message_class("tf2_msgs/msg/TFMessage")(transforms=several))


class StaticTransformBroadcaster:
    """Publishes transforms that hold for good; later listeners get them, too."""

    def __init__(self, node: Node, qos: QoSProfile | int | None = None) -> None:
        self.pub_tf = node.create_publisher(message_class("tf2_msgs/msg/TFMessage"), names.TF_STATIC, qos or _STATIC)
        self._all: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 — tf2's name
        """Publish one TransformStamped, or several, with all that were sent before."""
        for one in transform if isinstance(transform, list | tuple) else [transform]:
            self._all[one.child_frame_id] = one
        self.pub_tf.publish(message_class("tf2_msgs/msg/TFMessage")(transforms=list(self._all.values())))


_STATIC = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _rigid(transform: Any) -> Rigid:
    rigid = rigid_of(transform)
    length = math.sqrt(float(rigid.rotation @ rigid.rotation))
    if not abs(length - 1) < 0.01:
        raise InvalidArgumentException(f"the rotation of {transform.child_frame_id!r} has length {length:g}, want 1")
    return Rigid(rigid.translation, rigid.rotation / length)
