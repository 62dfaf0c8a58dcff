"""Backing off and driving around: both sides of every time, distance and speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.follow.control.test_backing import AHEAD, BACKING, BESIDE, GRID, HERE, NEAR, is_free_behind, looked, places

from limo_hog.follow.control.backing import Other
from limo_hog.follow.control.steer import Aim, Detour, Steering
from limo_hog.follow.decision import Mode
from limo_hog.follow.robot import LIMO, Twist
from limo_hog.follow.sense.clearance import Margin
from limo_hog.follow.sense.observation import Odometry

NOBODY = places()


def test_ground_and_people_are_remembered_for_59_seconds() -> None:
    for age, known in ((58.9, True), (59.1, False)):
        # The ground on one side was seen at 0 s, on the other at 1 s.
        assert is_free_behind(looked((1.5, -1.5), until=age)) == known
        others = BACKING.remember((Other(1.0, 1.0, 0.0),), NOBODY, NOBODY, NOBODY, age)
        assert (others == (Other(1.0, 1.0, 0.0),)) == known


def test_where_a_person_out_of_sight_can_be_ground_is_known_for_five_seconds() -> None:
    for age, known in ((4.9, True), (5.1, False)):
        assert is_free_behind(looked((1.5, -1.5), until=age), BESIDE) == known


def test_a_person_is_out_of_sight_after_eight_tenths_of_a_second() -> None:
    for unseen_s, can in ((0.75, False), (0.85, True)):
        assert BACKING.can_hold_other((Other(0.0, 0.0, 0.0),), places((0.1, 0.0)), unseen_s).tolist() == [can]


@pytest.mark.parametrize("unseen_s", [1.0, 4.0])
def test_a_person_can_be_half_a_metre_and_a_metre_a_second_from_where_they_were(unseen_s: float) -> None:
    others = (Other(1.0, -1.0, 3.0), Other(50.0, 0.0, 3.0))
    reach = 0.5 + unseen_s
    around = places((1.0 + reach - 0.01, -1.0), (1.0 + reach + 0.01, -1.0), (1.0, -1.0 - reach + 0.01), (20.0, 20.0))
    assert BACKING.can_hold_other(others, around, 3.0 + unseen_s).tolist() == [True, False, True, False]
    assert not BACKING.can_hold_other((), around, 3.0).any()


def test_each_who_is_measured_is_the_nearest_of_those_remembered_who_can_have_walked_there() -> None:
    others = (Other(0.0, 0.0, 0.0), Other(3.0, 0.0, 0.0))
    for x, left in ((2.9, Other(0.0, 0.0, 0.0)), (0.2, Other(3.0, 0.0, 0.0))):
        assert BACKING.remember(others, places((x, 0.0)), NOBODY, NOBODY, 1.0) == (Other(x, 0.0, 1.0), left)
    # Half a metre and a metre for the second since; further off it is one more.
    one = others[:1]
    for x, count in ((1.49, 1), (1.51, 2)):
        assert len(BACKING.remember(one, places((x, 0.0)), NOBODY, NOBODY, 1.0)) == count


def test_legs_within_half_a_metre_are_the_remembered_persons_and_the_nearest_of_several() -> None:
    one = (Other(1.0, 1.0, 0.0),)
    for x, at in ((1.49, 1.0), (1.51, 0.0)):
        assert [other.at for other in BACKING.remember(one, NOBODY, places((x, 1.0)), NOBODY, 1.0)] == [at]
    both = places((1.4, 1.0), (0.9, 1.0), (8.0, 8.0))
    assert BACKING.remember(one, NOBODY, both, NOBODY, 1.0) == (Other(0.9, 1.0, 1.0),)
    # Who is within half a metre of the person followed is that person.
    for x, count in ((1.49, 0), (1.51, 1)):
        assert len(BACKING.remember(one, NOBODY, NOBODY, places((x, 1.0)), 1.0)) == count


def test_it_looks_behind_where_a_person_who_stands_is_a_quarter_of_a_metre_too_near() -> None:
    for too_far, looks in ((-0.24, False), (-0.26, True)):
        command, reason = BACKING.blindly(Twist(-0.4, 0.1), 0.0, NEAR, too_far, 0.3, "why")
        assert command == (Twist(0.0, 3.0) if looks else Twist(0.0, 0.1))
        assert (reason == "why") != looks


def test_from_a_person_straight_ahead_it_looks_behind_by_a_turn_to_the_left() -> None:
    straight = replace(NEAR, bearing=0.0, heading=0.0)
    assert BACKING.blindly(Twist(-0.4, 0.0), 0.0, straight, -0.5, 0.3, "")[0] == Twist(0.0, 3.0)


def test_a_person_walks_who_comes_or_crosses_faster_than_standing_people_seem_to() -> None:
    for range_rate, bearing_rate, walks in (
        (-0.29, 0.0, False),
        (-0.31, 0.0, True),
        (0.31, 0.0, True),
        (0.0, 0.14, False),
        (0.0, -0.16, True),
    ):
        # Two metres off, .15 rad/s are .3 m/s.
        aim = replace(NEAR, distance=2.0, range_rate=range_rate, bearing_rate=bearing_rate)
        command, _ = BACKING.blindly(Twist(-0.4, 0.1), 0.0, aim, -0.5, 0.3, "")
        assert (command == Twist(0.0, 0.1)) == walks


def test_onto_unknown_ground_it_backs_at_the_limit_at_most() -> None:
    for speed in (-0.4, -0.1):
        assert BACKING.blindly(Twist(speed, 0.1), 0.2, NEAR, -0.5, 0.3, "why") == (Twist(max(speed, -0.2), 0.1), "why")
    assert BACKING.blind_limit((), HERE, LIMO, 9.0) == 0.2


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_a_person_who_can_be_at_any_place_behind_makes_it_stand(yaw: float) -> None:
    pose = Odometry(9.0, 1.0, -2.0, yaw)
    back = complex(-math.cos(yaw), -math.sin(yaw))
    # Seen a second ago: 1.5 m from the farthest place, .3 m behind the outline.
    for off, limit in ((1.49, 0.0), (1.51, 0.2)):
        at = complex(1.0, -2.0) + (0.145 + 0.3 + off) * back
        assert BACKING.blind_limit((Other(at.real, at.imag, 8.0),), pose, LIMO, 9.0) == limit


def test_what_stands_behind_blocks_once_it_has_stood_there_for_six_seconds() -> None:
    ground = GRID.start(HERE)
    occupied, freed = ground.occupied.copy(), ground.freed.copy()
    behind = GRID.flat(ground, np.array([(-0.345, 0.0)]))
    occupied.flat[behind] = 1.0
    for seen_free, blocked in ((3.9, True), (4.1, False)):
        freed.flat[behind] = seen_free
        stands = replace(ground, occupied=occupied, freed=freed, stamp=10.0)
        assert BACKING.is_blocked(HERE, GRID, stands, LIMO) == blocked
        assert not BACKING.is_blocked(Odometry(yaw=math.pi), GRID, stands, LIMO)
    assert bool(BACKING.is_free_behind(AHEAD, HERE, GRID, None, (), LIMO))


def post(x: float, y: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([(x, y)])


@pytest.mark.parametrize("bearing", [0.0, 0.7, -2.0])
def test_what_is_nearer_than_45_centimetres_to_a_person_is_theirs_and_hides_nothing(bearing: float) -> None:
    along, across = complex(math.cos(bearing), math.sin(bearing)), complex(-math.sin(bearing), math.cos(bearing))

    def at(far: float, aside: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        place = far * along + aside * across
        return post(place.real, place.imag)

    for off, kept in ((0.44, 0), (0.46, 1)):
        assert len(Detour().obstacles(at(3.0, off), bearing, 3.0)) == kept
        assert Detour().hides(at(3.0 - off, 0.0), bearing, 3.0) == bool(kept)
    for aside, hidden in ((0.11, True), (0.13, False)):
        assert Detour().hides(at(1.0, aside), bearing, 3.0) == Detour().hides(at(1.0, -aside), bearing, 3.0) == hidden
    assert Detour().hides(at(0.01, 0.0), bearing, 3.0)
    assert not Detour().hides(at(-0.01, 0.0), bearing, 3.0)


def wide(x: float, half: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """A wall across the way, as far to either side."""
    return np.array([(x, y) for y in np.arange(-half, half + 0.01, 0.02)])


def test_directions_up_to_six_steps_of_eight_hundredths_are_tried_to_either_side() -> None:
    # The person stays in the image, which ends at .62 rad. A wall .3 m to one side is passed on the other.
    assert Detour().steps * Detour().step == pytest.approx(0.48)
    wall = np.array([(1.2, y) for y in np.arange(0.1, 0.21, 0.02)])
    for begun, steps in ((0.48, 6), (0.0, -3), (-0.48, -3)):
        assert Detour().heading(wall, 0.0, 4.0, begun, LIMO) == pytest.approx(0.08 * steps)
    assert Detour().heading(wide(0.8, 3.0), 0.0, 4.0, 0.0, LIMO) is None


def test_a_detour_is_kept_while_the_way_around_the_other_side_is_not_a_third_of_it() -> None:
    # Half as much as the detour itself counts what it differs from the one begun, four steps to the left: four steps
    # against two and half of six, and against one and half of five.
    narrow = Detour(margin=Margin(0.65, 0.05))
    for right_end, steps in ((0.06, 4), (0.12, -1)):
        wall = np.array([(1.2, y) for y in np.arange(right_end, 0.141, 0.02)])
        assert narrow.heading(wall, 0.0, 4.0, 4 * 0.08, LIMO) == pytest.approx(0.08 * steps)
        assert narrow.heading(wall, 0.0, 4.0, 0.0, LIMO) == pytest.approx(-0.16 if steps > 0 else -0.08)


def test_along_a_way_a_direction_is_free_for_a_quarter_of_a_metre_or_a_third_of_that() -> None:
    # To a wall: .145 m of robot, .65 m of margin.
    detour = replace(Detour(), steps_near=0)
    for creep in (0.25, 0.25 / 3):
        assert detour.near(wide(0.795 + creep + 0.005, 3.0), 0.0, LIMO) == 0.0
    assert detour.near(wide(0.795 + 0.25 / 3 - 0.005, 3.0), 0.0, LIMO) is None
    assert Detour().steps_near * Detour().step == pytest.approx(1.2)


STEERING = Steering()
THERE = Aim(0.0, 1.5 + LIMO.camera_x, 0.0, 0.0, heading=0.0, hidden=False)


@pytest.mark.parametrize(
    ("change", "holds", "stands"),
    [
        ({"distance": 1.5 + LIMO.camera_x + 0.07}, True, True),
        ({"distance": 1.5 + LIMO.camera_x - 0.07}, True, True),
        ({"distance": 1.5 + LIMO.camera_x + 0.09}, False, False),
        ({"distance": 1.5 + LIMO.camera_x - 0.09}, False, False),
        ({"range_rate": 0.09}, True, True),
        ({"range_rate": -0.11}, False, False),
        ({"bearing": 0.019}, True, True),
        ({"bearing": -0.021}, True, False),
        ({"bearing_rate": 0.049}, True, True),
        ({"bearing_rate": -0.051}, True, False),
    ],
)
def test_smaller_errors_and_slower_people_are_left_alone(change: dict[str, float], holds: bool, stands: bool) -> None:
    aim = replace(THERE, **change)  # type: ignore[arg-type]
    aim = replace(aim, heading=aim.bearing)
    twist, mode, _ = STEERING.command(aim, 1.5, LIMO, confirmed=True, worth_nearing=False, in_view=True, lost_s=0.0)
    assert (mode is Mode.HOLD) == holds
    assert (twist == Twist()) == stands


def test_a_person_goes_to_a_side_whose_bearing_changes_by_a_twentieth_of_a_radian_a_second() -> None:
    for rate, side in ((0.049, -1.0), (0.051, 1.0)):
        assert STEERING.side_of(replace(THERE, bearing=-0.3, bearing_rate=rate)) == side
        assert STEERING.side_of(replace(THERE, bearing=0.3, bearing_rate=-rate)) == -side


def test_out_of_the_image_it_turns_faster_and_only_there() -> None:
    half = LIMO.field_of_view / 2
    for bearing, limit in ((half - 0.01, 1.5), (half + 0.6, 3.0), (-half - 0.6, -3.0), (-half + 0.01, -1.5)):
        aim = replace(THERE, distance=3.0, bearing=bearing, heading=bearing)
        twist, _, _ = STEERING.command(aim, 1.5, LIMO, confirmed=True, worth_nearing=False, in_view=True, lost_s=0.0)
        assert twist.angular == pytest.approx(limit)
