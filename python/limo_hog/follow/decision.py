"""What a follower decides at one instant, and what every controller offers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Generic, Protocol, TypeVar

from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.sense.region import Region
from limo_hog.follow.twist import Twist

S = TypeVar("S")


class Mode(str, Enum):
    """What the follower is doing, in words for the score card."""

    SEARCH = "search"
    """Nobody has been found yet."""
    FOLLOW = "follow"
    """Somebody is being followed."""
    HOLD = "hold"
    """Somebody is being followed and stands where they should: no need to move."""
    BLOCKED = "blocked"
    """Something is in the way, or the senses cannot be trusted: the robot may not do what it wanted to."""
    LOST = "lost"
    """Somebody was followed and is not seen any more."""


@dataclass(frozen=True, slots=True)
class Decision(Generic[S]):
    """A controller's answer to one observation.

    Attributes
    ----------
    twist
        What the robot should do now.
    state
        What the controller wants back with the next observation.
    mode, reason
        What the follower is doing, and why, in a few words.
    target
        Index into `observation.detections` of the person who is followed; None where nobody is.
    region
        Where to look in the next frame; None asks for the whole image.
    """

    twist: Twist
    state: S
    mode: Mode
    reason: str
    target: int | None = None
    region: Region | None = None


class Controller(Protocol[S]):
    """Steers the robot by what it sees: parameters are frozen, all memory is in the state it is handed."""

    def start(self) -> S:
        """Return the state before the first observation."""
        ...

    def step(self, observation: Observation, state: S) -> Decision[S]:
        """Decide what to do about one observation."""
        ...
