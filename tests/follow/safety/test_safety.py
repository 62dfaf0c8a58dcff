"""No controller passes the safety layer, and bad input stops the robot within one period."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.follow.safety.headstrong import Headstrong, ahead
from tests.follow.views import NOBODY, boxes, flat, look, scan, scan_of

from limo_hog.detections import Detections
from limo_hog.follow import Decision, Guard, Mode, Observation, Odometry, Sensors, Twist
from limo_hog.follow.robot import LIMO
from limo_hog.follow.safety import scan_fault
from limo_hog.follow.sense.clearance import Look, room_seen_behind
from limo_sim.world.robot import Drive


def whole(stamp: float = 0.0, detections: Detections = NOBODY, **other: object) -> Observation:
    """What a robot with all its senses knows, on free ground; `other` has other readings."""
    known = {"depth": flat(8.0), "scan": scan(stamp=stamp), "odometry": Odometry(stamp), **other}
    return replace(look(detections, stamp), **known)  # type: ignore[arg-type]


def test_the_way_is_free_when_nothing_is_there() -> None:
    decision = ahead().step(whole(scan=scan()), ahead().start())
    assert decision.twist == Twist(0.5, 0.3)
    assert decision.reason == "because"


def test_a_person_near_ahead_stops_the_robot_but_not_its_turn() -> None:
    decision = ahead().step(whole(scan=scan_of([(0.6, 0.0)])), ahead().start())
    assert decision.twist == Twist(0.0, 0.3)
    assert decision.mode is Mode.BLOCKED
    assert "ahead" in decision.reason


def test_depth_sees_what_the_lidar_misses() -> None:
    # A hand at 0.5 m, above the lidar's plane: nothing in the scan.
    depth = flat(8.0)
    depth[100:140, 300:340] = 0.5
    view = whole(scan=scan(), depth=depth)
    assert ahead().step(view, ahead().start()).twist.linear == 0


def test_a_depth_image_of_zeros_shows_nothing_and_stops_the_robot() -> None:
    decision = ahead().step(whole(scan=scan(), depth=flat(0.0)), ahead().start())
    assert decision.twist == Twist(0.0, 0.0)
    assert "no valid pixel" in decision.reason


def test_two_frames_may_have_one_stamp() -> None:
    first = ahead().step(whole(3.0, scan=scan(stamp=3.0)), ahead().start())
    again = ahead().step(whole(3.0, scan=scan(stamp=3.0)), first.state)
    assert again.twist.linear == 0.5


def test_what_was_seen_before_a_turn_stops_the_way_back() -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    there = whole(scan=scan_of([(0.7, 0.0)]), odometry=Odometry())
    state = guard.step(there, guard.start()).state
    # Turned about: what was ahead is behind now, where the lidar does not look.
    turned = whole(1.0, scan=scan(stamp=1.0), odometry=Odometry(1.0, 0.1, 0.0, np.pi))
    decision = guard.step(turned, state)
    assert decision.twist.linear == 0
    assert "behind" in decision.reason
    later = whole(62.0, scan=scan(stamp=62.0), odometry=Odometry(62.0, 0.1, 0.0, np.pi))
    assert guard.step(later, decision.state).twist.linear == -guard.unseen_speed


@pytest.mark.parametrize(("age", "stopped"), [(0.2, True), (59.9, True), (60.1, False)])
def test_what_was_seen_behind_counts_for_a_minute(age: float, stopped: bool) -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    # On any clock, and not behind yet.
    there = whole(700.0, scan=scan_of([(0.7, 0.0)], 700.0), odometry=Odometry(700.0))
    state = guard.step(there, guard.start()).state
    turned = Odometry(700.0 + age, yaw=np.pi)
    later = whole(700.0 + age, scan=scan(stamp=700.0 + age), odometry=turned)
    assert (guard.step(later, state).twist.linear == 0) is stopped


@dataclass(frozen=True)
class Listener:
    """Stands, and keeps what it is told of what was seen before."""

    def start(self) -> list[list[float]] | None:
        return None

    def step(self, observation: Observation, state: list[list[float]] | None) -> Decision[list[list[float]] | None]:
        del state
        told = observation.remembered
        return Decision(Twist(), None if told is None else told.tolist(), Mode.HOLD, "listening")


def test_the_controller_is_told_what_was_seen_where_the_lidar_does_not_look_now() -> None:
    guard = Guard(Listener())
    first = guard.step(whole(scan=scan_of([(0.7, 0.0)]), odometry=Odometry()), guard.start())
    # Of what the newest scan shows nothing is told twice.
    assert first.state.inner == []
    turned = Odometry(1.0, 0.1, 0.0, np.pi)
    told = guard.step(whole(1.0, scan=scan_of([(0.5, 0.3)], 1.0), odometry=turned), first.state)
    assert told.state.inner
    assert np.array(told.state.inner) == pytest.approx(np.full((len(told.state.inner), 2), (-0.6, 0.0)), abs=0.03)
    without = guard.step(whole(2.0, odometry=None), told.state)
    assert without.state.inner is None


def test_it_backs_fast_only_onto_ground_that_was_seen_to_be_free() -> None:
    guard = Guard(Headstrong(Twist(-0.7, 0.0)))
    free = np.full(292, 8.0, np.float32)
    # At the start nothing behind has been seen.
    first = guard.step(whole(scan=scan(free), odometry=Odometry()), guard.start())
    assert first.twist.linear == -guard.unseen_speed
    # Turned about: what was ahead is behind now.
    turned = whole(1.0, scan=scan(free, 1.0), odometry=Odometry(1.0, yaw=np.pi))
    assert guard.step(turned, first.state).twist.linear == -guard.max_backward == -0.6
    long_after = whole(61.0, scan=scan(free, 61.0), odometry=Odometry(61.0, yaw=np.pi))
    assert guard.step(long_after, first.state).twist.linear == -guard.unseen_speed


def test_ground_behind_something_was_not_seen() -> None:
    looks = [Look(scan_of([(0.3, 0.0)]), Odometry())]
    # Turned about, 0.8 m further on: the thing is behind at 0.8 - 0.3 m of the centre; what is behind it was hidden.
    assert room_seen_behind(looks, Odometry(x=0.8), LIMO) < 0.4
    assert room_seen_behind([Look(scan(), Odometry())], Odometry(x=0.8), LIMO) == pytest.approx(0.6, abs=0.11)


def returns_kept(post: tuple[float, float], pose: Odometry, began: float = 0.0) -> tuple[int, int]:
    """How many returns of a post are remembered, and how many of them after an empty scan from another pose."""
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    there = whole(began, scan=scan_of([post], began), odometry=Odometry(began))
    state = guard.step(there, guard.start()).state
    after = guard.step(whole(pose.stamp, scan=scan(stamp=pose.stamp), odometry=pose), state).state
    return len(state.scan_points), len(after.scan_points)


@pytest.mark.parametrize("turn", [2.3, -2.3])
@pytest.mark.parametrize("left", [0.1, -0.1])
def test_an_obstacle_on_either_side_behind_the_field_of_view_is_remembered(left: float, turn: float) -> None:
    before, after = returns_kept((0.6, left), Odometry(1.0, yaw=turn))
    assert after == before > 0


def test_an_obstacle_just_behind_the_lidars_field_of_view_is_remembered() -> None:
    # Drive to where the obstacle is at 109 degrees from the base, and at 121 from the lidar, which sees 115.
    yaw, x, y = -1.9, 0.4 * np.cos(1.9), 0.4 * np.sin(1.9)
    pose = Odometry(1.0, 0.6 - (np.cos(yaw) * x - np.sin(yaw) * y), -(np.sin(yaw) * x + np.cos(yaw) * y), yaw)
    before, after = returns_kept((0.6, 0.0), pose)
    assert after == before > 0


def test_returns_are_forgotten_where_the_lidar_sees_nothing_now_or_its_clock_was_set_back() -> None:
    # It stood at 100 degrees to the left, near the end of the field of view, and walks off.
    before, after = returns_kept((0.103 + 0.35 * np.cos(1.9), 0.35 * np.sin(1.9)), Odometry(0.1))
    assert before > after == 0
    before, after = returns_kept((0.6, 0.0), Odometry(3.0, yaw=np.pi), began=100.0)
    assert before > after == 0


def test_points_further_than_the_robot_backs_off_are_not_remembered() -> None:
    assert returns_kept((1.6, 0.0), Odometry(0.1)) == (0, 0)


@pytest.mark.parametrize(("free", "speed"), [(0.0, 0.0), (0.09, 0.2), (0.375, 0.5), (0.84, 0.8)])
def test_the_robot_stops_60_cm_before_an_obstacle_by_half_its_brakes(free: float, speed: float) -> None:
    # speed · 0.25 s + speed² / (2 · 0.5 m/s²) is the free way; the camera is .061 m behind the robot's front.
    view = whole(scan=scan(), depth=flat(free + 0.6 + 0.061))
    assert ahead(2.0).step(view, ahead().start()).twist.linear == pytest.approx(speed, abs=2e-3)


@pytest.mark.parametrize(
    ("box", "faulty"),
    [
        ((-32, 100, 64, 128), False),
        ((-33, 100, 64, 128), True),
        ((607, 100, 64, 128), False),
        ((608, 100, 64, 128), True),
        ((100, -64, 64, 128), False),
        ((100, -65, 64, 128), True),
        ((100, 415, 64, 128), False),
        ((100, 416, 64, 128), True),
        ((100, 100, 1, 1), False),
        ((100, 100, 64, 0), True),
    ],
)
def test_a_box_whose_middle_is_no_pixel_of_the_image_is_a_fault(box: tuple[int, int, int, int], faulty: bool) -> None:
    decision = ahead().step(whole(detections=boxes(box)), ahead().start())
    assert (decision.mode is Mode.BLOCKED) is faulty


def test_one_depth_pixel_and_one_beam_are_enough_to_go_by() -> None:
    depth, ranges = flat(np.nan), np.full(292, np.nan, np.float32)
    depth[3, 4], ranges[7] = 5.0, 5.0
    decision = ahead().step(whole(depth=depth, scan=scan(ranges)), ahead().start())
    assert decision.twist.linear == 0.5


def test_depth_beyond_its_reach_is_left_to_the_lidar() -> None:
    # The robot's length, the margin and a metre: 1.89 m from the camera.
    for depth, free in ((1.85, False), (1.93, True)):
        view = whole(scan=scan(), depth=flat(depth))
        assert (ahead(2.0).step(view, ahead().start()).twist.linear == LIMO.max_speed) is free


def test_a_fault_of_the_same_instant_forgets_nothing() -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    there = whole(1.0, scan=scan_of([(0.6, 0.0)], 1.0), odometry=Odometry(1.0))
    state = guard.step(there, guard.start()).state
    faulty = guard.step(whole(1.0, fault="dark"), state).state
    assert len(faulty.scan_points) == len(state.scan_points) > 0
    assert faulty.inner == state.inner == 1


@pytest.mark.parametrize(("wanted", "driven"), [(0.7, 0.2), (0.1, 0.1), (-0.7, 0.0)])
def test_a_robot_without_lidar_drives_slowly_and_never_backwards(wanted: float, driven: float) -> None:
    guard = Guard(Headstrong(Twist(wanted, 0.2)), without_lidar=True)
    decision = guard.step(whole(scan=None), guard.start())
    assert decision.twist == Twist(driven, 0.2)
    assert decision.reason == ("because" if wanted > 0 else "the robot does not back without sight")


BAD = {
    "detector failed": whole(fault="the detector failed: out of memory"),
    "not a time": whole(stamp=float("nan")),
    "no valid pixel": whole(depth=flat(np.nan)),
    "the camera's": whole(depth=np.ones((2, 2), np.float32)),
    "scan is empty": whole(scan=scan(np.empty(0, np.float32))),
    "no valid range": whole(scan=scan(np.full(292, np.nan, np.float32))),
    **{
        f"no valid range from {least} to {most} m": whole(
            scan=replace(scan(np.full(292, value, np.float32)), range_min=least, range_max=most)
        )
        for value, least, most in (
            *((0.0, 0.12, 8.0), (-1.0, 0.12, 7.0), (-np.inf, 0.12, 6.0)),
            *((2.0, math.nan, 8.0), (2.0, 0.12, math.nan), (2.0, 8.0, 0.12)),
        )
    },
    **{
        f"the scan's angles, {least} to {most} rad": whole(scan=turned)
        for least, most in (
            *((math.nan, 2.0), (-2.0, math.nan), (-2.0, math.inf), (-math.inf, 2.0)),
            *((2.0, -2.0), (1.0, 1.0)),
        )
        for turned in [replace(scan(), angle_min=least, angle_max=most)]
    },
    "the scan's stamp is nan": whole(scan=scan(stamp=math.nan)),
    "outside the 640x480 image": whole(detections=boxes((700, 10, 64, 128))),
    "box (10, 10, 0, 128)": whole(detections=boxes((10, 10, 0, 128))),
    "do not belong together": whole(detections=boxes((10, 10, 64, 128)), clothes=np.zeros((2, 2, 3))),
    "(4,) and scores": whole(detections=Detections(np.array([1, 2, 3, 4], np.int32), np.ones(4))),
    "(1, 3) and scores": whole(detections=Detections(np.ones((1, 3), np.int32), np.ones(1))),
    "(2, 4) and scores (1,)": whole(detections=Detections(np.full((2, 4), 9, np.int32), np.ones(1))),
    "not a number": whole(detections=boxes((10, 10, 64, 128), scores=(float("nan"),))),
    "odometry": whole(odometry=Odometry(yaw=float("inf"))),
}


@pytest.mark.parametrize("why", BAD)
def test_bad_input_stops_the_robot_says_why_and_the_next_good_one_goes_on(why: str) -> None:
    guard = ahead()
    good = guard.step(whole(), guard.start())
    assert good.twist.linear == 0.5
    stamp = 0.1 if np.isfinite(BAD[why].stamp) else float("nan")
    bad = guard.step(replace(BAD[why], stamp=stamp), good.state)
    assert bad.twist == Twist()
    assert bad.mode is Mode.BLOCKED
    assert why in bad.reason
    assert guard.step(whole(0.2), bad.state).twist.linear == 0.5


def test_time_that_runs_backwards_stops_the_robot_and_begins_a_new_story() -> None:
    guard = ahead()
    state = guard.step(whole(100.0), guard.start()).state
    back = guard.step(whole(3.0), state)
    assert back.twist == Twist()
    assert "backwards" in back.reason
    onward = guard.step(whole(3.1), back.state)
    assert onward.twist.linear == 0.5
    assert onward.state.inner == 1


def test_a_command_that_is_no_number_is_never_sent() -> None:
    guard = Guard(Headstrong(Twist(float("nan"), 0.0)))
    decision = guard.step(whole(), guard.start())
    assert decision.twist == Twist()
    assert decision.mode is Mode.BLOCKED


def test_an_old_scan_is_not_trusted() -> None:
    decision = ahead().step(whole(5.0, scan=scan(stamp=4.0)), ahead().start())
    assert decision.twist == Twist()
    assert "1.0 s old" in decision.reason


def test_between_frames_a_newer_scan_stops_the_last_command() -> None:
    guard = ahead()
    state = guard.step(whole(scan=scan()), guard.start()).state
    assert guard.recheck(0.1, Sensors(scan(stamp=0.1), Odometry(0.1)), state).twist.linear == 0.5
    assert guard.recheck(0.1, Sensors(scan_of([(0.6, 0.0)], 0.1), Odometry(0.1)), state).twist.linear == 0


@pytest.mark.parametrize("why", [why for why in BAD if scan_fault(BAD[why].scan)])
def test_between_frames_a_bad_scan_stops_the_robot_and_is_not_remembered(why: str) -> None:
    guard = ahead()
    state = guard.step(whole(scan=scan(), odometry=Odometry()), guard.start()).state
    bad = guard.recheck(0.1, Sensors(BAD[why].scan, Odometry(0.1)), state)
    assert bad.twist == Twist()
    assert bad.mode is Mode.BLOCKED
    assert why in bad.reason
    assert bad.state == state
    assert guard.recheck(0.2, Sensors(scan(stamp=0.2), Odometry(0.2)), bad.state).twist.linear == 0.5


@pytest.mark.parametrize("speed", [Twist(0.75, 0.0), Twist(0.7, 0.9), Twist(0.2, 3.0), Twist(-0.6, 1.0)])
@pytest.mark.parametrize("lost", ["camera", "scan", "odometry"])
def test_the_wheels_stand_a_second_after_the_last_reading(lost: str, speed: Twist) -> None:
    guard = Guard(Headstrong(speed))
    drive, state, steps = Drive(LIMO.wheel_separation, 1.0, LIMO.acceleration, 0.5), guard.start(), 100
    heard: dict[str, float] = {}
    for step in range(steps + 51):
        now = step / 50
        for sense, every in (("camera", 5), ("scan", 6), ("odometry", 1)):
            if step % every == 0 and (step < steps or sense != lost):
                heard[sense] = now
        turn, wheels = scan(stamp=heard["scan"]), Odometry(heard["odometry"])
        if step % 5 == 0:
            if heard["camera"] == now:
                decision = guard.step(whole(now, scan=turn, odometry=wheels), state)
            else:
                decision = guard.recheck(now, Sensors(turn, wheels), state)
            state = decision.state
            drive.command(decision.twist, now)
        drive.advance(now, 0.02)
        if step == steps - 1:
            assert abs(drive.left) + abs(drive.right) > 0.2  # it drives
    assert [drive.left, drive.right] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert f"no {lost}" in decision.reason


@pytest.mark.parametrize("began", [0.0, 1.7e9])
def test_silence_of_the_camera_stops_the_robot_on_any_clock(began: float) -> None:
    guard = ahead()
    state = guard.step(whole(began, scan=scan(stamp=began)), guard.start()).state
    for age, share in ((0.15, 1.0), (0.4, 0.95)):  # a late frame slows it down
        now = began + age
        slowed = guard.recheck(now, Sensors(scan(stamp=now), Odometry(now)), state).twist.linear
        assert slowed == pytest.approx(0.5 * share, 0.01)
    decision = guard.recheck(began + 0.6, Sensors(scan(stamp=began + 0.6), Odometry(began + 0.6)), state)
    assert decision.twist == Twist()
    assert "no camera frame for 0.6 s" in decision.reason


def test_the_age_of_a_frame_counts_from_when_it_was_decided_on() -> None:
    # A frame that comes 0.4 s late is not older the moment it is used.
    guard = ahead()
    late = whole(100.0, scan=scan(stamp=100.4), odometry=Odometry(100.4))
    state = guard.step(late, guard.start()).state
    assert guard.recheck(100.8, Sensors(scan(stamp=100.8), Odometry(100.8)), state).twist.linear > 0.4
    assert guard.recheck(101.0, Sensors(scan(stamp=101.0), Odometry(101.0)), state).twist == Twist()


def test_before_the_first_frame_and_after_a_fault_a_recheck_stands() -> None:
    guard = ahead()
    assert guard.recheck(0.0, Sensors(scan(), None), guard.start()).twist == Twist()
    faulty = guard.step(whole(fault="dark"), guard.start())
    assert guard.recheck(0.1, Sensors(scan(stamp=0.1), Odometry(0.1)), faulty.state).reason == "no usable camera frame"
