"""A short form of the random calls, of which `.ci/hardening` makes more."""

import subprocess
import sys


def test_some_thousand_random_calls_are_answered_or_end_in_a_named_error() -> None:
    command = [sys.executable, "-m", "tests.hardening.api", "--calls", "6000", "--first", "20000000"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("6000 calls") and "0 findings" in done.stdout
