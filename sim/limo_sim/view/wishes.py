"""What a page may ask of a run: go on, stop, step, another speed, another value of a parameter."""

from __future__ import annotations

import json
from typing import Any

from limo_sim.view.pace import Pace
from limo_sim.view.tuning import Parameter, ParameterError, Tunable

#: A wish is one flat JSON object of less than 100 bytes; a longer message than this closes the connection.
MAX_BYTES = 1024
SPEED = Parameter("speed", 1.0, 0.0, 100.0, "×", "Simulated seconds in a second; 0 is as fast as it can.")


def obey(text: str, pace: Pace, controller: Tunable[Any] | None) -> str | None:
    """Do what a page wishes; returns what is wrong with the wish, None where it was done."""
    try:
        wish = json.loads(text)
        if "set" in wish:
            if controller is None:
                return "this run has no parameters"
            controller.set(wish["set"], wish["value"])
        elif wish["do"] == "speed":
            pace.set_speed(SPEED.checked(wish["value"]))
        else:
            {"pause": pace.pause, "resume": pace.resume, "step": pace.step}[wish["do"]]()
    except ParameterError as error:
        return str(error)
    except (ValueError, KeyError, TypeError, RecursionError):
        return f"not understood: {text[:100]}"
    return None
