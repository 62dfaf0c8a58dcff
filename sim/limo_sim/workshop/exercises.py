"""An exercise, read from a TOML file: the scenes a node is tried in, its checkpoints, and the points of each."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

from limo_sim.workshop import checkpoints, sights, stretch
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.scenes import Scene
from limo_sim.world.scenario import Person, Scenario
from limo_sim.world.schema import ScenarioError, build

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found]

_FOLDER = Path(__file__).with_name("exercises")

#: What a checkpoint's `check` may be.
CHECKS: dict[str, Callable[..., Finding]] = {
    **{name: getattr(sights, name) for name in ("shown", "found", "logged", "scaled_back", "best")},
    **{
        name: getattr(checkpoints, name)
        for name in "stands turns dead_band drives speaks returns keeps limits figure follows".split()
    },
    **stretch.CHECKS,
}


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """One checkpoint: its check, task, name and points, how it is judged and where, and hints from vague to plain."""

    check: str
    task: int
    name: str
    points: int
    judge: Callable[..., Finding]
    hints: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Exercise:
    """What is asked of a node.

    Attributes
    ----------
    name, title
        What it is called.
    scenes, checkpoints
        Where the node is tried, and what it is judged by.
    solution
        Which of `workshop.solution`'s texts solves it; "" where none does.
    """

    name: str
    title: str
    scenes: tuple[Scene, ...]
    checkpoints: tuple[Checkpoint, ...]
    solution: str = ""

    def has(self, check: str) -> bool:
        """Whether one of the checkpoints is of this check."""
        return any(checkpoint.check == check for checkpoint in self.checkpoints)


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

    def scene(self, name: str) -> Scene:
        if self.scenario:
            scenario = Scenario.load(self.scenario)
        else:
            standing = tuple(Person(route=((x, y, 3600.0),), facing=0.0) for x, y in self.people)
            scenario = Scenario(
                **{**_fields(self.arena), "name": f"check:{name}", "people": standing + self.arena.people}
            )
            scenario.check(f"scene.{name}: ")
        return Scene(name, self.words, scenario, self.seconds, self.arguments, self.last)


@dataclass(frozen=True, slots=True)
class _CheckpointTable:
    """A checkpoint in a file; what else its table has are bounds, arguments of the check."""

    points: int
    check: str = ""
    task: int = 1
    name: str = ""
    hints: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()


def _fields(value: Any) -> dict[str, Any]:
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


def task_name(task: int) -> str:
    """Return a task's name: its number; A to E for the stretch tasks, which are numbered from 6 on."""
    return str(task) if task < 6 else "ABCDE"[task - 6] if task < 11 else str(task)


def names() -> list[str]:
    """Return the names of the exercises that come along."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml") if path.stem != "common")


@cache
def exercise(name_or_path: str) -> Exercise:
    """Read one of `names()`, or a TOML file. A scene or checkpoint that it only names is one of `common.toml`.

    Raises
    ------
    ScenarioError
        With the file, the key and what is allowed there.
    """
    path = Path(name_or_path) if name_or_path.endswith(".toml") else _FOLDER / f"{name_or_path}.toml"
    if path.parent == _FOLDER and path.stem not in names():
        raise ScenarioError(f"unknown exercise {name_or_path}: want one of {', '.join(names())}, or a .toml file")
    table, where = _table(path), f"{path.name}: "
    unknown = [key for key in table if key not in ("title", "scenes", "scene", "checkpoints", "solution")]
    if unknown or not {"title", "scenes", "checkpoints"} <= table.keys():
        raise ScenarioError(
            f"{where}{unknown[0] if unknown else 'title, scenes or checkpoints'}: "
            + (
                "unknown key; a file has title, scenes, [scene.NAME], [checkpoints] and solution"
                if unknown
                else "missing"
            )
        )
    common = _table(_FOLDER / "common.toml")
    own = common["scene"] | table.get("scene", {})
    for name in table["scenes"]:
        if name not in own:
            raise ScenarioError(
                f"{where}scenes: unknown scene {name!r}, want one of {', '.join(own)}, or [scene.{name}]"
            )
    scenes = tuple(build(_SceneTable, own[name], f"{where}scene.{name}.").scene(name) for name in table["scenes"])
    points = tuple(
        _checkpoint(name, given, common["checkpoints"].get(name, {}), table["scenes"], where)
        for name, given in table["checkpoints"].items()
    )
    return Exercise(path.stem, str(table["title"]), scenes, points, str(table.get("solution", "")))


def _checkpoint(name: str, given: Any, common: Mapping[str, Any], scenes: list[str], where: str) -> Checkpoint:
    where = f"{where}checkpoints.{name}"
    given = dict(common) | (given if isinstance(given, dict) else {"points": given})
    check = given.get("check", name)
    if check not in CHECKS:
        raise ScenarioError(f"{where}: unknown check {check!r}, want one of {', '.join(CHECKS)}")
    own = {key: value for key, value in given.items() if key in _CheckpointTable.__dataclass_fields__}
    bounds = {key: value for key, value in given.items() if key not in own}
    table = build(_CheckpointTable, own, f"{where}.")
    bound_names = list(inspect.signature(CHECKS[check]).parameters)[1:]
    for key in bounds:
        if key not in bound_names:
            raise ScenarioError(
                f"{where}.{key}: unknown key; bounds of {check!r} are: {', '.join(bound_names) or 'none'}"
            )
    for scene in table.scenes:
        if scene not in scenes:
            raise ScenarioError(f"{where}.scenes: {scene!r} is none of the exercise's scenes: {', '.join(scenes)}")
    judge = partial(CHECKS[check], **bounds)
    return Checkpoint(check, table.task, table.name or name, table.points, judge, table.hints, table.scenes)


def _table(path: Path) -> dict[str, Any]:
    try:
        return dict(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(f"{path}: cannot be read as TOML: {getattr(error, 'strerror', None) or error}") from error


def scene_named(name: str) -> Scene:
    """Return a scene by `NAME` of tasks 1 to 4, or by `EXERCISE/NAME`.

    Raises
    ------
    ScenarioError
        If there is no such scene.
    """
    of, _, scene = name.rpartition("/")
    there = {one.name: one for one in exercise(of or "follower").scenes}
    if scene not in there:
        raise ScenarioError(f"unknown scene {name!r}, want one of {', '.join(there)}, or EXERCISE/NAME")
    return there[scene]
