"""A 10 x 10 m arena with a walking person and a Limo robot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from limo_sim.run.arena import Arena
    from limo_sim.run.episode import Episode, run_episode, score
    from limo_sim.run.score import ScoreCard
    from limo_sim.world.scenario import Scenario

__all__ = ["Arena", "Episode", "Scenario", "ScoreCard", "run_episode", "score"]

#: Where each name is. They are imported when asked for: the commands' help needs no OpenCV.
_MODULES = {
    "Arena": "run.arena",
    "Episode": "run.episode",
    "Scenario": "world.scenario",
    "ScoreCard": "run.score",
    "run_episode": "run.episode",
    "score": "run.episode",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"limo_sim.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
