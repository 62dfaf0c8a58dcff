"""A controller whose parameters can be changed while it drives."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterator
from typing import Any, Generic, TypeVar

from limo_hog.cv2_api.arguments import shown
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.tracks.asking import Whom, WhomError, checked

S = TypeVar("S")


class ParameterError(LimoHogError):
    """A controller has no such parameter, or it cannot have that value."""


@dataclasses.dataclass(frozen=True, slots=True)
class Parameter:
    """A number that can be set."""

    name: str  #: of the controller's field; of a field of a field with a dot between them
    value: float  #: what it is now; a whole number stays one
    #: low, high: what it may be, both included
    low: float
    high: float
    unit: str  #: its unit, such as "m" or "frames"
    tooltip: str  #: what it does, in a sentence

    @property
    def whole(self) -> bool:
        """Whether it is a whole number."""
        return isinstance(self.value, int)

    def checked(self, value: Any) -> float:
        """Return `value` as a number of this parameter's kind.

        Raises
        ------
        ParameterError
            It is no number within the bounds.
        """
        # A bool is an int to Python, and an int may be too long for a float; NaN is within no bounds.
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not self.low <= value <= self.high or (self.whole and value != int(value)):
            kind, unit = "whole number" if self.whole else "number", f" {self.unit}" if self.unit else ""
            raise ParameterError(
                f"{self.name}: got {shown(value)}, want a {kind} from {self.low:g} to {self.high:g}{unit}"
            )
        return type(self.value)(value)


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
        controller: Any = self._controller
        decision: Decision[S] = controller.step(observation, state if asked is None else controller.ask(asked, state))
        return decision

    def follow(self, whom: Whom) -> None:
        """Ask to follow a person from the next step on, as `Follower.follow`; raises `WhomError`."""
        if not hasattr(self._controller, "ask"):
            raise WhomError(f"{type(self._controller).__name__} follows nobody in particular")
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

        Raises
        ------
        ParameterError
            There is no such parameter, or the value is not a number within its bounds.
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
