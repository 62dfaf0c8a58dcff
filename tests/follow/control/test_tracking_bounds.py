"""The parts of the tracking controller, one by one: distances, doubts, maps and ways out, by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.estimates import upper
from tests.follow.tracks.test_scan_movers import person, walker
from tests.follow.views import flat, look, scan_of

from limo_hog.follow import Decision, Mode, Observation, Odometry, TrackingController, Twist
from limo_hog.follow.control.selection import Choice, TrackingState, believed
from limo_hog.follow.control.steer import Aim
from limo_hog.follow.sense.clearance import NO_POINTS
from limo_hog.follow.space.grid import Ground
from limo_hog.follow.tracks.identity import Likeness, Traits
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracks

CONTROLLER = TrackingController()
GRID = CONTROLLER.grid
NOW = 5.0


def someone(
    number: int, x: float, y: float = 0.0, vx: float = 0.0, vy: float = 0.0, *, seen: float = NOW, window: float = 100.0
) -> Person:
    """A confirmed person who is at a place now, with a velocity; the window is small enough to be whole anywhere."""
    one = person(number, x, y, seen)
    track = replace(one.track, stamp=NOW, mean=(x, y, vx, vy), covariance=upper(0.01 * np.eye(4)))
    return replace(one, track=track, window=window, centre=0.0)


def view(late: float = 0.0) -> Observation:
    """A frame in which nobody is found, taken `late` before the newest odometry, of a robot that stands."""
    return replace(look(stamp=NOW - late), odometry=Odometry(NOW))


def state(*people: Person, pose: Odometry | None = None, **other: object) -> TrackingState:
    tracks = Tracks(people, stamp=NOW, poses=(pose or Odometry(NOW),))
    return replace(CONTROLLER.start(), tracks=tracks, **other)  # type: ignore[arg-type]


def likely(**chances: float) -> Likeness:
    odds = tuple((int(name[1:]), chance) for name, chance in chances.items())
    return Likeness(Traits(1, None, 100.0), (2.0, 0.0), NOW, odds)


def blocked(*places: tuple[float, float], since: float = -math.inf) -> Ground:
    """Ground on which something stands at places, and was not there until a stamp [s]."""
    ground = GRID.start(Odometry())
    occupied, freed = ground.occupied.copy(), np.full_like(ground.freed, NOW)
    at = GRID.flat(ground, np.array(places))
    occupied.flat[at], freed.flat[at] = 2.0, since
    return replace(ground, occupied=occupied, freed=freed, stamp=NOW)


@pytest.mark.parametrize(
    ("brisk", "acceleration", "late", "keeps"),
    [
        # The time of a period of .1 s, what the image is late, and 1.9 s at 1 m/s² of the wheels, at the person's pace.
        (0.0, 1.0, 0.0, 1.5),
        (0.7, 1.0, 0.0, 1.5),
        (1.0, 1.0, 0.0, 2.0),
        (1.0, 1.0, 0.5, 2.5),
        (1.5, 4.0, 0.0, 1.5 * (0.1 + 0.95)),
        (1.0, 0.25, 0.0, 0.1 + 3.8),
    ],
)
def test_it_keeps_off_a_person_by_their_way_in_the_time_it_needs(
    brisk: float, acceleration: float, late: float, keeps: float
) -> None:
    known = state(brisk=brisk, acceleration=acceleration)
    assert CONTROLLER._keeps(someone(1, 3.0), known, view(late)) == pytest.approx(keeps)
    # Of what is not known to be a person nothing is known.
    assert CONTROLLER._keeps(replace(someone(1, 3.0), confirmed=False), known, view(late)) == 1.5


def test_it_keeps_as_far_off_as_shows_all_of_a_person_and_further_where_images_are_late() -> None:
    # .44 of the window is above the middle at most: 240 px.
    tall = someone(1, 3.0, window=240 / 0.44 * 2.0)
    assert CONTROLLER._keeps(tall, state(), view()) == pytest.approx(2.0 - 0.084)
    assert CONTROLLER._keeps(tall, state(brisk=0.5), view()) == pytest.approx(2.0 - 0.084)
    # Both come nearer to each other for .3 s: twice .5 m/s.
    assert CONTROLLER._keeps(tall, state(brisk=0.5), view(0.3)) == pytest.approx(2.0 - 0.084 + 0.3)


def test_it_comes_nearer_to_a_person_who_will_be_out_of_sight_in_a_second() -> None:
    wall = blocked(*((2.0, 0.5 + 0.02 * step) for step in range(200)))
    for speed, keeps in ((0.4, 1.5), (1.6, 1.2)):
        # Behind the wall's end the line of sight to y = 1.3 is cut, to y = .4 it is not.
        known = state(ground=wall)
        assert CONTROLLER._keeps(someone(1, 3.0, vy=speed), known, view()) == keeps
    assert CONTROLLER._keeps(someone(1, 3.0, vy=1.6), state(), view()) == 1.5
    near = replace(CONTROLLER, target_distance=1.1)
    assert near._keeps(someone(1, 3.0, vy=1.6), state(ground=wall), view()) == 1.1


def moving(known: Track | None, *places: tuple[float, float], now: float = NOW) -> float | None:
    """Return the bearing of what moves and may be the person, legs that walk being at places."""
    movers = tuple(
        replace(walker(None, x, y), felt=now, track=replace(walker(None, x, y).track, stamp=now)) for x, y in places
    )
    tracks = Tracks(stamp=now, poses=(Odometry(now),), movers=movers)
    return CONTROLLER._off_unknown(replace(state(known=known), tracks=tracks), replace(view(), stamp=now))


def test_it_turns_to_the_least_turn_to_what_moves_where_a_lost_person_can_be() -> None:
    assert moving(None) is None
    assert moving(None, (0.0, 2.0), (-2.0, -2.0)) == pytest.approx(math.pi / 2)
    assert moving(None, (0.0, 2.0), (2.0, -2.0)) == pytest.approx(-math.pi / 4)
    # Half a metre, and half a metre a second for four seconds.
    known = Track(NOW - 4.0, (2.0, 0.0, 0.3, 0.3), upper(np.eye(4)))
    for far, may in ((2.45, True), (2.55, False)):
        assert (moving(known, (2.0, far)) is not None) == may


def doubtful(*people: Person, likeness: Likeness | None) -> Decision[TrackingState]:
    choice = Choice(1, likeness, NOW, candidates=tuple(one.number for one in people))
    return CONTROLLER._look_at(state(*people, choice=choice), view())


def test_in_doubt_it_turns_to_the_mean_of_the_candidates_by_how_likely_they_are() -> None:
    left, right = someone(1, 2.0, 0.3), someone(2, 2.0, -0.3)
    off = math.atan2(0.3, 2.0)
    assert doubtful(left, right, likeness=likely(_1=0.6, _2=0.2)).twist == Twist(
        0.0,
        pytest.approx(2.5 * off * (0.6 - 0.2) / 0.8),  # type: ignore[arg-type]
    )
    assert doubtful(left, right, likeness=None).twist.angular == pytest.approx(0.0)
    aside = doubtful(someone(1, 0.5, 2.0), likeness=likely(_1=0.3))
    assert (aside.twist.angular, aside.mode) == (1.5, Mode.HOLD)
    assert doubtful(someone(1, 0.5, -2.0), likeness=likely(_1=0.3)).twist.angular == -1.5
    assert aside.reason == "not sure whether this is the person followed"
    assert aside.state.since_full == 0
    assert doubtful(left, right, likeness=likely()).twist.angular == 0.0


def test_a_person_is_worth_nearing_who_is_too_small_for_the_model_and_likely() -> None:
    aim = Aim(0.0, 4.0, 0.0, 0.0, 0.0, hidden=False)
    one = someone(1, 4.0)
    for height, odds, worth in ((128.0, 0.0, True), (128.1, 0.0, False), (100.0, -0.4, True), (100.0, -0.41, False)):
        likely_ = replace(one, window=4.0 * height, log_odds=odds)
        assert CONTROLLER._is_worth_nearing(likely_, aim) == worth


def test_part_of_the_image_is_searched_for_fourteen_frames_for_one_who_is_surely_the_person() -> None:
    one = someone(1, 3.0, window=500.0)
    sure = Choice(1, likely(_1=0.96), NOW)
    assert CONTROLLER._region(one, state(one, choice=sure, since_full=13), view()) is not None
    assert CONTROLLER._region(one, state(one, choice=sure, since_full=14), view()) is None
    assert CONTROLLER._region(one, state(one, choice=Choice(1, likely(_1=0.94), NOW)), view()) is None
    weak = replace(one, confirmed=False, log_odds=-3.0, age=50)
    assert CONTROLLER._region(weak, state(weak, choice=sure), view()) is None
    assert CONTROLLER._region(replace(weak, age=5), state(weak, choice=sure), view()) is not None


@pytest.mark.parametrize("yaw", [0.0, 0.3, -0.4])
def test_the_part_searched_is_around_where_the_person_will_be_in_the_next_frame(yaw: float) -> None:
    # A tenth of a second on: at 1 m/s across, .1 m to the left of where they are.
    one = someone(1, 3.0, 0.0, 0.0, 1.0, window=500.0)
    region = CONTROLLER._region(one, state(one, pose=Odometry(NOW, yaw=yaw)), view())
    assert region is not None
    column = 320 - 448.6 * math.tan(math.atan2(0.1, 3.0) - yaw)
    half = 500.0 / 3.0 / 2
    assert region.x == pytest.approx(column - half, abs=16.5)
    assert region.x + region.width == pytest.approx(column + half, abs=16.5)


def test_a_scan_is_entered_into_the_map_a_fifth_of_a_second_after_the_last() -> None:
    before = CONTROLLER._map(state(), replace(view(), scan=scan_of([(2.0, 0.0)], NOW)))
    assert before.ground is not None
    for later, entered in ((0.15, False), (0.25, True)):
        scan = scan_of([(2.0, 0.0)], NOW + later)
        after = CONTROLLER._map(before, replace(view(), odometry=Odometry(NOW + later), scan=scan))
        assert (after.ground is not before.ground) == entered
    assert CONTROLLER._map(state(), replace(view(), scan=scan_of([]), odometry=None)).ground is None


def mapped(one: Person, depth: NDArray[np.float32] | None = None) -> Ground:
    """Return the map after three scans that hit a place ahead, in half a second."""
    known = state(one)
    for step in range(3):
        now = NOW + 0.25 * step
        scan = scan_of([(2.05, 0.05)], now)
        known = CONTROLLER._map(known, replace(view(), odometry=Odometry(now), scan=scan, depth=depth))
    assert known.ground is not None
    return known.ground


def test_people_measured_lately_are_no_part_of_the_map_and_the_depth_image_is() -> None:
    place = np.array([(2.05, 0.05)])
    for seen, there in ((NOW + 0.5, False), (NOW - 0.25, False), (NOW - 1.4, True)):
        assert bool(GRID.is_blocked(mapped(someone(1, 2.0, seen=seen)), place)[0]) == there
    assert bool(GRID.is_blocked(mapped(replace(someone(1, 2.0), confirmed=False)), place)[0])
    # A wall 3 m from the camera fills cells; one beyond 3.5 m does not.
    for far, there in ((3.0, True), (3.6, False)):
        ground = mapped(someone(1, -2.0), flat(far))
        assert bool(GRID.is_blocked(ground, np.array([(far + 0.084, 0.5 * far / 3)])).any()) == there


def gives_way(
    own: int | None, *people: Person, twist: Twist | None = None, mode: Mode = Mode.HOLD, **known: Any
) -> Decision[TrackingState]:
    """Return the command in place of one, among people of whom `own` is followed."""
    followed = next((one for one in people if one.number == own), None)
    decision = Decision(twist or Twist(), replace(state(*people), **known), mode, "why")
    return CONTROLLER._give_way(decision, followed, view(), NO_POINTS)


def test_the_person_followed_is_given_way_to_from_further_off_than_others() -> None:
    passes = someone(1, 1.2, 0.6, -0.7)
    alone = gives_way(1, passes)
    assert alone.reason == "giving way to a person"
    assert alone.mode is Mode.FOLLOW
    assert alone.state.gave_way_at == NOW
    assert alone.state.way_out is not None
    assert gives_way(None, passes).reason == "why"
    assert gives_way(None, passes).state.way_out is None
    # With another who is followed elsewhere the same.
    assert gives_way(2, passes, someone(2, 3.0, -1.0)).reason == "why"
    assert gives_way(1, passes, mode=Mode.LOST).mode is Mode.LOST


def test_the_person_followed_is_taken_to_walk_as_fast_as_they_are_known_to() -> None:
    # At .4 m/s they come too near in more than 2.8 s, at 1.2 m/s in less; others come as they do.
    setting_out = someone(1, 2.6, 0.0, -0.4)
    for own, brisk, way in ((1, 0.0, False), (1, 1.2, True), (None, 1.2, False)):
        assert (gives_way(own, setting_out, brisk=brisk).state.way_out is not None) == way


def test_a_way_is_remembered_by_its_direction_in_the_odometry_frame_and_since_when() -> None:
    comes = someone(1, 1.4, 0.0, -0.8, 0.1)
    first = gives_way(1, comes).state.way_out
    assert first is not None
    assert first[2] == NOW
    begun = (-first[0], first[1], NOW - 0.3)
    assert gives_way(1, comes, way_out=begun).state.way_out == pytest.approx(begun)


def test_the_command_is_what_the_wheels_reach_in_a_period_and_a_half() -> None:
    # From standing at 1 m/s² within .1 s, half as much again.
    after = gives_way(None, twist=Twist(0.6, 0.0), acceleration=1.0)
    assert after.twist == after.state.sent == Twist(pytest.approx(0.15), 0.0)  # type: ignore[arg-type]
    assert after.reason == "why"


def test_others_are_kept_in_mind_and_the_person_followed_is_none() -> None:
    after = gives_way(1, someone(1, 2.0), someone(2, 3.0, 1.5)).state.others
    assert [(one.x, one.y, one.at) for one in after] == [(3.0, 1.5, NOW)]
    near = gives_way(1, someone(1, 2.0), others=after)
    assert near.state.others == after


def test_the_people_believed_in_are_in_the_robots_frame_with_their_velocities() -> None:
    one = replace(someone(4, 1.0, 3.0, 0.5, -0.25), log_odds=math.log(3.0))
    known = state(one, pose=Odometry(NOW, 1.0, 1.0, math.pi / 2), choice=Choice(4, likely(_4=0.7), NOW))
    (seen,) = believed(replace(known, tracks=replace(known.tracks, boxes=((4, 2),))), NOW, Noise())
    # The robot is at (1, 1) and looks along +y.
    assert (seen.x, seen.y, seen.vx, seen.vy) == pytest.approx((2.0, 0.0, -0.25, -0.5))
    assert (seen.number, seen.box, seen.same) == (4, 2, 0.7)
    assert seen.probability == pytest.approx(0.75)
    (unknown,) = believed(state(one), NOW, Noise())
    assert (unknown.box, unknown.same) == (None, None)


def test_something_hides_a_place_only_if_it_lasts() -> None:
    for since, hides in ((-math.inf, True), (NOW - 6.1, True), (NOW - 5.9, False)):
        ground = blocked((1.5, 0.0), (1.5, 0.05), (1.5, -0.05), since=since)
        assert CONTROLLER._hides(ground, Odometry(), (3.0, 0.0)) == hides
        assert not CONTROLLER._hides(ground, Odometry(), (3.0, 1.5))
