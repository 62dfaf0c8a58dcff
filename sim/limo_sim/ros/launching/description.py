"""What a launch file imports: `launch`, `launch_ros` and `ament_index_python`, as far as `limo-hog run` reads them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from limo_sim.ros.launching.packages import share_directory
from limo_sim.ros.lockstep.records import StubError

#: Launch arguments by name.
Configurations = dict[str, str]


class Substitution:
    """A text that is known when the launch file runs."""

    def perform(self, configurations: Configurations) -> str:
        """Return the text."""
        raise NotImplementedError


class TextSubstitution(Substitution):
    """A fixed text."""

    def __init__(self, *, text: str) -> None:
        self._text = text

    def perform(self, configurations: Configurations) -> str:  # noqa: ARG002 — the base's
        """Return the text."""
        return self._text


class LaunchConfiguration(Substitution):
    """The value of a launch argument."""

    def __init__(self, variable_name: str, *, default: Any = None) -> None:
        self._name, self._default = variable_name, default

    def perform(self, configurations: Configurations) -> str:
        """Return the value."""
        if self._name in configurations:
            return configurations[self._name]
        if self._default is None:
            raise StubError(f"the launch argument {self._name!r} has no value: give {self._name}:=value")
        return text_of(self._default, configurations)


class EnvironmentVariable(Substitution):
    """The value of an environment variable."""

    def __init__(self, name: str, *, default_value: str | None = None) -> None:
        self._name, self._default = name, default_value

    def perform(self, configurations: Configurations) -> str:  # noqa: ARG002 — the base's
        """Return the value."""
        value = os.environ.get(self._name, self._default)
        if value is None:
            raise StubError(f"the environment variable {self._name!r} is not set")
        return value


class PathJoinSubstitution(Substitution):
    """Parts of a path."""

    def __init__(self, substitutions: Iterable[Any]) -> None:
        self._parts = list(substitutions)

    def perform(self, configurations: Configurations) -> str:
        """Return the path."""
        return str(Path(*(text_of(part, configurations) for part in self._parts)))


class FindPackageShare(Substitution):
    """The folder of a package's files."""

    def __init__(self, package: Any) -> None:
        self._package = package

    def perform(self, configurations: Configurations) -> str:
        """Return the folder."""
        return share_directory(text_of(self._package, configurations))


def text_of(value: Any, configurations: Configurations) -> str:
    """Return the text of a word, a substitution, or a list of them."""
    if isinstance(value, Substitution):
        return value.perform(configurations)
    if isinstance(value, list | tuple):
        return "".join(text_of(part, configurations) for part in value)
    return str(value)


@dataclass
class IfCondition:
    """Holds where its text is true."""

    predicate_expression: Any
    wanted = True

    def holds(self, configurations: Configurations) -> bool:
        """Whether it holds."""
        text = text_of(self.predicate_expression, configurations).strip().lower()
        if text not in ("true", "1", "false", "0"):
            raise StubError(f"a condition is {text!r}: want true or false")
        return (text in ("true", "1")) is self.wanted


class UnlessCondition(IfCondition):
    """Holds where its text is false."""

    wanted = False


@dataclass
class DeclareLaunchArgument:
    """A launch argument and its default."""

    name: str
    default_value: Any = None
    description: str = ""
    choices: list[str] | None = None
    condition: IfCondition | None = None


@dataclass
class LogInfo:
    """A line for the log."""

    msg: Any
    condition: IfCondition | None = None


@dataclass
class SetEnvironmentVariable:
    """An environment variable; it changes nothing here."""

    name: Any
    value: Any
    condition: IfCondition | None = None


@dataclass
class GroupAction:
    """Several actions under one condition."""

    actions: list[Any]
    scoped: bool = True
    condition: IfCondition | None = None


@dataclass
class Node:
    """A node to start; `output`, `emulate_tty`, `respawn` and the like change nothing here."""

    executable: Any
    package: Any = None
    name: Any = None
    namespace: Any = None
    parameters: list[Any] = field(default_factory=list)
    remappings: list[tuple[Any, Any]] = field(default_factory=list)
    arguments: list[Any] = field(default_factory=list)
    ros_arguments: list[Any] = field(default_factory=list)
    condition: IfCondition | None = None
    output: Any = "log"
    emulate_tty: bool = False
    respawn: Any = False
    respawn_delay: float | None = None
    exec_name: Any = None
    prefix: Any = None


class LaunchDescription:
    """The actions of a launch file."""

    def __init__(self, initial_entities: Iterable[Any] = ()) -> None:
        self.entities = list(initial_entities)

    def add_action(self, action: Any) -> None:
        """Add an action."""
        self.entities.append(action)


OFFERED: dict[str, dict[str, Any]] = {
    "launch": {"LaunchDescription": LaunchDescription},
    "launch.actions": {
        "DeclareLaunchArgument": DeclareLaunchArgument,
        "LogInfo": LogInfo,
        "GroupAction": GroupAction,
        "SetEnvironmentVariable": SetEnvironmentVariable,
    },
    "launch.conditions": {"IfCondition": IfCondition, "UnlessCondition": UnlessCondition},
    "launch.substitutions": {
        "LaunchConfiguration": LaunchConfiguration,
        "EnvironmentVariable": EnvironmentVariable,
        "PathJoinSubstitution": PathJoinSubstitution,
        "TextSubstitution": TextSubstitution,
    },
    "launch_ros": {},
    "launch_ros.actions": {"Node": Node},
    "launch_ros.substitutions": {"FindPackageShare": FindPackageShare},
    "ament_index_python": {"get_package_share_directory": share_directory},
    "ament_index_python.packages": {"get_package_share_directory": share_directory},
}
