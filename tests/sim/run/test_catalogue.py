"""The catalogue finds scenarios by name, by file and by seed."""

from __future__ import annotations

from pathlib import Path

import pytest

from limo_sim.run.catalogue import load
from limo_sim.world.scenario import Scenario
from limo_sim.world.schema import ScenarioError


@pytest.mark.parametrize("name", Scenario.names())
def test_a_plain_name_is_the_scenario_that_comes_along(name: str) -> None:
    assert load(name) == Scenario.load(name)


def test_a_file_is_read_wherever_it_lies(tmp_path: Path) -> None:
    file = tmp_path / "mine:3.toml"
    file.write_text("[camera]\nrate_hz = 5.0\n", encoding="utf-8")
    assert load(file).camera.rate_hz == 5.0
    assert load(str(file)) == load(file)


def test_a_seed_varies_a_scenario_and_the_same_seed_varies_it_the_same() -> None:
    workshop, one, other = load("workshop"), load("workshop:1"), load("workshop:2")
    assert one == load("workshop:1")
    assert one.name == "workshop:1"
    assert one.people[0].route == workshop.people[0].route
    assert len({workshop.people[0].shirt, one.people[0].shirt, other.people[0].shirt}) == 3
    assert len({workshop.light, one.light, other.light}) == 3


def test_scenarios_drawn_from_seeds_are_valid_and_differ() -> None:
    made = [load(f"random:{seed}") for seed in range(30)]
    for scenario in made:
        scenario.check()
    assert len({scenario.people for scenario in made}) == 30
    assert len({scenario.camera for scenario in made}) == 30
    assert {len(scenario.people) for scenario in made} == {1, 2}
    assert made[7] == load("random:7")


@pytest.mark.parametrize(
    "name", ["wrokshop", "wrokshop:3", "workshop:", "workshop:-1", "workshop:1.5", "random", "", ":"]
)
def test_an_unknown_name_is_refused_with_what_there_is(name: str) -> None:
    with pytest.raises(ScenarioError, match=f"unknown scenario {name}: want one of .*workshop.*random:SEED"):
        load(name)


def test_a_scenario_of_a_seed_is_not_the_business_of_scenario_load() -> None:
    with pytest.raises(ScenarioError, match="unknown scenario workshop:1"):
        Scenario.load("workshop:1")
