"""The tracking controller finds, follows, coasts, loses and finds again, and stays with whom it began with."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.control.driven import CONTROLLER, run
from tests.follow.views import GREEN, RED, World, flat, scan_of, there

from limo_hog.detections import Detections
from limo_hog.follow import Decision, Mode, Observation, Odometry, Twist
from limo_hog.follow.control.selection import TrackingState
from limo_hog.follow.sense.clearance import NO_POINTS
from limo_hog.follow.sense.observation import clothes_in


def test_it_faces_a_new_person_at_once_and_drives_only_when_sure() -> None:
    world = World(person=(3.0, 1.0))
    first = run(world, 0.1)
    assert first.twist.angular > 0.3 and first.twist.linear == 0
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


def test_it_coasts_over_missing_frames_and_says_where_it_looks() -> None:
    world = World(person=(3.0, -0.5), velocity=(0.0, 0.3))
    decision = run(world, 0.5, run(world, 4.0).state, visible=False)
    assert decision.mode is Mode.FOLLOW
    assert abs(world.bearing) < 0.06
    assert decision.target is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_person_gone_is_lost_and_searched_for_the_way_they_went(side: float) -> None:
    world = World(person=(3.0, side * -1.0), velocity=(0.0, side * 0.4), lidar=False)
    decision = run(world, 1.5, run(world, 4.0).state, visible=False)
    assert decision.reason == "following the legs or the predicted position"
    decision = run(world, 2.0, decision.state, visible=False)
    assert (decision.mode, decision.reason) == (Mode.LOST, "searching for the lost person")
    assert decision.twist == Twist(0.0, side * CONTROLLER.lookout.search_rate)


def test_a_far_person_is_looked_for_enlarged_though_missed_and_a_near_one_in_the_whole_image() -> None:
    for distance, is_far in ((6.0, True), (2.5, False)):
        world = World(person=(distance, 0.0), velocity=(0.8, 0.0) if is_far else (0.0, 0.0))
        seen = run(world, 1.0)
        assert (there(seen.region).scale == 2.0) == is_far
        missed = run(world, 0.1, seen.state, visible=False)
        assert (missed.region is not None) == is_far


def test_a_lost_person_is_looked_for_in_the_whole_image_enlarged_and_the_first_as_it_is() -> None:
    assert run(World(), 0.1, visible=False).region is None
    world = World(person=(3.0, -1.0), velocity=(0.0, -0.4), lidar=False)
    lost = run(world, 4.0, run(world, 4.0).state, visible=False)
    assert lost.mode is Mode.LOST
    region = there(lost.region)
    assert (region.x, region.y, region.width, region.height, region.scale) == (0, 0, 640, 480, 2.0)


def test_legs_in_the_scan_keep_a_person_too_near_for_the_camera() -> None:
    world = World(person=(1.6, 0.0))
    state = run(world, 4.0).state
    world.velocity = (-0.25, 0.0)
    for _ in range(30):
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
    # A wall hides the person. The robot faces where they should be; odometry noise of 1 degree moves that to and fro.
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


def test_it_backs_away_from_a_person_who_comes_near_but_not_into_what_is_behind() -> None:
    world = World()
    state = run(world, 12.0).state
    world.velocity = (-0.3, 0.0)
    backing = run(world, 2.0, state)
    assert backing.twist.linear < -0.1
    assert world.distance > 1.3
    # A wall that it saw before it turned round is .15 m behind.
    ground, x = there(backing.state.ground), world.robot[0] - CONTROLLER.robot.half_length - 0.15
    wall, _ = CONTROLLER.grid.flat(ground, np.array([(x, y) for y in np.arange(-0.5, 0.5, 0.05)]))
    ground.occupied.flat[wall], ground.freed.flat[wall] = 2.0, -np.inf
    # It brakes as hard as it believes the wheels to.
    assert CONTROLLER.step(world.observe(), backing.state).twist.linear > backing.twist.linear + 0.1


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
    assert turns[1.0] > 0.3 and turns[-1.0] < -0.3
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
    assert (decision.mode, decision.reason) == (Mode.SEARCH, "turning to what moves in the scan")
    assert decision.twist.angular < -0.5 and decision.twist.linear == 0
    # Nothing moves where legs stand: it searches to the side it began with.
    standing = walking(World(person=(-3.0, 0.0)), CONTROLLER.start(), [(0.3, -1.8)] * 25)
    assert standing.twist.angular == CONTROLLER.lookout.search_rate


def test_a_lost_person_is_looked_for_where_legs_walk() -> None:
    for side in (1, -1):
        world, state = World(person=(2.0, 0.0)), CONTROLLER.start()
        for step in range(60):
            legs = [(0.1 + 0.02 * step + dx, 1.6 * side) for dx in (-0.05, 0.0, 0.05)]
            points = [*legs, (1.95, 0.0), (2.05, 0.0)] if step < 20 else legs
            view = replace(world.observe(visible=step < 20), scan=scan_of(points, world.time))
            decision = CONTROLLER.step(view, state)
            state = decision.state
            world.time += world.period
        assert decision.mode == Mode.LOST
        assert decision.twist.angular * side > 0.2


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
    at = 1.26
    for step in range(60):
        at += 0.05 if step < 20 else 0.0
        x = 2.0 - (0.05 * (step - 20) if step >= 20 else 0.0)
        decision = walking(world, state, [(x, at)])
        state = decision.state
        if decision.mode is Mode.LOST:
            break
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
        kept.append(there(run(world, 5.0).belief.keeps))
    assert kept[0] == pytest.approx(CONTROLLER.target_distance)
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


def test_how_fast_the_person_walks_is_not_learnt_from_a_track_that_may_be_anothers() -> None:
    world = World(person=(2.0, -1.0), velocity=(0.0, 0.5))
    slow = run(world, 3.0).state
    for sure in (True, False):
        fast, state = replace(world, velocity=(0.0, 1.2)), slow
        for _ in range(8):
            assert state.choice.likeness is not None
            likeness = replace(state.choice.likeness, chances=((1, 1.0 if sure else 0.7),))
            state = run(fast, 0.1, replace(state, choice=replace(state.choice, likeness=likeness))).state
        assert (state.brisk > slow.brisk + 0.2) == sure


def test_where_no_way_is_free_it_stands() -> None:
    world = World(person=(4.0, 0.0))
    state = run(world, 2.0).state
    ring = [(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.arange(-1.9, 1.91, 0.03)]
    assert CONTROLLER.step(replace(world.observe(), scan=scan_of(ring, world.time)), state).mode is Mode.BLOCKED


def together(one: Detections, two: Detections) -> Detections:
    return Detections(np.concatenate([one.windows, two.windows]), np.concatenate([one.scores, two.scores]))


def test_it_stays_with_the_person_it_began_with() -> None:
    world = World()
    state = run(world, 5.0).state
    mine = state.choice.number
    for _ in range(20):
        x, y = world.person
        other = World(person=(x + 0.5, y - 0.8), robot=world.robot, time=world.time)
        view, second = world.observe(), other.observe(score=5.0).detections
        assert len(second) == 1
        decision = CONTROLLER.step(replace(view, detections=together(second, view.detections)), state)
        state = decision.state
        world.time += 0.1
        assert (state.choice.number, decision.target) == (mine, 1)


def seen_in(view: Observation, shirt: tuple[int, int, int]) -> Observation:
    """The same view with a colour image, in which whoever is seen wears a shirt."""
    image = np.full((480, 640, 3), shirt, np.uint8)
    return replace(view, clothes=clothes_in(image, view.detections.windows))


def lost(world: World) -> TrackingState:
    """Follow a person in red, who goes out of sight to the right for 9 s."""
    state = CONTROLLER.start()
    for _ in range(130):
        view = seen_in(world.observe(visible=world.time < 4.0), RED)
        decision = CONTROLLER.step(view, state)
        state = decision.state
        world.time += world.period
    assert decision.mode is Mode.LOST
    assert "lost person" in decision.reason
    return state


def test_a_person_in_other_clothes_is_not_the_lost_one_until_long_after() -> None:
    world = World()
    state = lost(world)
    parted = 4.0
    # One box tells the colours, and not yet that it is another.
    state = CONTROLLER.step(seen_in(world.observe(), GREEN), state).state
    world.time += world.period
    while world.time < parted + CONTROLLER.selection.reidentify_s - 0.1:
        decision = CONTROLLER.step(seen_in(world.observe(), GREEN), state)
        state = decision.state
        assert decision.target is None
        assert "another is in view" in decision.reason
        world.time += world.period
    world.time += 0.5
    decision = CONTROLLER.step(seen_in(world.observe(), GREEN), state)
    assert (decision.target, decision.reason) == (0, "following another person: the lost one was not found")


def test_who_wears_the_lost_persons_clothes_or_any_unknown_ones_is_followed_at_once() -> None:
    world = World()
    state = lost(world)
    decision = CONTROLLER.step(seen_in(world.observe(), RED), state)
    assert decision.target == 0
    assert "turning to a possible person" in decision.reason
    assert CONTROLLER.step(world.observe(), state).target == 0


def test_between_two_alike_it_stands_and_looks_and_says_that_it_is_not_sure() -> None:
    world = World(person=(2.5, 0.0))
    state = run(world, 4.0).state
    other = World(person=(2.5, 0.9), robot=world.robot, time=world.time)
    for _ in range(8):
        view, second = world.observe(), other.observe()
        people = together(view.detections, second.detections)
        both = replace(view, detections=people, depth=np.minimum(there(view.depth), there(second.depth)))
        state = CONTROLLER.step(both, state).state
        world.time, other.time = world.time + 0.1, other.time + 0.1
    one, two = (person.number for person in state.tracks.people)
    doubtful = replace(there(state.choice.likeness), chances=((one, 0.5), (two, 0.45)))
    standing = replace(world.observe(), odometry=Odometry(world.time, *world.robot))
    decision = CONTROLLER.step(standing, replace(state, choice=replace(state.choice, likeness=doubtful)))
    assert (decision.mode, decision.target) == (Mode.HOLD, None)
    assert decision.reason == "not sure which of 2 is the person followed"
    # Both are kept in view: it turns to between them.
    assert decision.twist.linear == 0 and decision.twist.angular > 0.1
    same = [round(person.same or 0.0, 1) for person in decision.belief.people]
    assert same == [0.5, 0.5] or same == [0.5, 0.4]
