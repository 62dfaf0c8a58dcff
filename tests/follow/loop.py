"""The follower's loop with a detector and a driver that are made up. Tests call `Follower` here alone."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from tests.follow.views import boxes, flat, scan, there

from limo_hog.detections import Detections
from limo_hog.follow import (
    Decision,
    Follower,
    Frame,
    FrameLog,
    Guard,
    Mode,
    Observation,
    Odometry,
    Region,
    Scan,
    Sensors,
    Twist,
)

IMAGE = np.full((480, 640, 3), 90, np.uint8)
SENSORS = Sensors(scan(), Odometry())
DEPTH = flat(8.0)
FOCAL_PX = 448.6
REGION = Region(96, 32, 208, 192, 150.0)


@dataclass
class Loop:
    """A follower whose detector finds one box and whose driver drives on and asks for a region.

    `shown` are the sizes of the images that were searched, `told` what the driver was told; where `fails` is set the
    detector raises it.
    """

    fails: Exception | None = None
    shown: list[tuple[int, ...]] = field(default_factory=list)
    told: list[Observation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._follower = Follower(self, self)

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        self.shown.append(image.shape)
        if self.fails is not None:
            raise self.fails
        return boxes((10, 20, 64, 128))

    def start(self) -> int:
        return 0

    def step(self, observation: Observation, state: int) -> Decision[int]:
        self.told.append(observation)
        return Decision(Twist(0.5, 0.1), state + 1, Mode.FOLLOW, f"step {state}", 0, REGION)

    def tick(self, now: float, frame: Frame | None, sensors: Sensors = SENSORS) -> FrameLog | None:
        return self._follower.tick(now, frame, sensors)

    def frame(self, now: float, sensors: Sensors = SENSORS, depth: NDArray[np.float32] | None = DEPTH) -> FrameLog:
        return there(self.tick(now, Frame(now, IMAGE, FOCAL_PX, depth), sensors))

    def between(self, now: float, turn: Scan | None = None, odometry: Odometry | None = None) -> Decision[None]:
        """The command of a control period without an image; the lidar hits nothing unless `turn` says otherwise."""
        return there(self.tick(now, None, Sensors(turn or scan(stamp=now), odometry or Odometry(now)))).decision


@dataclass(frozen=True)
class Headstrong:
    """Always wants the same."""

    twist: Twist

    def start(self) -> int:
        return 0

    def step(self, observation: Observation, state: int) -> Decision[int]:
        del observation
        return Decision(self.twist, state + 1, Mode.FOLLOW, "because")


def ahead(speed: float = 0.5) -> Guard[int]:
    return Guard(Headstrong(Twist(speed, 0.3)))
