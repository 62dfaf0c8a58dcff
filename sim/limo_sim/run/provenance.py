"""What a figure came from: short hashes of the scenario and of the code, so that a table can be checked."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path

import limo_hog
from limo_sim.world.scenario import Scenario

# Of hexadecimal digits: by chance two of a thousand scenarios share a hash in one of 10¹³ tables.
_DIGITS = 16
# Code that changes no figure: the page, the films and the recordings of a run.
_LOOKS_ON = "view"


def scenario_hash(scenario: Scenario) -> str:
    """Return 16 hexadecimal digits of the SHA-256 of every value in a scenario, its name and summary left out."""
    table = dataclasses.asdict(scenario)
    del table["name"], table["summary"]
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:_DIGITS]


@cache
def code_version() -> str:
    """Return the versions of limo-hog and limo-sim, and 16 hexadecimal digits of the SHA-256 of their Python sources.

    The compiled part differs from one platform to the next; its version stands for it.
    """
    digest = hashlib.sha256()
    for package in (Path(limo_hog.__file__).parent, Path(__file__).parents[1]):
        for path in sorted(package.rglob("*.py"), key=lambda path: path.relative_to(package).as_posix()):
            name = path.relative_to(package)
            if name.parts[0] != _LOOKS_ON:
                digest.update(f"{package.name}/{name.as_posix()}\n".encode())
                digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return f"limo-hog {version('limo-hog')}, limo-sim {version('limo-sim')}, {digest.hexdigest()[:_DIGITS]}"
