"""ROS 2's own rclpy, in an environment of its own: a peer that is not ours."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

PYTHON = Path(os.environ.get("LIMO_HOG_RCLPY", Path(__file__).parents[2] / "target/rclpy/bin/python"))
needs_rclpy = pytest.mark.skipif(not PYTHON.exists(), reason="needs ROS 2's own rclpy: run .ci/rclpy")


def start(program: Path, *words: str, stderr: Any = None, **environment: str) -> subprocess.Popen[str]:
    """Start a program under rclpy; what it prints is to be read, and what it is told comes by standard input.

    Its errors go where the test's go, unless to `stderr`: a program that fails must show why.
    """
    return subprocess.Popen(
        [str(PYTHON), str(program), *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        env={**os.environ, "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp", **environment},
    )
