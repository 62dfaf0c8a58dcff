"""What a figure came from: short hashes of the scenario and of the code, so that a table can be checked."""

from __future__ import annotations

import dataclasses
import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import limo_hog
from limo_hog.atomic import json_text
from limo_sim.world.scenario import Scenario

# Of hexadecimal digits: by chance two of a thousand scenarios share a hash in one of 10¹³ tables.
_DIGITS = 16
# Code that changes no figure: the page, the films and the recordings of a run.
_LOOKS_ON = "view"


def fingerprint(data: bytes) -> str:
    """Return the SHA-256 of a text, the same whatever its line ends are: 64 hexadecimal digits."""
    return hashlib.sha256(data.replace(b"\r\n", b"\n")).hexdigest()


def scenario_hash(scenario: Scenario) -> str:
    """Return 16 digits of the fingerprint of what a scenario says, its name and summary left out.

    Values that are the defaults are left out as well, so that a new option leaves the hashes of old scenarios alone.
    """
    table = _told(dataclasses.replace(scenario, name="", summary=""))
    return fingerprint(json_text(table, sort_keys=True).encode())[:_DIGITS]


def _told(value: Any) -> Any:
    """Return a dataclass as nested lists and tables, without the fields that hold their default."""
    if isinstance(value, tuple):
        return [_told(item) for item in value]
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    told = {}
    for field in dataclasses.fields(value):
        item = getattr(value, field.name)
        if item != (field.default if field.default_factory is dataclasses.MISSING else field.default_factory()):
            told[field.name] = _told(item)
    return told


@cache
def code_version() -> str:
    """Return the versions of limo-hog and limo-sim, and 16 digits of the fingerprint of their Python sources.

    The compiled part differs from one platform to the next; its version stands for it.
    """
    sources = []
    for package in (Path(limo_hog.__file__).parent, Path(__file__).parents[1]):
        for path in sorted(package.rglob("*.py"), key=lambda path: path.relative_to(package).as_posix()):
            name = path.relative_to(package)
            if name.parts[0] != _LOOKS_ON:
                sources += [f"{package.name}/{name.as_posix()}\n".encode(), path.read_bytes()]
    digest = fingerprint(b"".join(sources))[:_DIGITS]
    return f"limo-hog {version('limo-hog')}, limo-sim {version('limo-sim')}, {digest}"
