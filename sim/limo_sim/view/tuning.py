"""A controller whose parameters can be changed while it drives."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Generic, TypeVar

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.sense.observation import Observation

S = TypeVar("S")


#: Parts of a controller whose numbers are offered with its own; the rest of `TrackingController` needs measurements.
_PARTS = ("steering", "search", "selection")


class ParameterError(LimoHogError):
    """A controller has no such parameter, or it cannot have that value."""


class Tunable(Generic[S]):
    """Stands for a controller, and can swap it for one with another parameter between two steps."""

    def __init__(self, controller: Controller[S]) -> None:
        self._controller = controller

    def start(self) -> S:
        """Return the state before the first observation."""
        return self._controller.start()

    def step(self, observation: Observation, state: S) -> Decision[S]:
        """Decide as the controller with today's parameters does."""
        return self._controller.step(observation, state)

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers that can be set, those of a part as "part.name"."""
        own = _fields(self._controller)
        parts = {
            f"{part}.{name}": number
            for part, value in own.items()
            for name, number in _fields(value).items()
            if part in _PARTS
        }
        return {name: value for name, value in (own | parts).items() if type(value) in (int, float)}

    def set(self, name: str, value: float) -> None:
        """Give a parameter a value; a whole number stays one.

        Raises
        ------
        ParameterError
            There is no such parameter, or the value is not a finite number from 0 on.
        """
        parameters = self.parameters
        if name not in parameters:
            raise ParameterError(f"no parameter {name!r}; there are {', '.join(parameters)}")
        if not isinstance(value, (int, float)) or not math.isfinite(value) or value < 0:
            raise ParameterError(f"{name}: got {value!r}, want a number from 0 on")
        controller: Any = self._controller
        part, _, field = name.rpartition(".")
        change = {field: type(parameters[name])(value)}
        if part:
            change = {part: dataclasses.replace(getattr(controller, part), **change)}
        self._controller = dataclasses.replace(controller, **change)


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a frozen dataclass by name; none of anything else."""
    if not dataclasses.is_dataclass(value):
        return {}
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
