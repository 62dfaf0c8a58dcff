"""A controller whose parameters can be changed while it drives."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Generic, TypeVar

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.sense.observation import Observation

S = TypeVar("S")


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
    def target_distance(self) -> float | None:
        """Distance that the controller holds now [m]; None where it holds none."""
        return self.parameters.get("target_distance")

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers that can be set."""
        if not dataclasses.is_dataclass(self._controller):
            return {}
        values: dict[str, Any] = {
            field.name: getattr(self._controller, field.name) for field in dataclasses.fields(self._controller)
        }
        return {name: value for name, value in values.items() if type(value) in (int, float)}

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
        self._controller = dataclasses.replace(controller, **{name: type(parameters[name])(value)})
