"""The scenes in which a student's node is tried, and the node's outputs for each frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_sim.ros.lockstep.calls import LOGGER, Calls
from limo_sim.ros.lockstep.records import Command, Found, Shown
from limo_sim.ros.runner import Limits, Said, run_node
from limo_sim.ros.stage import Ended, Stage
from limo_sim.run.log import Step
from limo_sim.world.scenario import Person, Scenario
from limo_sim.world.truth import Truth


@dataclass(frozen=True, slots=True)
class Scene:
    """A short run: the scenario, its description in words, and ROS arguments for the node."""

    name: str
    words: str
    scenario: Scenario
    seconds: float = 1.0
    arguments: tuple[str, ...] = ()


def standing(*places: tuple[float, float]) -> Scenario:
    """Return an arena with people who stand at (x, y) [m], facing the world's +x."""
    return Scenario(name="workshop check", people=tuple(Person(route=((x, y, 3600.0),), facing=0.0) for x, y in places))


LEFT = Scene("left", "a person stands on the left", standing((2.1, 0.6)))
RIGHT = Scene("right", "a person stands on the right", standing((2.1, -0.6)))
#: Longer than 30 frames, since many nodes log every thirtieth.
AHEAD = Scene("ahead", "a person stands straight ahead", standing((3.2, 0.0)), 3.3)
NOBODY = Scene("nobody", "the room is empty", standing())
#: Two people, of whom OpenCV's detector lists the less sure one first.
TWO = Scene("two", "two people stand there", standing((2.2, 0.7), (3.4, -1.0)), 0.6)
NEAR = Scene(
    "near", "a person is nearer than the target distance", standing((2.0, 0.0)), 1.0, ("-p", "target_distance:=2.5")
)
FAR = Scene(
    "far", "a person is farther than the target distance", standing((3.2, 0.0)), 3.3, ("-p", "target_distance:=1.5")
)

FOLLOWER_SCENES = (LEFT, RIGHT, AHEAD, NOBODY, TWO)
PROXEMIC_SCENES = (LEFT, RIGHT, NOBODY, TWO, NEAR, FAR)


@dataclass(frozen=True, slots=True)
class Look:
    """One camera frame, and the node's outputs before the next one.

    Attributes
    ----------
    time
        When the node got it [s].
    image
        The camera's.
    found
        Boxes in the camera's pixels.
    raw
        The detector's result, in pixels of the image it was given; None where it was not called.
    commands
        What was published on /cmd_vel.
    windows
        The newest picture of each window, shown for this frame or before.
    said
        What was logged.
    truth
        The arena when the frame was taken.
    """

    time: float
    image: NDArray[np.uint8]
    found: Detections
    raw: Found | None
    commands: tuple[Command, ...]
    windows: dict[str, Shown]
    said: tuple[str, ...]
    truth: Truth


@dataclass
class Take:
    """A node in one scene.

    Attributes
    ----------
    looks
        What it made of each camera frame.
    path
        The robot's x, y, yaw in each control period [m, m, rad].
    outcome
        How the run ended; None before.
    """

    scene: Scene
    looks: list[Look] = field(default_factory=list)
    path: list[tuple[float, float, float]] = field(default_factory=list)
    outcome: Ended | None = None

    @property
    def calls(self) -> Calls:
        """What the node called."""
        return self.outcome.stage.calls if self.outcome is not None else Calls()


def play(script: Path, scene: Scene, limits: Limits | None = None, said: Said = lambda *_: None) -> Take:
    """Run a node in a scene and note its outputs for each frame; `said` is given what it prints."""
    take = Take(scene)
    lines: list[str] = []
    commanded = 0

    def watch(step: Step) -> None:
        nonlocal commanded
        take.path.append(step.truth.robot)
        log = step.log
        if log.frame is None or step.seen is None:
            return
        take.looks.append(
            Look(
                log.time,
                log.frame.image,
                log.detections,
                stage.found[-1] if stage.found else None,
                tuple(stage.commands[commanded:]),
                dict(stage.shown),
                tuple(lines),
                step.seen,
            )
        )
        commanded = len(stage.commands)
        lines.clear()

    stage = Stage(
        script,
        scene.scenario,
        scene.seconds,
        log=lambda _time, _level, name, message: None if name == LOGGER else lines.append(message),
        watch=watch,
    )
    take.outcome = run_node(stage, ("--ros-args", *scene.arguments), limits=limits, said=said, fast=True)
    return take
