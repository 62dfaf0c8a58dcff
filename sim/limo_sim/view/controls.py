"""Control messages of a page: pause, resume, step, speed, whom to follow, and the value of a parameter."""

from __future__ import annotations

import json
from typing import Any

from limo_hog.follow.tracks.asking import WhomError
from limo_sim.view.pace import Pace
from limo_sim.view.tuning import Parameter, ParameterError, Tunable

#: A control message is one flat JSON object of less than 100 bytes; one longer than this closes the connection.
MAX_BYTES = 1024
SPEED = Parameter("speed", 1.0, 0.0, 100.0, "×", "Simulated seconds in a second; 0 is as fast as it can.")


def apply(text: str, pace: Pace, controller: Tunable[Any] | None) -> str | None:
    """Apply a control message; returns what is wrong with it, None where it was applied."""
    try:
        message = json.loads(text)
        if "set" in message:
            if controller is None:
                return "this run has no parameters"
            controller.set(message["set"], message["value"])
        elif "follow" in message:
            if controller is None:
                return "this run has no follower of ours"
            controller.follow(message["follow"])
        elif message["do"] == "speed":
            pace.set_speed(SPEED.checked(message["value"]))
        else:
            {"pause": pace.pause, "resume": pace.resume, "step": pace.step}[message["do"]]()
    except (ParameterError, WhomError) as error:
        return str(error)
    except (ValueError, KeyError, TypeError, RecursionError):
        return f"not understood: {text[:100]}"
    return None
