"""`limo-hog run --real`: the computer's own rclpy; where there is none, a stand-in shows what is run."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="needs limo-hog[ros2]")

from limo_hog.cli.main import main


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="ROS 2 is installed")
def test_without_ros_2_it_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "node.py").write_text("import rclpy\n")
    assert main(["run", "--real", str(tmp_path / "node.py")]) == 1
    assert "needs ROS 2's rclpy" in capsys.readouterr().err


def test_the_script_runs_with_what_rclpy_there_is_until_the_arenas_time_is_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rclpy.py").write_text("NAME = 'the real one'\n")
    (tmp_path / "node.py").write_text(
        "import pathlib, sys, time, rclpy\n"
        "try:\n    time.sleep(60)\nexcept KeyboardInterrupt:\n"
        "    pathlib.Path(__file__).with_name('said').write_text(f'{rclpy.NAME} {sys.argv[1:]}')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(130 + worker))
    command = ["run", "--real", str(tmp_path / "node.py"), "--scenario", "empty", "--seconds", "1"]
    assert main([*command, "--ros-args", "-p", "a:=1"]) == 0
    assert (tmp_path / "said").read_text() == "the real one ['--ros-args', '-p', 'a:=1']"
