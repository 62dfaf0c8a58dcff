"""Control messages of a page: pause, resume, step, speed, whom to follow, and the value of a parameter."""

from __future__ import annotations

import dataclasses
import json
from typing import Any, Protocol

from limo_hog.cv2_api.arguments import shown
from limo_hog.exceptions import LimoHogError
from limo_hog.live.pace import Pace

#: A control message is one flat JSON object of less than 100 bytes; one longer than this closes the connection.
MAX_BYTES = 1024


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
        """Return `value` as a number of this parameter's kind; raises `ParameterError` if it is none within bounds."""
        # A bool is an int to Python, and an int may be too long for a float; NaN is within no bounds.
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not self.low <= value <= self.high or (self.whole and value != int(value)):
            kind, unit = "whole number" if self.whole else "number", f" {self.unit}" if self.unit else ""
            raise ParameterError(
                f"{self.name}: got {shown(value)}, want a {kind} from {self.low:g} to {self.high:g}{unit}"
            )
        return type(self.value)(value)


SPEED = Parameter("speed", 1.0, 0.0, 100.0, "×", "Simulated seconds in a second; 0 is as fast as it can.")


class Settable(Protocol):
    """What has parameters; a follower has `follow(whom)`, too."""

    def set(self, name: str, value: Any) -> None:
        """Give a parameter a value; raises `ParameterError`."""


def apply(text: str, pace: Pace, controller: Settable | None) -> str | None:
    """Apply a control message; returns what is wrong with it, None where it was applied."""
    try:
        message = json.loads(text)
        if "set" in message:
            if controller is None:
                return "this run has no parameters"
            controller.set(message["set"], message["value"])
        elif "follow" in message:
            if controller is None or not hasattr(controller, "follow"):
                return "this run has no follower of ours"
            controller.follow(message["follow"])
        elif message["do"] == "speed":
            pace.set_speed(SPEED.checked(message["value"]))
        else:
            {"pause": pace.pause, "resume": pace.resume, "step": pace.step}[message["do"]]()
    except LimoHogError as error:
        return str(error)
    except (ValueError, KeyError, TypeError, RecursionError):
        return f"not understood: {text[:100]}"
    return None
