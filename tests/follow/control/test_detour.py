"""Driving around what stands between the robot and the person."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.follow.control.steer import Detour
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import Margin


def wall(x: float, low: float = -3.0, high: float = 3.0) -> NDArray[np.float64]:
    """A wall across the way."""
    return np.array([(x, y) for y in np.arange(low, high + 0.001, 0.02)])


def test_a_way_that_is_free_half_as_far_is_taken_and_a_shorter_one_is_not() -> None:
    # Wanted: 1.2 m free. Room to a wall is its distance less .145 m of robot and .65 m of margin.
    detour = Detour()
    assert detour.heading(wall(1.5), 0.0, 4.0, 0.0, LIMO) == 0.0
    assert detour.heading(wall(1.1), 0.0, 4.0, 0.0, LIMO) is None


def test_the_way_to_the_person_is_looked_at_up_to_the_look_ahead_or_their_legs() -> None:
    # 1.2 m of way, .145 m of robot and .65 m of margin: a wall at 2 m is as good as none, one at 1.98 m is not.
    detour = Detour(steps=0)
    assert detour.heading(wall(2.0), 0.0, 4.0, 0.0, LIMO) == 0.0
    assert detour.free(wall(1.98), 0.0, 0.0, 1.2, LIMO) is None
    # A person at 1.7 m: what is free up to .9 m before them is enough.
    assert detour.heading(wall(1.6), 0.0, 1.7, 0.0, LIMO) == 0.0
    assert detour.heading(wall(1.19), 0.0, 1.7, 0.0, LIMO) is None


def test_of_two_ways_around_the_preferred_one_is_taken() -> None:
    post = np.array([[1.2, 0.0]])
    left, right = (Detour().heading(post, 0.0, 4.0, side, LIMO) for side in (0.3, -0.3))
    assert left is not None
    assert right is not None
    assert left > 0.2
    assert right == pytest.approx(-left)


@pytest.mark.parametrize("bearing", [0.0, 0.7, -2.0])
def test_what_is_nearer_than_45_centimetres_to_a_person_is_theirs(bearing: float) -> None:
    along, across = complex(math.cos(bearing), math.sin(bearing)), complex(-math.sin(bearing), math.cos(bearing))

    def at(far: float, aside: float) -> NDArray[np.float64]:
        place = far * along + aside * across
        return np.array([(place.real, place.imag)])

    for off, kept in ((0.44, 0), (0.46, 1)):
        assert len(Detour().obstacles(at(3.0, off), bearing, 3.0)) == kept
        assert Detour().hides(at(3.0 - off, 0.0), bearing, 3.0) == bool(kept)
    for aside, hidden in ((0.11, True), (0.13, False)):
        assert Detour().hides(at(1.0, aside), bearing, 3.0) == Detour().hides(at(1.0, -aside), bearing, 3.0) == hidden
    assert Detour().hides(at(0.01, 0.0), bearing, 3.0)
    assert not Detour().hides(at(-0.01, 0.0), bearing, 3.0)


def test_a_wall_is_passed_on_the_nearer_side_and_the_person_stays_in_the_image() -> None:
    # The person stays in the image, which ends at .62 rad. A wall .3 m to one side is passed on the other.
    across = wall(1.2, 0.1, 0.2)
    for begun, steps in ((0.48, 6), (0.0, -3), (-0.48, -3)):
        assert Detour().heading(across, 0.0, 4.0, begun, LIMO) == pytest.approx(0.08 * steps)
    assert Detour().heading(wall(0.8), 0.0, 4.0, 0.0, LIMO) is None


def test_a_detour_is_kept_while_the_other_side_is_not_a_third_of_it() -> None:
    # Half as much as the detour itself counts what it differs from the one begun, four steps to the left: four steps
    # against two and half of six, and against one and half of five.
    narrow = Detour(margin=Margin(0.65, 0.05))
    for right_end, steps in ((0.06, 4), (0.12, -1)):
        across = wall(1.2, right_end, 0.14)
        assert narrow.heading(across, 0.0, 4.0, 4 * 0.08, LIMO) == pytest.approx(0.08 * steps)
        assert narrow.heading(across, 0.0, 4.0, 0.0, LIMO) == pytest.approx(-0.16 if steps > 0 else -0.08)


def test_along_a_way_a_direction_is_free_for_a_third_of_a_quarter_of_a_metre() -> None:
    # To a wall: .145 m of robot, .65 m of margin.
    straight = Detour(steps_near=0)
    for room, heading in ((0.25 / 3 + 0.005, 0.0), (0.25 / 3 - 0.005, None)):
        assert straight.near(wall(0.795 + room), 0.0, LIMO) == heading
