"""Scenarios that ask for nothing new show what they always showed."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

#: Some bytes of five frames of each scenario, recorded before rooms, people and detectors could vary.
RECORDED: dict[str, str] = json.loads(Path(__file__).with_name("frames.json").read_text())
#: Every so many bytes of a frame one is kept: a prime, so that all columns, rows and channels are met.
STRIDE = 20_011


def sampled(name: str) -> NDArray[np.uint8]:
    """Return some bytes of the colour images of two seconds."""
    arena, bytes_ = Arena(Scenario.load(name), 0), []
    for step in range(100):
        if step % 20 == 0:
            bytes_.append(arena.frame().image.ravel()[::STRIDE])
        arena.command(Twist(0.2, 0.4 * math.sin(step)))
        arena.step()
    return np.concatenate(bytes_)


@pytest.mark.parametrize("name", RECORDED)
def test_an_old_scenario_shows_the_frames_it_always_showed(name: str) -> None:
    recorded = np.frombuffer(bytes.fromhex(RECORDED[name]), np.uint8)
    # Another CPU or numpy may round a value to the next level; anything else is another picture.
    np.testing.assert_allclose(sampled(name).astype(int), recorded, rtol=0, atol=1)
