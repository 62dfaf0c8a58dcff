"""An exercise, read from a TOML file: the scenes a node is tried in, its checkpoints, and the points of each."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from limo_sim.run.score import ScoreCard
from limo_sim.workshop import checkpoints, sights, stretch
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.takes import Scene
from limo_sim.world.scenario import Person, Scenario
from limo_sim.world.schema import ScenarioError, build, from_toml, misfit

_FOLDER = Path(__file__).with_name("exercises")

#: What a checkpoint's `check` may be.
CHECKS: dict[str, Callable[..., Finding]] = {
    **{name: getattr(sights, name) for name in ("shown", "found", "logged", "scaled_back", "best")},
    **{name: getattr(checkpoints, name) for name in "stands turns dead_band drives speaks returns keeps".split()},
    **{name: getattr(checkpoints, name) for name in ("limits", "figures")},
    **stretch.CHECKS,
}


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """One checkpoint: its points, check, task and name, hints from vague to plain, where and how it is judged."""

    points: int
    check: str = ""
    task: int = 1
    name: str = ""
    hints: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()
    judge: Callable[..., Finding] = sights.shown


@dataclass(frozen=True, slots=True)
class Exercise:
    """What is asked of a node."""

    title: str
    scenes: tuple[Scene, ...]  #: where the node is tried
    checkpoints: tuple[Checkpoint, ...]  #: what it is judged by
    solution: str = ""  #: which of `workshop.solution`'s texts solves it; "" where none does


@dataclass(frozen=True, slots=True)
class _File:
    """A file: `scene` has the scenes of its own, by name, and `checkpoints` points, or a table with them, by name."""

    title: str
    scenes: tuple[str, ...]
    checkpoints: dict  # type: ignore[type-arg]
    scene: dict = field(default_factory=dict)  # type: ignore[type-arg]
    solution: str = ""
    task: int = 0


@dataclass(frozen=True, slots=True)
class _SceneTable:
    """A scene in a file; `people` stand at x, y [m], `scenario` names one of `Scenario.names()`, `arena` is one."""

    words: str
    people: tuple[tuple[float, float], ...] = ()
    scenario: str = ""
    arena: Scenario = field(default_factory=Scenario)
    seconds: float = 1.0
    arguments: tuple[str, ...] = ()
    last: bool = False

    def scene(self, name: str, where: str) -> Scene:
        scenario = Scenario.load(self.scenario) if self.scenario else replace(self.arena, name=f"check:{name}")
        standing = tuple(Person(route=((x, y, 3600.0),), facing=0.0) for x, y in self.people)
        scenario = replace(scenario, people=standing + scenario.people)
        scenario.check(where)
        return Scene(name, self.words, scenario, self.seconds, self.arguments, self.last)


def task_name(task: int) -> str:
    """Return a task's name: its number; A to E for the stretch tasks, which are numbered from 6 on."""
    return str(task) if task < 6 else "ABCDE"[task - 6] if task < 11 else str(task)


def names() -> list[str]:
    """Return the names of the exercises that come along."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml") if path.stem != "common")


@cache
def exercise(name_or_path: str) -> Exercise:
    """Read one of `names()`, or a TOML file. A scene or checkpoint that it only names is one of `common.toml`.

    Raises `ScenarioError` with the file, the key and what is allowed there.
    """
    path = Path(name_or_path) if name_or_path.endswith(".toml") else _FOLDER / f"{name_or_path}.toml"
    if path.parent == _FOLDER and path.stem not in names():
        raise ScenarioError(f"unknown exercise {name_or_path}: want one of {', '.join(names())}, or a .toml file")
    where, common = f"{path.name}: ", _table(_FOLDER / "common.toml")
    file = build(_File, _table(path), where)
    own = common["scene"] | file.scene
    for name in file.scenes:
        if name not in own:
            raise misfit(f"{where}scenes", f"unknown scene {name!r}", f"one of {', '.join(own)}, or [scene.{name}]")
    keys = {name: f"{where}scene.{name}." for name in file.scenes}
    scenes = tuple(build(_SceneTable, own[name], key).scene(name, key) for name, key in keys.items())
    task = {"task": file.task} if file.task else {}
    checkpoints = tuple(
        _checkpoint(
            {"check": name, "name": name} | common["checkpoints"].get(name, {}) | task,
            given if isinstance(given, dict) else {"points": given},
            file.scenes,
            f"{where}checkpoints.{name}",
        )
        for name, given in file.checkpoints.items()
    )
    return Exercise(file.title, scenes, checkpoints, file.solution)


def _checkpoint(common: dict[str, Any], given: dict[str, Any], scenes: tuple[str, ...], where: str) -> Checkpoint:
    table = common | given
    bounds = {key: table.pop(key) for key in list(table) if key == "judge" or key not in Checkpoint.__slots__}
    point = build(Checkpoint, table, f"{where}.")
    if point.check not in CHECKS:
        raise ScenarioError(f"{where}: unknown check {point.check!r}, want one of {', '.join(CHECKS)}")
    there = list(inspect.signature(CHECKS[point.check]).parameters)[1:]
    there = list(ScoreCard.__slots__) if there == ["wanted"] else there
    for key in bounds:
        if key not in there:
            said = f"unknown key; bounds of {point.check!r} are: {', '.join(there) or 'none'}"
            raise ScenarioError(f"{where}.{key}: {said}")
    for scene in point.scenes:
        if scene not in scenes:
            raise ScenarioError(f"{where}.scenes: {scene!r} is none of the exercise's scenes: {', '.join(scenes)}")
    return replace(point, judge=partial(CHECKS[point.check], **bounds))


def _table(path: Path) -> dict[str, Any]:
    try:
        return from_toml(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(f"{path}: cannot be read as TOML: {getattr(error, 'strerror', None) or error}") from error


def scene_named(name: str) -> Scene:
    """Return a scene by `NAME` of tasks 1 to 4, or by `EXERCISE/NAME`.

    Raises `ScenarioError` if there is no such scene.
    """
    of, _, scene = name.rpartition("/")
    there = {scene.name: scene for scene in exercise(of or "follower").scenes}
    if scene not in there:
        raise ScenarioError(f"unknown scene {name!r}, want one of {', '.join(there)}, or EXERCISE/NAME")
    return there[scene]
