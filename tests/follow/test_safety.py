"""No controller passes the safety layer, and bad input stops the robot within one period."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.follow.views import boxes, flat, look, scan, scan_of

from limo_hog.follow import Decision, Guard, Mode, Observation, Odometry, Twist
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import DepthGrid, Margin, room_ahead, scan_points


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


def test_the_way_is_free_when_nothing_is_there() -> None:
    decision = ahead().step(replace(look(), scan=scan()), ahead().start())
    assert decision.twist == Twist(0.5, 0.3)
    assert decision.reason == "because"


def test_somebody_near_ahead_stops_the_robot_but_not_its_turn() -> None:
    decision = ahead().step(replace(look(), scan=scan_of([(0.6, 0.0)])), ahead().start())
    assert decision.twist == Twist(0.0, 0.3)
    assert decision.mode is Mode.BLOCKED
    assert "ahead" in decision.reason


def test_the_robot_slows_down_before_it_stops() -> None:
    speeds = [
        ahead().step(replace(look(), scan=scan_of([(x, 0.0)])), ahead().start()).twist.linear
        for x in (2.0, 1.0, 0.9, 0.8, 0.7)
    ]
    assert speeds[0] == 0.5
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] < 0.05


def test_depth_sees_what_the_lidar_misses() -> None:
    # A hand at 0.5 m, above the lidar's plane: nothing in the scan.
    depth = flat(8.0)
    depth[100:140, 300:340] = 0.5
    view = replace(look(), scan=scan(), depth=depth)
    assert ahead().step(view, ahead().start()).twist.linear == 0


def test_the_floor_is_no_obstacle() -> None:
    rows = np.arange(480, dtype=np.float32)[:, None] + 0.5 - 240
    floor = np.where(rows > 0, 0.175 * 448.6 / np.maximum(rows, 0.5), np.inf).astype(np.float32)
    assert len(DepthGrid().points(np.broadcast_to(floor, (480, 640)), 448.6, 1.8, LIMO)) == 0


def test_what_was_seen_before_a_turn_stops_the_way_back() -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    there = replace(look(), scan=scan_of([(0.7, 0.0)]), odometry=Odometry())
    state = guard.step(there, guard.start()).state
    # Turned about: what was ahead is behind now, where the lidar does not look.
    turned = replace(look(stamp=1.0), scan=scan(stamp=1.0), odometry=Odometry(1.0, 0.1, 0.0, np.pi))
    decision = guard.step(turned, state)
    assert decision.twist.linear == 0
    assert "behind" in decision.reason
    later = replace(look(stamp=20.0), scan=scan(stamp=20.0), odometry=Odometry(20.0, 0.1, 0.0, np.pi))
    assert guard.step(later, decision.state).twist.linear == -0.3


def test_backwards_it_goes_slowly_for_it_does_not_look_there() -> None:
    guard = Guard(Headstrong(Twist(-0.7, 0.2)))
    decision = guard.step(replace(look(), scan=scan()), guard.start())
    assert decision.twist == Twist(-guard.max_backward, 0.2)
    assert decision.reason == "because"


def test_somebody_beside_is_passed_and_somebody_in_the_way_is_not() -> None:
    margin = Margin(0.5, 0.2)
    assert room_ahead(np.array([[1.0, 0.4]]), margin, LIMO) == np.inf
    assert room_ahead(np.array([[1.0, 0.0]]), margin, LIMO) == pytest.approx(1.0 - 0.145 - 0.5)


def test_a_scan_becomes_points_counter_clockwise_from_the_first_beam() -> None:
    (point,) = scan_points(scan(np.array([np.inf, np.inf, 1.0], np.float32)), LIMO)
    assert point == pytest.approx([0.103 + np.cos(2.0), np.sin(2.0)])


BAD = {
    "detector failed": replace(look(), fault="the detector failed: out of memory"),
    "not a time": replace(look(), stamp=float("nan")),
    "no valid pixel": replace(look(), depth=flat(np.nan)),
    "the camera's": replace(look(), depth=np.ones((2, 2), np.float32)),
    "scan is empty": replace(look(), scan=scan(np.empty(0, np.float32))),
    "no valid range": replace(look(), scan=scan(np.full(292, np.nan, np.float32))),
    "outside the 640x480 image": look(boxes((700, 10, 64, 128))),
    "box (10, 10, 0, 128)": look(boxes((10, 10, 0, 128))),
    "do not belong together": replace(look(boxes((10, 10, 64, 128))), clothes=np.zeros((2, 2, 3))),
    "not a number": look(boxes((10, 10, 64, 128), scores=(float("nan"),))),
    "odometry": replace(look(), odometry=Odometry(yaw=float("inf"))),
}


@pytest.mark.parametrize("why", BAD)
def test_bad_input_stops_the_robot_says_why_and_the_next_good_one_goes_on(why: str) -> None:
    guard = ahead()
    good = guard.step(look(), guard.start())
    assert good.twist.linear == 0.5
    stamp = 0.1 if np.isfinite(BAD[why].stamp) else float("nan")
    bad = guard.step(replace(BAD[why], stamp=stamp), good.state)
    assert bad.twist == Twist()
    assert bad.mode is Mode.BLOCKED
    assert why in bad.reason
    assert guard.step(look(stamp=0.2), bad.state).twist.linear == 0.5


def test_time_that_runs_backwards_stops_the_robot_and_begins_a_new_story() -> None:
    guard = ahead()
    state = guard.step(look(stamp=100.0), guard.start()).state
    back = guard.step(look(stamp=3.0), state)
    assert back.twist == Twist()
    assert "backwards" in back.reason
    onward = guard.step(look(stamp=3.1), back.state)
    assert onward.twist.linear == 0.5
    assert onward.state.inner == 1


def test_a_command_that_is_no_number_is_never_sent() -> None:
    guard = Guard(Headstrong(Twist(float("nan"), 0.0)))
    decision = guard.step(look(), guard.start())
    assert decision.twist == Twist()
    assert decision.mode is Mode.BLOCKED


def test_an_old_scan_is_not_trusted() -> None:
    decision = ahead().step(replace(look(stamp=5.0), scan=scan(stamp=4.0)), ahead().start())
    assert decision.twist == Twist()
    assert "1.0 s old" in decision.reason


def test_between_frames_a_newer_scan_stops_the_last_command() -> None:
    guard = ahead()
    state = guard.step(replace(look(), scan=scan()), guard.start()).state
    assert guard.recheck(0.1, scan(stamp=0.1), None, state).twist.linear == 0.5
    assert guard.recheck(0.1, scan_of([(0.6, 0.0)], 0.1), None, state).twist.linear == 0


def test_silence_of_the_camera_stops_the_robot() -> None:
    guard = ahead()
    state = guard.step(replace(look(), scan=scan()), guard.start()).state
    decision = guard.recheck(0.6, scan(stamp=0.6), None, state)
    assert decision.twist == Twist()
    assert "no camera frame for 0.6 s" in decision.reason
