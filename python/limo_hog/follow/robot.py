"""A robot as data: its outline, where its sensors and wheels sit, what it can do; and the command it is given.

Lengths are in the base frame: x forward, y left, z up, origin on the floor below the middle of the body.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from limo_hog.exceptions import LimoHogError
from limo_hog.extras import needed


class RobotError(LimoHogError, ValueError):
    """A robot that cannot be driven; the message names the file, the key and what is allowed."""


def _within(default: float, low: float, high: float) -> Any:
    return field(default=default, metadata={"range": (low, high)})


@dataclass(frozen=True, slots=True)
class RobotGeometry:
    """A robot with two driven sides; by default the Limo, its lengths from LCAS/limo_ros2's `limo_four_diff.xacro`.

    Raises `RobotError` for a value of another type, or out of its range.
    """

    half_length: float = _within(0.145, 0.02, 2.0)  #: Half of the body's outline [m].
    half_width: float = _within(0.11, 0.02, 2.0)
    #: Where the camera sits, ahead of the centre and above the floor [m]; it looks level and straight ahead.
    camera_x: float = _within(0.084, -2.0, 2.0)
    camera_z: float = _within(0.175, 0.02, 2.0)
    field_of_view: float = _within(1.23918, 0.2, 3.0)  #: Horizontal field of view of the camera [rad].
    #: Where the lidar sits, ahead of the centre and above the floor [m]; its plane is level.
    lidar_x: float = _within(0.103, -2.0, 2.0)
    lidar_z: float = _within(0.111, 0.01, 2.0)
    #: Which way the lidar's angle 0 looks [rad], counter-clockwise from straight ahead.
    lidar_yaw: float = _within(0.0, -math.tau, math.tau)
    #: Between the left and the right wheels, as the differential drive counts it [m].
    wheel_separation: float = _within(0.172, 0.02, 4.0)
    max_speed: float = _within(1.0, 0.01, 10.0)  #: The most that it is told to drive and to turn [m/s, rad/s].
    max_turn: float = _within(11.6, 0.01, 100.0)
    acceleration: float = _within(1.0, 0.05, 20.0)  #: How fast it speeds up and brakes [m/s²].
    may_back: bool = True  #: Whether it may drive backwards.

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if "range" not in item.metadata:
                if not isinstance(value, bool):
                    raise RobotError(f"{item.name}: got {value!r}, want true or false")
                continue
            low, high = item.metadata["range"]
            if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                raise RobotError(f"{item.name}: got {value!r}, want a number in {low:g} … {high:g}")

    def focal_px(self, width: int) -> float:
        """Return the camera's focal length for images of `width` [px]: 448.6 for 640."""
        return width / 2 / math.tan(self.field_of_view / 2)


LIMO = RobotGeometry()


def load_robot(path: str | Path) -> RobotGeometry:
    """Read a robot from a TOML file with `RobotGeometry`'s names; what is left out is the Limo's.

    Raises `RobotError` with the file, the key and what is allowed there.
    """
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        with needed(by="a robot's file"):
            import tomli as tomllib  # type: ignore[import-not-found]
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise RobotError(f"{path}: cannot be read as TOML: {error}") from error
    known = [item.name for item in fields(RobotGeometry)]
    for key in table:
        if key not in known:
            raise RobotError(f"{path}: {key}: unknown key, want one of {', '.join(known)}")
    try:
        return RobotGeometry(**table)
    except RobotError as error:
        raise RobotError(f"{path}: {error}") from None


@dataclass(frozen=True, slots=True)
class Twist:
    """What a differential-drive robot is told to do; the default is to stop."""

    linear: float = 0.0  #: Forward speed [m/s], along the robot's x axis.
    angular: float = 0.0  #: Turn rate [rad/s] about the robot's z axis, counter-clockwise positive.
