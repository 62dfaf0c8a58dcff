"""What is noted of a run in lock step: commands, pictures and boxes, each with its time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.robot import Twist

#: Takes what a script logs: time [s], level, logger, message.
Log = Callable[[float, str, str, str], None]


class StubError(LimoHogError):
    """A script uses something that `limo-hog run` does not offer, or sends a command that is not finite."""


@dataclass(frozen=True, slots=True)
class Found:
    """What the script's HOG detector found in one image, in pixels of that image."""

    shape: tuple[int, ...]
    detections: Detections
    ms: float


@dataclass(frozen=True, slots=True)
class Command:
    """A command the script sent, when [s], and from which line of the script."""

    time: float
    twist: Twist
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Shown:
    """A picture in a window, and when [s]."""

    time: float
    picture: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Callback:
    """When a callback began, and how long it slept [s of simulated time]."""

    time: float
    slept: float


@dataclass(frozen=True, slots=True)
class Fault:
    """Why a script ended before its time."""

    how: str  #: such as "failed with ValueError", "hung" or "died"
    message: str  #: in one line
    traceback: str = ""  #: the script's part of it; "" without an exception
    line: int | None = None  #: of the script; None where it is not known
