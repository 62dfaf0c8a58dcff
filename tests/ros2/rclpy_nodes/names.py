"""Prints rclpy's public names as the record in tests/sim/ros/rclpy_api has them: module, name, parameters.

To record those of an installed rclpy: target/rclpy/bin/python tests/ros2/rclpy_nodes/names.py > RECORD.txt
"""

import importlib
import importlib.metadata
import inspect
import re

MODULES = (
    *("", ".callback_groups", ".client", ".clock", ".clock_type", ".duration", ".exceptions", ".executors", ".logging"),
    *(".node", ".parameter", ".publisher", ".qos", ".service", ".subscription", ".task", ".time", ".timer"),
    *(".utilities", ".wait_for_message"),
)


def parameters(function):
    """Return "(a, b, *, c)", without self."""
    said = []
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return ""
    for one in signature.parameters.values():
        if one.name in ("self", "cls"):
            continue
        if one.kind == one.KEYWORD_ONLY and not any(word.startswith("*") for word in said):
            said.append("*")
        said.append({one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "") + one.name)
    return f"({', '.join(said)})"


def members(kind):
    """Give the public members that a class itself defines."""
    for name, member in vars(kind).items():
        if inspect.isclass(member) and member.__module__ != kind.__module__:
            continue
        function = member.__func__ if isinstance(member, staticmethod | classmethod) else member
        if name == "__init__" or not name.startswith("_"):
            yield name, parameters(function) if inspect.isfunction(function) else ""


lines = []
for module_name in MODULES:
    module = importlib.import_module(f"rclpy{module_name}")
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", "") == module.__name__
        if name.startswith("_") or not own:
            continue
        where = module.__name__
        if inspect.isclass(thing):
            lines += [f"{where} {name}", *(f"{where} {name}.{member}{told}" for member, told in members(thing))]
        elif inspect.isfunction(thing):
            lines.append(f"{where} {name}{parameters(thing)}")
        elif type(thing).__name__ != "TypeVar":
            lines.append(f"{where} {name}")
distributions = (one.metadata["Name"] or "" for one in importlib.metadata.distributions())
version = importlib.metadata.version(next(name for name in distributions if re.fullmatch(r"ros-\w+-rclpy", name)))
print(f"# Public names and parameters of rclpy {version}, as it is installed: module, name, parameters.")
print("\n".join(lines))
