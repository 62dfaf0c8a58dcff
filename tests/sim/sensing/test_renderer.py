"""The camera sees what rays solved one by one see; the canvas draws solids where a formula says they are."""

import dataclasses
import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import there

from limo_hog._core import Canvas
from limo_hog.exceptions import ParameterError
from limo_hog.follow.robot import LIMO
from limo_hog.named_detectors import detector_named
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, CameraPose
from limo_sim.sensing.renderer import Renderer, Seen
from limo_sim.world.furniture import KINDS, Box
from limo_sim.world.person import BodyMesh, Pose, body
from limo_sim.world.scenario import Camera, Depth, Furniture, Person, Room, Scenario, Wall, WallsTexture

HERE = CameraPose(0.0, 0.0, 0.0)
EYE = np.array([0.0, 0.0, 0.175])
SOMEBODY = Person(route=((3, 0, 0),))
ADULT = Person(route=((3, 0, 0),), height=1.85)
EXACT = Scenario(camera=Camera(noise=0.0), depth=Depth(noise=0.0, invalid=0.0, far_m=20.0))

Picture = tuple[NDArray[np.uint8], NDArray[np.float32], list[Seen]]


def picture(
    *poses: Pose | None,
    furniture: tuple[Furniture, ...] = (),
    camera: CameraPose = HERE,
    scenario: Scenario = EXACT,
    person: Person = SOMEBODY,
) -> Picture:
    scenario = dataclasses.replace(scenario, people=(person,) * len(poses), furniture=furniture)
    return Renderer(scenario, np.random.default_rng(0)).render(camera, poses, np.random.default_rng(1))


