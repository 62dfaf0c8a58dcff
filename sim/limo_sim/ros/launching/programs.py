"""Programs: each node of a launch file, a single script being one, with its context and its command line."""

from __future__ import annotations

import runpy
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from limo_sim.ros.launching.description import (
    DeclareLaunchArgument,
    GroupAction,
    LaunchDescription,
    LogInfo,
    Node,
    SetEnvironmentVariable,
    Substitution,
    text_of,
)
from limo_sim.ros.launching.packages import Executable, executable, look_around
from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.world import LOGGER, World
from limo_sim.ros.rclpy_stub.context import Context, RosArguments, read_parameters

#: A launch file's name ends so.
SUFFIX = ".launch.py"


@dataclass(frozen=True, slots=True)
class Program:
    """One node of a launch file."""

    executable: Executable
    context: Context
    argv: list[str]

    def run(self) -> None:
        """Run it as `ros2 run` would."""
        found = self.executable
        namespace: dict[str, Any] = {
            "__name__": f"{found.package}.{found.file.stem}" if found.function else "__main__",
            "__package__": found.package or None,
            "__file__": str(found.file),
        }
        root = found.file.parents[found.package.count(".") + 1] if found.package else found.file.parent
        sys.path.insert(0, str(root))
        code = compile(found.file.read_bytes(), str(found.file), "exec")
        exec(code, namespace)  # noqa: S102 — the student's node is run: that is the purpose
        if found.function:
            if found.function not in namespace:
                raise StubError(f"{found.file.name} has no function {found.function}(), which setup.py names")
            namespace[found.function]()


def launch(file: Path, world: World, arguments: Sequence[str]) -> None:
    """Start every node of a launch file, each in a thread of its own.

    Parameters
    ----------
    file
        The launch file.
    world
        The run.
    arguments
        Launch arguments as name:=value, and what follows --ros-args, which every node gets.

    Raises
    ------
    StubError
        If the file has no `generate_launch_description()`, or starts what is not there.
    """
    look_around(file)
    words = list(arguments)
    cut = words.index("--ros-args") if "--ros-args" in words else len(words)
    configurations = dict(_assignment(word) for word in words[:cut])
    make = runpy.run_path(str(file)).get("generate_launch_description")
    made = make() if callable(make) else None
    if not isinstance(made, LaunchDescription):
        raise StubError(f"{file.name} has no generate_launch_description() that returns a LaunchDescription")
    nodes = [action for action in _flat(made.entities, configurations, world) if isinstance(action, Node)]
    if not nodes:
        raise StubError(f"{file.name} starts no node")
    for program in [_program(node, configurations, world, words[cut:]) for node in nodes]:
        world.scripts.add(str(program.executable.file))
        thread = threading.Thread(target=program.run)
        thread.limo_program = (program.context, program.argv)  # type: ignore[attr-defined]
        thread.start()


def _assignment(word: str) -> tuple[str, str]:
    name, found, value = word.partition(":=")
    if not found:
        raise StubError(f"{word!r} is no launch argument: want name:=value")
    return name, value


def _flat(entities: Sequence[Any], configurations: dict[str, str], world: World) -> Iterator[Any]:
    for action in entities:
        condition = getattr(action, "condition", None)
        if condition is not None and not condition.holds(configurations):
            continue
        if isinstance(action, DeclareLaunchArgument):
            if action.default_value is not None:
                configurations.setdefault(action.name, text_of(action.default_value, configurations))
            value = configurations.get(action.name)
            if action.choices and value not in action.choices:
                raise StubError(f"the launch argument {action.name}:={value} is none of {', '.join(action.choices)}")
        elif isinstance(action, LogInfo):
            world.log(world.time, "INFO", LOGGER, text_of(action.msg, configurations))
        elif isinstance(action, GroupAction):
            yield from _flat(action.actions, configurations, world)
        elif isinstance(action, Node):
            yield action
        elif not isinstance(action, SetEnvironmentVariable):
            raise StubError(f"limo-hog run does not offer {type(action).__name__} in a launch file")


def _program(node: Node, configurations: dict[str, str], world: World, rest: list[str]) -> Program:
    def text(value: Any) -> str:
        return text_of(value, configurations)

    preset = RosArguments()
    for given in node.parameters:
        if isinstance(given, dict):
            preset.parameters.setdefault("/**", {}).update(_values(given, configurations))
        else:
            read_parameters(Path(text(given)), preset)
    preset.remaps |= {text(old): text(new) for old, new in node.remappings}
    preset.remaps |= {"__node": text(node.name)} if node.name is not None else {}
    preset.remaps |= {"__ns": text(node.namespace)} if node.namespace is not None else {}
    found = executable(text(node.package or ""), text(node.executable))
    ros = [*(text(word) for word in node.ros_arguments), *rest[1:]]
    argv = [str(found.file), *(text(word) for word in node.arguments), "--ros-args", *ros]
    return Program(found, Context(world, preset), argv)


def _values(given: dict[Any, Any], configurations: dict[str, str], prefix: str = "") -> dict[str, Any]:
    """Return parameters by name; a substitution's text is read as YAML, as in ROS."""
    from limo_sim.ros.rclpy_stub.context import yaml_value

    values: dict[str, Any] = {}
    for name, value in given.items():
        key = prefix + text_of(name, configurations)
        if isinstance(value, dict):
            values |= _values(value, configurations, f"{key}.")
        elif isinstance(value, Substitution):
            values[key] = yaml_value(text_of(value, configurations), f"the parameter {key}")
        else:
            values[key] = value
    return values
