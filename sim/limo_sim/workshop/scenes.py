"""The scenes in which a student's node is tried."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from limo_sim.ros.runner import Limits, Said, run_node
from limo_sim.ros.stage import Stage
from limo_sim.run.log import Step
from limo_sim.workshop.takes import Take
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


def play(script: Path, scene: Scene, limits: Limits | None = None, said: Said = lambda *_: None) -> Take:
    """Run a node in a scene and note what it does; `said` is given what it prints."""
    take = Take(scene)

    def watch(step: Step) -> None:
        take.path.append((step.log.time, *step.truth.robot))

    stage = Stage(script, scene.scenario, scene.seconds, log=take.log, watch=watch, witness=take)
    take.outcome = run_node(stage, ("--ros-args", *scene.arguments), limits=limits, said=said, checked=True)
    return take
