"""Furniture that moves is seen, felt and walked round where it is."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.sim.logs import drive, poses_of, there

from limo_sim.run.arena import Arena
from limo_sim.world.crowd import STEP_S
from limo_sim.world.movers import Movers
from limo_sim.world.scenario import Camera, Mover, Person, Robot, Scenario

TROLLEY = Scenario(movers=(Mover("trolley", ((2.0, -1.0, 0), (2.0, 1.0, 0)), 0.5),))


def test_a_mover_keeps_its_timetable() -> None:
    for time, y in ((0.0, -1.0), (2.0, 0.0), (4.0, 1.0), (6.0, 0.0), (10.0, 0.0)):
        (piece,) = Movers(TROLLEY.movers).at(time)
        assert (piece.x, piece.y) == pytest.approx((2.0, y))


def test_camera_and_lidar_see_a_mover_where_it_was_when_they_looked() -> None:
    arena = drive(Arena(dataclasses.replace(TROLLEY, camera=Camera(latency_s=0.4)), 0), 2.4)
    frame, scan = arena.frame(), arena.scan()
    assert frame.stamp == pytest.approx(2.0)
    # Long side along y: the trolley drives sideways to the camera, 0.17 m deep.
    assert frame.depth[200:280, 320].min() == pytest.approx(2.0 - 0.17 - 0.084, abs=0.03)
    angles = np.linspace(-2.0, 2.0, 292)
    hit = scan.ranges < 2.5
    assert np.median(np.sin(angles[hit]) * scan.ranges[hit]) == pytest.approx(0.5 * (scan.stamp - 2.0), abs=0.1)


def test_a_mover_pushes_the_robot_aside_which_counts_as_a_contact() -> None:
    arena = drive(Arena(Scenario(movers=(Mover("trolley", ((1.0, 0.05, 0), (-1.0, 0.05, 0)), 0.4),)), 0), 4.0)
    assert arena.contacts.wall == 1
    assert arena.contacts.person == 0
    assert arena.truth().robot[0] < -0.3


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, -2.0])
def test_a_mover_has_the_velocity_of_its_way_in_the_physics(heading: float) -> None:
    end = (2.0 + math.cos(heading), math.sin(heading), 0)
    arena = drive(Arena(Scenario(movers=(Mover("trolley", ((2.0, 0.0, 0), end), 0.5),))), 0.5)
    (body,) = arena._moving
    # Half a second at half a metre a second.
    assert tuple(body.velocity) == pytest.approx((0.5 * math.cos(heading), 0.5 * math.sin(heading)))
    assert tuple(body.position) == pytest.approx((2.0 + 0.25 * math.cos(heading), 0.25 * math.sin(heading)))


def test_a_person_who_yields_walks_round_a_mover() -> None:
    person = Person(route=((-1.0, 0.03, 0), (4.0, 0.03, 900)), behaviour="social_force", speed=0.7)
    scenario = dataclasses.replace(
        TROLLEY, people=(person,), robot=Robot(x=-4), movers=(Mover("trolley", ((4.2, 0, 0), (-2.0, 0, 0)), 0.4),)
    )
    poses = [there(pose) for (pose,) in poses_of(scenario, 10.0, (-4.0, 0.0, 0.0))]
    pieces = [piece for step in range(len(poses)) for piece in Movers(scenario.movers).at(step * STEP_S)]
    assert min(math.dist((a.x, a.y), (b.x, b.y)) for a, b in zip(poses, pieces, strict=True)) > 0.17 + 0.1
    assert poses[-1].x > 3.8
