"""The controllers by the names the command line and the score card use."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from limo_hog.exceptions import LimoHogError
from limo_hog.follow.control.tracking import TrackingController
from limo_hog.follow.control.workshop import ApproachController, ProxemicController
from limo_hog.follow.decision import Controller
from limo_hog.follow.tracks.asking import Whom

#: The workshop's two controllers, then the one to use.
CONTROLLERS = ("approach", "proxemic", "tracking")


class ControllerError(LimoHogError):
    """There is no such controller, or it has no such parameter."""


def controller_named(name: str, target_distance: float | None = None, person: Whom | None = None) -> Controller[Any]:
    """Return a controller, with another distance to hold [m] and with whom to follow first, where they are given.

    Raises `ControllerError` where there is none of that name, or it holds no distance or follows nobody in particular.
    """
    if person is not None and name in CONTROLLERS and name != "tracking":
        raise ControllerError(f"the {name} controller follows whoever is detected first: use tracking")
    if name == "approach":
        if target_distance is not None:
            raise ControllerError("the approach controller holds no distance: use proxemic or tracking")
        return ApproachController()
    if name not in CONTROLLERS:
        raise ControllerError(f"no controller {name!r}: want one of {', '.join(CONTROLLERS)}")
    controller = ProxemicController() if name == "proxemic" else TrackingController(person=person)
    return controller if target_distance is None else replace(controller, target_distance=target_distance)


def detector_of(controller: str) -> str:
    """Return which detector a controller is used with where none is asked for: the workshop's with OpenCV's HOG."""
    return "limo" if controller == "tracking" else "hog"
