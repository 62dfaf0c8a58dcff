"""Callback groups: which callbacks may run while others wait."""

from __future__ import annotations

from typing import Any

from limo_sim.ros.rclpy_stub.partial import PartialApi


class CallbackGroup(PartialApi, missing=("beginning_execution", "ending_execution")):
    """Callbacks that are scheduled by the same rule."""

    def __init__(self) -> None:
        self._entities: list[Any] = []
        #: How many of its callbacks run now.
        self.running = 0

    def add_entity(self, entity: Any) -> None:
        """Add a subscription, timer, service or client."""
        self._entities.append(entity)

    def has_entity(self, entity: Any) -> bool:
        """Whether it belongs to the group."""
        return any(known is entity for known in self._entities)

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002 — rclpy's signature
        """Whether one more of its callbacks may begin."""
        return True


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Callbacks of which one runs at a time."""

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002 — rclpy's signature
        """Whether none of its callbacks runs."""
        return self.running == 0


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks that may run while others of the group wait."""
