"""A robot is data: read from a file, and taken by the follower for guard and controller alike."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.follow.loop import DEPTH, FOCAL_PX, IMAGE, Headstrong, Loop
from tests.follow.views import scan, scan_of, there

from limo_hog.follow import (
    LIMO,
    Follower,
    Frame,
    Odometry,
    RobotError,
    RobotGeometry,
    Sensors,
    TrackingController,
    Twist,
    load_robot,
)
from limo_hog.follow.decision import made_for

TALL = RobotGeometry(half_length=0.25, half_width=0.2, camera_z=0.25, field_of_view=math.pi / 3, lidar_yaw=math.pi)


def driven(robot: RobotGeometry, wanted: Twist, sensors: Sensors) -> tuple[Twist, str]:
    frame = Frame(0.0, IMAGE, FOCAL_PX, DEPTH)
    decision = there(Follower(Headstrong(wanted), Loop(), robot).tick(0.0, frame, sensors)).decision
    return decision.twist, decision.reason


@pytest.mark.parametrize("page", ["docs/own-robot.md", "docs/follower.md", "examples/robot/robot.toml"])
def test_the_robots_of_the_pages_are_robots(page: str, tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / page).read_text(encoding="utf-8")
    robots = re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if page.endswith(".md") else [text]
    (tmp_path / "robot.toml").write_text("".join(robots))
    assert load_robot(tmp_path / "robot.toml").camera_z == 0.25


def test_a_file_names_what_differs_from_the_limo(tmp_path: Path) -> None:
    path = tmp_path / "tall.toml"
    with pytest.raises(RobotError, match=r"tall\.toml: No such file or directory$"):
        load_robot(path)
    path.write_text("half_length = 0.25\ncamera_z = 0.25\nmay_back = false\nmax_speed = 1\n")
    assert load_robot(path) == replace(LIMO, half_length=0.25, camera_z=0.25, may_back=False)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("half_lenght = 0.2", "half_lenght: unknown key, want one of half_length, half_width"),
        ("camera_z = 'high'", "camera_z: got 'high', want a number in 0.02 … 2"),
        ("max_speed = -1.0", "max_speed: got -1.0, want a number in 0.01 … 10"),
        ("max_speed = nan", "max_speed: got nan"),
        ("may_back = 1", "may_back: got 1, want true or false"),
        ("half_length = ", "cannot be read as TOML"),
    ],
)
def test_a_wrong_file_is_refused_by_file_key_and_what_is_allowed(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(RobotError, match=r"robot\.toml") as refused:
        load_robot(path)
    assert why in str(refused.value)


def test_a_longer_robot_stops_earlier_and_one_of_weak_brakes_keeps_more_room() -> None:
    post = Sensors(scan_of([(0.80, 0.0)]), Odometry())
    assert driven(LIMO, Twist(0.5, 0.0), post)[0].linear > 0
    assert driven(replace(LIMO, half_length=0.25), Twist(0.5, 0.0), post)[0].linear == 0
    post = Sensors(scan_of([(1.2, 0.0)]), Odometry())
    speeds = [driven(replace(LIMO, acceleration=a), Twist(0.9, 0.0), post)[0].linear for a in (0.3, 1.0)]
    assert 0 < speeds[0] < speeds[1] < 0.9


def test_no_command_is_faster_than_the_robot_or_backs_one_that_may_not() -> None:
    free = Sensors(scan(), Odometry())
    slow = replace(LIMO, max_speed=0.3, max_turn=0.5, may_back=False)
    assert driven(slow, Twist(0.7, 2.0), free)[0] == Twist(0.3, 0.5)
    assert driven(slow, Twist(0.1, -2.0), free)[0] == Twist(0.1, -0.5)
    assert driven(slow, Twist(-0.2, 0.0), free) == (Twist(), "the robot does not back at all")
    assert driven(replace(LIMO, max_speed=0.1), Twist(-0.2, 0.0), free)[0] == Twist(-0.1, 0.0)


def test_a_lidar_that_looks_backwards_guards_the_way_back_not_the_way_ahead() -> None:
    # The same beam, straight ahead of the lidar: 0.5 m off, ahead of a Limo and behind the other.
    turned = replace(LIMO, lidar_x=0.0, lidar_yaw=math.pi)
    ranges = np.full(292, np.inf, np.float32)
    ranges[140:152] = 0.5
    post = Sensors(scan(ranges), Odometry())
    assert driven(replace(turned, lidar_yaw=0.0), Twist(0.3, 0.0), post)[0].linear == 0
    assert driven(turned, Twist(0.3, 0.0), post)[0].linear == 0.3
    assert driven(turned, Twist(-0.3, 0.0), post) == (Twist(), "an obstacle is too close behind")


def test_a_controller_that_knows_its_robot_is_given_the_followers() -> None:
    tracking = made_for(TrackingController(), TALL)
    assert isinstance(tracking, TrackingController)
    assert tracking.robot == tracking.tracker.robot == tracking.tracker.movers.robot == TALL
    with pytest.raises(RobotError, match="another robot"):
        Follower(TrackingController(robot=TALL), Loop(), replace(TALL, camera_z=0.3))
