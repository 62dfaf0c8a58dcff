"""What a robot would see, made up: observations for controllers, without a simulator."""

import math
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.follow.robot import Twist
from limo_hog.follow.sense.observation import Observation, Odometry, Scan

WIDTH, HEIGHT, FOCAL = 640, 480, 448.6
RED, GREEN, BLUE = (40, 40, 170), (50, 140, 50), (130, 50, 35)
NOBODY = Detections.none()
T = TypeVar("T")


def there(one: T | None) -> T:
    """Return what is there: somebody in the arena, a box in the image."""
    assert one is not None
    return one


def boxes(*rows: tuple[int, int, int, int], scores: tuple[float, ...] | None = None) -> Detections:
    """Detections at the given boxes, all equally sure unless `scores` says otherwise."""
    chosen = scores if scores is not None else (2.0,) * len(rows)
    return Detections(np.array(rows, np.int32).reshape(-1, 4), np.array(chosen, np.float64))


def dressed(
    box: tuple[int, int, int, int], shirt: tuple[int, int, int], trousers: tuple[int, int, int]
) -> NDArray[np.uint8]:
    """A grey image with a person in a detection window, in BGR colours: a shirt above, trousers below."""
    x, y, w, h = box
    image = np.full((HEIGHT, WIDTH, 3), 180, np.uint8)
    left, right = x + round(0.35 * w), x + round(0.65 * w)
    image[y + round(0.25 * h) : y + round(0.49 * h), left:right] = shirt
    image[y + round(0.49 * h) : y + round(0.85 * h), left:right] = trousers
    return image


def flat(depth: float) -> NDArray[np.float32]:
    return np.full((HEIGHT, WIDTH), depth, np.float32)


def before_wall(depth: float, box: tuple[int, int, int, int], wall: float = 8.0) -> NDArray[np.float32]:
    """A depth image of a person in a detection window, half as wide, three quarters as high, and a wall behind."""
    x, y, w, h = box
    image = flat(wall)
    image[max(y + h // 8, 0) : y + h - h // 8, max(x + w // 4, 0) : max(x + w - w // 4, 0)] = depth
    return image


def scan(ranges: NDArray[np.float32] | None = None, stamp: float = 0.0) -> Scan:
    """A lidar turn; nothing hit unless `ranges` says otherwise."""
    return Scan(stamp, np.full(292, np.inf, np.float32) if ranges is None else ranges, -2.0, 2.0, 0.12, 8.0)


def scan_of(points: list[tuple[float, float]], stamp: float = 0.0) -> Scan:
    """A lidar turn that hits points of the base frame, each 3 beams wide."""
    ranges = np.full(292, np.inf, np.float32)
    for x, y in points:
        beam = round((math.atan2(y, x - 0.103) + 2.0) / 4.0 * 291)
        ranges[max(beam - 1, 0) : beam + 2] = math.hypot(x - 0.103, y)
    return scan(ranges, stamp)


def look(detections: Detections = NOBODY, stamp: float = 0.0) -> Observation:
    return Observation(stamp, WIDTH, HEIGHT, FOCAL, detections)


@dataclass
class World:
    """One person, a robot that does as it is told, a perfect camera of 10 frames a second, and no furniture."""

    person: tuple[float, float] = (3.0, 0.0)
    velocity: tuple[float, float] = (0.0, 0.0)
    robot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    time: float = 0.0
    period: float = 0.1
    lidar: bool = True
    told: Twist = field(default_factory=Twist)

    @property
    def bearing(self) -> float:
        x, y, yaw = self.robot
        return math.remainder(math.atan2(self.person[1] - y, self.person[0] - x) - yaw, math.tau)

    @property
    def distance(self) -> float:
        return math.dist(self.person, self.robot[:2])

    def observe(self, *, visible: bool = True, score: float = 3.0) -> Observation:
        """What the robot sees now: the person's box and depth where they are in view."""
        x, y, yaw = self.robot
        depth = self.distance * math.cos(self.bearing) - 0.084
        odometry = Odometry(self.time, x, y, yaw, self.told.linear, self.told.angular)
        turn = scan(stamp=self.time) if self.lidar else None
        seen = replace(look(stamp=self.time), depth=flat(8.0), scan=turn, odometry=odometry)
        if not visible or abs(self.bearing) > 0.55:
            return seen
        height = 0.9 * FOCAL / depth
        column = WIDTH / 2 - FOCAL * self.distance * math.sin(self.bearing) / depth
        row = HEIGHT / 2 - 0.275 * FOCAL / depth
        window = 1.33 * height
        box = tuple(round(v) for v in (column - window / 4, row - window / 2, window / 2, window))
        return replace(seen, detections=boxes(box, scores=(score,)), depth=before_wall(depth, box))  # type: ignore[arg-type]

    def drive(self, twist: Twist) -> None:
        self.told = twist
        x, y, yaw = self.robot
        yaw += twist.angular * self.period
        x += twist.linear * self.period * math.cos(yaw)
        y += twist.linear * self.period * math.sin(yaw)
        self.robot = x, y, yaw
        self.person = tuple(p + v * self.period for p, v in zip(self.person, self.velocity, strict=True))  # type: ignore[assignment]
        self.time += self.period
