"""Runs of nodes against small arenas."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import pytest
from tests.sim.ros.scripts import HEAD, NOBODY, Run, run_script

from limo_sim.ros.stage import Ended
from limo_sim.world.scenario import Scenario


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run a script's text against the arena; returns how it ended."""

    def run_text(text: str, scenario: Scenario = NOBODY, seconds: float = 2.0, **options: Any) -> Ended:
        script = tmp_path / "node.py"
        script.write_text(HEAD + textwrap.dedent(text), encoding="utf-8")
        return run_script(script, scenario, seconds, **options)

    return run_text
