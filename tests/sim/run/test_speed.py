"""The arena is fast enough for hundreds of runs. Time is the processor's; limits allow for a noisy machine."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import Arena
from limo_sim.sensing.camera import CameraPose
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Scenario

NOISY_MACHINE = 3.0
WORKSHOP = Scenario.load("workshop")


def fastest_ms(action: Callable[[], object], tries: int) -> float:
    times = []
    for _ in range(tries):
        start = time.thread_time()
        action()
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def test_a_frame_takes_three_milliseconds() -> None:
    renderer = Renderer(WORKSHOP, np.random.default_rng(0))
    for distance in (1.75, 3.0):
        pose = Pose(distance, 0.2, 2.0, 1.0, 1.0)
        draw = lambda pose=pose: renderer.render(CameraPose(0, 0, 0), [pose], np.random.default_rng(1))  # noqa: E731
        assert fastest_ms(draw, 40) < 3.0 * NOISY_MACHINE


def test_a_scan_takes_a_fifth_of_a_millisecond() -> None:
    arena = Arena(WORKSHOP, 0)

    def scan() -> None:
        arena._scan = None
        arena.scan()

    assert fastest_ms(scan, 100) < 0.2 * NOISY_MACHINE


def test_an_episode_without_detection_runs_many_times_faster_than_real_time() -> None:
    arena = Arena(WORKSHOP, 0)

    def half_a_second() -> None:
        for _ in range(25):
            arena.frame()
            arena.scan()
            arena.command(Twist(0.0, 0.3))
            arena.step()

    assert 500 / fastest_ms(half_a_second, 40) > 25 / NOISY_MACHINE
