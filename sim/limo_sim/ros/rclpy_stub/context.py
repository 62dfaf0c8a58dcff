"""The run a script belongs to, and the ROS arguments of its command line."""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from limo_sim.ros.lockstep.records import StubError
from limo_sim.ros.lockstep.world import World


@dataclass
class RosArguments:
    """What stands after --ros-args.

    Attributes
    ----------
    parameters
        Values by node name ("/**" for every node) and parameter name.
    remaps
        New names by old ones; "__node" and "__ns" rename the node.
    """

    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    remaps: dict[str, str] = field(default_factory=dict)

    def parameters_of(self, node: str, namespace: str) -> dict[str, Any]:
        """Return the values meant for a node."""
        full = f"{namespace.rstrip('/')}/{node}"
        values: dict[str, Any] = {}
        for key in ("/**", node, full):
            values |= self.parameters.get(key, {})
        return values


def parse_ros_arguments(arguments: list[str]) -> RosArguments:
    """Read `-p name:=value`, `-r from:=to` and `--params-file FILE` after each --ros-args; values are YAML, as in ROS.

    Raises
    ------
    StubError
        If one of them is malformed.
    """
    parsed = RosArguments()
    words = iter(arguments)
    ours = False
    for word in words:
        if word in ("--ros-args", "--"):
            ours = word == "--ros-args"
        elif not ours:
            continue
        elif word in ("-p", "--param", "-r", "--remap"):
            rule = next(words, "")
            name, found, value = rule.partition(":=")
            if not found or not name:
                raise StubError(f"{word} {rule}: want {word} name:=value")
            node, _, name = name.rpartition(":")
            if word in ("-r", "--remap"):
                parsed.remaps[name] = value
            else:
                parsed.parameters.setdefault(node or "/**", {})[name] = yaml_value(value, f"{word} {rule}")
        elif word == "--params-file":
            read_parameters(Path(next(words, "")), parsed)
        elif word in ("--log-level", "--log-config-file"):
            next(words, "")
        elif word not in ("--enable-rosout-logs", "--disable-rosout-logs", "--disable-stdout-logs"):
            raise StubError(f"--ros-args {word}: want -p name:=value, -r from:=to or --params-file FILE")
    return parsed


def read_parameters(path: Path, into: RosArguments) -> None:
    """Add the content of a parameter file."""
    if not path.is_file():
        raise StubError(f"--params-file {path}: no such file")
    content = yaml_value(path.read_text(encoding="utf-8"), f"--params-file {path}")
    if not isinstance(content, dict):
        raise StubError(f"--params-file {path}: want NODE: ros__parameters: name: value")
    for node, section in content.items():
        values = section.get("ros__parameters") if isinstance(section, dict) else None
        if not isinstance(values, dict):
            raise StubError(f"--params-file {path}: {node} has no ros__parameters")
        into.parameters.setdefault(str(node), {}).update(_flat(values))


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def yaml_value(text: str, where: str) -> Any:
    """Return what a text in YAML says; `where` names it in the error."""
    # rosbags brings ruamel.yaml along
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe").load(io.StringIO(text))
    except YAMLError as error:
        raise StubError(f"{where}: not YAML: {str(error).splitlines()[0]}") from error


class Context:
    """The state that `rclpy.init` makes and `rclpy.shutdown` ends."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.is_initialized = False
        self.arguments = RosArguments()
        #: The executor of `rclpy.spin` without one.
        self.executor: Any = None

    def init(self, args: list[str] | None) -> None:
        """Begin, with the command line's arguments unless others are given."""
        if self.is_initialized:
            raise RuntimeError("rclpy.init() has been called before, without rclpy.shutdown()")
        self.arguments = parse_ros_arguments(sys.argv if args is None else list(args))
        self.is_initialized = True

    def shutdown(self) -> None:
        """End."""
        self.is_initialized = False
        self.executor = None

    def ok(self) -> bool:
        """Whether nodes may go on."""
        return self.is_initialized and not self.world.over


_world: World | None = None


def enter(world: World | None) -> None:
    """Set the run that scripts belong to; None when it is over."""
    global _world
    _world = world


def current() -> Context:
    """Return the context of the program that calls.

    Raises
    ------
    StubError
        Outside a run, or in a thread that the script did not start with `threading.Thread`.
    """
    if _world is None:
        raise StubError("this rclpy works inside `limo-hog run` alone")
    seat = _world.turns.seat()
    if seat is None:
        raise StubError(
            "limo-hog run offers rclpy in the main thread and in those of threading.Thread, not in a pool's"
        )
    context: Context = seat.owner
    return context
