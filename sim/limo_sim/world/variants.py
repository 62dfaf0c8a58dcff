"""The people of a run, drawn from its seed as the scenario's `[vary]` asks for, and the numbers of random streams."""

from __future__ import annotations

import dataclasses

import numpy as np

from limo_sim.world.scenario import Person, Scenario, Vary
from limo_sim.world.schema import ScenarioError, misfit

# The random streams of a run: what draws from one is `default_rng([seed, number, …])`, so that none changes another.
# Every published figure rests on these numbers: a new stream takes the next one, and none is changed.
CAMERA_STREAM, LIDAR_STREAM, IMU_STREAM, DROP_STREAM, SLIP_STREAM, PATTERN_STREAM = range(6)  # of `run.arena`
MISS_STREAM, FALSE_STREAM = 6, 7  # of the detector's faults, `run.detector_faults`
PEOPLE_STREAM = 8  # of the people's clothes, statures, speeds and starts, below
CROWD_STREAM = 9  # of the people who give way, each with its own number behind
# Two that were given the crowd's number, and keep it for the figures: the robot's way in `run.export`, and the errors
# of the sightings in `env`. The first person who gives way draws the same numbers there.
WANDERING_STREAM = SIGHTING_STREAM = CROWD_STREAM

_SKIN = ((236, 196, 168), (198, 154, 124), (150, 104, 76), (96, 66, 50))
_HAIR = ((28, 24, 24), (56, 38, 28), (120, 92, 58), (150, 148, 144))
_TRIES = 200  # chosen


def of_run(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario with the people of the run with `seed`, as its `vary` asks for; itself where that is off.

    In what is returned `vary` is off: the people are drawn. Raises `ScenarioError` where no people that fit into the
    room were found.
    """
    if scenario.vary == Vary():
        return scenario
    random = np.random.default_rng([seed, PEOPLE_STREAM])
    for _ in range(_TRIES):
        people = tuple(_another(person, scenario.vary, random) for person in scenario.people)
        drawn = dataclasses.replace(scenario, people=people, vary=Vary())
        try:
            drawn.check()
        except ScenarioError:
            continue
        return drawn
    found = f"no people that fit found in {_TRIES} tries"
    raise misfit(f"{scenario.name}: vary", found, "a smaller place or height")


def _another(person: Person, vary: Vary, random: np.random.Generator) -> Person:
    taller, faster = random.uniform(-1.0, 1.0, size=2).tolist()
    moved = random.uniform(-vary.place, vary.place, size=(len(person.route), 2)).tolist()
    other = _dressed(person, random) if vary.clothes else person
    return dataclasses.replace(
        other,
        height=person.height * (1.0 + vary.height * taller),
        speed=person.speed * (1.0 + vary.speed * faster),
        route=tuple((x + dx, y + dy, pause) for (x, y, pause), (dx, dy) in zip(person.route, moved, strict=True)),
    )


def _dressed(person: Person, random: np.random.Generator) -> Person:
    random.random()  # drew the stature once: what is drawn below, and the figures, rest on it
    return dataclasses.replace(
        person,
        girth=float(random.uniform(0.85, 1.2)),
        shirt=_cloth(random, 190),
        trousers=_cloth(random, 110),
        skin=_SKIN[random.integers(len(_SKIN))],
        hair=_HAIR[random.integers(len(_HAIR))],
    )


def _cloth(random: np.random.Generator, brightest: int) -> tuple[float, float, float]:
    red, green, blue = random.integers(24, brightest, size=3).tolist()
    return float(red), float(green), float(blue)
