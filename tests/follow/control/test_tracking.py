"""The tracking controller finds, follows, holds, coasts, loses and finds again."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.control.driven import CONTROLLER, run
from tests.follow.views import NOBODY, World, flat, scan_of

from limo_hog.detections import Detections
from limo_hog.follow import Decision, Mode, Odometry
from limo_hog.follow.control.selection import TrackingState
from limo_hog.follow.sense.clearance import NO_POINTS


def test_it_searches_by_turning_and_does_not_drive() -> None:
    decision = run(World(person=(-3.0, 0.0)), 1.0)
    assert decision.mode is Mode.SEARCH
    assert decision.twist.linear == 0
    assert abs(decision.twist.angular) == CONTROLLER.lookout.search_rate


def test_it_faces_a_new_person_at_once_and_drives_only_when_sure() -> None:
    world = World(person=(3.0, 1.0))
    first = run(world, 0.1)
    assert first.twist.angular > 0.3
    assert first.twist.linear == 0
    assert "possible person" in first.reason
    assert run(world, 1.5, first.state).twist.linear > 0.2


def test_it_holds_its_distance_to_a_person_who_stands() -> None:
    world = World()
    decision = run(world, 12.0)
    assert decision.mode is Mode.HOLD
    assert world.distance - 0.084 == pytest.approx(1.5, abs=0.1)


def test_it_follows_without_lag_a_person_who_walks_around_it() -> None:
    world = World(person=(2.0, -1.0), velocity=(0.0, 0.4))
    run(world, 6.0)
    # A proportional controller of the same gain lags by rate / gain: 0.2 / 2.5 rad here.
    assert abs(world.bearing) < 0.03


def test_it_backs_away_from_a_person_who_comes_near() -> None:
    world = World()
    state = run(world, 12.0).state
    world.velocity = (-0.3, 0.0)
    decision = run(world, 2.0, state)
    assert decision.twist.linear < -0.1
    assert world.distance > 1.3


def test_it_coasts_over_missing_frames_and_says_where_it_looks() -> None:
    world = World(person=(3.0, -0.5), velocity=(0.0, 0.3))
    state = run(world, 4.0).state
    decision = run(world, 0.5, state, visible=False)
    assert decision.mode is Mode.FOLLOW
    assert abs(world.bearing) < 0.06
    assert decision.target is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_person_gone_is_lost_and_searched_for_the_way_they_went(side: float) -> None:
    world = World(person=(3.0, side * -1.0), velocity=(0.0, side * 0.4), lidar=False)
    state = run(world, 4.0).state
    decision = run(world, 1.5, state, visible=False)
    assert decision.reason == "following the legs or the predicted position"
    decision = run(world, 2.0, decision.state, visible=False)
    assert decision.mode is Mode.LOST
    assert decision.twist.linear == 0
    assert decision.reason == "searching for the lost person"
    assert decision.twist.angular == side * CONTROLLER.lookout.search_rate


def test_legs_in_the_scan_keep_a_person_too_near_for_the_camera() -> None:
    world = World(person=(1.6, 0.0))
    state = run(world, 4.0).state
    for _ in range(30):
        world.velocity = (-0.25, 0.0)
        legs = scan_of([(world.distance, 0.08), (world.distance, -0.08)], world.time)
        view = replace(world.observe(visible=False), scan=legs)
        decision = CONTROLLER.step(view, state)
        state = decision.state
        world.drive(decision.twist)
    assert decision.mode is not Mode.LOST
    assert decision.twist.linear < 0


def test_weak_boxes_of_a_pillar_are_never_driven_to() -> None:
    world = World(person=(2.5, 0.0))
    state = CONTROLLER.start()
    for frame in range(200):
        decision = CONTROLLER.step(world.observe(visible=frame % 2 == 0, score=0.6), state)
        state = decision.state
        world.drive(decision.twist)
        assert decision.twist.linear == 0


def test_the_search_keeps_its_side_though_the_predicted_bearing_changes_sign() -> None:
    # The depth image says that a wall hides the person, so they are remembered. The robot faces where they should be;
    # odometry noise of 1 degree moves that to and fro.
    world = World(person=(3.0, 0.0))
    state = run(world, 4.0).state
    rates = []
    x, y, yaw = world.robot
    for frame in range(75):
        noise = 0.02 if frame % 4 < 2 else -0.02
        odometry = Odometry(world.time, x, y, yaw + noise)
        view = replace(world.observe(visible=False), odometry=odometry, depth=flat(1.2), scan=None)
        decision = CONTROLLER.step(view, state)
        state = decision.state
        world.time += world.period
        if "searching" in decision.reason:
            rates.append(decision.twist.angular)
    assert len(rates) > 40
    assert set(rates) in ({CONTROLLER.lookout.search_rate}, {-CONTROLLER.lookout.search_rate})


def test_a_late_frame_does_not_make_it_swing() -> None:
    # Frames 0.4 s late: the robot must not turn on for what it has turned already.
    world = World(person=(3.0, 1.5))
    state = CONTROLLER.start()
    views, overshoot = [], 0.0
    for _ in range(60):
        now = Odometry(world.time, *world.robot)
        views.append(world.observe())
        late = replace(views[max(0, len(views) - 5)], odometry=now, scan=None)
        decision = CONTROLLER.step(late, state)
        state = decision.state
        world.drive(decision.twist)
        overshoot = min(overshoot, world.bearing)
    assert abs(world.bearing) < 0.03
    assert overshoot > -0.12


def test_it_goes_around_a_pillar_between() -> None:
    world = World(person=(5.0, 0.0))
    state = run(world, 2.5).state
    pillar = (world.robot[0] + 1.2, 0.05)
    here = (pillar[0] - world.robot[0], pillar[1])
    view = replace(
        world.observe(), scan=scan_of([here, (here[0], here[1] + 0.1), (here[0], here[1] - 0.1)], world.time)
    )
    decision = CONTROLLER.step(view, state)
    assert decision.reason == "driving around an obstacle"
    assert abs(decision.twist.angular) > 0.2


def test_nothing_depends_on_anything_but_what_is_handed_in() -> None:
    one, two = World(person=(2.5, 0.4)), World(person=(2.5, 0.4))
    assert run(one, 3.0).twist == run(two, 3.0).twist
    assert not math.isnan(one.bearing)
    assert CONTROLLER.step(replace(one.observe(), detections=NOBODY), CONTROLLER.start()).target is None


def test_it_does_not_back_into_what_its_map_shows_behind() -> None:
    # A person comes towards it; a wall that it saw before it turned round is .15 m behind.
    world = World()
    state = run(world, 12.0).state
    world.velocity = (-0.3, 0.0)
    state = run(world, 1.5, state).state
    assert state.ground is not None
    backing = CONTROLLER.step(world.observe(), state)
    assert backing.twist.linear < -0.05
    ground, x = state.ground, world.robot[0] - CONTROLLER.robot.half_length - 0.15
    wall, _ = CONTROLLER.grid.flat(ground, np.array([(x, y) for y in np.arange(-0.5, 0.5, 0.05)]))
    ground.occupied.flat[wall], ground.freed.flat[wall] = 2.0, -np.inf
    # It brakes as hard as it believes the wheels to.
    assert CONTROLLER.step(world.observe(), state).twist.linear > backing.twist.linear + 0.1


def test_it_backs_past_what_was_seen_behind_and_keeps_the_person_in_the_image() -> None:
    # A person has stopped nearer than it keeps; a post .5 m behind is a little to the left of the way straight back.
    world = World()
    state = run(world, 12.0).state
    world.robot = (world.robot[0] + 0.3, 0.0, 0.0)
    state = run(world, 0.2, state).state
    post = np.array([[-CONTROLLER.robot.half_length - 0.5, 0.05]])
    turns = {}
    for side in (1.0, -1.0):
        decision = CONTROLLER.step(replace(world.observe(), remembered=post * (1.0, side)), state)
        assert decision.twist.linear < 0
        assert decision.reason == "giving way to a person"
        turns[side] = decision.twist.angular
    # Turned to the right its back goes to the left, and the other way round.
    assert turns[1.0] > 0.3
    assert turns[-1.0] < -0.3
    straight = CONTROLLER.step(replace(world.observe(), remembered=NO_POINTS), state)
    assert abs(straight.twist.angular) < 0.1


def test_what_moves_beside_is_kept_in_mind_while_a_person_is_followed() -> None:
    world, state = World(person=(2.0, 0.0)), CONTROLLER.start()
    for step in range(20):
        legs = [(0.4 + dx, -1.8 + 0.06 * step) for dx in (-0.03, 0.0, 0.03)]
        view = replace(world.observe(), scan=scan_of([(2.0, 0.0), *legs], world.time))
        decision = CONTROLLER.step(view, state)
        state = decision.state
        world.time += world.period
    assert decision.mode in (Mode.FOLLOW, Mode.HOLD)
    assert any(math.dist(one.track.mean[:2], legs[1]) < 0.3 for one in state.tracks.movers)


def walking(world: World, state: TrackingState, legs: list[tuple[float, float]]) -> Decision[TrackingState]:
    """Let a person's legs be at these places, whom the camera does not show, with a robot that stands."""
    for x, y in legs:
        points = [(x - 0.05, y - 0.04), (x - 0.05, y), (x + 0.05, y), (x + 0.05, y + 0.04)]
        decision = CONTROLLER.step(replace(world.observe(visible=False), scan=scan_of(points, world.time)), state)
        state = decision.state
        world.time += world.period
    return decision


