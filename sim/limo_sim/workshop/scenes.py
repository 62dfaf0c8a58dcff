"""The scenes in which a student's node is tried."""

from __future__ import annotations

from dataclasses import dataclass

from limo_sim.world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Scene:
    """A short run."""

    name: str
    words: str  #: what happens there
    scenario: Scenario
    seconds: float = 1.0  #: how long it is [s]
    arguments: tuple[str, ...] = ()  #: ROS arguments for the node
    last: bool = False  #: whether it is played only where every checkpoint of the other scenes holds
