"""Scenarios of rooms and people run: robot and people meet as their summaries say."""

from __future__ import annotations

import numpy as np
import pytest

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
    assert card.in_view and card.detected


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
