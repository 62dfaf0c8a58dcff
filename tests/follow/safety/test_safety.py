"""No controller passes the safety layer, bad input stops the robot within one period, and ground seen is geometry."""

import cmath
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from tests.follow.loop import Headstrong, ahead
from tests.follow.views import NOBODY, boxes, flat, look, scan, scan_of

from limo_hog.detections import Detections
from limo_hog.follow import Decision, Guard, Mode, Observation, Odometry, Sensors, Twist
from limo_hog.follow.robot import LIMO
from limo_hog.follow.safety import scan_fault
from limo_hog.follow.sense.clearance import Look, room_seen_behind
from limo_hog.follow.sense.observation import Scan
from limo_sim.world.robot import Drive

Box = tuple[int, int, int, int]


def whole(stamp: float = 0.0, detections: Detections = NOBODY, **other: object) -> Observation:
    """What a robot with all its senses knows, on free ground; `other` has other readings."""
    known = {"depth": flat(8.0), "scan": scan(stamp=stamp), "odometry": Odometry(stamp), **other}
    return replace(look(detections, stamp), **known)  # type: ignore[arg-type]


#: Something stands near ahead.
THING = whole(scan=scan_of([(0.6, 0.0)]))


def first(view: Observation, speed: float = 0.5) -> Decision[Any]:
    """What becomes of the first command of a controller that drives ahead."""
    return ahead(speed).step(view, ahead(speed).start())


def recheck(guard: Guard[int], state: Any, now: float, turn: Scan | None = None) -> Decision[Any]:
    """What becomes of the last command between two frames, on free ground unless `turn` says otherwise."""
    return guard.recheck(now, Sensors(turn or scan(stamp=now), Odometry(now)), state)


def test_a_person_near_ahead_stops_the_robot_but_not_its_turn() -> None:
    for view, twist, mode in ((whole(), Twist(0.5, 0.3), Mode.FOLLOW), (THING, Twist(0.0, 0.3), Mode.BLOCKED)):
        decision = first(view)
        assert (decision.twist, decision.mode) == (twist, mode)
        assert ("ahead" in decision.reason) is (mode is Mode.BLOCKED)


def test_depth_sees_what_the_lidar_misses() -> None:
    # A hand at 0.5 m, above the lidar's plane: nothing in the scan.
    depth = flat(8.0)
    depth[100:140, 300:340] = 0.5
    assert first(whole(depth=depth)).twist.linear == 0


def test_what_was_seen_before_a_turn_stops_the_way_back() -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    state = guard.step(whole(scan=scan_of([(0.7, 0.0)])), guard.start()).state
    # Turned about: what was ahead is behind now, where the lidar does not look.
    decision = guard.step(whole(1.0, odometry=Odometry(1.0, 0.1, 0.0, np.pi)), state)
    assert decision.twist.linear == 0
    assert "behind" in decision.reason
    later = whole(62.0, odometry=Odometry(62.0, 0.1, 0.0, np.pi))
    assert guard.step(later, decision.state).twist.linear == -guard.unseen_speed


@pytest.mark.parametrize(("age", "stopped"), [(0.2, True), (59.9, True), (60.1, False)])
def test_what_was_seen_behind_counts_for_a_minute(age: float, stopped: bool) -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    # On any clock, and not behind yet.
    state = guard.step(whole(700.0, scan=scan_of([(0.7, 0.0)], 700.0)), guard.start()).state
    later = whole(700.0 + age, odometry=Odometry(700.0 + age, yaw=np.pi))
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
    before = guard.step(whole(scan=scan_of([(0.7, 0.0)])), guard.start())
    # Of what the newest scan shows nothing is told twice.
    assert before.state.inner == []
    turned = Odometry(1.0, 0.1, 0.0, np.pi)
    told = guard.step(whole(1.0, scan=scan_of([(0.5, 0.3)], 1.0), odometry=turned), before.state)
    assert told.state.inner
    assert np.array(told.state.inner) == pytest.approx(np.full((len(told.state.inner), 2), (-0.6, 0.0)), abs=0.03)
    without = guard.step(whole(2.0, odometry=None), told.state)
    assert without.state.inner is None


