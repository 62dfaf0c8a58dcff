"""What is noted of a run in lock step: commands, pictures and boxes, each with its time."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.exceptions import LimoHogError
from limo_hog.follow.pipeline import Periods
from limo_hog.follow.robot import Twist
from limo_sim.ros.interfaces import Message
from limo_sim.run.log import Step
from limo_sim.run.score import Scorer

#: Takes what a script logs: time [s], level, logger, message.
Log = Callable[[float, str, str, str], None]


class StubError(LimoHogError):
    """A script uses something that `limo-hog run` does not offer, or sends a command that is not finite."""


class Reader(Protocol):
    """A subscription; one that `keeps` is given what was published before it."""

    topic: str
    keeps: bool

    def offer(self, message: Message) -> None:
        """Queue a message, which is the reader's own."""
        ...


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


@dataclass
class Past:
    """What is known of a run that another process began: enough to go on with it.

    Attributes
    ----------
    scorer
        Has measured every control period.
    commands
        Time [s], linear [m/s] and angular speed [rad/s] of every command, one after another.
    periods
        When the last control period began.
    found
        Whether a control period had a target.
    detector_inputs, target_distance
        As `World` has them.
    """

    scorer: Scorer
    commands: array[float] = field(default_factory=lambda: array("d"))
    periods: Periods = field(default_factory=Periods)
    found: bool = False
    detector_inputs: list[str] = field(default_factory=list)
    target_distance: float | None = None

    def add(self, step: Step) -> None:
        """Take the next control period."""
        self.scorer.add(step)
        self.periods.begins(step.log.time, None)
        self.found |= step.log.decision.target is not None
