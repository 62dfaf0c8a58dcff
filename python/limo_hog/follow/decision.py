"""What a follower decides at one instant, and the interface of every controller."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO, RobotError, RobotGeometry, Twist
from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.sense.region import Region

S = TypeVar("S")


class Mode(str, Enum):
    """What the follower is doing, in words for the score card."""

    SEARCH = "search"  #: No person has been found yet.
    FOLLOW = "follow"  #: A person is being followed.
    HOLD = "hold"  #: The followed person is at the target distance: no need to drive.
    BLOCKED = "blocked"  #: An obstacle is in the way, or an input is faulty: the command was not let through.
    LOST = "lost"  #: A person was followed and is not found any more.
    DRIVE = "drive"  #: The robot is commanded by a node that does not say what it is doing: it moves.
    STAND = "stand"  #: The same, and it does not move.


class Believed(NamedTuple):
    """A tracked person: where, how surely, and which of the frame's boxes is theirs."""

    x: float  #: Position in the base frame [m].
    y: float
    probability: float  #: That it is a person, 0 … 1.
    number: int = 0  #: Identifies the person; never used twice.
    vx: float = 0.0  #: Velocity over the ground, along the base frame's axes [m/s].
    vy: float = 0.0
    box: int | None = None  #: Index into `observation.detections`; None where HOG did not find them in this frame.
    same: float | None = None  #: Probability that it is the person followed, 0 … 1; None while none was followed.


@dataclass(frozen=True, slots=True)
class Belief:
    """What a controller takes to be true, for those who watch; nothing is decided by it."""

    #: Distance it holds now [m], more than its target where the camera would else cut the person off; None without one.
    keeps: float | None = None
    people: tuple[Believed, ...] = ()  #: Everyone tracked.
    #: Where a lost person may be, each as likely: x, y in the base frame [m].
    places: tuple[tuple[float, float], ...] = ()
    way: tuple[tuple[float, float], ...] = ()  #: The way it means to drive: x, y in the base frame [m].
    followed: int | None = None  #: Number of the person followed; None while there is none.
    rollout: tuple[tuple[float, float], ...] = ()  #: Where the command leads: x, y in the base frame [m].
    #: float64 (K, T, 2) [m], base frame: where each of the commands compared leads; None without any.
    rollouts: NDArray[np.float64] | None = field(default=None, compare=False)
    shares: tuple[tuple[str, float], ...] = ()  #: What each critic adds to its cost, by name.


@dataclass(frozen=True, slots=True)
class Decision(Generic[S]):
    """A controller's answer to one observation."""

    twist: Twist  #: What the robot should do now.
    state: S  #: The controller's memory, to be handed in with the next observation.
    mode: Mode  #: What the follower is doing, and why, in a few words.
    reason: str
    target: int | None = None  #: Index into `observation.detections` of the person followed; None where there is none.
    region: Region | None = None  #: Where to look in the next frame; None asks for the whole image.
    belief: Belief = field(default_factory=Belief)  #: What the controller takes to be true.


class Controller(Protocol[S]):
    """Steers the robot by observations: parameters are frozen, all memory is in the state."""

    def start(self) -> S:
        """Return the state before the first observation."""

    def step(self, observation: Observation, state: S) -> Decision[S]:
        """Decide what to do about one observation."""


def made_for(controller: Controller[S], robot: RobotGeometry) -> Controller[S]:
    """Return a controller that drives `robot`: one that knows its robot is given this one.

    Raises `RobotError` for one that was made for another robot than the Limo and this one.
    """
    known = getattr(controller, "robot", robot)
    if known not in (robot, LIMO):
        raise RobotError("the controller was made for another robot: give the follower the same")
    return controller if known == robot else replace(controller, robot=robot)  # type: ignore[type-var]