def test_it_backs_fast_only_onto_ground_that_was_seen_to_be_free() -> None:
    guard = Guard(Headstrong(Twist(-0.7, 0.0)))
    free = np.full(292, 8.0, np.float32)
    # At the start nothing behind has been seen.
    start = guard.step(whole(scan=scan(free)), guard.start())
    assert start.twist.linear == -guard.unseen_speed
    # Turned about, what was ahead is behind; a minute later it is old.
    for stamp, speed in ((1.0, 0.6), (61.0, guard.unseen_speed)):
        turned = whole(stamp, scan=scan(free, stamp), odometry=Odometry(stamp, yaw=np.pi))
        assert guard.step(turned, start.state).twist.linear == -speed


def test_ground_behind_something_was_not_seen() -> None:
    looks = [Look(scan_of([(0.3, 0.0)]), Odometry())]
    # Turned about, 0.8 m further on: the thing is behind at 0.8 - 0.3 m of the centre; what is behind it was hidden.
    assert room_seen_behind(looks, Odometry(x=0.8), LIMO) < 0.4
    assert room_seen_behind([Look(scan(), Odometry())], Odometry(x=0.8), LIMO) == pytest.approx(0.6, abs=0.11)


def returns_kept(post: tuple[float, float], pose: Odometry, began: float = 0.0) -> tuple[int, int]:
    """How many returns of a post are remembered, and how many of them after an empty scan from another pose."""
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    state = guard.step(whole(began, scan=scan_of([post], began)), guard.start()).state
    after = guard.step(whole(pose.stamp, odometry=pose), state).state
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


def test_returns_are_forgotten_that_are_gone_or_far_or_of_another_clock() -> None:
    # It stood at 100 degrees to the left, near the end of the field of view, and walks off.
    before, after = returns_kept((0.103 + 0.35 * np.cos(1.9), 0.35 * np.sin(1.9)), Odometry(0.1))
    assert before > after == 0
    before, after = returns_kept((0.6, 0.0), Odometry(3.0, yaw=np.pi), began=100.0)
    assert before > after == 0
    assert returns_kept((1.6, 0.0), Odometry(0.1)) == (0, 0)


@pytest.mark.parametrize(("free", "speed"), [(0.0, 0.0), (0.09, 0.2), (0.375, 0.5), (0.84, 0.8)])
def test_the_robot_stops_60_cm_before_an_obstacle_by_half_its_brakes(free: float, speed: float) -> None:
    # speed · 0.25 s + speed² / (2 · 0.5 m/s²) is the free way; the camera is .061 m behind the robot's front.
    assert first(whole(depth=flat(free + 0.6 + 0.061)), 2.0).twist.linear == pytest.approx(speed, abs=2e-3)


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ((-32, 100, 64, 128), (-33, 100, 64, 128)),
        ((607, 100, 64, 128), (608, 100, 64, 128)),
        ((100, -64, 64, 128), (100, -65, 64, 128)),
        ((100, 415, 64, 128), (100, 416, 64, 128)),
        ((100, 100, 1, 1), (100, 100, 64, 0)),
    ],
)
def test_a_box_whose_middle_is_no_pixel_of_the_image_is_a_fault(within: Box, beyond: Box) -> None:
    for box, mode in ((within, Mode.FOLLOW), (beyond, Mode.BLOCKED)):
        assert first(whole(detections=boxes(box))).mode is mode


def test_one_depth_pixel_and_one_beam_are_enough_to_go_by() -> None:
    depth, ranges = flat(np.nan), np.full(292, np.nan, np.float32)
    depth[3, 4], ranges[7] = 5.0, 5.0
    assert first(whole(depth=depth, scan=scan(ranges))).twist.linear == 0.5


