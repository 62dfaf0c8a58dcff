"""Follow-Bench's files become our scenes at half their size, and its oracles follow the first person."""

from dataclasses import replace
from pathlib import Path

import pytest
from benches.follow_bench import BEHIND, FollowBenchError, number_of, read
from benches.oracle import ORACLES, STRANGER, oracle

from limo_sim.run.arena import Arena
from limo_sim.run.episode import play
from limo_sim.run.log import Step
from limo_sim.world.people import Person
from limo_sim.world.scenario import Scenario

FILE = """
world: {height: 20, width: 40}
target:
  - {state: [10.0, 10.0, 0.0], goal: [30.0, 10.0, 0.0], vel_max: [1.5, 1.5]}
obstacle:
  - {shape: {name: rectangle, length: 40.0, width: 0.0001}, state: [20.0, 0.0, 0]}
  - {shape: {name: rectangle, length: 1.0, width: 2.0}, state: [20.0, 15.0, 0]}
  - {shape: {name: rectangle, length: 6.0, width: 4.0}, state: [30.0, 16.0, 0]}
human:
  - {state: [20.0, 8.0, 0], goal: [[[20.0, 8.0, 0], [24.0, 8.0, 0], [24.0, 4.0, 0]]], vel_max: [1.0, 1.0]}
  - {state: [10.0, 5.0, 0], goal: [12.0, 5.0, 0], vel_max: [1.5, 1.5]}
  - {state: [10.0, 6.0, 0], goal: [[[10.0, 6.0, 0], [20.0, 15.0, 0]]], vel_max: [1.5, 1.5]}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Scenario:
    path = tmp_path / "MadeUpOrcaH3_back_7.yaml"
    path.write_text(FILE)
    return read(path)


def test_lengths_and_speeds_are_halved_about_the_middle(scene: Scenario) -> None:
    target, *others = scene.people
    assert scene.room.half == 10.0 and target.route == ((-5.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    assert [person.speed for person in scene.people] == [0.75, 0.5, 0.75, 0.75]
    assert (scene.robot.x, scene.robot.y, scene.robot.yaw) == (-5.0 - BEHIND, 0.0, 0.0)
    assert all(person.yields for person in others)
    # People walk to and fro, and a corner within a block is left out.
    three, single, blocked = others
    assert [corner[:2] for corner in three.route] == [(0.0, -1.0), (2.0, -1.0), (2.0, -3.0), (2.0, -1.0)]
    assert (len(single.route), len(blocked.route)) == (2, 1) and "1 corners left out" in scene.summary


def test_a_thin_block_is_a_wall_and_a_thick_one_is_hollow(scene: Scenario) -> None:
    solid, *shell = scene.walls
    assert (solid.length, solid.thickness) == (1.0, 0.5)
    assert sorted(wall.length for wall in shell) == pytest.approx([1.9, 1.9, 2.9, 2.9])


@pytest.mark.parametrize("name", ["DoorwayOrcaH2W2.8_back_41", "DoorwayOrcaH2W2.8_left_side_3", "notes"])
def test_files_kept_back_are_refused(name: str) -> None:
    with pytest.raises(FollowBenchError, match="from 1 to 40"):
        number_of(Path(f"{name}.yaml"))


@pytest.mark.parametrize("name", ORACLES)
def test_an_oracle_follows_the_first_person_and_comes_nearer(name: str, scene: Scenario) -> None:
    arena, steps = Arena(scene, 7), list[Step]()
    play(arena, oracle(name, arena), 5.0, names=(name, "truth"), watch=steps.append)
    for step in (one for one in steps if one.seen is not None):
        target, first = step.log.decision.target, step.seen.people[0] if step.seen else None
        assert target is not None and first is not None
        assert tuple(step.log.detections.windows[target]) == first.box
    assert steps[-1].truth.robot[0] > scene.robot.x + 0.5


def test_the_sighted_oracle_knows_of_nobody_behind_it_and_not_who_comes_from_there() -> None:
    robot = Scenario.load("standing").robot
    first = Person(route=((robot.x + 1.6, robot.y, 3600.0),))
    # From behind the robot to where the lidar shows them, beside the image.
    comes = Person(route=((robot.x - 2.0, robot.y + 1.5, 2.0), (robot.x + 0.3, robot.y + 1.5, 3600.0)))
    scene = replace(Scenario.load("standing"), people=(first, comes))
    known = {}
    for name in ("oracle", "sighted"):
        arena, steps = Arena(scene, 7), list[Step]()
        play(arena, oracle(name, arena), 6.0, names=(name, "truth"), watch=steps.append)
        known[name] = [{person.number for person in steps[at].log.decision.belief.people} for at in (10, -1)]
    assert known == {"oracle": [{1, 2}, {1, 2}], "sighted": [{1}, {1, 2 + STRANGER}]}
