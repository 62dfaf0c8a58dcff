"""Ways lead round obstacles and are as short as they can be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from limo_sim.world.furniture import Disc, Rectangle, distance_to
from limo_sim.world.paths import FloorPlan


def test_the_way_is_straight_where_nothing_stands_in_it() -> None:
    plan = FloorPlan([Rectangle(0, 3, 1, 1)], 5.0, 0.3)
    place, length = plan.way((-2, 0), (2, 1))
    assert place == (2, 1)
    assert length == pytest.approx(math.hypot(4, 1))


def test_the_way_round_a_square_goes_by_its_nearer_corners() -> None:
    plan = FloorPlan([Rectangle(0, 0.2, 1, 1)], 5.0, 0.3)
    (x, y), length = plan.way((-3, 0), (3, 0))
    assert (x, y) == pytest.approx((-1.3, -1.1), abs=0.01)
    assert length == pytest.approx(2 * math.hypot(1.7, 1.1) + 2.6, abs=0.01)


def test_the_way_round_a_disc_is_hardly_longer_than_tangents_and_arc() -> None:
    plan = FloorPlan([Disc(0, 0, 0.7)], 5.0, 0.3)
    angle = math.acos(1.0 / 3.0)
    shortest = 2 * math.sqrt(9 - 1) + (math.pi - 2 * angle)
    assert shortest <= plan.way((-3, 0), (3, 0))[1] < 1.03 * shortest


def test_a_door_is_found_and_one_too_narrow_is_none() -> None:
    for width, passable in ((0.7, True), (0.5, False)):
        walls = [Rectangle(0, side * (2.5 + width / 2), 0.05, 2.5) for side in (-1, 1)]
        length = FloorPlan(walls, 5.0, 0.3).way((-2, 2), (2, 2))[1]
        assert math.isfinite(length) == passable


def test_ways_within_the_margin_begin_without_it() -> None:
    plan = FloorPlan([Rectangle(0, 0, 1, 1)], 5.0, 0.3)
    place, length = plan.way((-1.1, 0), (1.1, 0))
    assert place[0] == pytest.approx(-1.3, abs=0.01)
    assert length < 2 * math.hypot(1.3, 0.2) + 2.7


def test_a_wall_hides_what_is_behind_it() -> None:
    plan = FloorPlan([Rectangle(0, 0, 0.05, 1.0, 0.3), Disc(3, 0, 0.2)], 5.0, 0.3)
    start, end = np.array([[-1.0, 0], [-1, 2], [2, 0], [2, 0.5]]), np.array([[1.0, 0], [1, 2], [4, 0], [4, 0.5]])
    assert plan.hidden(start, end).tolist() == [True, False, True, False]


def test_the_way_to_the_nearest_point_is_as_long_as_the_distance() -> None:
    shapes: list[Disc | Rectangle] = [Disc(1, 2, 0.4), Rectangle(-1, 0.5, 0.7, 0.2, 0.6)]
    places = np.random.default_rng(0).uniform(-4, 4, (200, 2))
    away = FloorPlan(shapes, 5.0, 0.3).away(places)
    for index, place in enumerate(places.tolist()):
        for column, shape in ((1, shapes[0]), (0, shapes[1])):
            assert math.hypot(*away[index, column]) == pytest.approx(max(distance_to(shape, *place), 0.0), abs=1e-6)