def test_before_a_person_is_found_it_turns_to_what_walks_beside_it() -> None:
    world = World(person=(-3.0, 0.0))
    walked = [(0.3 + 0.06 * step, -1.8) for step in range(25)]
    decision = walking(world, CONTROLLER.start(), walked)
    assert decision.mode is Mode.SEARCH
    assert decision.reason == "turning to what moves in the scan"
    assert decision.twist.angular < -0.5
    assert decision.twist.linear == 0
    # Nothing moves where legs stand: it searches to the side it began with.
    standing = walking(World(person=(-3.0, 0.0)), CONTROLLER.start(), [(0.3, -1.8)] * 25)
    assert standing.twist.angular == CONTROLLER.lookout.search_rate


def test_a_person_who_leaves_the_view_is_followed_by_the_lidar_as_long_as_they_move() -> None:
    world, state = World(person=(2.0, 0.0)), CONTROLLER.start()
    for step in range(30):
        y = 0.0 if step < 12 else 0.07 * (step - 12)
        world.person = (2.0, y)
        legs = [(2.0 + dx, y + dy) for dx, dy in ((-0.05, -0.04), (-0.05, 0.0), (0.05, 0.0), (0.05, 0.04))]
        state = CONTROLLER.step(replace(world.observe(), scan=scan_of(legs, world.time)), state).state
        world.time += world.period
    number = state.choice.number
    # Beyond the camera's view, for longer than legs alone are followed.
    at, decision = 1.26, None
    for step in range(60):
        at += 0.05 if step < 20 else 0.0
        x = 2.0 - (0.05 * (step - 20) if step >= 20 else 0.0)
        decision = walking(world, state, [(x, at)])
        state = decision.state
        if decision.mode is Mode.LOST:
            break
    assert decision is not None
    assert step > 45
    assert decision.belief.followed == number or decision.mode is Mode.LOST


