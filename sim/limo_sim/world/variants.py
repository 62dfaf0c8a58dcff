"""Scenarios drawn from a seed: light, clothes and sensor errors alone, or people and furniture as well."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from limo_sim.world.scenario import Camera, Depth, Furniture, Light, Person, Scenario, Vary
from limo_sim.world.schema import ScenarioError

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
# Named, so that a new kind of furniture leaves the scenarios of every seed as they were.
_PIECES = ("bollard", "chair", "coat_rack", "cone", "pillar")
_TRIES = 200  # measured: of the seeds 0 … 299 none needs more than 6


def varied(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario with clothes, statures, light and sensor errors drawn from `seed`.

    Routes, furniture and the robot stay as they are.
    """
    random = np.random.default_rng(seed)
    return _with_faults(
        dataclasses.replace(
            scenario,
            name=f"{scenario.name}:{seed}",
            people=tuple(_dressed(person, random) for person in scenario.people),
            light=_light(random),
        ),
        random,
    )


def of_run(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario with the people of the run with `seed`, as its `vary` asks for; itself where that is off.

    In what is returned `vary` is off: the people are drawn.

    Raises
    ------
    ScenarioError
        No people that fit into the room were found.
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
    raise ScenarioError(
        f"{scenario.name}: vary: no people that fit found in {_TRIES} tries, want a smaller place or height"
    )


def _another(person: Person, vary: Vary, random: np.random.Generator) -> Person:
    taller, faster = random.uniform(-1.0, 1.0, size=2).tolist()
    moved = random.uniform(-vary.place, vary.place, size=(len(person.route), 2)).tolist()
    other = _dressed(person, random) if vary.clothes else person
    return dataclasses.replace(
        other,
        height=person.height * (1.0 + vary.height * taller),
        speed=person.speed * (1.0 + vary.speed * faster),
        speeds=tuple(speed * (1.0 + vary.speed * faster) for speed in person.speeds),
        route=tuple((x + dx, y + dy, pause) for (x, y, pause), (dx, dy) in zip(person.route, moved, strict=True)),
    )


def made_up(seed: int) -> Scenario:
    """Return a scenario drawn from `seed`: one or two people, and up to four pieces of furniture."""
    random = np.random.default_rng(seed)
    for _ in range(_TRIES):
        scenario = Scenario(
            name=f"random:{seed}",
            summary="Drawn from a seed.",
            people=tuple(_dressed(_walker(random), random) for _ in range(random.integers(1, 3))),
            furniture=tuple(_piece(random) for _ in range(random.integers(0, 5))),
            light=_light(random),
        )
        try:
            scenario.check()
        except ScenarioError:
            continue
        return _with_faults(scenario, random)
    raise ScenarioError(f"random:{seed}: no valid scenario found in {_TRIES} tries; take another seed")


def _walker(random: np.random.Generator) -> Person:
    corners = random.integers(2, 6)
    places = random.uniform(-4.2, 4.2, size=(corners, 2))
    pauses = random.choice([0.0, 0.5, 2.0, 6.0], size=corners)
    route = [(float(x), float(y), float(pause)) for (x, y), pause in zip(places, pauses, strict=True)]
    return Person(route=tuple(route), speed=float(random.uniform(0.15, 0.9)))


def _dressed(person: Person, random: np.random.Generator) -> Person:
    return dataclasses.replace(
        person,
        height=float(random.uniform(0.82, 1.0)),
        girth=float(random.uniform(0.85, 1.2)),
        shirt=_cloth(random, 190),
        trousers=_cloth(random, 110),
        skin=_SKIN[random.integers(len(_SKIN))],
        hair=_HAIR[random.integers(len(_HAIR))],
    )


def _cloth(random: np.random.Generator, brightest: int) -> tuple[float, float, float]:
    red, green, blue = random.integers(24, brightest, size=3).tolist()
    return float(red), float(green), float(blue)


def _piece(random: np.random.Generator) -> Furniture:
    x, y, yaw = random.uniform((-4.2, -4.2, -math.pi), (4.2, 4.2, math.pi)).tolist()
    return Furniture(kind=_PIECES[random.integers(len(_PIECES))], x=x, y=y, yaw=yaw)


def _light(random: np.random.Generator) -> Light:
    angle, slope = random.uniform(-math.pi, math.pi), random.uniform(0.3, 1.2)
    return Light(
        sun=(float(slope * math.cos(angle)) / 1.2, float(slope * math.sin(angle)) / 1.2, -0.9),
        diffuse=float(random.uniform(0.6, 0.9)),
        ambient=float(random.uniform(0.3, 0.5)),
        sky=float(random.uniform(0.62, 0.78)),
        floor=float(random.uniform(0.38, 0.52)),
        wall=float(random.uniform(0.85, 1.0)),
    )


def _with_faults(scenario: Scenario, random: np.random.Generator) -> Scenario:
    return dataclasses.replace(
        scenario,
        camera=Camera(
            noise=float(random.uniform(0.8, 2.0)),
            latency_s=float(random.choice([0.0, 0.0, 0.1, 0.2])),
            drop_probability=float(random.choice([0.0, 0.0, 0.1, 0.3])),
        ),
        depth=Depth(noise=float(random.uniform(0.002, 0.01)), invalid=float(random.uniform(0.0, 0.01))),
    )
