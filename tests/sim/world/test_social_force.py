"""People push each other and keep from walls as the paper of 1995 says."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import poses_of

from limo_sim.world.crowd import STEP_S
from limo_sim.world.scenario import Person, Robot, Room, Scenario, Wall
from limo_sim.world.social_force import F64, People, SocialForce, acceleration

MODEL = SocialForce()
ADULT = MODEL.adult_m
FREE = np.full((1, 1, 2), np.inf)


def felt(at: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0), *, hidden: bool = False) -> F64:
    """Return what the person at `at`, who walks along x, feels of another at the origin alone: float64 (2,) [m/s²]."""
    along = np.array([[1.0, 0.0]])
    places, radii = np.array([at, (0.0, 0.0)]), np.full(2, 0.13 * ADULT)
    two = People(places, np.array([along[0], velocity]), radii, np.full(1, ADULT), along, along)
    return np.asarray(acceleration(two, FREE, np.array([[False, hidden]]), MODEL)[0])


def potential(at: F64, velocity: F64) -> float:
    """Return V of equation (3), b of equation (4) [m²/s²]."""
    step = velocity * 2.0
    both = math.hypot(*at) + math.hypot(*(at - step))
    return 2.1 * math.exp(-0.5 * math.sqrt(both**2 - step @ step) / 0.3)


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.9, 0.0), (-0.3, 1.1)])
@pytest.mark.parametrize("at", [(-0.9, 0.3), (-1.4, -0.6), (-0.6, 0.02)])
def test_the_push_is_the_slope_of_the_papers_potential(at: tuple[float, float], velocity: tuple[float, float]) -> None:
    place, pace, tiny = np.array(at), np.array(velocity), 1e-6
    around = [[potential(place + side * axis, pace) for axis in np.eye(2)] for side in (-tiny, tiny)]
    downhill = -np.diff(around, axis=0)[0] / (2 * tiny)
    in_sight = -downhill[0] >= math.cos(math.radians(100.0)) * math.hypot(*downhill)
    np.testing.assert_allclose(felt(at, velocity), downhill * (1.0 if in_sight else 0.5), rtol=1e-5)


def test_what_is_behind_counts_half_a_wall_hides_and_touching_bodies_part() -> None:
    before = felt((-0.8, 0.0))[0]
    assert before == pytest.approx(-7.0 * math.exp(-0.8 / 0.3))
    assert felt((0.8, 0.0))[0] == pytest.approx(-0.5 * before)
    assert felt((-0.8, 0.0), hidden=True).tolist() == [0.0, 0.0]
    near, touching = (felt((-gap, 0.0))[0] for gap in (0.26 * ADULT + 0.01, 0.26 * ADULT - 0.01))
    assert touching - near == pytest.approx(-15.0, abs=1.0)


def test_a_wall_pushes_with_the_papers_strength_and_a_child_feels_it_in_proportion() -> None:
    rest = np.zeros((1, 2))
    for scale in (1.0, 0.5):
        size = np.array([scale * ADULT])
        alone = People(rest, rest, 0.13 * size, size, rest, np.array([[1.0, 0.0]]))
        pushed = acceleration(alone, np.array([[[0.0, 0.4 * scale]]]), np.zeros((1, 1), bool), MODEL)[0]
        np.testing.assert_allclose(pushed, [0.0, scale * 50.0 * math.exp(-2.0)])


def walked(scenario: Scenario, seconds: float, robot: tuple[float, float, float], seed: int = 0) -> F64:
    """Return everybody's places, float64 (steps, people, 2)."""
    seen = poses_of(scenario, seconds, robot, seed)
    return np.array([[(pose.x, pose.y) for pose in poses if pose is not None] for poses in seen])


def speeds(places: F64) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(np.diff(places, axis=0), axis=2)) / STEP_S


def test_somebody_alone_reaches_the_wanted_speed_in_the_papers_half_second() -> None:
    alone = Person(route=((-3, 0, 0), (4, 0, 900)), speed=1.34, height=ADULT, behaviour="social_force")
    places = walked(Scenario(people=(alone,), robot=Robot(y=-4)), 3.0, (0.0, -4.0, 0.0))
    times = STEP_S * np.arange(1, 126)
    assert np.abs(speeds(places)[:125, 0] - 1.34 * (1 - np.exp(-times / 0.5))).max() < 0.08
    assert np.abs(places[..., 1]).max() < 0.1


@pytest.mark.parametrize("seed", [0, 1])
def test_two_streams_pass_a_door_by_turns(seed: int) -> None:
    people, side = [], [-1, 1] * 9
    for index, sign in enumerate(side):
        row, beside = index // 6, index // 2 % 3 - 1
        start, through = (sign * (2.5 + 0.9 * row), 0.9 * beside, 0), (-sign * 6.0, 1.5 * beside, 0)
        away = (-sign * 7.5, 1.5 * beside + 0.6 * row, 900)
        people.append(Person(route=(start, through, away), speed=1.34, height=1.75, behaviour="social_force"))
    door = Wall((0, -9), (0, -0.6)), Wall((0, 0.6), (0, 9))
    scenario = Scenario(people=tuple(people), walls=door, room=Room(9.0), robot=Robot(x=-8, y=-8))
    places = walked(scenario, 45.0, (-8.0, -8.0, 0.0), seed)

    across = places[..., 0] * -np.array(side) > 0
    assert across[-1].all()
    order = [side[index] for index in np.argsort(across.argmax(axis=0))]
    turns = sum(one != other for one, other in pairwise(order))
    # Of 18 people in random order 9 on average follow one from the other side, and 5 or fewer in 3 of 100 orders.
    assert 1 <= turns <= 5
    gaps = np.hypot(*np.moveaxis(places[:, :, None] - places[:, None], 3, 0)) + 9.0 * np.eye(len(people))
    # Shoulders overlap by no more than a tenth of their breadth.
    assert gaps.min() > 0.9 * 0.26 * 1.75
    assert speeds(places).max() < 1.3 * 1.34 + 1e-6
    in_door = np.abs(places[..., 0]) < 0.05
    assert np.abs(places[..., 1][in_door]).max() < 0.6 - 0.13 * 1.75


@pytest.mark.parametrize(("height", "speed"), [(0.9, 0.7), (1.75, 1.34)])
@pytest.mark.parametrize("aside", [0.0, 0.05, -0.2])
def test_a_person_who_meets_a_standing_robot_walks_round_it_and_on(height: float, speed: float, aside: float) -> None:
    person = Person(route=((-3, aside, 0), (3, aside, 900)), speed=speed, height=height, behaviour="social_force")
    places = walked(Scenario(people=(person,)), 16.0, (0.0, 0.0, 0.0))[:, 0]
    gap = np.hypot(*places.T).min() - person.radius
    assert gap > 0.19 + 0.05
    assert math.dist(places[-1], (3, aside)) < 0.1
    # No farther off the line than there is need for, and at the wanted speed before and behind.
    assert np.abs(places[:, 1]).max() < 1.3
    pace = speeds(places[:, None])[:, 0]
    assert pace[places[:-1, 0] > 1.2][:10].mean() == pytest.approx(speed, rel=0.1)
    # Who ignores the robot walks straight through its place.
    blind = Scenario(people=(dataclasses.replace(person, reaction="ignore"),))
    assert np.hypot(*walked(blind, 16.0, (0.0, aside, 0.0))[:, 0].T).min() < abs(aside) + 0.1
