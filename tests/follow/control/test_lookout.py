"""Looking for a lost person: what the camera shows is empty, and a place to look from is kept until one is better."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.follow.views import scan

from limo_hog.follow.control.lookout import Hunt, Lookout
from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.clearance import NO_POINTS, Points
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.space.places import Places, Wandering
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise

LOOKOUT, GRID, HERE, NOW = Lookout(), Grid(), Odometry(10.0), 10.0
#: A scan whose beams tell nothing.
BLIND = scan(np.full(292, np.nan, np.float32), NOW)


def free_ground() -> Ground:
    """Ground that nothing stands on, seen by a robot that turned once about itself."""
    ground = None
    for turn in (0.0, 1.5, 3.0, 4.5):
        ground = GRID.update(ground, scan(stamp=NOW - 5 + turn), replace(HERE, yaw=turn), NO_POINTS, NO_POINTS)
    assert ground is not None
    return ground


def hunt_for(points: Points, planned: float) -> Hunt:
    """Return the hunt for a person who may be at each of (N, 2) places."""
    track = kalman.initiate(NOW - 1.0, 0.0, 2.0, HERE, Noise())
    return Hunt(track, Places(NOW, points, np.zeros(points.shape)), planned=planned)


def test_no_person_is_where_the_camera_shows_none() -> None:
    sure = Lookout(wandering=Wandering(found=1.0))
    around = np.array([(r * np.cos(a), r * np.sin(a)) for r in (1.0, 3.3, 3.7, 4.5) for a in np.arange(-3, 3.1, 0.3)])
    after = sure.step(hunt_for(around, NOW), BLIND, NOW, HERE, GRID, free_ground(), LIMO)
    left = {tuple(one) for one in after.places.points.tolist()}
    shown = (np.abs(np.arctan2(around[:, 1], around[:, 0])) < 0.5) & (np.hypot(*around.T) < 3.5)
    assert shown.any()
    assert left == {tuple(one) for one in around[~shown].tolist()}


@pytest.mark.parametrize(("off", "rate"), [(0.0, 0.0), (0.3, 0.6), (-0.3, -0.6), (1.0, 1.2), (-3.0, -1.2)])
def test_it_turns_by_the_angle_that_is_left_and_never_faster_than_its_limit(off: float, rate: float) -> None:
    assert Lookout(turn_gain=2.0, max_turn=1.2).turn(off) == pytest.approx(rate)


@dataclass(frozen=True, slots=True)
class Counted(Grid):
    """A grid that notes how many places are looked from, and at."""

    asked: list[tuple[int, int]] = field(default_factory=list)

    def sees(
        self, ground: Ground, origins: Points, places: Points, *, lasting: bool = False, samples: int = 24
    ) -> NDArray[np.bool_]:
        self.asked.append((len(origins), len(places)))
        return Grid.sees(self, ground, origins, places, lasting=lasting, samples=samples)


@pytest.mark.parametrize("count", [1, 40, 150, 1000])
def test_as_many_places_are_compared_however_large_the_room_and_many_the_guesses(count: int) -> None:
    grid = Counted()
    hunt = LOOKOUT.step(hunt_for(np.full((count, 2), 1.5), -np.inf), BLIND, NOW, HERE, grid, free_ground(), LIMO)
    origins, places = grid.asked[-1]
    assert hunt.planned == NOW
    assert LOOKOUT.candidates <= origins <= 2 * LOOKOUT.candidates + 1
    assert min(count, 50) <= places < 100


def test_a_place_that_is_driven_to_is_kept_until_another_is_half_as_good_again() -> None:
    lookout = Lookout(candidates=10_000)
    for more, kept in ((1.3, True), (2.0, False)):
        few, many = np.full((24, 2), (0.0, 4.5)), np.full((round(24 * more), 2), (0.0, -4.5))
        hunt = hunt_for(np.concatenate([few, many]), -np.inf)
        fresh = lookout.step(hunt, BLIND, NOW, HERE, GRID, free_ground(), LIMO)
        assert fresh.way[-1, 1] < 0
        mirrored = fresh.way * (1.0, -1.0)
        after = lookout.step(replace(hunt, way=mirrored), BLIND, NOW, HERE, GRID, free_ground(), LIMO)
        assert (after.way[-1, 1] > 0) == kept
