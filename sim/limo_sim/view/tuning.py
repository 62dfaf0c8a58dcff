"""A controller whose parameters can be changed while it drives."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, Generic, TypeVar

from limo_hog.cv2_api.arguments import shown
from limo_hog.follow.decision import Controller, Decision
from limo_hog.follow.sense.observation import Observation
from limo_hog.live.controls import Parameter, ParameterError

S = TypeVar("S")

#: Where a field gives no bounds: from 0 to so many times its default.
_SPAN = 10.0


class Tunable(Generic[S]):
    """Stands for a controller, and can swap it for one with another parameter between two steps.

    Parameters are the numeric fields of a dataclass. A field's `metadata` may give `low`, `high`, `unit` and
    `tooltip`; unit and tooltip are otherwise those of the class's docstring, and bounds from 0 to ten times the
    default. Numbers of a field that is a dataclass itself are parameters where their metadata give bounds.
    """

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
        default: Any = field.default if type(field.default) in (int, float) else 0
        if type(value) in (int, float) and ("high" in about or not prefix):
            unit, tooltip = _documented(type(owner)).get(field.name, ("", ""))
            yield Parameter(
                prefix + field.name,
                value,
                about.get("low", 0),
                about.get("high", _SPAN * (abs(default) or 1)),
                about.get("unit", unit),
                about.get("tooltip", tooltip),
            )
        else:
            yield from _parameters_of(value, f"{prefix}{field.name}.")


def _replaced(owner: Any, path: list[str], value: float) -> Any:
    name, *rest = path
    return dataclasses.replace(owner, **{name: _replaced(getattr(owner, name), rest, value) if rest else value})


@cache
def _documented(kind: type) -> dict[str, tuple[str, str]]:
    """Read unit and meaning of each attribute from a class's docstring, in numpydoc's form.

    The unit is what first stands in brackets, [1] for none; an entry of several names may have as many units, or one
    for all.
    """
    _, _, section = (inspect.getdoc(kind) or "").partition("\nAttributes\n----------\n")
    found = {}
    for entry in re.finditer(r"^(\w[\w, ]*)\n((?:[ ]+.*\n?)+)", section, re.MULTILINE):
        names = [name.strip() for name in entry[1].split(",")]
        text = " ".join(entry[2].split())
        bracket = re.search(r" \[([^\]]*)\]", text)
        units = [one.strip() for one in bracket[1].split(",")] if bracket else ["1"]
        for i, name in enumerate(names):
            unit = units[i] if len(units) == len(names) else units[0]
            found[name] = ("" if unit == "1" else unit, text.replace(bracket[0], "", 1) if bracket else text)
    return found
