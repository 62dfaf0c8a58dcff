"""A card tells what it came from."""

from __future__ import annotations

import dataclasses
import re

from limo_sim.run.provenance import code_version, scenario_hash
from limo_sim.world.scenario import Camera, Scenario


def test_scenarios_have_hashes_of_their_own_whatever_they_are_called() -> None:
    names = Scenario.names()
    assert len({scenario_hash(Scenario.load(name)) for name in names}) == len(names)
    workshop = Scenario.load("workshop")
    assert scenario_hash(dataclasses.replace(workshop, name="mine", summary="")) == scenario_hash(workshop)
    assert scenario_hash(dataclasses.replace(workshop, camera=Camera(noise=1.001))) != scenario_hash(workshop)


def test_a_scenario_that_says_what_it_would_have_left_out_has_the_same_hash() -> None:
    workshop = Scenario.load("workshop")
    told = dataclasses.replace(workshop, people=(dataclasses.replace(workshop.people[0], speed=0.75),), camera=Camera())
    assert scenario_hash(told) == scenario_hash(workshop)


def test_new_options_leave_the_hashes_of_old_scenarios_alone() -> None:
    assert scenario_hash(Scenario.load("empty")) == "44136fa355b3678a"
    assert scenario_hash(Scenario.load("workshop")) == "f6353cf7e6222da5"


def test_the_code_is_told_by_versions_and_a_hash() -> None:
    assert re.fullmatch(r"limo-hog \d+\.\d+\S*, limo-sim \d+\.\d+\S*, [0-9a-f]{16}", code_version())
