"""Suites are frozen: their files are those that were hashed, and can be run. A card tells what it came from."""

from __future__ import annotations

import dataclasses
import re
import shutil
from collections import Counter
from pathlib import Path

import pytest

from limo_sim.run import suite as suites
from limo_sim.run.arena import Arena
from limo_sim.run.provenance import code_version, scenario_hash
from limo_sim.run.suite import Suite
from limo_sim.world.scenario import Camera, Scenario
from limo_sim.world.schema import ScenarioError

V1 = Suite.load("v1")


def test_the_first_suite_has_twenty_scenarios_in_four_groups() -> None:
    assert Counter(V1.groups.values()) == {"plain": 5, "senses": 5, "people": 5, "places": 5}
    assert len({entry.sha256 for entry in V1.scenarios}) == 20
    assert {path.stem for path in V1.path(V1.scenarios[0]).parent.glob("*.toml")} == set(V1.groups)


@pytest.mark.parametrize("entry", V1.scenarios, ids=lambda entry: entry.name)
def test_every_scenario_can_be_run_with_ten_seeds_and_its_people_differ(entry: suites.Entry) -> None:
    scenario = Scenario.load(V1.path(entry))
    assert scenario.summary
    assert len({Arena(scenario, seed).scenario.people for seed in range(10)}) == 10


def test_a_file_that_was_changed_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(suites._FOLDER, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(suites, "_FOLDER", tmp_path)
    assert Suite.load("v1") == V1
    file = tmp_path / "v1" / "door.toml"
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert Suite.load("v1") == V1
    file.write_text(file.read_text(encoding="utf-8") + "# easier\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="unknown suite v0: want one of v1"):
        Suite.load("v0")
    with pytest.raises(ScenarioError, match=r"suite v1: door.toml has the SHA-256 .*those of another suite"):
        Suite.load("v1")


def test_the_page_of_the_benchmark_is_about_these_files() -> None:
    page = (Path(__file__).parents[3] / "docs" / "benchmark.md").read_text(encoding="utf-8")
    for entry in V1.scenarios:
        assert f"| `{entry.name}` | {Scenario.load(V1.path(entry)).summary} | `{entry.sha256[:16]}` |" in page


def test_scenarios_have_hashes_of_their_own_whatever_they_are_called() -> None:
    names = Scenario.names()
    assert len({scenario_hash(Scenario.load(name)) for name in names}) == len(names)
    workshop = Scenario.load("workshop")
    assert scenario_hash(dataclasses.replace(workshop, name="mine", summary="")) == scenario_hash(workshop)
    assert scenario_hash(dataclasses.replace(workshop, camera=Camera(noise=1.001))) != scenario_hash(workshop)
    # What it would have left out may be said.
    told = dataclasses.replace(workshop, people=(dataclasses.replace(workshop.people[0], speed=0.75),), camera=Camera())
    assert scenario_hash(told) == scenario_hash(workshop)


def test_new_options_leave_the_hashes_of_old_scenarios_alone() -> None:
    assert scenario_hash(Scenario.load("empty")) == "44136fa355b3678a"
    assert scenario_hash(Scenario.load("workshop")) == "f6353cf7e6222da5"


def test_the_code_is_told_by_versions_and_a_hash() -> None:
    assert re.fullmatch(r"limo-hog \d+\.\d+\S*, limo-sim \d+\.\d+\S*, [0-9a-f]{16}", code_version())
