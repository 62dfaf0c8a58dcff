"""A replay goes by the robot's rules: which depth image belongs to a picture, and what a failing detector means."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest import MonkeyPatch
from tests.answers import AnswerTo
from tests.follow.views import scan

from limo_hog.cli import replay as command
from limo_hog.cli.main import main
from limo_hog.detections import Detections
from limo_hog.follow import LIMO, Decision, Follower, Mode, Observation, Odometry, RobotGeometry, Twist
from limo_hog.ros2 import messages, names
from limo_hog.ros2.bag import Record, bag_writer
from limo_hog.ros2.findings import stamped_twist
from limo_hog.ros2.frames import static_transforms
from limo_hog.ros2.replay import replay
from limo_hog.ros2.senses import Senses

PICTURE = np.zeros((48, 64, 3), np.uint8)


@dataclass
class Driver:
    """Drives on, and notes what it is told."""

    told: list[Observation] = field(default_factory=list)

    def start(self) -> None:
        return None

    def step(self, observation: Observation, state: None) -> Decision[None]:
        del state
        self.told.append(observation)
        return Decision(Twist(0.2, 0.0), None, Mode.FOLLOW, "because")


@dataclass
class Finder:
    """Finds nobody; fails in one picture, counted from 1."""

    fails_in: int = 0
    calls: int = 0

    def detect(self, _: NDArray[np.uint8]) -> Detections:
        self.calls += 1
        if self.calls == self.fails_in:
            raise RuntimeError("out of memory")
        return Detections.none()


def depth(metres: float) -> NDArray[np.float32]:
    return np.full((48, 64), metres, np.float32)


def records(*depths: tuple[float, NDArray[Any]], stamp: float = 1.0) -> Iterator[Record]:
    """A camera's calibration, depth images at their stamps, a picture, and the command that answered it."""
    yield Record(names.CAMERA_INFO, 0.0, messages.camera_info(0.0, 64, 48, 50.0))
    for at, pixels in depths:
        yield Record(names.DEPTH, at, messages.image(at, pixels))
    yield Record(names.IMAGE, stamp, messages.image(stamp, PICTURE))
    yield Record(names.COMMAND, stamp, messages.twist(Twist()))


DEPTHS = {
    "its own": ([(1.0, depth(2.0))], 2.0),
    "earlier": ([(0.96, depth(2.0))], 2.0),
    "too early": ([(0.94, depth(2.0))], None),
    "too late": ([(1.06, depth(2.0))], None),
    "not the newest": ([(0.9, depth(1.0)), (0.98, depth(2.0)), (1.04, depth(3.0))], 2.0),
    "millimetres": ([(1.0, np.full((48, 64), 2500, np.uint16))], 2.5),
    "of another size": ([(1.0, np.ones((24, 32), np.float32))], None),
}


@pytest.mark.parametrize(("depths", "told"), DEPTHS.values(), ids=DEPTHS)
def test_a_depth_image_belongs_to_the_picture_that_is_nearest_in_time(depths: Any, told: float | None) -> None:
    driver = Driver()
    assert len(list(replay(records(*depths), driver, Finder()))) == 1
    given = driver.told[0].depth
    assert (None if given is None else given[0, 0]) == told


def test_until_the_calibration_comes_the_limos_own_focal_length_is_taken() -> None:
    senses = Senses()
    assert senses.frame(0.0, np.zeros((480, 640, 3), np.uint8)).focal_px == pytest.approx(448.6, abs=0.05)
    assert senses.frame(0.0, np.zeros((240, 320, 3), np.uint8)).focal_px == pytest.approx(224.3, abs=0.05)
    senses.take(messages.camera_info(0.0, 640, 480, 0.0))
    assert senses.focal_px is None
    senses.take(messages.camera_info(0.0, 640, 480, 500.0))
    assert senses.frame(0.0, PICTURE).focal_px == 500.0


def frames(count: int) -> Iterator[Record]:
    yield Record(names.CAMERA_INFO, 0.0, messages.camera_info(0.0, 64, 48, 50.0))
    for at in (0.1 * k for k in range(count)):
        yield Record(names.DEPTH, at, messages.image(at, depth(8.0)))
        yield Record(names.SCAN, at, messages.laser_scan(scan(stamp=at)))
        yield Record(names.ODOMETRY, at, messages.odometry(Odometry(at)))
        yield Record(names.IMAGE, at, messages.image(at, PICTURE))


