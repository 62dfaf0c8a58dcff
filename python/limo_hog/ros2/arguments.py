"""What stands after `--ros-args`, as ROS 2 reads it: names, namespace and parameters of a node."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from limo_hog.exceptions import LimoHogError

#: A flag of ROS 2 that changes nothing here.
_FLAG = re.compile(r"--(en|dis)able-(rosout|stdout|external-lib)-logs")
#: Options of ROS 2 with a value that change nothing here.
_WITHOUT_EFFECT = ("--log-level", "--log-config-file", "--log-file-name", "-e", "--enclave")
#: Parameters are nested no deeper: namespaces, node and the dots of a name.
_DEEPEST = 50
_NAME = r"(?:~/|/)?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*"
#: A remap rule: "node:from:=to", the node left out for every node; a namespace is absolute.
_RULE = re.compile(
    rf"(?:(?P<node>[A-Za-z_]\w*):)?(?:(?P<ns>__ns):=(?P<space>/|(?=/){_NAME})"
    rf"|(?:rostopic://)?(?P<old>(?!__ns:){_NAME}):=(?P<new>{_NAME}))"
)


class RosArgumentError(LimoHogError):
    """What stands after --ros-args is malformed, or its file is missing."""


@dataclass
class RosArguments:
    """What stands after --ros-args."""

    #: Values by node ("/**" for every node, "/ns/node" for one) and parameter name.
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    #: Rules (node, old name, new name), the first that fits counts; node "" is every node. The old names "__node" and
    #: "__ns" rename the node and its namespace.
    remaps: list[tuple[str, str, str]] = field(default_factory=list)

    def named(self, name: str, namespace: str = "") -> NodeNames:
        """Return the names of the node that calls itself `name` in `namespace`."""
        own = {old: new for node, old, new in reversed(self.remaps) if node in ("", name)}
        new_name = own.get("__node", own.get("__name", name))
        return NodeNames(new_name, "/" + own.get("__ns", namespace).strip("/"), self)


@dataclass(frozen=True)
class NodeNames:
    """A node's name and namespace, as "/" or "/robot1", and the arguments that rename what it uses."""

    name: str
    namespace: str = "/"
    arguments: RosArguments = field(default_factory=RosArguments)

    @property
    def full(self) -> str:
        """Namespace and name, as "/robot1/follower"."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def expand(self, topic: str) -> str:
        """Return a topic's absolute name, without remaps: "scan" is in the namespace, "~/x" below the node."""
        if topic.startswith("~"):
            return f"{self.full}/{topic[1:].lstrip('/')}"
        return topic if topic.startswith("/") else f"{self.namespace.rstrip('/')}/{topic}"

    def remap(self, topic: str) -> str | None:
        """Return a topic's new name, absolute; None where no rule speaks of it."""
        full = self.expand(topic)
        for node, old, new in self.arguments.remaps:
            if node in ("", self.name) and not old.startswith("__") and self.expand(old) == full:
                return self.expand(new)
        return None

    def resolve(self, topic: str) -> str:
        """Return a topic's absolute name, after the remaps."""
        return self.remap(topic) or self.expand(topic)

    @property
    def parameters(self) -> dict[str, Any]:
        """The values meant for this node; what is said later counts."""
        values: dict[str, Any] = {}
        for pattern, meant in self.arguments.parameters.items():
            # "/**" stands for any number of names, "/*" for one.
            parts = re.split(r"(/\*\*|/\*)", pattern if pattern.startswith("/") else f"/{pattern}")
            like = "".join({"/**": r"(/\w+)*", "/*": r"/\w+"}.get(part, re.escape(part)) for part in parts)
            if re.fullmatch(like, self.full):
                values |= meant
        return values


def parse_ros_arguments(arguments: Sequence[str]) -> RosArguments:
    """Read `-p name:=value`, `-r from:=to` and `--params-file FILE` after each --ros-args; values are YAML, as in ROS.

    Raises `RosArgumentError` if one of them is malformed, or a file is missing.
    """
    parsed = RosArguments()
    words = iter(arguments)
    ours = False
    for word in words:
        if word in ("--ros-args", "--"):
            ours = word == "--ros-args"
        elif not ours:
            continue
        elif word in ("-r", "--remap"):
            rule = next(words, "")
            read = _RULE.fullmatch(rule)
            if read is None:
                raise RosArgumentError(f"{word} {rule}: want {word} from:=to, names such as scan or /robot1/scan")
            parsed.remaps.append((read["node"] or "", read["ns"] or read["old"], read["space"] or read["new"]))
        elif word in ("-p", "--param"):
            rule = next(words, "")
            name, _, value = rule.partition(":=")
            node, _, name = name.rpartition(":")
            if not name or ":=" not in rule:
                raise RosArgumentError(f"{word} {rule}: want {word} name:=value")
            parsed.parameters.setdefault(node or "/**", {})[name] = _yaml(value, f"{word} {rule}")
        elif word == "--params-file":
            _read_parameters(Path(next(words, "")), parsed)
        elif word in _WITHOUT_EFFECT:
            next(words, "")
        elif not _FLAG.fullmatch(word):
            raise RosArgumentError(f"--ros-args {word}: want -p name:=value, -r from:=to or --params-file FILE")
    return parsed


def _read_parameters(path: Path, into: RosArguments) -> None:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise RosArgumentError(f"--params-file {path}: cannot be read: {why.lower()}") from error
    _add(_yaml(text, f"--params-file {path}"), "", path, into)


def _add(section: Any, node: str, path: Path, into: RosArguments) -> None:
    """Add a section: namespaces hold nodes, and these `ros__parameters`."""
    if not isinstance(section, dict) or not section:
        problem = f"{node} has no ros__parameters" if node else "want NODE: ros__parameters: name: value"
        raise RosArgumentError(f"--params-file {path}: {problem}")
    for key, inner in section.items():
        if key != "ros__parameters":
            _add(inner, f"{node.rstrip('/')}/{str(key).lstrip('/')}" if node else str(key), path, into)
        elif isinstance(inner, dict) and node:
            into.parameters.setdefault(node, {}).update(_flat(inner))
        else:
            raise RosArgumentError(f"--params-file {path}: {node or 'it'} has no ros__parameters")


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def _yaml(text: str, where: str) -> Any:
    """Return what a text in YAML says; `where` names it in the error. As in ROS 2, there are no aliases."""
    # rosbags brings ruamel.yaml along
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MantissaNoDotYAML1_1Warning, YAMLError

    yaml = YAML(typ="safe", pure=True)
    yaml.version = (1, 1)
    try:
        with warnings.catch_warnings():
            # ROS 2 reads 1e3 as a number, though YAML 1.1 wants 1.0e3.
            warnings.simplefilter("ignore", MantissaNoDotYAML1_1Warning)
            depth = 0
            for token in yaml.scan(io.StringIO(text)):
                kind = type(token).__name__
                depth += ("Start" in kind) - ("End" in kind)
                if kind == "AliasToken" or depth > _DEEPEST:
                    why = "an alias (*name)" if kind == "AliasToken" else f"nested more than {_DEEPEST} deep"
                    raise RosArgumentError(f"{where}: {why}, which is not read")
            return yaml.load(io.StringIO(text))
    except YAMLError as error:
        raise RosArgumentError(f"{where}: not YAML: {str(error).splitlines()[0]}") from error
