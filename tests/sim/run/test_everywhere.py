"""`[vary]` and `[detector]` count wherever a scenario runs, or are refused by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from limo_hog.follow import ApproachController
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.env import LimoFollowV1
from limo_sim.ros.live import run_live
from limo_sim.ros.runner import run_node
from limo_sim.ros.stage import Stage
from limo_sim.run.arena import Arena
from limo_sim.run.episode import run_episode
from limo_sim.run.sweep import Run, play
from limo_sim.world.scenario import DetectorFaults, Person, Scenario, Vary
from limo_sim.world.schema import ScenarioError
from limo_sim.world.variants import of_run

DRAWN = Scenario(
    name="drawn", people=(Person(route=((2.5, 0.0, 0.0), (3.0, 1.5, 0.0))),), vary=Vary(clothes=True, place=0.4)
)
UNKIND = Scenario(name="unkind", detector=DetectorFaults(recall=0.5))


@pytest.fixture
def node(tmp_path: Path) -> Path:
    (tmp_path / "node.py").write_text("import rclpy\nrclpy.init()\nrclpy.spin(rclpy.create_node('idle'))\n")
    return tmp_path / "node.py"


@pytest.mark.parametrize(
    "start",
    [
        lambda _: Arena(DRAWN, 3),
        lambda _: run_episode(DRAWN, ApproachController(), detector_named("hog"), 0.2, 3),
        lambda node: run_node(Stage(node, DRAWN, 0.5, 3)).episode,
        lambda _: run_live(DRAWN, 3, 0.04, None),
    ],
    ids=["arena", "closed loop", "node", "arena on the network"],
)
def test_whoever_runs_meets_the_people_of_the_seed(start: Callable[[Path], Any], node: Path) -> None:
    assert start(node).scenario == of_run(DRAWN, 3)


def test_a_sweep_runs_with_the_people_of_the_seed(tmp_path: Path) -> None:
    assert Arena(DRAWN).scenario == Arena(DRAWN, 0).scenario != Arena(DRAWN, 3).scenario
    file = tmp_path / "drawn.toml"
    file.write_text("[vary]\nplace = 0.4\n[[people]]\nroute = [[2.5, 0.0, 0.0], [3.0, 1.5, 0.0]]\n", encoding="utf-8")
    cards = [play(Run(str(file), "approach", "hog", seed, 0.2)) for seed in (3, 4, 3)]
    assert cards[0].scenario_hash == cards[2].scenario_hash != cards[1].scenario_hash


def test_every_episode_of_the_environment_draws_people_of_its_own() -> None:
    env = LimoFollowV1(DRAWN)
    places = [env.reset(seed=seed)[0].tolist() for seed in (0, 1, 0)]
    assert places[0] == places[2] != places[1]


@pytest.mark.parametrize(
    "start",
    [
        lambda node: Stage(node, UNKIND, 0.5),
        lambda _: run_live(UNKIND, 0, 0.04, None),
        lambda _: LimoFollowV1(UNKIND, "camera"),
    ],
    ids=["run", "arena", "images of LimoFollow-v1"],
)
def test_faults_are_refused_where_the_detector_is_anothers(start: Callable[[Path], object], node: Path) -> None:
    with pytest.raises(ScenarioError, match=r"scenario 'unkind': detector: .*; leave the table out"):
        start(node)