def test_a_box_on_the_wall_beside_a_missed_person_does_not_take_their_track() -> None:
    world = World(person=(2.5, 0.0))
    state = run(world, 4.0).state
    seen = world.observe()
    beside = seen.detections.windows + np.array([60, 0, 0, 0], np.int32)
    for _ in range(5):
        view = world.observe(visible=False)
        # The wall is as far as the person: by its place and size the box would fit.
        wall = replace(view, detections=Detections(beside, seen.detections.scores), depth=flat(world.distance - 0.084))
        state = CONTROLLER.step(wall, state).state
        world.time += 0.1
    person = next(one for one in state.tracks.people if one.confirmed)
    assert person.track.mean[:2] == pytest.approx(world.person, abs=0.1)


def test_it_keeps_further_off_a_person_who_walks_where_the_images_come_late() -> None:
    kept = []
    for period in (0.1, 0.4):
        world = World(person=(2.5, -1.0), velocity=(0.0, 0.5), period=period)
        belief = run(world, 4.0).belief
        assert belief is not None
        kept.append(belief.keeps)
    assert kept[0] == pytest.approx(CONTROLLER.target_distance)
    assert kept[1] is not None
    assert kept[1] > CONTROLLER.target_distance + 0.1


def test_how_fast_a_person_walks_is_learnt_and_remembered_while_they_stand() -> None:
    world = World(person=(2.0, -1.0))
    state = run(world, 3.0).state
    assert state.brisk < 0.2
    world.velocity = (0.0, 0.6)
    walked = run(world, 3.0, state).state
    world.velocity = (0.0, 0.0)
    stood = run(world, 3.0, walked).state
    assert walked.brisk == pytest.approx(0.6, abs=0.15)
    assert stood.brisk == pytest.approx(walked.brisk, abs=0.05)


def test_where_no_way_is_free_it_stands() -> None:
    world = World(person=(4.0, 0.0))
    state = run(world, 2.0).state
    ring = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.arange(-1.9, 1.91, 0.03)]
    assert CONTROLLER.step(replace(world.observe(), scan=scan_of(ring, world.time)), state).mode is Mode.BLOCKED
