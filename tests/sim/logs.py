"""Logs of runs in the arena, kept without their pictures, and of people who walk in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from limo_hog.follow.robot import Twist
from limo_sim.run.arena import STEPS_PER_SECOND, Arena
from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step
from limo_sim.world.crowd import STEP_S, Crowd
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Scenario

T = TypeVar("T")


def kept_in(steps: list[Step]) -> Callable[[Step], None]:
    """What a run is to be watched by, so that its steps are kept."""
    return lambda step: steps.append(step.bare())


def steps_of(*arguments: Any, **options: Any) -> list[Step]:
    """Run an episode, with the arguments of `run_episode`, and return its control periods."""
    steps: list[Step] = []
    run_episode(*arguments, watch=kept_in(steps), **options)
    return steps


def drive(arena: Arena, seconds: float, twist: Twist | None = None) -> Arena:
    """Let a time pass, with a command before every step where there is one."""
    for _ in range(round(seconds * STEPS_PER_SECOND)):
        if twist is not None:
            arena.command(twist)
        arena.step()
    return arena


def poses_of(
    scenario: Scenario, seconds: float, robot: tuple[float, float, float] = (-4.5, -4.5, 0.0), seed: int = 0
) -> list[tuple[Pose | None, ...]]:
    """Where everybody is from step to step, while the robot stands."""
    scenario.check()
    crowd = Crowd(scenario, seed)
    seen = [crowd.poses]
    for step in range(1, round(seconds / STEP_S) + 1):
        crowd.advance(step * STEP_S, robot)
        seen.append(crowd.poses)
    return seen


def there(one: T | None) -> T:
    """Return what is there: somebody in the arena, a box in the image."""
    assert one is not None
    return one
