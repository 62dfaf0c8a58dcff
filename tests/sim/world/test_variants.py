"""People of a run: drawn from its seed as far as the scenario asks for, and no further."""

from __future__ import annotations

import dataclasses

import pytest

from limo_sim.world.scenario import Person, Scenario, Vary
from limo_sim.world.schema import ScenarioError
from limo_sim.world.variants import of_run

ROUTE = ((2.5, -1.0, 2.0), (3.0, 1.5, 2.0))
PLAIN = Scenario(people=(Person(route=ROUTE, speed=0.4), Person(route=((-2.0, 1.0, 0.0),))))
DRAWN = dataclasses.replace(PLAIN, vary=Vary(clothes=True, height=0.1, speed=0.3, place=0.4))


def test_a_seed_draws_clothes_stature_speed_and_places_within_what_is_asked_for() -> None:
    runs = [of_run(DRAWN, seed) for seed in range(200)]
    assert runs[3] == of_run(DRAWN, 3)
    assert of_run(runs[3], 4) is runs[3]
    assert of_run(PLAIN, 1) is PLAIN
    assert len({run.people for run in runs}) == 200
    for run in runs:
        run.check()
        for person, plain in zip(run.people, PLAIN.people, strict=True):
            assert 0.9 * plain.height <= person.height <= 1.1 * plain.height
            assert 0.7 * plain.speed <= person.speed <= 1.3 * plain.speed
            for (x, y, pause), (plain_x, plain_y, plain_pause) in zip(person.route, plain.route, strict=True):
                assert max(abs(x - plain_x), abs(y - plain_y)) <= 0.4
                assert pause == plain_pause
    heights = [run.people[0].height for run in runs]
    assert max(heights) - min(heights) > 0.15 * PLAIN.people[0].height


def test_what_is_not_asked_for_stays() -> None:
    run = of_run(dataclasses.replace(PLAIN, vary=Vary(speed=0.5)), 5)
    assert run.people[0].speed != PLAIN.people[0].speed
    for person, plain in zip(run.people, PLAIN.people, strict=True):
        assert dataclasses.replace(person, speed=plain.speed) == plain


def test_people_that_do_not_fit_are_refused_by_name() -> None:
    tall = dataclasses.replace(DRAWN, people=tuple(Person(route=((3.0, 0.0, 0.0),), height=2.0) for _ in range(16)))
    with pytest.raises(ScenarioError, match="vary: no people that fit found"):
        of_run(tall, 0)