def rays(columns: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Directions in the arena's frame of pixels seen by a camera at `HERE`, one metre deep."""
    left, up = (CENTRE_X - columns) / LIMO.focal_px(640), (CENTRE_Y - rows) / LIMO.focal_px(640)
    return np.stack([np.ones(len(columns)), left, up], axis=1)


def first_hit(figure: BodyMesh, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth [m] at which rays from the camera meet a body: capsules as rows of balls, ellipsoids as they are."""
    share = np.linspace(0, 1, 80)[:, None, None]
    balls = (figure.start + share * (figure.end - figure.start)).reshape(-1, 3) - EYE
    radii = (figure.start_radius + share[..., 0] * (figure.end_radius - figure.start_radius)).reshape(-1)
    nearest = np.full(len(directions), np.inf)

    def hit(squared: NDArray[np.float64], along: NDArray[np.float64], beside: float) -> None:
        """Where a depth t solves squared t² - 2 along t + beside = 0, the ray is on the solid's surface."""
        under = along**2 - squared * beside
        on = under > 0
        nearest[on] = np.minimum(nearest[on], (along[on] - np.sqrt(under[on])) / squared[on])

    squared = (directions**2).sum(axis=1)
    for centre, radius in zip(balls, radii, strict=True):
        hit(squared, directions @ centre, centre @ centre - radius**2)
    for centre, axes in zip(figure.centre, figure.axes, strict=True):
        shrink = np.linalg.inv(axes)
        ahead, offset = directions @ shrink.T, shrink @ (centre - EYE)
        hit((ahead**2).sum(axis=1), ahead @ offset, offset @ offset - 1)
    return nearest


@pytest.mark.parametrize(
    ("person", "distance", "yaw"),
    [
        *((SOMEBODY, distance, yaw) for distance in (1.6, 3.0) for yaw in (0.0, 2.3, math.pi / 2)),
        *((ADULT, distance, math.pi) for distance in (3.9, 4.6)),
    ],
)
def test_a_body_covers_the_pixels_and_has_the_depth_of_its_solids(person: Person, distance: float, yaw: float) -> None:
    pose = Pose(distance, 0.15, yaw, phase=1.1, swing=1.0)
    _, depth, [(visible, box)] = picture(pose, person=person)
    assert visible == pytest.approx(1.0, abs=0.01)
    left, top, width, height = there(box)
    silhouette = depth < picture(None)[1] - 0.01
    rows, columns = np.nonzero(silhouette)
    edges = columns.min() - left, rows.min() - top, left + width - 1 - columns.max(), top + height - 1 - rows.max()
    assert np.abs(edges).max() <= 2
    rows, columns = (grid.reshape(-1) for grid in np.mgrid[top : top + height, left : left + width])
    expected = first_hit(body(person, pose), rays(columns, rows))
    solid, seen = np.isfinite(expected), silhouette[rows, columns]
    both = solid & seen
    assert both.sum() / (solid | seen).sum() > 0.97
    gaps = np.abs(depth[rows, columns][both] - expected[both]) / max(person.height, 1.0)
    assert np.median(gaps) < 0.003
    assert np.percentile(gaps, 95) < 0.015


def inside(piece: Furniture, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (..., 3) lie in any solid of a piece."""
    cos, sin = math.cos(piece.yaw), math.sin(piece.yaw)
    x, y, z = points[..., 0] - piece.x, points[..., 1] - piece.y, points[..., 2]
    x, y = cos * x + sin * y, cos * y - sin * x
    found = np.zeros(x.shape, bool)
    for solid in KINDS[piece.kind].solids:
        tall = (z >= solid.z0) & (z <= solid.z1)
        if isinstance(solid, Box):
            found |= tall & (np.abs(x - solid.x) <= solid.half_x) & (np.abs(y - solid.y) <= solid.half_y)
        else:
            radius = solid.r0 + (z - solid.z0) / (solid.z1 - solid.z0) * (solid.r1 - solid.r0)
            found |= tall & (np.hypot(x - solid.x, y - solid.y) <= radius)
    return found


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_furniture_has_the_depth_that_marching_along_the_rays_finds(kind: str) -> None:
    piece = Furniture(kind, 2.0, 0.3, 0.7)
    _, depth, _ = picture(furniture=(piece,))
    rows, columns = (grid.reshape(-1) for grid in np.mgrid[30:320:4, 130:360:3])
    depths = np.arange(1.6, 2.4, 0.002)
    hits = inside(piece, EYE + depths[:, None, None] * rays(columns, rows))
    expected = np.where(hits.any(axis=0), depths[hits.argmax(axis=0)], np.inf)
    drawn = depth[rows, columns]
    floor = picture()[1][rows, columns]
    solid, seen = np.isfinite(expected) & (expected < floor), drawn < floor - 1e-3
    assert solid.sum() > 100
    both = solid & seen
    assert both.sum() / (solid | seen).sum() > 0.93
    gaps = np.abs(drawn[both] - expected[both])
    assert np.median(gaps) < 0.003
    assert np.percentile(gaps, 90) < 0.02


@pytest.mark.parametrize("camera", [HERE, CameraPose(1.0, -2.0, 0.7), CameraPose(-3.0, 3.0, -0.6)])
@pytest.mark.parametrize("half", [4.0, 12.0])
def test_inner_walls_have_the_depth_that_marching_along_the_rays_finds(camera: CameraPose, half: float) -> None:
    walls = (Wall((1.5, -1.0), (3.5, 0.5), 0.2), Wall((2.0, 1.0), (2.0, 3.5)), Wall((-3.0, 0.0), (1.0, 3.0), 0.05))
    flat = dataclasses.replace(EXACT, room=Room(half), walls=walls)
    _, depth, _ = picture(camera=camera, scenario=flat)
    rows, columns = (grid.reshape(-1) for grid in np.meshgrid((120, 200, 230, 250, 300), range(7, 640, 48)))
    steps, cos, sin = np.arange(0.0, 2 * half, 0.002)[:, None], math.cos(camera.yaw), math.sin(camera.yaw)
    ahead, left, up = rays(columns, rows).T
    x, y = camera.x + steps * (cos * ahead - sin * left), camera.y + steps * (sin * ahead + cos * left)
    z, walled = EYE[2] + steps * up, np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1), thickness in ((wall.start, wall.end, wall.thickness) for wall in walls):
        length = math.hypot(x1 - x0, y1 - y0)
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length
        across = ((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) / length
        walled |= (along > 0) & (along < length) & (np.abs(across) < thickness / 2)
    solid = ((walled | (np.maximum(np.abs(x), np.abs(y)) > half)) & (z < 1.0)) | (z < 0.0)
    hit, ray, furthest = solid.argmax(axis=0), np.arange(len(rows)), flat.depth.far_m - 0.01
    assert walled[hit, ray].any()
    expected = np.where(solid[hit, ray], steps[hit, 0], np.inf).clip(max=furthest)
    np.testing.assert_allclose(depth[rows, columns].clip(max=furthest), expected, rtol=0, atol=0.004)


def test_colour_changes_where_depth_does() -> None:
    # The wall's upper edge lies at the same row in both images, in every column.
    image, depth, _ = picture(camera=CameraPose(1.0, -2.0, 0.7))
    bright = np.abs(np.diff(image[:240, :, 0].astype(int), axis=0)).argmax(axis=0)
    far = np.isinf(depth[:240]).sum(axis=0) - 1
    assert np.abs(bright - far).max() <= 1


def test_somebody_behind_a_pillar_or_wall_is_hidden_and_before_or_beside_it_not() -> None:
    pillar = (Furniture("pillar", 2.0, 0.0),)
    _, behind, [(hidden, box)] = picture(Pose(4.0, 0.0, 0.0), furniture=pillar)
    _, _, [(part, _)] = picture(Pose(4.0, 0.3, 0.0), furniture=pillar)
    _, before, [(front, _)] = picture(Pose(1.6, 0.0, 0.0), furniture=pillar)
    assert hidden < 0.05 and box is not None
    assert 0.1 < part < 0.9 < front == 1.0
    assert behind[200, 320] == pytest.approx(1.85, abs=0.02)
    assert before[110, 320] < 1.6
    walls = (Wall((2.0, -3.0), (2.0, -0.5)), Wall((2.0, 0.5), (2.0, 3.0)))
    flat = dataclasses.replace(EXACT, walls=walls)
    shares = [picture(Pose(3.0, y, 0.0), scenario=flat)[2][0][0] for y in (0.0, 1.4)]
    assert shares == [1.0, 0.0]
    assert picture(Pose(1.5, 0.6, 0.0), scenario=flat)[2][0][0] == 1.0


def test_the_nearer_of_two_people_hides_the_other_whoever_comes_first() -> None:
    near, far = Pose(2.0, 0.05, 0.0), Pose(3.0, 0.1, 0.0)
    image, depth, [(first, _), (second, _)] = picture(near, far)
    same, same_depth, [(second_now, _), (first_now, _)] = picture(far, near)
    assert first == first_now == 1.0
    assert second == second_now < 0.6
    np.testing.assert_array_equal(image, same)
    np.testing.assert_array_equal(depth, same_depth)


@pytest.mark.parametrize(
    ("person", "pose", "gap"),
    [
        *((SOMEBODY, Pose(x, y, 1.0, 2.0, 1.0), 0.015) for x, y in ((0.5, 0.0), (0.8, 0.3), (1.1, -0.8), (1.6, 1.1))),
        *((ADULT, Pose(x, 0.2, 2.0, 2.0, 1.0), 0.01) for x in (1.2, 1.6, 2.5)),
    ],
)
def test_of_somebody_nearby_the_image_shows_what_single_rays_show(person: Person, pose: Pose, gap: float) -> None:
    rows, columns = (grid.reshape(-1) for grid in np.mgrid[-900:1300:6, -900:1500:6])
    expected = first_hit(body(person, pose), rays(columns, rows))
    covered = np.isfinite(expected)
    shown = covered & (rows >= 0) & (rows < 480) & (columns >= 0) & (columns < 640)
    _, depth, [(visible, box)] = picture(pose, person=person)
    assert visible == pytest.approx(shown.sum() / covered.sum(), abs=0.03)
    # The rays are six pixels apart, and one is of row 0.
    assert 0 <= rows[shown].min() - there(box)[1] < 6
    gaps = np.abs(depth[rows[shown], columns[shown]] - expected[shown])
    assert np.median(gaps) < gap


def test_somebody_behind_the_camera_is_not_seen_and_who_touches_it_does_no_harm() -> None:
    (image, depth, seen), (empty, empty_depth, _) = picture(Pose(-2.0, 0.0, 0.0)), picture(None)
    assert seen == [(0.0, None)]
    np.testing.assert_array_equal(image, empty)
    np.testing.assert_array_equal(depth, empty_depth)
    for distance, y in itertools.product((0.05, 0.15, 0.25, 0.5), (-0.2, 0.0, 0.2)):
        _, depth, [(visible, _)] = picture(Pose(distance, y, 1.0, 2.0, 1.0))
        assert 0.0 <= visible <= 1.0 and not np.isnan(depth).any()


def test_colour_noise_is_grey_and_as_strong_as_asked_for() -> None:
    clean = picture(None)[0].astype(int)
    for sigma in (1.0, 3.0):
        scenario = dataclasses.replace(EXACT, camera=Camera(noise=sigma))
        noise = picture(None, scenario=scenario)[0].astype(int) - clean
        assert (noise == noise[..., :1]).all()
        assert noise[..., 0].std() == pytest.approx(math.hypot(sigma, 1 / math.sqrt(12)), rel=0.02)
        assert abs(noise[..., 0].mean()) < 0.02


def test_depth_has_limits_noise_and_unknown_pixels() -> None:
    clean = picture(None)[1]
    limited = dataclasses.replace(EXACT, depth=Depth(near_m=0.5, far_m=4.0, noise=0.0, invalid=0.0))
    depth = picture(None, scenario=limited)[1]
    assert (depth[clean < 0.499] == -np.inf).all()
    assert (depth[clean > 4.001] == np.inf).all()
    within = (clean > 0.501) & (clean < 3.999)
    np.testing.assert_array_equal(depth[within], clean[within])

    noisy = dataclasses.replace(EXACT, depth=Depth(near_m=0.01, far_m=20, noise=0.01, invalid=0.02))
    depth = picture(None, scenario=noisy)[1]
    assert np.isnan(depth).mean() == pytest.approx(0.02, rel=0.05)
    known = np.isfinite(depth) & np.isfinite(clean)
    assert (depth[known] / clean[known]).std() == pytest.approx(0.01, rel=0.05)


def test_shadow_falls_on_the_floor_beneath() -> None:
    lit, shaded = picture(None)[0], picture(Pose(2.0, 0.0, 0.0))[0]
    row = round(CENTRE_Y + LIMO.focal_px(640) * 0.175 / 1.88)
    assert shaded[row, 320, 0] < lit[row, 320, 0] - 10
    assert shaded[470, 320, 0] == lit[470, 320, 0]


@pytest.mark.parametrize(("yaw", "x", "y"), [(0.0, 4.9, 0.5), (0.4, 4.9, 1.5), (1.9, -0.7, 4.9), (-2.7, -4.9, -2.0)])
def test_a_door_is_drawn_where_the_pinhole_sees_it(yaw: float, x: float, y: float) -> None:
    person = Person(route=((0, 2, 0),), behaviour="social_force", enters=(x, y))
    camera = CameraPose(0.3, -0.2, yaw)
    image, _, _ = picture(None, person=person, camera=camera)
    along = np.array([0.0, 1.0]) if abs(x) == 4.9 else np.array([1.0, 0.0])
    edges = np.array([[*(np.array([x, y]) + side * 0.34 * 0.9 * along), 0.5] for side in (-1, 1)])
    right, down, ahead = camera.to_camera(edges).T
    left, end = sorted((CENTRE_X + LIMO.focal_px(640) * right / ahead).tolist())
    row = round(float((CENTRE_Y + LIMO.focal_px(640) * down / ahead).mean()))
    dark = np.flatnonzero(image[row].max(axis=1) < 60)
    assert dark[0] == pytest.approx(left, abs=1.0)
    assert dark[-1] == pytest.approx(end, abs=1.0)


def test_bricks_lie_at_their_height_on_every_side_of_an_inner_wall() -> None:
    wall, bricks = Wall((2, -1), (2, 1), 0.3), WallsTexture("bricks", 0.6)
    scenario = dataclasses.replace(EXACT, walls=(wall,), walls_texture=bricks)
    for camera in (HERE, CameraPose(4, 0, math.pi)):
        image, depth, _ = picture(scenario=scenario, camera=camera)
        assert depth[240, 320] == pytest.approx(1.85, rel=0.02)
        # From the wall's top down, a joint every 0.0625 m (ten of the picture's pixels).
        heights = 1.0 - 0.0625 * np.arange(3, 14) - 0.006 - LIMO.camera_z
        rows = np.round(CENTRE_Y - LIMO.focal_px(640) * heights / 1.85).astype(int)
        profile = image[:, 250:390].mean(axis=(1, 2))
        assert profile[rows].mean() < 0.8 * profile[rows + 8].mean()


def test_paint_changes_neither_depth_nor_sky_nor_floor_and_is_that_of_its_seed() -> None:
    painted = dataclasses.replace(EXACT, walls_texture=WallsTexture("bricks", 0.3, 1.0))
    camera = CameraPose(1.0, 0.5, 0.6)
    (before, depth, _), (after, same, _) = picture(camera=camera), picture(camera=camera, scenario=painted)
    np.testing.assert_array_equal(depth, same)
    changed = (before != after).any(axis=2)
    assert 0.1 < changed.mean() < 0.5
    on_wall = np.flatnonzero(changed.any(axis=1))
    assert on_wall[0] > CENTRE_Y - LIMO.focal_px(640) * 0.83 / 2.5
    assert on_wall[-1] < CENTRE_Y + LIMO.focal_px(640) * 0.18 / 2.5
    boards = [dataclasses.replace(EXACT, walls_texture=WallsTexture("boards", posters=1.0, seed=k)) for k in (0, 0, 1)]
    one, again, other = (picture(scenario=scenario)[0] for scenario in boards)
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


HEIGHT, WIDTH, FOCAL = 60, 80, 50.0
LIGHT = (0.0, -1.0, 0.0, 0.5, 0.5)
PALETTE = np.arange(512, dtype=np.uint32)
#: A capsule 3 m away that leans across the image: from (20, 20) for 30 px, radius 6 px.
STRIP = np.array([[0, 20, 20, 0.8, 0.6, 30, 6, 0, 3, 0, 0.01, 0]], np.float64)
ELLIPSE = np.array([[0, 40, 30, 1 / 20, 0, 1 / 10, 10, 20, 3, 0, 0, 0.5]], np.float64)


def canvas() -> Canvas:
    empty = Canvas(HEIGHT, WIDTH, FOCAL)
    empty.begin((0, 0, WIDTH, HEIGHT))
    return empty


def drawn(full: Canvas) -> np.ndarray:
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    full.draw(None, depth, PALETTE)
    return depth


def test_a_strip_holds_the_pixels_within_its_radius_of_its_axis() -> None:
    full = canvas()
    full.strips(STRIP, LIGHT)
    y, x = np.mgrid[:HEIGHT, :WIDTH] - np.array([20, 20])[:, None, None]
    along = np.clip(0.8 * x + 0.6 * y, 0, 30)
    away, depth = np.hypot(x - 0.8 * along, y - 0.6 * along), drawn(full)
    assert np.isinf(depth[away > 5.6]).all()
    np.testing.assert_allclose(depth[away < 5.4], 3 - 0.01 * np.sqrt(36 - away[away < 5.4] ** 2), rtol=1e-5)


def test_an_ellipse_holds_the_pixels_within_its_half_axes() -> None:
    full = canvas()
    full.ellipses(ELLIPSE, LIGHT)
    y, x = np.mgrid[:HEIGHT, :WIDTH] - np.array([30, 40])[:, None, None]
    inside, depth = 1 - (x / 20) ** 2 - (y / 10) ** 2, drawn(full)
    assert np.isinf(depth[inside < 0]).all()
    np.testing.assert_allclose(depth[inside > 0.1], 3 - 0.5 * np.sqrt(inside[inside > 0.1]), rtol=1e-5)


def test_only_the_window_is_drawn_into_and_the_count_is_that_of_its_pixels() -> None:
    part = Canvas(HEIGHT, WIDTH, FOCAL)
    part.begin((30, 25, 50, 35))
    part.ellipses(ELLIPSE, LIGHT)
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    owners = np.full((HEIGHT, WIDTH), -1, np.int16)
    assert part.draw(None, depth, PALETTE, owners, 3) == 200
    whole = canvas()
    whole.ellipses(ELLIPSE, LIGHT)
    np.testing.assert_array_equal(depth[25:35, 30:50], drawn(whole)[25:35, 30:50])
    assert np.count_nonzero(owners == 3) == np.count_nonzero(np.isfinite(depth)) == 200
    assert part.seen(depth) == (200, 200, (30, 25, 50, 35))
    assert part.seen(depth - 1) == (200, 0, (30, 25, 50, 35))


@pytest.mark.parametrize("ugly", [math.nan, math.inf, -math.inf, 0.0, 1e300, -1e300])
def test_any_numbers_are_drawn_without_a_crash(ugly: float) -> None:
    full = canvas()
    for column in range(12):
        for rows, cast in ((STRIP, full.strips), (ELLIPSE, full.ellipses)):
            row = rows.copy()
            row[0, column] = ugly
            cast(row, LIGHT)
    full.frustum([ugly] * 13, LIGHT)
    full.slab([ugly] * 17)
    image = np.zeros((HEIGHT, WIDTH), np.uint32)
    full.draw(image, np.full((HEIGHT, WIDTH), np.inf, np.float32), PALETTE)


FLAT = np.zeros((HEIGHT, WIDTH), np.float32)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: Canvas(0, WIDTH, FOCAL), "80 x 0"),
        (lambda: Canvas(HEIGHT, 20_000, FOCAL), "sides of 1 to 16384"),
        (lambda: canvas().begin((0, 0, WIDTH + 1, 5)), "not within 80 x 60"),
        (lambda: canvas().begin((9, 0, 3, 5)), "not within"),
        (lambda: canvas().strips(np.zeros((3, 11)), LIGHT), "11 numbers; 12"),
        (lambda: canvas().draw(None, FLAT[1:].copy(), PALETTE), r"\[59, 80\]; \[60, 80\] in C order"),
        (lambda: canvas().draw(None, np.asfortranarray(FLAT), PALETTE), "C order"),
        (lambda: canvas().draw(FLAT[:9].astype(np.uint32), FLAT.copy(), PALETTE), r"\[9, 80\]"),
        (lambda: canvas().draw(None, FLAT.copy(), PALETTE[:0]), "palette is empty"),
        (lambda: canvas().seen(FLAT[:, 1:].copy()), r"\[60, 79\]"),
    ],
)
def test_what_does_not_fit_the_image_is_refused(wrong: Callable[[], object], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        wrong()
