"""Quality of service, as far as it changes what arrives."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any


class ReliabilityPolicy(IntEnum):
    """Whether lost messages are sent again; none are lost here."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(IntEnum):
    """Whether late readers get old messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class HistoryPolicy(IntEnum):
    """How many messages wait for a slow reader."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2


class LivelinessPolicy(IntEnum):
    """How a writer shows that it lives; it always does here."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3


@dataclass
class QoSProfile:
    """What a writer offers and a reader asks for; lifespan, deadline and lease are taken and change nothing here."""

    depth: int = 10
    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    liveliness: LivelinessPolicy = LivelinessPolicy.SYSTEM_DEFAULT
    lifespan: Any = None
    deadline: Any = None
    liveliness_lease_duration: Any = None
    avoid_ros_namespace_conventions: bool = False


def to_profile(given: QoSProfile | int) -> QoSProfile:
    """Return a profile; a number is the depth of the default one.

    Raises
    ------
    TypeError, ValueError
        As rclpy does, if it is neither.
    """
    if isinstance(given, QoSProfile):
        return given
    if not isinstance(given, int):
        raise TypeError(f"want a QoSProfile or a depth, came {type(given).__name__} {given!r}")
    if given < 0:
        raise ValueError(f"the depth must be 0 or more, came {given}")
    return QoSProfile(depth=given)


qos_profile_system_default = QoSProfile()
qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = QoSProfile()
qos_profile_parameters = QoSProfile(depth=1000)
