"""Scenarios of rooms and people run: robot and people meet as their summaries say."""

from __future__ import annotations

import numpy as np
import pytest

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.run.arena import Arena
from limo_sim.run.baselines import controller_of
from limo_sim.run.episode import run_episode, score
from limo_sim.world.scenario import Scenario

SCENARIOS = ("flat", "gathering", "poster_wall", "side_door", "tall")


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario_is_played_by_the_tracking_controller(name: str) -> None:
    episode = run_episode(Scenario.load(name), controller_of("tracking", None), detector_named("hog"), 4.0, 0)
    card = score(episode)
    assert card.frames == 40
    assert card.contacts_person == card.contacts_wall == 0
    assert card.in_view


def test_in_the_corridor_one_person_walks_ahead_and_the_other_passes_the_robot() -> None:
    arena = Arena(Scenario.load("side_door"), 0)
    places = []
    while arena.time < 25.0:
        arena.step()
        places.append([(pose.x, pose.y) for pose in arena.plan().people if pose is not None])
    ahead, towards = np.moveaxis(np.array(places), 1, 0)
    assert ahead[:, 0].max() > 1.5
    assert towards[:, 0].min() < -6.5
    in_corridor = (towards[:, 0] > -7.5) & (towards[:, 0] < 1.0)
    assert np.abs(towards[in_corridor, 1]).max() < 0.95
    assert arena.contacts.person == 0


def test_the_adult_is_as_tall_in_the_image_as_at_that_distance_and_found() -> None:
    arena = Arena(Scenario.load("tall"), 0)
    detector = detector_named("hog")
    found = 0
    for _ in range(5):
        for _ in range(50):
            arena.step()
        frame = arena.frame()
        [person] = frame.truth.people
        assert person is not None
        assert person.box is not None
        _, top, _, height = person.box
        assert top > 0
        # A foot may be nearer than the trunk by half a step.
        assert height == pytest.approx(LIMO.focal_px(640) * 1.85 / (person.x - LIMO.camera_x), rel=0.1)
        found += len(detector.detect(frame.image)) > 0
    assert found >= 4
