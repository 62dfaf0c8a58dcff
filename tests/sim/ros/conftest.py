"""Runs of nodes against small arenas."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.sim.ros.scripts import HEAD, NOBODY, Run, run_script

from limo_sim.ros.stage import Ended
from limo_sim.world.scenario import Scenario


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], Path]:
    """Write a script's text into a file."""

    def write(text: str) -> Path:
        path = tmp_path / "node.py"
        path.write_text(HEAD + textwrap.dedent(text), encoding="utf-8")
        return path

    return write


@pytest.fixture
def run(script: Callable[[str], Path]) -> Run:
    """Run a script's text against the arena; returns how it ended."""

    def run_text(text: str, scenario: Scenario = NOBODY, seconds: float = 2.0, **options: Any) -> Ended:
        return run_script(script(text), scenario, seconds, **options)

    return run_text
