"""The arena's robot is the one of a file: its camera, its lidar, its outline, its wheels."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.follow.loop import Headstrong
from tests.sim.logs import drive

from limo_hog import PeopleDetector
from limo_hog.follow import LIMO, Follower, RobotError, Twist
from limo_hog.follow.sense.clearance import completed, scan_points
from limo_hog.follow.sense.observation import Sensors
from limo_sim.run.arena import Arena
from limo_sim.run.provenance import scenario_hash
from limo_sim.world.scenario import Camera, Depth, Lidar, Room, Scenario, Wall, Wheels
from limo_sim.world.schema import ScenarioError

OWN = """
half_length = 0.25
half_width = 0.18
camera_x = 0.2
camera_z = 0.25
field_of_view = 1.0472
lidar_x = -0.1
lidar_yaw = 3.14159265
wheel_separation = 0.3
max_speed = 0.6
acceleration = 0.5
"""


def own(tmp_path: Path, text: str = OWN, scenario: str = "empty") -> Scenario:
    (tmp_path / "robot.toml").write_text(text)
    return Scenario.load(scenario, tmp_path / "robot.toml")


def quiet(scenario: Scenario) -> Scenario:
    exact: dict[str, Any] = {"depth": Depth(noise=0.0, invalid=0.0, far_m=20.0), "camera": Camera(noise=0.0)}
    exact |= {"lidar": Lidar(noise_m=0.0), "odometry": Wheels(slip=0.0), "room": Room(3.0)}
    return dataclasses.replace(scenario, **exact)


def test_the_camera_sees_from_where_it_sits_and_as_wide_as_it_is(tmp_path: Path) -> None:
    frame = Arena(quiet(own(tmp_path))).frame()
    assert frame.focal_px == pytest.approx(320 / math.tan(math.radians(30)), rel=1e-4)
    assert frame.depth[479, 320] == pytest.approx(0.25 * frame.focal_px / 239.5, rel=1e-4)
    assert frame.depth[240, 320] == pytest.approx(3.0 - 0.2, abs=1e-3)


def test_the_lidar_looks_where_it_is_turned_and_the_follower_turns_it_back(tmp_path: Path) -> None:
    scenario = dataclasses.replace(quiet(own(tmp_path)), walls=(Wall((-1.5, -2.9), (-1.5, 2.9), 0.02),))
    arena = Arena(scenario)
    ranges = arena.scan().ranges
    assert ranges[len(ranges) // 2] == pytest.approx(1.49 - 0.1, abs=5e-3)
    told = arena.scan().turned(scenario.robot.geometry.lidar_yaw)
    assert math.cos((told.angle_min + told.angle_max) / 2) == pytest.approx(-1.0)


def test_where_the_lidar_does_not_look_the_depth_image_completes_the_scan(tmp_path: Path) -> None:
    scenario = quiet(own(tmp_path))
    arena, robot = Arena(scenario), scenario.robot.geometry
    scan = completed(arena.scan().turned(robot.lidar_yaw), arena.frame(), arena.odometry(), robot)
    angles = np.array([0.0, 0.4, -0.4, 0.8, np.pi])
    assert scan.looks_at(angles).tolist() == [True, True, True, False, True]
    points = scan_points(scan, robot)
    ahead = points[np.abs(np.arctan2(points[:, 1], points[:, 0])) < 0.4]
    assert len(ahead) > 50
    assert ahead[:, 0] == pytest.approx(np.full(len(ahead), 3.0), abs=0.01)  # the wall, as far as it is
    # A Limo's lidar looks where the camera does.
    limo = Arena(quiet(own(tmp_path, "")))
    assert completed(limo.scan(), limo.frame(), limo.odometry(), LIMO) is limo.scan()


def test_wheels_do_what_the_file_says(tmp_path: Path) -> None:
    arena = Arena(quiet(own(tmp_path)))
    assert drive(arena, 0.5, Twist(1.0, 0.0)).odometry().linear == pytest.approx(0.25, abs=0.011)
    assert drive(arena, 3.0, Twist(0.0, 5.0)).odometry().angular == pytest.approx(2 * 0.6 / 0.3, abs=1e-6)


@pytest.mark.parametrize("text", ["", OWN], ids=["limo", "own"])
def test_the_outline_keeps_its_distance_from_a_wall(text: str, tmp_path: Path) -> None:
    arena = Arena(quiet(own(tmp_path, text)))
    follower = Follower(Headstrong(Twist(0.6, 0.0)), PeopleDetector(), arena.robot)
    while arena.time < 14.0:
        log = follower.tick(arena.time, arena.frame(), Sensors(arena.scan(), arena.odometry()))
        if log is not None:
            arena.command(log.decision.twist)
        arena.step()
    gap = 3.0 - arena.plan().robot[0] - arena.robot.half_length
    assert arena.contacts.wall == 0
    assert gap == pytest.approx(0.6, abs=0.01)  # `Margin.ahead`
    assert np.hypot(*arena.plan().robot[:2]) > 1.5


def test_a_scenario_may_bring_its_robot_and_a_wrong_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text("[robot.geometry]\ncamera_z = 0.25\n")
    scenario = Scenario.load(path)
    assert scenario.robot.geometry == dataclasses.replace(LIMO, camera_z=0.25)
    assert scenario_hash(scenario) != scenario_hash(Scenario()) == scenario_hash(own(tmp_path, ""))
    path.write_text("[robot.geometry]\ncamera_z = 5.0\n")
    with pytest.raises(ScenarioError, match=r"own\.toml: robot\.geometry\.camera_z: got 5\.0, want .* 0\.02"):
        Scenario.load(path)
    with pytest.raises(RobotError, match=r"robot\.toml: wings: unknown key"):
        own(tmp_path, "wings = 2")
    path.write_text('[[furniture]]\nkind = "cone"\nx = 1.0\ny = 0.0\n')
    with pytest.raises(ScenarioError, match=r"furniture\[0\]: is 0\.80 m from .*, want at least 1\.41 m"):
        own(tmp_path, "half_length = 1.0\nhalf_width = 1.0", str(path))
