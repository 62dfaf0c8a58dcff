"""Logs of runs in the arena, kept without their pictures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from limo_sim.run.episode import run_episode
from limo_sim.run.log import Step


def kept_in(steps: list[Step]) -> Callable[[Step], None]:
    """What a run is to be watched by, so that its steps are kept."""
    return lambda step: steps.append(step.bare())


def steps_of(*arguments: Any, **options: Any) -> list[Step]:
    """Run an episode, with the arguments of `run_episode`, and return its control periods."""
    steps: list[Step] = []
    run_episode(*arguments, watch=kept_in(steps), **options)
    return steps
