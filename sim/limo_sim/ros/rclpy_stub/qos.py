"""Quality of service, as far as it changes what arrives."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Any

from limo_sim.ros.rclpy_stub.partial import PartialApi


class ReliabilityPolicy(IntEnum):
    """Whether lost messages are sent again; none are lost here."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4
    RMW_QOS_POLICY_RELIABILITY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_RELIABILITY_RELIABLE = RELIABLE
    RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT = BEST_EFFORT
    RMW_QOS_POLICY_RELIABILITY_UNKNOWN = UNKNOWN


class DurabilityPolicy(IntEnum):
    """Whether late readers get old messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4
    RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL = TRANSIENT_LOCAL
    RMW_QOS_POLICY_DURABILITY_VOLATILE = VOLATILE
    RMW_QOS_POLICY_DURABILITY_UNKNOWN = UNKNOWN


class HistoryPolicy(IntEnum):
    """How many messages wait for a slow reader."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3
    RMW_QOS_POLICY_HISTORY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_HISTORY_KEEP_LAST = KEEP_LAST
    RMW_QOS_POLICY_HISTORY_KEEP_ALL = KEEP_ALL
    RMW_QOS_POLICY_HISTORY_UNKNOWN = UNKNOWN


class LivelinessPolicy(IntEnum):
    """How a writer shows that it lives; it always does here."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5
    RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_LIVELINESS_AUTOMATIC = AUTOMATIC
    RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC = MANUAL_BY_TOPIC
    RMW_QOS_POLICY_DURABILITY_UNKNOWN = UNKNOWN


class InvalidQoSProfileException(Exception):  # noqa: N818 — rclpy's name
    """A profile says neither how many messages wait nor that all do."""


@dataclass
class QoSProfile(PartialApi, missing=("get_c_qos_profile",)):
    """What a writer offers and a reader asks for; lifespan, deadline and lease are taken and change nothing here."""

    depth: Any = None
    history: HistoryPolicy = HistoryPolicy.UNKNOWN
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    liveliness: LivelinessPolicy = LivelinessPolicy.SYSTEM_DEFAULT
    lifespan: Any = None
    deadline: Any = None
    liveliness_lease_duration: Any = None
    avoid_ros_namespace_conventions: bool = False

    def __post_init__(self) -> None:
        if self.depth is None and self.history in (HistoryPolicy.UNKNOWN, HistoryPolicy.KEEP_LAST):
            raise InvalidQoSProfileException("a QoSProfile needs a depth, or the history KEEP_ALL")
        self.depth = 10 if self.depth is None else self.depth
        self.history = HistoryPolicy.KEEP_LAST if self.history == HistoryPolicy.UNKNOWN else self.history


def to_profile(given: QoSProfile | int) -> QoSProfile:
    """Return a profile; a number is the depth of the default one.

    Raises `TypeError` or `ValueError` as rclpy does, if it is neither.
    """
    if isinstance(given, QoSProfile):
        return given
    if not isinstance(given, int):
        raise TypeError(f"want a QoSProfile or a depth, came {type(given).__name__} {given!r}")
    if given < 0:
        raise ValueError(f"the depth must be 0 or more, came {given}")
    return QoSProfile(depth=given)


qos_profile_default = QoSProfile(depth=10)
qos_profile_system_default = QoSProfile(depth=10)
qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = QoSProfile(depth=10)
qos_profile_parameters = QoSProfile(depth=1000)


class QoSPresetProfiles(Enum):
    """The profiles by name."""

    UNKNOWN = QoSProfile(depth=10, reliability=ReliabilityPolicy.UNKNOWN)
    DEFAULT = qos_profile_default
    SYSTEM_DEFAULT = qos_profile_system_default
    SENSOR_DATA = qos_profile_sensor_data
    SERVICES_DEFAULT = qos_profile_services_default
    PARAMETERS = qos_profile_parameters
    PARAMETER_EVENTS = QoSProfile(depth=1000)
    ROSOUT_DEFAULT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ACTION_STATUS_DEFAULT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    BEST_AVAILABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_AVAILABLE)

    @classmethod
    def short_keys(cls) -> list[str]:
        """Return the names in lower case."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        """Return a profile by its name."""
        profile: QoSProfile = cls[name.upper()].value
        return profile


#: What `rclpy.qos` holds.
OFFERED = {
    "QoSProfile": QoSProfile,
    "InvalidQoSProfileException": InvalidQoSProfileException,
    "QoSPresetProfiles": QoSPresetProfiles,
    **{kind.__name__: kind for kind in (ReliabilityPolicy, DurabilityPolicy, HistoryPolicy, LivelinessPolicy)},
    **{f"QoS{kind.__name__}": kind for kind in (ReliabilityPolicy, DurabilityPolicy, HistoryPolicy, LivelinessPolicy)},
    **{name: profile for name, profile in globals().items() if name.startswith("qos_profile_")},
}
