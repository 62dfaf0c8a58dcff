"""Runs of nodes against small arenas."""

import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.sim.ros.scripts import HEAD, Run, run_script


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "node.py"
        path.write_text(HEAD + textwrap.dedent(text), encoding="utf-8")
        return path

    return write


@pytest.fixture
def run(script: Callable[[str], Path]) -> Run:
    return lambda text, *arguments, **options: run_script(script(text), *arguments, **options)
