"""What of a class of rclpy `limo-hog run` leaves out: each name raises an error that says so."""

from __future__ import annotations

from typing import Any, ClassVar

from limo_sim.ros.lockstep.records import StubError


class AttributeNotOfferedError(StubError, AttributeError):
    """An attribute that the class of ROS 2 has, and that limo-hog does not; `hasattr` is False."""


class Offered:
    """A class of rclpy: names of `_not_offered` are refused by name, any other is the script's own mistake."""

    _not_offered: ClassVar[tuple[str, ...]] = ()

    def __getattr__(self, name: str) -> Any:
        kind = next((base.__name__ for base in type(self).__mro__ if "_not_offered" in vars(base)), "")
        if name in self._not_offered:
            raise AttributeNotOfferedError(f"limo-hog run does not offer {kind}.{name}")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
