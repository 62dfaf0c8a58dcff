"""ROS 2's own rclpy, in an environment of its own: a peer that is not ours."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

PYTHON = Path(os.environ.get("LIMO_HOG_RCLPY", Path(__file__).parents[2] / "target/rclpy/bin/python"))
needs_rclpy = pytest.mark.skipif(not PYTHON.exists(), reason="needs ROS 2's own rclpy: run .ci/rclpy")


def start(program: Path, *words: str, stderr: Any = None, **environment: str) -> subprocess.Popen[str]:
    """Start a program under rclpy, its input and output piped; its errors are shown with the test's: they say why."""
    command, env = [str(PYTHON), str(program), *words], os.environ | {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=stderr, text=True, env=env | environment)
