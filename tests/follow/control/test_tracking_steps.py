"""One step of the tracking controller from states that are made up: distance kept, region, map, ways."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.follow.control.driven import CONTROLLER, GRID, NOW, blocked, likely, run, someone, state, view
from tests.follow.views import World, flat, scan_of, there

from limo_hog.follow import Decision, Mode, Observation, Odometry
from limo_hog.follow.control.rollouts import DIRECT
from limo_hog.follow.control.selection import Choice, TrackingState, believed
from limo_hog.follow.space.grid import Ground
from limo_hog.follow.tracks.hiding import Other
from limo_hog.follow.tracks.kalman import Noise
from limo_hog.follow.tracks.person import Person


def step(own: int, *people: Person, seen: Observation | None = None, **known: Any) -> Decision[TrackingState]:
    """A step among people measured just now, of whom `own` is followed, a tenth of a second after the last."""
    choice, seen = known.pop("choice", Choice(own, likely(**{f"_{own}": 0.99}), NOW)), seen or view()
    before = state(*people, pose=seen.odometry, choice=choice, **known)
    return CONTROLLER.step(seen, replace(before, tracks=replace(before.tracks, stamp=NOW - 0.1)))


def keeps(one: Person, **known: Any) -> float | None:
    return step(1, one, **known).belief.keeps


@pytest.mark.parametrize(
    ("brisk", "acceleration", "keeps_m"),
    [
        # The time of a period of .1 s, and 1.9 s at 1 m/s² of the wheels, at the person's pace.
        (0.0, 1.0, 1.5),
        (0.7, 1.0, 1.5),
        (1.0, 1.0, 2.0),
        (1.5, 4.0, 1.5 * (0.1 + 0.95)),
        (1.0, 0.49, 0.1 + 1.9 / 0.7),
        # Never so far that HOG finds nobody.
        (1.0, 0.25, 3.0),
    ],
)
def test_it_keeps_off_a_person_by_their_way_in_the_time_it_needs(
    brisk: float, acceleration: float, keeps_m: float
) -> None:
    assert keeps(someone(1, 3.0), brisk=brisk, acceleration=acceleration) == pytest.approx(keeps_m)


def test_it_keeps_as_far_off_as_shows_all_of_a_person() -> None:
    # .44 of the window is above the middle at most: 240 px.
    tall = someone(1, 3.0, window=240 / 0.44 * 2.0)
    for brisk in (0.0, 0.5):
        assert keeps(tall, brisk=brisk) == pytest.approx(2.0 - 0.084)


def test_it_comes_nearer_to_a_person_who_will_be_out_of_sight_in_a_second() -> None:
    # Behind the wall's end the line of sight to y = 1.3 is cut, to y = .4 it is not.
    wall = blocked(*((2.0, 0.5 + 0.02 * step) for step in range(200)))
    for speed, near in ((0.4, 1.5), (1.6, 1.2)):
        assert keeps(someone(1, 3.0, vy=speed), ground=wall) == near
    assert keeps(someone(1, 3.0, vy=1.6)) == 1.5


def test_part_of_the_image_is_searched_for_a_person_who_is_surely_the_one() -> None:
    one = someone(1, 3.0, window=500.0)
    for since_full, chance, part in ((13, 0.99, True), (14, 0.99, False), (0, 0.7, False)):
        choice = Choice(1, likely(_1=chance), NOW)
        assert (step(1, one, choice=choice, since_full=since_full).region is not None) == part


@pytest.mark.parametrize("yaw", [0.0, 0.3, -0.4])
def test_the_part_searched_is_around_where_the_person_will_be_in_the_next_frame(yaw: float) -> None:
    # A tenth of a second on: at 1 m/s across, .1 m to the left of where they are.
    pose = Odometry(NOW, yaw=yaw)
    region = there(step(1, someone(1, 3.0, 0.0, 0.0, 1.0, window=500.0), seen=replace(view(), odometry=pose)).region)
    column = 320 - 448.6 * math.tan(math.atan2(0.1, 3.0) - yaw)
    half = 500.0 / 3.0 / 2
    assert region.x == pytest.approx(column - half, abs=16.5)
    assert region.x + region.width == pytest.approx(column + half, abs=16.5)


def mapped(*, shown: bool, wall: float | None = None) -> Ground:
    """The map after legs at 2 m for a second, of a person whom the camera shows or not, before a wall [m]."""
    world, known = World(person=(2.0, 0.0)), CONTROLLER.start()
    for frame in range(20):
        legs = scan_of([(2.0, 0.05), (2.0, -0.05)], world.time) if frame >= 10 else None
        seen = replace(world.observe(visible=shown), scan=legs)
        known = CONTROLLER.step(seen if wall is None else replace(seen, depth=flat(wall)), known).state
        world.time += world.period
    return there(known.ground)


def test_people_are_no_part_of_the_map_and_what_the_depth_image_shows_is() -> None:
    legs = np.array([(2.05, 0.05)])
    for shown in (True, False):
        assert GRID.is_blocked(mapped(shown=shown), legs)[0] != shown
    for far, stands in ((3.0, True), (3.6, False)):
        found = GRID.is_blocked(mapped(shown=False, wall=far), np.array([(far + 0.084, 0.5 * far / 3)]))
        assert found[0] == stands


def test_people_who_come_are_given_way_to_whether_they_are_followed_or_not() -> None:
    comes, aside = someone(1, 1.2, 0.0, -0.8), someone(2, 3.0, -1.0)
    for given in (step(1, comes), step(2, comes, aside)):
        assert (given.reason, given.mode) == ("giving way to a person", Mode.FOLLOW)
        assert given.state.kept != DIRECT


def test_the_command_is_what_the_wheels_reach_in_a_period_and_a_half() -> None:
    # From standing at 1 m/s² within .1 s, half as much again.
    after = step(1, someone(1, 4.0))
    assert after.twist == after.state.sent
    assert after.twist.linear == pytest.approx(0.15)


def test_a_decision_carries_its_rollout_and_what_each_critic_adds() -> None:
    belief = step(1, someone(1, 4.0)).belief
    assert len(belief.rollout) == CONTROLLER.planner.sampling.steps
    assert belief.rollout[-1][0] > 0.5
    assert dict(belief.shares).keys() >= {"goal_distance", "followed", "change_of_mind"}


def test_others_are_kept_in_mind_and_the_person_followed_is_none() -> None:
    after = step(1, someone(1, 2.0), someone(2, 3.0, 1.5)).state.others
    assert [(one.x, one.y, one.at) for one in after] == [(3.0, 1.5, NOW)]
    assert step(1, someone(1, 2.0), others=after).state.others == after


def test_what_lasts_where_another_was_was_nobody() -> None:
    # A wall's end that was seen from a new side seemed to walk.
    wall = blocked(*((-1.0, y) for y in np.arange(-0.5, 0.5, 0.05)))
    beside, on = Other(-1.0, 1.5, NOW - 3.0), Other(-1.0, 0.0, NOW - 3.0)
    assert step(1, someone(1, 2.0), others=(beside, on), ground=wall).state.others == (beside,)


def test_the_people_believed_in_are_in_the_robots_frame_with_their_velocities() -> None:
    one = replace(someone(4, 1.0, 3.0, 0.5, -0.25), log_odds=math.log(3.0))
    known = state(one, pose=Odometry(NOW, 1.0, 1.0, math.pi / 2), choice=Choice(4, likely(_4=0.7), NOW))
    tracks = replace(known.tracks, boxes=((4, 2),))
    (seen,) = believed(replace(known, tracks=tracks), known.tracks.poses[-1], Noise())
    # The robot is at (1, 1) and looks along +y.
    assert (seen.x, seen.y, seen.vx, seen.vy) == pytest.approx((2.0, 0.0, -0.25, -0.5))
    assert (seen.number, seen.box, seen.same) == (4, 2, 0.7)
    assert seen.probability == pytest.approx(0.75)
    (unknown,) = believed(state(one), Odometry(NOW), Noise())
    assert (unknown.box, unknown.same) == (None, None)


def test_where_what_lasts_is_in_the_way_a_way_is_planned_and_kept_for_a_while() -> None:
    wall = [(1.25, y) for y in np.arange(-0.9, 0.9, 0.02)]
    lasts, passing = blocked(*wall), blocked(*wall, since=NOW - 1.0)
    seen = replace(view(), scan=scan_of(wall, NOW))

    def way(ground: Ground, **known: Any) -> Any:
        return step(1, someone(1, 3.0), seen=seen, ground=ground, **known).state.way

    assert len(way(lasts)) > 1
    # What came lately goes away as well.
    assert len(way(passing)) == 0
    old = np.array([(0.0, 0.0), (0.5, -0.5), (1.0, -1.2)])
    for ago, anew in ((0.7, False), (0.9, True)):
        assert (way(lasts, way=old, way_at=NOW - ago) is not old) == anew


def reason_after(seconds: float, *, pillar: bool = False) -> str:
    """What is done, of whose place no map tells, after a person was not measured for so long [s]."""
    world = World(lidar=False)
    known = run(world, 2.0).state
    world.time = there(known.tracks.person(known.choice.number)).measured + seconds
    # The depth image shows something nearer, so that it is no wonder that the camera finds nobody.
    seen = replace(world.observe(visible=False), depth=flat(0.5))
    if pillar:
        seen = replace(seen, scan=scan_of([(1.0, 0.0)], world.time))
    return CONTROLLER.step(seen, replace(known, known=None)).reason


@pytest.mark.parametrize(("seconds", "pillar", "faced"), [(1.9, False, True), (2.1, False, False), (7.9, True, True)])
def test_an_unmeasured_person_is_faced_for_two_seconds_or_longer_where_hidden(
    seconds: float, pillar: bool, faced: bool
) -> None:
    assert ("the predicted position" in reason_after(seconds, pillar=pillar)) == faced


def searched(*, scan: bool = True, **other: Any) -> Decision[TrackingState]:
    """A step after a person was lost 2 m ahead 2 s ago, on ground seen all around, with a scan that tells nothing."""
    ground = GRID.start(Odometry())
    now = np.full_like(ground.seen, NOW)
    lost: dict[str, Any] = {
        "choice": Choice(None, likely(_1=0.0), NOW - 2.0),
        "known": replace(someone(1, 2.0).track, stamp=NOW - 2.0),
        "ground": replace(ground, occupied=ground.occupied - 1, seen=now, freed=now, stamp=NOW),
        "side": -1.0,
    }
    blind = replace(scan_of([], NOW), ranges=np.full(292, np.nan, np.float32)) if scan else None
    return CONTROLLER.step(replace(view(), scan=blind), state(**{**lost, **other}))


def test_a_lost_person_is_looked_for_where_they_can_be_with_a_map_and_a_scan() -> None:
    looks = searched()
    assert looks.mode is Mode.LOST and looks.state.hunt is not None
    assert len(looks.belief.places) == 150
    assert "searching for" not in looks.reason
    # Else, and after a minute, it turns in place.
    for without in (searched(known=None), searched(ground=None, scan=False), searched(choice=Choice())):
        assert without.state.hunt is None
        assert (without.twist.linear, without.twist.angular < 0) == (0.0, True)
    assert searched(choice=Choice()).mode is Mode.SEARCH
    for ago, hunts in ((59.0, True), (61.0, False)):
        long_lost = searched(known=replace(someone(1, 2.0).track, stamp=NOW - ago))
        assert (long_lost.state.hunt is not None) == hunts
