"""What is on the walls is where it belongs, and changes nothing but colours."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.detectors import detector_named
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, CameraPose
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.scenario import Camera, Person, Scenario, Wall, WallsTexture

QUIET = Camera(noise=0.0)


def seen(scenario: Scenario, camera: CameraPose) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    renderer = Renderer(scenario, np.random.default_rng(0))
    image, depth, _ = renderer.render(camera, [None] * len(scenario.people), np.random.default_rng(1))
    return image, depth


@pytest.mark.parametrize(("yaw", "x", "y"), [(0.0, 4.9, 0.5), (0.4, 4.9, 1.5), (1.9, -0.7, 4.9), (-2.7, -4.9, -2.0)])
def test_a_door_is_drawn_where_the_pinhole_sees_it(yaw: float, x: float, y: float) -> None:
    person = Person(route=((0, 2, 0),), behaviour="social_force", enters=(x, y))
    camera = CameraPose(0.3, -0.2, yaw)
    image, _ = seen(Scenario(people=(person,), camera=QUIET), camera)
    along = np.array([0.0, 1.0]) if abs(x) == 4.9 else np.array([1.0, 0.0])
    edges = np.array([[*(np.array([x, y]) + side * 0.34 * 0.9 * along), 0.5] for side in (-1, 1)])
    right, down, ahead = camera.to_camera(edges).T
    left, end = sorted((CENTRE_X + LIMO.focal_px(640) * right / ahead).tolist())
    row = round(float((CENTRE_Y + LIMO.focal_px(640) * down / ahead).mean()))
    dark = np.flatnonzero(image[row].max(axis=1) < 60)
    assert dark[0] == pytest.approx(left, abs=1.0)
    assert dark[-1] == pytest.approx(end, abs=1.0)


def test_bricks_lie_at_their_height_on_every_side_of_an_inner_wall() -> None:
    scenario = Scenario(walls=(Wall((2, -1), (2, 1), 0.3),), walls_texture=WallsTexture("bricks", 0.6), camera=QUIET)
    for camera in (CameraPose(0, 0, 0), CameraPose(4, 0, math.pi)):
        image, depth = seen(scenario, camera)
        distance = 1.85
        assert depth[240, 320] == pytest.approx(distance, rel=0.02)
        # From the wall's top down, a joint every 0.0625 m (ten of the picture's pixels).
        rows = [
            CENTRE_Y - LIMO.focal_px(640) * (1.0 - 0.0625 * n - 0.006 - LIMO.camera_z) / distance for n in range(3, 14)
        ]
        profile = image[:, 250:390].mean(axis=(1, 2))
        joints = np.mean([profile[round(row)] for row in rows])
        bricks = np.mean([profile[round(row) + 8] for row in rows])
        assert joints < 0.8 * bricks


def test_paint_changes_neither_depth_nor_sky_nor_floor() -> None:
    plain, painted = Scenario(camera=QUIET), Scenario(camera=QUIET, walls_texture=WallsTexture("bricks", 0.3, 1.0))
    camera = CameraPose(1.0, 0.5, 0.6)
    (before, depth), (after, same) = seen(plain, camera), seen(painted, camera)
    np.testing.assert_array_equal(depth, same)
    changed = (before != after).any(axis=2)
    assert 0.1 < changed.mean() < 0.5
    on_wall = np.flatnonzero(changed.any(axis=1))
    assert on_wall[0] > CENTRE_Y - LIMO.focal_px(640) * 0.83 / 2.5
    assert on_wall[-1] < CENTRE_Y + LIMO.focal_px(640) * 0.18 / 2.5


def test_the_same_seed_paints_the_same_and_another_seed_something_else() -> None:
    one, again, other = (
        seen(Scenario(walls_texture=WallsTexture("boards", posters=1.0, seed=seed)), CameraPose(0, 0, 0))[0]
        for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.05


def test_hog_takes_posters_for_people_now_and_then_and_a_plain_wall_never() -> None:
    detector, random = detector_named("hog"), np.random.default_rng(0)
    hit = {0.0: 0, 1.0: 0}
    for posters in hit:
        renderer = Renderer(Scenario(walls_texture=WallsTexture(posters=posters)), np.random.default_rng(0))
        for number in range(60):
            x, y, yaw = random.uniform((-4, -4, -math.pi), (4, 4, math.pi)).tolist()
            image, _, _ = renderer.render(CameraPose(x, y, yaw), [], np.random.default_rng(number))
            hit[posters] += len(detector.detect(image)) > 0
    assert hit[0.0] == 0
    assert 1 <= hit[1.0] <= 15
