"""Short forms of the long programs in this folder, which `.ci/hardening` runs."""

from __future__ import annotations

import subprocess
import sys


def program(*arguments: str, timeout: float = 240) -> str:
    """Run a program of this folder; return its output, which must hold no finding."""
    done = subprocess.run(
        [sys.executable, "-m", *arguments], capture_output=True, text=True, timeout=timeout, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_some_thousand_random_calls_are_answered_or_end_in_a_named_error() -> None:
    said = program("tests.hardening.api", "--calls", "6000", "--first", "20000000")
    assert said.startswith("6000 calls") and "0 findings" in said
