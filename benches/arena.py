"""What a frame and a scan of the arena cost, in every scenario: `uv run python benches/arena.py`.

The robot keeps 1 m from the nearest person, closer than any follower; every frame (colour, depth and truth)
and every scan on the way is made several times, and the least of its times counts. One thread, processor time.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.sensing import lidar
from limo_sim.sensing.camera import CameraPose
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Furniture, Scenario

REPEATS = 5
KEPT_M, STOP_M = 1.0, 0.4
FRAME_STEPS = STEPS_PER_SECOND // 10


def least_ms(action: Callable[[], object]) -> float:
    """Least processor time of several calls [ms]."""
    times = []
    for _ in range(REPEATS):
        start = time.thread_time()
        action()
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def nearest_person(arena: Arena) -> tuple[float, float] | None:
    """Distance [m] and bearing [rad] of the nearest person."""
    there = [(person.distance, person.bearing) for person in arena.truth().people if person is not None]
    return min(there, default=None)


def drive(scenario: Scenario, seconds: float) -> Iterator[tuple[float, float]]:
    """Costs of a frame and a scan [ms], ten times a second."""
    arena = Arena(scenario, 0)

    def frame() -> None:
        arena._frame = None
        arena.frame()

    def scan() -> None:
        arena._scan = None
        arena.scan()

    for step in range(round(seconds * STEPS_PER_SECOND)):
        if step % FRAME_STEPS == 0:
            yield least_ms(frame), least_ms(scan)
            distance, bearing = nearest_person(arena) or (KEPT_M, 0.0)
            free = float(arena.scan().ranges[lidar.BEAMS // 4 : -lidar.BEAMS // 4].min()) > STOP_M
            arena.command(Twist(min(0.8 * (distance - KEPT_M), 0.5 if free else 0.0), 2.0 * bearing))
        arena.step()


def around(distance: float, people: int) -> Iterator[float]:
    """Cost of a frame [ms] with people side by side at a distance [m], in the middle and at the edge, turned 8 ways."""
    person = Scenario.load("standing").people
    renderer = Renderer(Scenario(people=people * person), np.random.default_rng(0))
    for aside in (0.0, 0.25, 0.6):
        for turn in range(8):
            poses = [
                Pose(distance * math.cos(angle), distance * math.sin(angle), turn * math.tau / 8, turn, 1.0)
                for angle in (aside, -0.3)[:people]
            ]
            yield least_ms(lambda poses=poses: renderer.render(CameraPose(0, 0, 0), poses, np.random.default_rng(1)))


def crowd(distance: float) -> Iterator[float]:
    """Cost of a frame [ms] with six people in two staggered rows from a distance [m] on, turned 8 ways."""
    person = Scenario.load("standing").people
    renderer = Renderer(Scenario(people=6 * person), np.random.default_rng(0))
    for turn in range(8):
        poses = [
            Pose(distance * (1 + 0.15 * (n % 3)), (n - 2.5) * distance * 0.22, turn * math.tau / 8 + n, turn + n, 1.0)
            for n in range(6)
        ]
        yield least_ms(lambda poses=poses: renderer.render(CameraPose(0, 0, 0), poses, np.random.default_rng(1)))


def pillars(count: int) -> Iterator[float]:
    """Cost of a frame [ms] with pillars in sight, 1.2 to 4.6 m away, placed 8 ways."""
    for seed in range(8):
        random, placed = np.random.default_rng(seed), list[Furniture]()
        while len(placed) < count:
            x, y = random.uniform((1.2, -3.0), (4.6, 3.0)).tolist()
            if abs(y) < 0.6 * x and all(math.hypot(x - other.x, y - other.y) > 0.4 for other in placed):
                placed.append(Furniture("pillar", x, y))
        renderer = Renderer(Scenario(furniture=tuple(placed)), np.random.default_rng(0))
        yield least_ms(lambda renderer=renderer: renderer.render(CameraPose(0, 0, 0), [], np.random.default_rng(1)))


def summary(times: list[float]) -> str:
    """Median, 95th percentile and maximum."""
    return " ".join(f"{value:8.2f}" for value in (np.median(times), np.percentile(times, 95), max(times)))


def main() -> None:
    """Print a line a scenario, and a line a distance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=40.0, help="simulated, of each scenario")
    parser.add_argument("scenarios", nargs="*", default=Scenario.names())
    args = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'ms':20}{'frame: median p95 max':>27}{'scan: median p95 max':>27}")
    for name in args.scenarios:
        frames, scans = zip(*drive(Scenario.load(name), args.seconds), strict=True)
        print(f"{name:20}{summary(frames)} {summary(scans)}", flush=True)
    for people, word in ((1, "person"), (2, "two")):
        for distance in (0.5, 0.7, 0.9, 1.2, 1.5, 2.0, 3.0, 4.0, 6.0):
            print(f"{f'{word} at {distance} m':20}{summary(list(around(distance, people)))}", flush=True)
    for distance in (1.2, 2.0, 3.0, 4.0):
        print(f"{f'six from {distance} m on':20}{summary(list(crowd(distance)))}", flush=True)
    print(f"{'twenty pillars':20}{summary(list(pillars(20)))}", flush=True)


if __name__ == "__main__":
    main()
