"""Nodes in the style of the public tutorials run unmodified, and two runs of a node with threads are the same."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.sim.ros.scripts import NOBODY, STANDING, run_script

from limo_sim.ros.stage import Ended
from limo_sim.world.scenario import Scenario

NODES = Path(__file__).parent / "nodes"


@dataclass
class Ran:
    """A run, and what was logged."""

    outcome: Ended
    said: list[str]

    @property
    def bearing(self) -> float:
        """Where the first person is in the end, seen from the robot [rad]."""
        person = self.outcome.stage.arena.truth().people[0]
        assert person is not None
        return person.bearing

    @property
    def commands(self) -> list[tuple[float, float, float]]:
        return [(round(c.time, 2), c.twist.linear, c.twist.angular) for c in self.outcome.stage.commands]


def ran(name: str, scenario: Scenario = NOBODY, seconds: float = 4.0) -> Ran:
    said: list[str] = []
    outcome = run_script(NODES / f"{name}.py", scenario, seconds, log=lambda _t, _l, _n, text: said.append(text))
    assert outcome.failure == "", outcome.traceback
    return Ran(outcome, said)


def test_a_class_with_timers_drives_by_stamped_commands() -> None:
    run = ran("timers", seconds=2.2)
    assert run.said == [f'Publishing: "Hello World: {number}"' for number in range(4)]
    assert run.outcome.stage.arena.truth().robot[0] == pytest.approx(0.2 * 2.0, abs=0.06)


def test_a_callback_may_wait_for_a_service_in_a_multi_threaded_executor() -> None:
    run = ran("groups", seconds=4.5)
    assert run.said == ["motor on", "motor off", "motor on", "motor off"]
    speeds = {at: linear for at, linear, _ in run.commands}
    assert (speeds[0.9], speeds[1.5], speeds[2.5], speeds[3.5]) == (0.0, 0.3, 0.0, 0.3)


def test_message_filters_and_a_camera_model_find_the_nearest_thing() -> None:
    run = ran("filters", STANDING, 3.0)
    assert run.said[0].startswith("bgr8 nearest 2.")
    assert abs(run.bearing) < 0.05


def test_a_client_of_a_service_gets_its_answer() -> None:
    assert ran("service_client", seconds=1.0).said == [
        "Incoming request\na: 41 b: 1",
        "Result of add_two_ints: for 41 + 1 = 42",
    ]


def test_a_listener_of_frames_drives_to_a_frame() -> None:
    run = ran("tf_listener", seconds=15.0)
    assert run.said[-1].startswith("arrived; 1 m before the lidar is 1.")
    x, y, _ = run.outcome.stage.arena.truth().robot[:3]
    assert (x, y) == pytest.approx((1.0, 0.5), abs=0.12)


def test_a_scan_follower_with_a_thread_that_spins_and_a_rate_turns_to_what_is_near() -> None:
    run = ran("scan_follower", STANDING, 4.0)
    assert [at for at, _, _ in run.commands[1:20]] == pytest.approx([0.1 * k for k in range(1, 20)], abs=0.03)
    assert abs(run.bearing) < 0.2


@pytest.mark.parametrize("name", ["groups", "scan_follower"])
def test_threads_take_turns_so_that_two_runs_are_the_same(name: str) -> None:
    first, second = (ran(name, STANDING, 3.0) for _ in range(2))
    assert first.commands == second.commands
    assert first.said == second.said


def test_a_node_finds_its_packages_files_as_ros2_pkg_create_lays_them_out(tmp_path: Path) -> None:
    node = tmp_path / "src" / "talk" / "talk" / "talker.py"
    node.parent.mkdir(parents=True)
    (node.parent / "__init__.py").touch()
    node.write_text(
        "import rclpy\nfrom ament_index_python.packages import get_package_share_directory as share\n"
        "rclpy.init()\nlogger = rclpy.create_node('talker').get_logger()\n"
        "logger.info(share('talk'))\nlogger.info(share('unknown'))\n"
    )
    said: list[str] = []
    run_script(node, NOBODY, 0.1, log=lambda _t, _l, _n, text: said.append(text))
    assert said[:2] == [str(node.parents[1]), str(node.parent)]