def test_depth_beyond_its_reach_is_left_to_the_lidar() -> None:
    # The robot's length, the margin and a metre: 1.89 m from the camera.
    for depth, free in ((1.85, False), (1.93, True)):
        assert (first(whole(depth=flat(depth)), 2.0).twist.linear == LIMO.max_speed) is free


def test_two_frames_may_have_one_stamp_and_a_fault_then_forgets_nothing() -> None:
    guard = Guard(Headstrong(Twist(-0.3, 0.0)))
    state = guard.step(whole(1.0, scan=scan_of([(0.6, 0.0)], 1.0)), guard.start()).state
    faulty = guard.step(whole(1.0, fault="dark"), state).state
    assert len(faulty.scan_points) == len(state.scan_points) > 0
    assert faulty.inner == state.inner == 1
    assert ahead().step(whole(3.0), first(whole(3.0)).state).twist.linear == 0.5


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
    "has no valid pixel": whole(depth=flat(0.0)),
    "1.0 s old": whole(scan=scan(stamp=-0.9)),
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
    stamp = 0.1 if np.isfinite(BAD[why].stamp) else float("nan")
    bad = ahead().step(replace(BAD[why], stamp=stamp), first(whole()).state)
    assert (bad.twist, bad.mode) == (Twist(), Mode.BLOCKED)
    assert why in bad.reason
    assert ahead().step(whole(0.2), bad.state).twist.linear == 0.5


def test_time_that_runs_backwards_stops_the_robot_and_begins_a_new_story() -> None:
    back = ahead().step(whole(3.0), first(whole(100.0)).state)
    assert back.twist == Twist()
    assert "backwards" in back.reason
    onward = ahead().step(whole(3.1), back.state)
    assert (onward.twist.linear, onward.state.inner) == (0.5, 1)


def test_a_command_that_is_no_number_is_never_sent() -> None:
    guard = Guard(Headstrong(Twist(float("nan"), 0.0)))
    decision = guard.step(whole(), guard.start())
    assert (decision.twist, decision.mode) == (Twist(), Mode.BLOCKED)


@pytest.mark.parametrize("why", [why for why in BAD if scan_fault(BAD[why].scan)])
def test_between_frames_a_bad_scan_stops_the_robot_and_is_not_remembered(why: str) -> None:
    state = first(whole()).state
    bad = recheck(ahead(), state, 0.1, BAD[why].scan)
    assert (bad.twist, bad.mode) == (Twist(), Mode.BLOCKED)
    assert why in bad.reason
    assert bad.state == state
    assert recheck(ahead(), bad.state, 0.2).twist.linear == 0.5


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
    state = first(whole(began)).state
    for age, share in ((0.15, 1.0), (0.4, 0.95)):  # a late frame slows it down
        assert recheck(ahead(), state, began + age).twist.linear == pytest.approx(0.5 * share, 0.01)
    decision = recheck(ahead(), state, began + 0.6)
    assert decision.twist == Twist()
    assert "no camera frame for 0.6 s" in decision.reason


def test_the_age_of_a_frame_counts_from_when_it_was_decided_on() -> None:
    # A frame that comes 0.4 s late is not older the moment it is used.
    state = first(whole(100.0, scan=scan(stamp=100.4), odometry=Odometry(100.4))).state
    assert recheck(ahead(), state, 100.8).twist.linear > 0.4
    assert recheck(ahead(), state, 101.0).twist == Twist()


def test_before_the_first_frame_and_after_a_fault_a_recheck_stands() -> None:
    assert ahead().recheck(0.0, Sensors(scan(), None), ahead().start()).twist == Twist()
    assert recheck(ahead(), first(whole(fault="dark")).state, 0.1).reason == "no usable camera frame"


