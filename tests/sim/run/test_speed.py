"""The arena is fast enough for hundreds of runs. Time is the processor's; the limit allows for a noisy machine."""

from __future__ import annotations

import time

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario

NOISY_MACHINE = 3.0


def test_an_episode_without_detection_runs_many_times_faster_than_real_time() -> None:
    arena, took = Arena(Scenario.load("workshop"), 0), []
    for _ in range(40):
        start = time.thread_time()
        for _ in range(25):
            arena.frame()
            arena.scan()
            arena.command(Twist(0.0, 0.3))
            arena.step()
        took.append(time.thread_time() - start)
    assert 0.5 / min(took) > 25 / NOISY_MACHINE
