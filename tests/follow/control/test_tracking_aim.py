"""Where the person followed is and which way leads there, and what is made of it from frame to frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.control.test_tracking_bounds import CONTROLLER, GRID, NOW, blocked, likely, someone, state, view
from tests.follow.views import World, flat, scan_of

from limo_hog.follow import Decision, Mode, Odometry, Twist
from limo_hog.follow.control.selection import Choice, TrackingState
from limo_hog.follow.control.steer import Aim
from limo_hog.follow.sense.clearance import NO_POINTS, scan_points
from limo_hog.follow.tracks.person import Person


def aim_at(one: Person, *points: tuple[float, float], keeps: float = 1.5, **known: Any) -> tuple[Aim, TrackingState]:
    """Return where a person is, and which way leads there, with a scan that hits points."""
    seen = replace(view(), scan=scan_of(list(points), NOW))
    returns = scan_points(seen.scan, CONTROLLER.robot) if seen.scan else NO_POINTS
    return CONTROLLER._aim(one, keeps, returns, replace(state(one), **known), seen)


@pytest.mark.parametrize("yaw", [0.0, 0.4, -1.0])
def test_an_aim_is_the_persons_place_and_their_own_motion_seen_from_the_robot(yaw: float) -> None:
    pose = Odometry(NOW, 1.0, -1.0, yaw)
    angle = yaw + 0.3
    along, across = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
    velocity = [0.5 * one + 0.2 * other for one, other in zip(along, across, strict=True)]
    one = someone(1, 1.0 + 2.0 * along[0], -1.0 + 2.0 * along[1], *velocity)
    aim, _ = CONTROLLER._aim(one, 1.5, NO_POINTS, state(one, pose=pose), replace(view(), odometry=pose))
    assert (aim.bearing, aim.distance, aim.range_rate, aim.bearing_rate) == pytest.approx((0.3, 2.0, 0.5, 0.1))
    assert (aim.heading, aim.hidden) == (aim.bearing, False)


def test_a_way_around_is_looked_for_only_to_come_nearer_to_a_person() -> None:
    post = [(1.0, 0.0), (1.0, 0.1), (1.0, -0.1)]
    # From .08 m nearer than is held the robot does not drive on.
    for distance, around in ((1.5 + 0.084 - 0.07, True), (1.5 + 0.084 - 0.09, False)):
        aim, after = aim_at(someone(1, distance), *post)
        assert (aim.heading != aim.bearing) == around
        assert aim.hidden
    assert aim_at(replace(someone(1, 3.0), confirmed=False), *post)[0].heading == 0.0
    assert len(after.way) == 0


def test_a_detour_leans_to_the_side_the_person_walks_to_and_keeps_to_the_one_begun() -> None:
    post = [(1.2, 0.0)]
    for vy, begun, side in ((0.5, 0.0, 1), (-0.5, 0.0, -1), (0.5, -0.4, -1), (-0.5, 0.4, 1)):
        aim, _ = aim_at(someone(1, 3.0, 0.0, 0.0, vy), *post, detour=begun)
        assert aim.heading is not None
        assert math.copysign(1, aim.heading) == side


def wall_across(x: float, low: float, high: float) -> list[tuple[float, float]]:
    return [(x, y) for y in np.arange(low, high, 0.02)]


def test_where_what_lasts_is_in_the_way_a_way_is_planned_and_kept_for_eight_tenths_of_a_second() -> None:
    wall = wall_across(1.25, -0.9, 0.9)
    lasts, passing = blocked(*wall), blocked(*wall, since=NOW - 1.0)
    one = someone(1, 3.0)
    aim, after = aim_at(one, *wall, ground=lasts)
    assert len(after.way) > 1
    assert after.way_at == NOW
    assert aim.heading is not None
    assert aim.heading != 0.0
    # What came lately goes away as well.
    assert len(aim_at(one, *wall, ground=passing)[1].way) == 0
    old = np.array([(0.0, 0.0), (0.5, -0.5), (1.0, -1.2)])
    for ago, anew in ((0.7, False), (0.9, True)):
        kept = aim_at(one, *wall, ground=lasts, way=old, way_at=NOW - ago)[1]
        assert (kept.way is not old) == anew
    # Where nothing is in the way it is forgotten.
    clear = aim_at(one, ground=lasts, way=old, way_at=NOW)[1]
    assert (len(clear.way), clear.way_at) == (0, -math.inf)


def test_along_a_way_it_goes_to_the_point_half_a_metre_ahead_or_beside_what_stands_there() -> None:
    way = np.array([(0.0, 0.0), (0.3, 0.1), (0.3, 0.4), (0.3, 2.0)])
    pose = Odometry(NOW, 0.0, 0.0, 0.5)
    off = math.atan2(0.4, 0.3) - 0.5
    assert CONTROLLER._along(way, NO_POINTS, pose) == pytest.approx(off)

    def before(bearing: float) -> NDArray[np.float64]:
        return np.array([(0.9 * math.cos(bearing + turn), 0.9 * math.sin(bearing + turn)) for turn in (-0.1, 0.0, 0.1)])

    assert abs(CONTROLLER._along(way, before(off), pose) - off) > 0.3
    # More than .8 rad aside it turns first, whatever stands there.
    turned = Odometry(NOW, 0.0, 0.0, -0.2)
    assert CONTROLLER._along(way, before(off + 0.7), turned) == pytest.approx(off + 0.7)


def test_the_direct_way_is_free_of_what_lasts_as_far_as_is_looked_or_the_person_s_legs_are() -> None:
    # 1.2 m are looked ahead, and as much as robot and margin take.
    for x, passing in ((1.2 + 0.145 + 0.65 + 0.06, True), (1.2 + 0.145 + 0.65 - 0.06, False)):
        wall = wall_across(x, -1.0, 1.0)
        assert CONTROLLER._is_passing(blocked(*wall), np.array(wall), 0.0, 3.0, Odometry(NOW)) == passing
    # A person at 1.5 m: six tenths of a metre must be free.
    for x, passing in ((0.6 + 0.795 + 0.06, True), (0.6 + 0.795 - 0.06, False)):
        wall = wall_across(x, -1.0, 1.0)
        assert CONTROLLER._is_passing(blocked(*wall), np.array(wall), 0.0, 1.5, Odometry(NOW)) == passing


def followed(seconds: float = 4.0, **world: Any) -> tuple[World, TrackingState]:
    """Return a world in which a person was followed, and the state."""
    there = World(**world)
    known = CONTROLLER.start()
    for _ in range(round(seconds / there.period)):
        decision = CONTROLLER.step(there.observe(), known)
        known = decision.state
        there.drive(decision.twist)
    return there, known


def test_how_fast_a_person_walks_is_learnt_quickly_upwards_and_slowly_downwards() -> None:
    world, known = followed(person=(2.0, -1.0))
    speeds = []
    for step in range(60):
        world.velocity = (0.0, 0.6 if step < 30 else 0.0)
        decision = CONTROLLER.step(world.observe(), known)
        one = decision.state.tracks.person(known.choice.number)
        assert one is not None
        speed = math.hypot(*one.track.mean[2:])
        share = 0.15 if speed > known.brisk else 0.0015
        assert decision.state.brisk == pytest.approx(known.brisk + share * (speed - known.brisk))
        speeds.append(speed - known.brisk)
        known = decision.state
        world.drive(decision.twist)
    assert max(speeds) > 0.2
    assert min(speeds) < -0.2


def test_where_the_person_was_is_known_from_frames_that_are_sure_and_of_a_confirmed_person() -> None:
    world, known = followed()
    assert known.known is not None
    likeness = known.choice.likeness
    assert likeness is not None
    number = likeness.traits.number
    for chance, confirmed, learnt in ((0.99, True, True), (0.9, True, False), (0.99, False, False)):
        doubt = replace(known.choice, likeness=replace(likeness, chances=((number, chance),)))
        people = tuple(
            replace(one, confirmed=confirmed, log_odds=one.log_odds * confirmed) for one in known.tracks.people
        )
        before = replace(known, choice=doubt, tracks=replace(known.tracks, people=people))
        after = CONTROLLER.step(world.observe(), before).state
        assert after.choice.number == number
        assert (after.known is not known.known) == learnt


def test_where_no_way_is_free_there_is_no_detour_to_keep_to() -> None:
    world, known = followed(2.0, person=(4.0, 0.0))
    ring = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.arange(-1.9, 1.91, 0.03)]
    decision = CONTROLLER.step(replace(world.observe(), scan=scan_of(ring, world.time)), replace(known, detour=0.3))
    assert decision.mode is Mode.BLOCKED
    assert decision.state.detour == 0.0


@pytest.mark.parametrize("side", [-1, 1])
def test_it_never_turns_so_fast_that_the_wheels_could_not_stop_in_time(side: int) -> None:
    world, known = followed(person=(2.5, 0.0))
    x, y, yaw = world.robot
    # Turned by half a radian at once, a robot with weak wheels; nobody walks.
    world.robot = x, y, yaw - side * 0.5
    weak = replace(known, acceleration=0.01)
    view_ = world.observe()
    decision, _ = CONTROLLER._follow(view_, NO_POINTS, weak)
    one = decision.state.tracks.person(known.choice.number)
    assert one is not None
    off = world.bearing
    most = math.sqrt(2 * 0.01 / (0.172 / 2) * abs(off)) + 0.1
    assert 0.5 * most < side * decision.twist.angular < most


def unseen_for(seconds: float, *, pillar: bool = False, gave_way_s: float = math.inf) -> str:
    """Return what is done, of whose place no map tells, after a person was not measured for so long."""
    world, known = followed(2.0, lidar=False)
    one = known.tracks.person(known.choice.number)
    assert one is not None
    world.time = one.measured + seconds
    known = replace(known, known=None, gave_way_at=world.time - gave_way_s)
    # The depth image shows something nearer, so that it is no wonder that the camera finds nobody.
    seen = replace(world.observe(visible=False), depth=flat(0.5))
    if pillar:
        seen = replace(seen, scan=scan_of([(1.0, 0.0)], world.time))
    points = NO_POINTS if seen.scan is None else scan_points(seen.scan, CONTROLLER.robot)
    return CONTROLLER._follow(seen, points, known)[0].reason


def test_an_unmeasured_person_is_faced_for_two_seconds_and_behind_something_until_forgotten() -> None:
    for seconds, pillar, faced in ((1.9, False, True), (2.1, False, False), (2.1, True, True), (7.9, True, True)):
        assert (unseen_for(seconds, pillar=pillar) == "turning to the predicted position") == faced


def test_a_person_who_was_given_way_to_is_faced_for_three_seconds() -> None:
    for seconds, ago, faced in ((2.5, 0.0, True), (3.1, 0.0, False), (2.5, 2.9, True), (2.5, 3.1, False)):
        assert (unseen_for(seconds, gave_way_s=ago) == "turning to the predicted position") == faced


def lost(**other: Any) -> TrackingState:
    """Return the state of a controller that lost a person 2 m ahead 2 s ago, on ground seen all around."""
    one = someone(1, 2.0, seen=NOW - 2.0)
    ground = GRID.start(Odometry())
    now = np.full_like(ground.seen, NOW)
    ground = replace(ground, occupied=ground.occupied - 1, seen=now, freed=now)
    before: dict[str, Any] = {
        "choice": Choice(None, likely(_1=0.0), NOW - 2.0),
        "known": replace(one.track, stamp=NOW - 2.0),
        "ground": replace(ground, stamp=NOW),
        "side": -1.0,
    }
    return replace(state(), **{**before, **other})


def searched(known: TrackingState, *, scan: bool = True) -> Decision[TrackingState]:
    blind = np.full(292, np.nan, np.float32)
    seen = replace(scan_of([], NOW), ranges=blind) if scan else None
    return CONTROLLER._search(known, replace(view(), scan=seen))


def test_a_lost_person_is_looked_for_where_they_can_be_by_one_who_knows_ground_and_scan() -> None:
    looks = searched(lost())
    assert looks.mode is Mode.LOST
    assert looks.state.hunt is not None
    assert len(looks.belief.places) == 150
    for reason in (looks.reason, searched(looks.state).reason):
        assert "searching for" not in reason
    for without in (lost(known=None), lost(ground=None), lost(choice=Choice())):
        turned = searched(without)
        assert turned.state.hunt is None
        assert turned.twist == Twist(0.0, -0.7)
    assert searched(lost(), scan=False).twist == Twist(0.0, -0.7)
    assert searched(lost(choice=Choice())).mode is Mode.SEARCH
    # After a minute it turns in place.
    for ago, hunts in ((59.0, True), (61.0, False)):
        long_lost = lost(known=replace(someone(1, 2.0).track, stamp=NOW - ago))
        assert (searched(long_lost).state.hunt is not None) == hunts


def test_it_says_that_another_person_is_in_view() -> None:
    for number, other in ((2, True), (1, False)):
        known = lost(choice=Choice(None, likely(_1=0.9), NOW - 2.0))
        known = replace(known, tracks=replace(known.tracks, people=(someone(number, 3.0, 1.0),)))
        assert searched(known).reason.endswith(": another is in view") == other
