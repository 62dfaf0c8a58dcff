"""Where a package's node is, without ROS: beside the launch file, in its package, or in a package beside that."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

from limo_sim.ros.lockstep.records import StubError

_folder = Path()


@dataclass(frozen=True, slots=True)
class Executable:
    """A node's file; with `function`, that is called after the file is read, as an entry point is.

    Attributes
    ----------
    file
        The script.
    package
        Its Python package, "" of a script outside one.
    function
        Name of the entry point; "" where the script is run as it is.
    """

    file: Path
    package: str = ""
    function: str = ""


def look_around(launch_file: Path) -> None:
    """Set the launch file from which packages are looked for."""
    global _folder
    _folder = launch_file.resolve().parent


def share_directory(package_name: str) -> str:
    """Return a package's folder: the launch file's own where it has that name, or one beside it."""
    for folder in (_folder, *_folder.parents[:3]):
        for candidate in (folder, folder / package_name, folder / "src" / package_name):
            if candidate.name == package_name and candidate.is_dir() and (candidate / "__init__.py").exists() is False:
                return str(candidate)
    return str(_folder.parent if _folder.name == "launch" else _folder)


def executable(package: str, name: str) -> Executable:
    """Return a package's node: by its setup.py's `console_scripts`, or a file of its name.

    Raises
    ------
    StubError
        If there is none; the error says where it was looked for.
    """
    root = Path(share_directory(package)) if package else _folder
    declared = _entry_points(root / "setup.py").get(name)
    if declared is not None:
        module, _, function = declared.partition(":")
        file = root / (module.replace(".", "/") + ".py")
        if file.is_file():
            return Executable(file, module.rpartition(".")[0], function or "main")
    stem = name.removesuffix(".py")
    places = [folder / f"{stem}.py" for folder in (_folder, root, root / package, root / "scripts", root / "nodes")]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        looked = ", ".join(dict.fromkeys(str(place.parent) for place in places))
        raise StubError(f"the launch file starts {package}/{name}, but {stem}.py is in none of: {looked}")
    return Executable(found)


def _entry_points(setup: Path) -> dict[str, str]:
    """Return the `console_scripts` of a setup.py, which is read and not run."""
    if not setup.is_file():
        return {}
    lines = [
        text.value
        for node in ast.walk(ast.parse(setup.read_bytes()))
        if isinstance(node, ast.Dict)
        for key, value in zip(node.keys, node.values, strict=True)
        if isinstance(key, ast.Constant) and key.value == "console_scripts" and isinstance(value, ast.List)
        for text in value.elts
        if isinstance(text, ast.Constant) and isinstance(text.value, str)
    ]
    return {name.strip(): target.strip() for name, _, target in (line.partition("=") for line in lines)}
