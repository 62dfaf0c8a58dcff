"""Scenarios by name: those that come with limo-sim, files, and scenarios drawn from a seed."""

from __future__ import annotations

from pathlib import Path

from limo_sim.world.scenario import Scenario
from limo_sim.world.schema import ScenarioError
from limo_sim.world.variants import made_up, varied

#: What the name of a scenario that is drawn from a seed alone begins with.
RANDOM = "random"


def load(name: str | Path) -> Scenario:
    """Return a scenario.

    Parameters
    ----------
    name
        One of `Scenario.names()`; the path of a TOML file; "NAME:SEED", a scenario that comes with limo-sim with other
        clothes, light and sensor faults; or "random:SEED", one in which everything is drawn from the seed.

    Raises
    ------
    ScenarioError
        With the name, or the file, the key and what is allowed there.
    """
    base, _, seed = str(name).rpartition(":")
    if seed.isdecimal() and base == RANDOM:
        return made_up(int(seed))
    if seed.isdecimal() and base in Scenario.names():
        return varied(Scenario.load(base), int(seed))
    if Path(name).suffix != ".toml" and str(name) not in Scenario.names():
        known = ", ".join(Scenario.names())
        raise ScenarioError(f"unknown scenario {name}: want one of {known}, NAME:SEED, {RANDOM}:SEED, or a .toml file")
    return Scenario.load(name)
