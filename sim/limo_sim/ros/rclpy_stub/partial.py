"""Classes of rclpy without some of their names: each of these raises an error that says so."""

from __future__ import annotations

from typing import Any, ClassVar

from limo_sim.ros.lockstep.records import StubError


class AttributeNotOfferedError(StubError, AttributeError):
    """An attribute that the class of ROS 2 has, and that limo-hog does not; `hasattr` is False."""


class PartialApi:
    """A class of rclpy; names that are `missing` from it are refused by name, any other is the script's own mistake.

    >>> class Publisher(PartialApi, missing=("assert_liveliness",)): ...
    """

    __missing: ClassVar[tuple[str, ...]] = ()
    __of: ClassVar[str] = ""

    def __init_subclass__(cls, *, missing: tuple[str, ...] = (), **options: Any) -> None:
        super().__init_subclass__(**options)
        if missing:
            cls.__missing, cls.__of = missing, cls.__name__

    def __getattr__(self, name: str) -> Any:
        if name in self.__missing:
            raise AttributeNotOfferedError(f"limo-hog run does not offer {self.__of}.{name}")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
