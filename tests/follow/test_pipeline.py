"""The follower's loop: detect in the region, observe, decide behind the safety layer, keep region and state."""

import pytest
from tests.follow.loop import DEPTH, FOCAL_PX, IMAGE, REGION, SENSORS, Loop
from tests.follow.views import flat, scan, scan_of, there

from limo_hog.follow import Decision, Follower, Frame, Mode, Odometry, Sensors, TrackingController, Twist
from limo_hog.follow.tracks.asking import WhomError


def test_the_region_asked_for_is_searched_next_and_boxes_are_in_the_whole_image() -> None:
    loop = Loop()
    first, second = loop.frame(0.0), loop.frame(0.1)
    assert loop.shown == [(480, 640, 3), (192, 208, 3)]
    assert (first.region, second.region) == (None, REGION)
    assert (second.detections.windows.tolist(), loop.told[1].region) == ([[106, 52, 64, 128]], REGION)
    assert first.detect_ms > 0


def test_the_state_is_kept_from_image_to_image_and_is_not_handed_out() -> None:
    loop = Loop()
    decisions = [loop.frame(0.1 * k).decision for k in range(3)]
    assert [one.reason for one in decisions] == ["step 0", "step 1", "step 2"]
    assert decisions[-1].state is None


def test_the_controller_is_told_what_the_sensors_say() -> None:
    loop, depth, sensors = Loop(), flat(3.0), Sensors(scan(stamp=4.9), Odometry(4.95, 1.0))
    loop.frame(5.0, sensors, depth)
    (told,) = loop.told
    assert (told.stamp, told.width, told.height, told.focal_px) == (5.0, 640, 480, FOCAL_PX)
    assert told.depth is depth and told.scan is sensors.scan and told.odometry is sensors.odometry
    assert there(told.clothes).shape == (1, 2, 3)


def test_a_detector_that_raises_stops_the_robot_and_the_next_image_is_searched_whole() -> None:
    loop = Loop()
    loop.frame(0.0)
    loop.fails = RuntimeError("the GPU fell off the bus")
    failed = loop.frame(0.1)
    assert failed.decision == Decision(Twist(), None, Mode.BLOCKED, "the detector failed: the GPU fell off the bus")
    assert (failed.failure, len(failed.detections)) == (failed.decision.reason, 0)
    loop.fails = None
    again = loop.frame(0.2)
    assert (again.failure, again.decision.twist) == ("", Twist(0.5, 0.1))
    assert (loop.shown[-1], len(loop.told)) == ((480, 640, 3), 2)


def test_every_command_passes_the_safety_layer() -> None:
    blocked = Loop().frame(0.0, Sensors(scan_of([(0.6, 0.0)]), Odometry())).decision
    assert (blocked.twist, blocked.mode) == (Twist(0.0, 0.1), Mode.BLOCKED)
    # Before the first image the robot stands.
    early = Loop().between(0.0)
    assert (early.twist, early.mode) == (Twist(), Mode.BLOCKED)


def test_between_images_a_newer_scan_counts_and_the_region_stays() -> None:
    loop = Loop()
    loop.frame(0.0)
    assert loop.between(0.1).twist == Twist(0.5, 0.1)
    stopped = loop.between(0.2, scan_of([(0.6, 0.0)], 0.2))
    assert stopped.twist == Twist(0.0, 0.1)
    assert (stopped.target, stopped.region, stopped.state) == (None, None, None)
    loop.frame(0.3)
    assert loop.shown[-1] == (192, 208, 3)


def test_the_scans_between_two_slow_images_come_with_the_second() -> None:
    loop = Loop()
    loop.frame(0.0)
    for stamp in (0.1, 0.2):
        loop.between(stamp, odometry=Odometry(stamp, x=stamp))
    loop.frame(0.3)
    loop.frame(0.4)
    between = [[(seen.stamp, pose.x) for seen, pose in one.between] for one in loop.told]
    assert between == [[], [(0.1, 0.1), (0.2, 0.2)], []]


def test_a_period_begins_with_a_new_image_and_a_tenth_of_a_second_after_the_last() -> None:
    loop, first, second = Loop(), Frame(0.0, IMAGE, FOCAL_PX, None), Frame(0.04, IMAGE, FOCAL_PX, None)
    ticks = [(0.0, first), (0.02, first), (0.06, second), (0.14, second), (0.16, second), (0.2, None), (0.26, None)]
    logs = [loop.tick(now, frame) for now, frame in ticks]
    assert [log and (log.time, log.frame) for log in logs] == [
        *((0.0, first), None, (0.06, second), None, (0.16, None), None, (0.26, None))
    ]
    # So does a clock that was set back.
    assert loop.tick(0.1, None) is not None


def test_a_follower_is_asked_for_a_person_and_says_so_until_they_are_found() -> None:
    loop = Loop()
    follower = Follower(TrackingController(), loop)
    follower.follow("left")
    log = there(follower.tick(0.0, Frame(0.0, IMAGE, FOCAL_PX, DEPTH), SENSORS))
    assert log.decision.reason.endswith("; asked for the person furthest left, not found yet")
    with pytest.raises(WhomError, match="got 'leftmost'"):
        follower.follow("leftmost")
    with pytest.raises(WhomError, match="Loop follows nobody in particular"):
        Follower(loop, loop).follow(1)
