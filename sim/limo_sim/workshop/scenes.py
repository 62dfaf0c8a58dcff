"""The scenes in which a student's node is tried."""

from __future__ import annotations

from dataclasses import dataclass

from limo_sim.world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Scene:
    """A short run.

    Attributes
    ----------
    name, words
        What it is called, and what happens there.
    scenario, seconds, arguments
        What is run, how long [s], and ROS arguments for the node.
    last
        Whether it is played only where every checkpoint of the other scenes holds.
    """

    name: str
    words: str
    scenario: Scenario
    seconds: float = 1.0
    arguments: tuple[str, ...] = ()
    last: bool = False