#: The documented steps behind the outline [m].
DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def shows_free(look: Look, place: complex) -> bool:
    """Whether the robot stood on a place, odometry frame, or a beam went 5 cm beyond it."""
    here = (place - complex(look.pose.x, look.pose.y)) * cmath.rect(1.0, -look.pose.yaw)
    if abs(here.real) < LIMO.half_length + 0.05 and abs(here.imag) < LIMO.half_width + 0.05:
        return True
    scan, (distance, angle) = look.scan, cmath.polar(here - LIMO.lidar_x)
    gaps = max(len(scan.ranges) - 1, 1)
    beam = round((angle - scan.angle_min) / ((scan.angle_max - scan.angle_min) / gaps))
    if not 0 <= beam < len(scan.ranges) or not scan.ranges[beam] >= scan.range_min:
        return False
    return min(float(scan.ranges[beam]), scan.range_max) > distance + 0.05


def room(looks: list[Look], pose: Odometry) -> float:
    """The same answer as `room_seen_behind`, by asking for one place after the other."""
    free = 0.0
    for depth in DEPTHS:
        corners = [complex(-LIMO.half_length - depth, side * LIMO.half_width) for side in (-1, 0, 1)]
        places = [complex(pose.x, pose.y) + corner * cmath.rect(1.0, pose.yaw) for corner in corners]
        if not all(any(shows_free(look, place) for look in looks) for place in places):
            break
        free = depth
    return free


def test_the_room_is_that_of_plain_geometry_for_random_looks() -> None:
    random = np.random.default_rng(7)
    rooms = []
    for _ in range(400):
        looks = []
        for _ in range(random.integers(1, 4)):
            count, far = int(random.choice([1, 7, 91, 240])), [0.05, 0.4, 0.9, 3.0, math.inf, math.nan]
            ranges = random.choice(far, count, p=[0.02, 0.03, 0.05, 0.5, 0.35, 0.05])
            reach = float(random.uniform(1.5, math.pi))
            scan = Scan(0.0, ranges.astype(np.float32), -reach, reach, 0.12, float(random.choice([0.7, 8.0])))
            x, y, yaw = random.uniform((-0.8, -0.8, -4), (0.8, 0.8, 4)).tolist()
            looks.append(Look(scan, Odometry(0.0, x, y, yaw)))
        x, y, yaw = random.uniform((-0.3, -0.3, -4), (0.3, 0.3, 4)).tolist()
        pose = Odometry(1.0, x, y, yaw)
        found = room_seen_behind(looks, pose, LIMO)
        assert found == pytest.approx(room(looks, pose))
        rooms.append(round(found, 1))
    assert {0.0, 0.1, 0.3, 0.6} <= set(rooms)
    assert room_seen_behind([], Odometry(), LIMO) == 0.0


@pytest.mark.parametrize(("driven", "seen"), [(0.0, 0.0), (0.12, 0.1), (0.33, 0.3), (0.95, 0.6)])
def test_the_ground_that_the_robot_left_straight_on_was_free(driven: float, seen: float) -> None:
    blind = Scan(0.0, np.zeros(3, np.float32), -1.0, 1.0, 0.12, 8.0)
    way = [Look(blind, Odometry(0.0, x)) for x in np.arange(0.0, driven, 0.1)] or [Look(blind, Odometry())]
    assert room_seen_behind(way, Odometry(1.0, x=driven), LIMO) == pytest.approx(seen)


def looks_after(*stamps: float) -> list[float]:
    state = ahead().start()
    for stamp in stamps:
        state = ahead().step(whole(stamp), state).state
    return [one.scan.stamp for one in state.looks]


def test_a_scan_every_half_second_is_kept_for_a_minute_and_an_older_one_begins_anew() -> None:
    assert looks_after(*(0.125 * step for step in range(12))) == [0.0, 0.5, 1.0]
    assert looks_after(0.0, 10.0, 59.75) == [0.0, 10.0, 59.75]
    assert looks_after(0.0, 10.0, 60.0) == [10.0, 60.0]
    assert looks_after(0.0, 100.0) == [100.0]
    after = ahead().step(whole(5.1, scan=scan(stamp=4.8)), first(whole(5.0)).state)
    assert [one.scan.stamp for one in after.state.looks] == [4.8]