def bag(path: Path, records: Iterable[Record]) -> str:
    """Record; returns the recording's name."""
    with bag_writer(path / "run.mcap") as write:
        for record in records:
            write(*record)
    return str(path / "run.mcap")


@pytest.mark.parametrize("kind", ["Twist", "TwistStamped"])
def test_the_recorded_command_is_what_drove_the_robot_of_either_type(kind: str) -> None:
    drove = Twist(0.3, -0.2)
    planned = Record("/cmd_vel_nav", 1.01, messages.twist(Twist(9.0, 9.0)))
    sent = messages.twist(drove) if kind == "Twist" else stamped_twist(1.02, drove)
    *before, _ = records()
    done = list(replay([*before, planned, Record(names.COMMAND, 1.02, sent)], Driver(), Finder()))
    assert [frame.recorded_twist for frame in done] == [drove]


def test_failures_are_counted_and_the_first_is_told(here: Path, monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    monkeypatch.setattr(command, "detector_named", lambda _name: Finder(fails_in=2))
    code, out, err = answer_to("replay", bag(here, frames(3)), "--json", "-")
    card = json.loads(out)
    assert (code, card["frames"], card["detector_failures"]) == (0, 3, 1)
    assert "1 of 3 frames: the detector failed: out of memory" in err


def test_one_line_says_which_senses_are_there_and_which_are_not() -> None:
    senses = Senses()
    assert senses.present() == "camera yes · camera_info no, 71° wide is assumed · depth no · scan NO · odom no"
    assert "scan no" in senses.present(without_lidar=True)
    senses.take(messages.camera_info(0.0, 64, 48, 50.0))
    senses.take(messages.odometry(Odometry()))
    assert senses.present() == "camera yes · camera_info yes · depth no · scan NO · odom yes"
    senses.take(messages.laser_scan(scan()))
    senses.take(messages.image(0.0, depth(1.0)))
    assert senses.present() == "camera yes · camera_info yes · depth yes · scan yes · odom yes"


def test_a_recording_of_other_names_is_replayed(here: Path, monkeypatch: MonkeyPatch, answer_to: AnswerTo) -> None:
    names_there = {names.IMAGE: "/r/rgb/image", names.CAMERA_INFO: "/r/rgb/camera_info", names.COMMAND: "/r/cmd_vel"}
    some = [Record("/r/scan_filtered", 0.9, messages.laser_scan(scan(stamp=0.9)))]
    some += [one._replace(topic=names_there.get(one.topic, "/r/depth")) for one in records((1.0, depth(2.0)))]
    driver = Driver()
    monkeypatch.setattr(command, "controller_named", lambda _name: driver)
    monkeypatch.setattr(command, "detector_named", lambda _name: Finder())
    words = ["replay", bag(here, some), "--json", "-", "--ros-args", "-r", "__ns:=/r"]
    words += ["-r", "limo_camera/image:=rgb/image"]
    _, out, err = answer_to(*words)
    # Without a scan the robot stands, as it did when this was recorded.
    assert json.loads(out)["linear_difference_max"] == 0.0 and driver.told[0].scan is None
    assert "/r/scan_filtered (sensor_msgs/msg/LaserScan); give --ros-args -r scan:=/r/scan_filtered" in err
    assert "/r/depth (depth); give --ros-args -r limo_camera/depth/image_raw:=/r/depth" in err
    code, _, err = answer_to(*words, "-r", "scan:=scan_filtered", "-r", "limo_camera/depth/image_raw:=depth")
    assert (code, err) == (0, "")
    assert driver.told[1].scan is not None and driver.told[1].depth is not None


def test_a_replay_has_the_robot_of_a_file_and_of_tf_static(here: Path, monkeypatch: MonkeyPatch) -> None:
    (here / "robot.toml").write_text("half_length = 0.25\ncamera_x = 0.2\n")
    mounts = static_transforms(0.0, replace(LIMO, camera_z=0.25, lidar_yaw=3.1))
    recording = bag(here, [Record(names.TF_STATIC, 0.0, mounts), *frames(2)])
    made_by = Mock(side_effect=Follower)
    monkeypatch.setattr("limo_hog.ros2.replay.Follower", made_by)
    assert main(["replay", recording, "--robot", "robot.toml"]) == 0
    made: RobotGeometry = made_by.call_args.args[2]
    assert (made.half_length, made.camera_x, made.camera_z) == (0.25, 0.2, 0.25)
    assert made.lidar_yaw == pytest.approx(3.1)
