"""Where a robot's sensors sit, by the frames of /tf_static."""

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import pytest

from limo_hog.follow import LIMO, RobotError, RobotGeometry
from limo_hog.ros2 import frames, messages

LEVEL = (0.0, 0.0, 0.0, 1.0)
OPTICAL = (-0.5, 0.5, -0.5, 0.5)
#: Child: parent, place, turn; the floor is 0.1 m below base_link.
TREE = {
    "base_link": ("base_footprint", (0.0, 0.0, 0.1), LEVEL),
    "mast": ("base_link", (0.05, 0.0, 0.1), LEVEL),
    "camera": ("mast", (0.15, 0.0, 0.05), LEVEL),
    "optical": ("camera", (0.0, 0.0, 0.0), OPTICAL),
    "laser": ("base_link", (-0.1, 0.0, 0.02), (0.0, 0.0, 1.0, 0.0)),
    "tilted": ("mast", (0.15, 0.0, 0.05), (0.0, math.sin(0.1), 0.0, math.cos(0.1))),
    "hanging": ("base_link", (0.1, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0)),
    "elsewhere": ("map", (1.0, 0.0, 0.0), LEVEL),
    "round": ("about", (0.0, 0.0, 0.0), LEVEL),
    "about": ("round", (0.0, 0.0, 0.0), LEVEL),
}


def mounts(tree: Mapping[str, tuple[Any, ...]] = TREE) -> frames.Mounts:
    made = frames.Mounts()
    made.take(frames._message([frames._transform(0.0, above, one, *at) for one, (above, *at) in tree.items()]))
    return made


@pytest.mark.parametrize("camera", ["camera", "optical"])
def test_sensors_sit_where_their_frames_do_above_the_floor(camera: str) -> None:
    robot, framed = mounts().applied(LIMO, "base_link", camera, "laser")
    assert framed == {"camera_x", "camera_z", "lidar_x", "lidar_z", "lidar_yaw"}
    told = robot.camera_x, robot.camera_z, robot.lidar_x, robot.lidar_z, abs(robot.lidar_yaw)
    assert told == pytest.approx((0.2, 0.25, -0.1, 0.12, math.pi))


def test_heights_count_from_the_base_without_a_footprint_and_a_files_stay() -> None:
    robot, _ = mounts({k: v for k, v in TREE.items() if k != "base_link"}).applied(LIMO, "base_link", "camera", "")
    assert robot.camera_z == pytest.approx(0.15)
    robot, _ = mounts().applied(replace(LIMO, camera_z=0.4), "base_link", "camera", "laser")
    assert (robot.camera_z, robot.camera_x) == pytest.approx((0.4, 0.2))


@pytest.mark.parametrize("frame", ["", "unknown", "elsewhere", "round"])
def test_a_sensor_whose_frame_is_not_below_the_base_sits_as_before(frame: str) -> None:
    assert mounts().applied(LIMO, "base_link", frame, frame) == (LIMO, frozenset())


MIXED = "/tf_static: camera_x · the robot's file: camera_z · a Limo's: lidar_x, lidar_yaw"


@pytest.mark.parametrize(
    ("file", "framed", "line"),
    [
        (LIMO, "", "a Limo's"),
        (LIMO, "camera_x camera_z lidar_x lidar_z lidar_yaw", "/tf_static"),
        (replace(LIMO, camera_x=0.2, camera_z=0.25, lidar_x=-0.1, lidar_yaw=3.0), "camera_x", "the robot's file"),
        (replace(LIMO, camera_z=0.25), "camera_x camera_z", MIXED),
    ],
)
def test_each_number_has_its_origin(file: RobotGeometry, framed: str, line: str) -> None:
    assert frames.whence(file, frozenset(framed.split())) == line


@pytest.mark.parametrize(
    ("camera", "lidar", "why"), [("tilted", "laser", "camera, tilted, does not"), ("camera", "hanging", "upside down")]
)
def test_a_sensor_that_is_not_level_is_refused(camera: str, lidar: str, why: str) -> None:
    with pytest.raises(RobotError, match=why):
        mounts().applied(LIMO, "base_link", camera, lidar)


def test_the_arenas_own_frames_give_back_its_robot() -> None:
    own = RobotGeometry(camera_x=0.2, camera_z=0.25, lidar_x=-0.1, lidar_z=0.2, lidar_yaw=3.0)
    read = frames.Mounts()
    read.take(frames.static_transforms(1.0, own))
    robot, names = read.applied(LIMO, messages.BASE_FRAME, messages.CAMERA_FRAME, messages.LIDAR_FRAME)
    assert len(names) == 5 and asdict(robot) == pytest.approx(asdict(own))
