"""The lidar measures what a ray in the physics engine meets."""

import math

import numpy as np
import pymunk
import pytest

from limo_hog.follow.robot import LIMO
from limo_sim.run.arena import Arena
from limo_sim.sensing import lidar
from limo_sim.world.furniture import Disc, Rectangle
from limo_sim.world.person import Pose, body, legs_at
from limo_sim.world.scenario import Lidar, Person, Room, Scenario, Wall


def by_physics(x: float, y: float, yaw: float, shapes: list[Disc | Rectangle]) -> list[float]:
    space = pymunk.Space()
    ground = space.static_body
    corners = [(-4.9, -4.9), (4.9, -4.9), (4.9, 4.9), (-4.9, 4.9)]
    space.add(*(pymunk.Segment(ground, corners[side - 1], corners[side], 0.0) for side in range(4)))
    for shape in shapes:
        if isinstance(shape, Disc):
            space.add(pymunk.Circle(ground, shape.radius, (shape.x, shape.y)))
        else:
            turned = pymunk.Transform.translation(shape.x, shape.y).rotated(shape.yaw)
            a, b = shape.half_x, shape.half_y
            space.add(pymunk.Poly(ground, [(-a, -b), (a, -b), (a, b), (-a, b)], turned))
    ranges = []
    for angle in np.linspace(-2, 2, 292) + yaw:
        end = x + 20 * math.cos(angle), y + 20 * math.sin(angle)
        hit = space.segment_query_first((x, y), end, 0.0, pymunk.ShapeFilter())
        assert hit is not None
        ranges.append(20 * hit.alpha)
    return ranges


@pytest.mark.parametrize("seed", range(8))
def test_ranges_equal_the_physics_engines_ray_casts(seed: int) -> None:
    random = np.random.default_rng(seed)
    shapes: list[Disc | Rectangle] = []
    for x, y, size, yaw in random.uniform((-4, -4, 0.02, 0), (4, 4, 0.4, 6), size=(8, 4)).tolist():
        if math.hypot(x - 0.5, y + 0.3) > 0.6:
            shapes += [Disc(x, y, size), Rectangle(-x, y, size, 0.5 * size, yaw)]
    shapes = [shape for shape in shapes if math.hypot(shape.x - 0.5, shape.y + 0.3) > 0.6]
    yaw = float(random.uniform(-3, 3))
    expected = by_physics(0.5, -0.3, yaw, shapes)
    np.testing.assert_allclose(lidar.cast(0.5, -0.3, yaw, shapes), expected, atol=2e-3)
    # A beam along an axis is no division by zero.
    ranges = lidar.cast(0.0, 0.0, 2.0, [Rectangle(3, 0, 0.1, 0.1)])
    assert ranges[0] == pytest.approx(2.9) and np.isfinite(ranges).all()


@pytest.mark.parametrize("height", [0.6, 1.2, 1.85, 2.0])
@pytest.mark.parametrize("phase", [0.0, 0.7, 1.6, 2.9, 4.4, 5.6])
def test_the_legs_are_all_that_the_plane_cuts_of_a_body(phase: float, height: float) -> None:
    person, pose = Person(route=((2, 0, 0),), height=height, girth=1.3), Pose(2, -1, 0.8, phase, 1.0)
    cut = legs_at(person, pose, LIMO.lidar_z)
    whole = body(person, pose)
    x, y = np.mgrid[1.6:2.4:0.005, -1.4:-0.6:0.005]
    flat = np.stack([x, y, np.full_like(x, LIMO.lidar_z)], axis=-1)
    inside = np.zeros(x.shape, bool)
    for start, end, radius, end_radius in zip(
        whole.start, whole.end, whole.start_radius, whole.end_radius, strict=True
    ):
        axis = end - start
        share = np.clip((flat - start) @ axis / (axis @ axis), 0, 1)
        gap = np.linalg.norm(flat - (start + share[..., None] * axis), axis=-1)
        inside |= gap < radius + share * (end_radius - radius)
    discs = np.any([np.hypot(x - disc.x, y - disc.y) < disc.radius for disc in cut], axis=0)
    assert discs.any()
    # a leaning shin is cut in an ellipse, of which the disc is the middle
    assert (inside & discs).sum() > 0.95 * discs.sum()
    assert (inside & discs).sum() > 0.6 * inside.sum()


def test_noise_has_the_spread_asked_for_and_ranges_keep_their_limits() -> None:
    random = np.random.default_rng(0)
    true = np.full(20_000, 3.0)
    assert lidar.measure(true, 0.01, random).std() == pytest.approx(0.01, rel=0.03)
    limits = lidar.measure(np.array([0.05, 0.5, 7.9, 8.1]), 0.0, random)
    np.testing.assert_array_equal(limits, np.array([np.inf, 0.5, 7.9, np.inf], np.float32))


def test_a_scan_has_the_robots_beams_and_sees_inner_walls_and_the_walls_of_any_room() -> None:
    scan = Arena(Scenario.load("empty"), 0).scan()
    assert scan.ranges.shape == (292,) and scan.ranges.dtype == np.float32
    assert (scan.angle_min, scan.angle_max, scan.range_min, scan.range_max) == (-2.0, 2.0, 0.12, 8.0)
    assert scan.ranges[140:152] == pytest.approx(4.9 - 0.103, abs=0.05)
    wall = Wall((1.0, 1.0), (3.0, 1.0), 0.2)
    arena = Arena(Scenario(lidar=Lidar(noise_m=0.0), room=Room(3.0), walls=(wall,)), 0)
    ranges, angles = arena.scan().ranges, np.linspace(-2, 2, 292)
    ahead, left = 0.103 + ranges * np.cos(angles), ranges * np.sin(angles)
    for angle, x, y in ((0.0, 3.0, None), (math.pi / 6, None, 0.9), (-1.2, None, -3.0), (1.9, None, 3.0)):
        beam = int(np.abs(angles - angle).argmin())
        assert (ahead[beam], left[beam]) == pytest.approx((x or ahead[beam], y or left[beam]), abs=1e-3)
