"""A program does the same, line by line, under ROS 2's own rclpy and under ours."""

import json
import os
import re
import signal
import sysconfig
from pathlib import Path

import pytest
from tests.ros2.real import needs_rclpy, start
from tests.sim.ros.scripts import run_script

from limo_sim import workshop
from limo_sim.run.log import Step
from limo_sim.world.scenario import Scenario

pytestmark = needs_rclpy

ROOT = Path(__file__).parents[3]
SMALL = Path(__file__).parent / "same" / "programs.py"
NODES = ROOT / "tests" / "ros2" / "rclpy_nodes"
#: Domains of its own for each worker, so that programs of two tests do not hear each other.
DOMAIN = 140 + int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
ALONE = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def by_program(text: str) -> dict[str, list[str]]:
    parts = re.split(r"^# (\w+)\n", text, flags=re.MULTILINE)[1:]
    return {name: lines.splitlines() for name, lines in zip(parts[::2], parts[1::2], strict=True)}


@pytest.fixture(scope="module")
def theirs() -> dict[str, list[str]]:
    return by_program(start(SMALL, **ALONE).communicate(timeout=100)[0])


@pytest.fixture(scope="module")
def ours() -> dict[str, list[str]]:
    return by_program(run_script(SMALL, seconds=60.0).printed["stdout"])


@pytest.mark.parametrize("name", re.findall(r"^def (\w+)\((?:node|_)\):", SMALL.read_text(), re.MULTILINE))
def test_a_small_program_prints_the_same(name: str, theirs: dict[str, list[str]], ours: dict[str, list[str]]) -> None:
    assert theirs["end"] == ours["end"] == []
    assert ours[name] == theirs[name]


@pytest.mark.parametrize("name", ["follower", "proxemic"])
def test_a_model_node_gives_the_same_commands(name: str, tmp_path: Path) -> None:
    node, commands = tmp_path / f"{name}.py", []
    node.write_text(workshop.solution(name))

    def watch(step: Step) -> None:
        if step.log.frame is not None:
            twist = step.log.decision.twist
            commands.append([round(step.log.time, 2), twist.linear, twist.angular])

    run_script(node, Scenario.load("followable"), 6.0, 3, watch=watch)
    path = os.pathsep.join([str(ROOT), str(ROOT / "python"), str(ROOT / "sim"), sysconfig.get_path("purelib")])
    model = start(NODES / "model.py", str(node), PYTHONPATH=path, **ALONE)
    stage = start(NODES / "stage.py", "followable", "3", "6", PYTHONPATH=path, **ALONE)
    try:
        said = json.loads(stage.communicate(timeout=100)[0].splitlines()[-1])
    finally:
        stage.kill()
        model.send_signal(signal.SIGINT)
        model.communicate(timeout=20)
    assert len(said) > 50
    assert said == commands
