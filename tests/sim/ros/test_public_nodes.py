"""Nodes in the style of the public tutorials run unmodified, and two runs of a node with threads are the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.sim.ros.scripts import NOBODY, STANDING, Ran, run_script

from limo_sim.world.scenario import Scenario

NODES = Path(__file__).parent / "nodes"


def ran(name: str, scenario: Scenario = NOBODY, seconds: float = 4.0) -> Ran:
    return run_script(NODES / f"{name}.py", scenario, seconds)


def commands(run: Ran) -> list[tuple[float, float, float]]:
    return [(round(c.time, 2), c.twist.linear, c.twist.angular) for c in run.stage.commands]


def bearing(run: Ran) -> float:
    """Where the first person is in the end, seen from the robot [rad]."""
    person = run.stage.arena.truth().people[0]
    assert person is not None
    return person.bearing


def test_a_callback_may_wait_for_a_service_in_a_multi_threaded_executor() -> None:
    run = ran("groups", seconds=4.5)
    assert run.said == ["motor on", "motor off", "motor on", "motor off"]
    speeds = {at: linear for at, linear, _ in commands(run)}
    assert (speeds[0.9], speeds[1.5], speeds[2.5], speeds[3.5]) == (0.0, 0.3, 0.0, 0.3)


def test_message_filters_and_a_camera_model_find_the_nearest_thing() -> None:
    run = ran("filters", STANDING, 3.0)
    assert run.said[0].startswith("bgr8 nearest 2.")
    assert abs(bearing(run)) < 0.05


def test_a_listener_of_frames_drives_to_a_frame() -> None:
    run = ran("tf_listener", seconds=15.0)
    assert run.said[-1].startswith("arrived; 1 m before the lidar is 1.")
    x, y, _ = run.stage.arena.truth().robot[:3]
    assert (x, y) == pytest.approx((1.0, 0.5), abs=0.12)


def test_a_scan_follower_with_a_thread_that_spins_and_a_rate_turns_to_what_is_near() -> None:
    run = ran("scan_follower", STANDING, 4.0)
    assert [at for at, _, _ in commands(run)[1:20]] == pytest.approx([0.1 * k for k in range(1, 20)], abs=0.03)
    assert abs(bearing(run)) < 0.2


@pytest.mark.parametrize("name", ["groups", "scan_follower"])
def test_threads_take_turns_so_that_two_runs_are_the_same(name: str) -> None:
    first, second = (ran(name, STANDING, 3.0) for _ in range(2))
    assert commands(first) == commands(second)
    assert first.said == second.said
