"""A controller whose parameters can be changed while it drives."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterator
from typing import Any, Generic, TypeVar

from limo_hog.cv2_api.arguments import shown
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.tracks.asking import Whom, ask_of, checked
from limo_hog.live.controls import Parameter, ParameterError

S = TypeVar("S")


class Tunable(Generic[S]):
    """Stands for a controller, and can swap it for one with another parameter between two steps.

    Parameters are the numbers that `limo_hog.follow.parameters.param` gives bounds, in a dataclass and its fields.
    """

    def __init__(self, controller: Controller[S]) -> None:
        self._controller = controller
        self._asked: Whom | None = None

    def start(self) -> S:
        """Return the state before the first observation."""
        return self._controller.start()

    def step(self, observation: Observation, state: S) -> Decision[S]:
        """Decide as the controller with today's parameters does."""
        asked, self._asked = self._asked, None
        if asked is not None:
            state = ask_of(self._controller)(asked, state)
        return self._controller.step(observation, state)

    def follow(self, whom: Whom) -> None:
        """Ask to follow a person from the next step on, as `Follower.follow`; raises `WhomError`."""
        ask_of(self._controller)
        self._asked = checked(whom)

    @property
    def target_distance(self) -> float | None:
        """Distance that the controller holds now [m]; None where it holds none."""
        target = self.parameters.get("target_distance")
        return None if target is None else target.value

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The numbers that can be set, by name."""
        return {parameter.name: parameter for parameter in _parameters_of(self._controller)}

    def set(self, name: str, value: Any) -> None:
        """Give a parameter a value.

        Raises `ParameterError` where there is no such parameter, or the value is not a number within its bounds.
        """
        parameters = self.parameters
        if name not in parameters:
            near = difflib.get_close_matches(name, parameters, n=5, cutoff=0.3) or [*parameters][:5]
            raise ParameterError(f"no parameter {shown(name)} among {len(parameters)}; {', '.join(near)} come nearest")
        self._controller = _replaced(self._controller, name.split("."), parameters[name].checked(value))


def _parameters_of(owner: Any, prefix: str = "") -> Iterator[Parameter]:
    if not dataclasses.is_dataclass(owner) or isinstance(owner, type):
        return
    for field in dataclasses.fields(owner):
        value, about = getattr(owner, field.name), field.metadata
        if "high" in about:
            yield Parameter(prefix + field.name, value, **about)
        else:
            yield from _parameters_of(value, f"{prefix}{field.name}.")


def _replaced(owner: Any, path: list[str], value: float) -> Any:
    name, *rest = path
    return dataclasses.replace(owner, **{name: _replaced(getattr(owner, name), rest, value) if rest else value})
