"""The lens bends as OpenCV's model says; the shutter blurs and leans what moves; the light changes."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import drive, there

from limo_hog.follow.robot import LIMO, Twist
from limo_sim.run.arena import Arena
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, HEIGHT, WIDTH, TrueFrame
from limo_sim.sensing.optics import Lens, Shutter
from limo_sim.world.scenario import Camera, Depth, Furniture, Light, Person, Robot, Scenario

MATRIX = np.array([[LIMO.focal_px(640), 0, CENTRE_X], [0, LIMO.focal_px(640), CENTRE_Y], [0, 0, 1.0]])
# A dark pillar in the middle of the image, nothing else.
POST = Scenario(furniture=(Furniture("coat_rack", 1.5, 0.0, math.pi / 2),), camera=Camera(noise=0.0))


@pytest.mark.parametrize(("k1", "k2"), [(-0.15, -0.02), (-0.1, 0.0), (0.3, 0.1), (0.1, -0.02)])
def test_a_place_in_the_image_moves_as_opencvs_camera_model_says(k1: float, k2: float) -> None:
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    places = [(320, 240), (150, 100), (500, 380), (330, 60), (60, 300)]
    for column, row in places:
        cv2.circle(picture, (column, row), 6, (255, 255, 255), -1)
    bent = Lens(k1, k2, LIMO.focal_px(640)).image(picture)[..., 0].astype(float)
    rays = np.array([(*place, 1.0) for place in places]) @ np.linalg.inv(MATRIX).T
    expected = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), MATRIX, np.array([k1, k2, 0.0, 0.0]))[0].reshape(-1, 2)
    for u, v in expected:
        if not (12 < u < WIDTH - 12 and 12 < v < HEIGHT - 12):
            continue
        places_near = np.mgrid[round(v) - 12 : round(v) + 13, round(u) - 12 : round(u) + 13]
        light = bent[tuple(places_near)]
        assert (places_near * light).sum(axis=(1, 2)) / light.sum() == pytest.approx((v, u), abs=0.3)


@pytest.mark.parametrize("k1", [-0.12, 0.25])
def test_the_true_box_goes_round_the_bent_silhouette(k1: float) -> None:
    person = Person(route=((2.2, 0.9, 3600.0),))
    scenario = Scenario(camera=Camera(k1=k1), depth=Depth(noise=0.0, invalid=0.0))
    frame = Arena(dataclasses.replace(scenario, people=(person,)), 0).frame()
    empty = Arena(scenario, 0).frame()
    rows, columns = np.nonzero(frame.depth < empty.depth - 0.05)
    left, top, width, height = there(there(frame.truth.people[0]).box)
    # Nothing is cut off; a box's corner may bend farther than the silhouette, which has none.
    edges = columns.min() - left, rows.min() - top, left + width - columns.max() - 1, top + height - rows.max() - 1
    assert all(-1 <= outside <= 9 for outside in edges)


@pytest.mark.parametrize(("x", "y"), [(1.7, 1.26), (2.5, 1.7), (2.5, 1.8), (3.5, 2.4)])
def test_what_the_lens_moves_out_of_the_image_is_not_visible(x: float, y: float) -> None:
    people, pillar = (Person(route=((x, y, 3600.0),)),), (Furniture("pillar", x, -y),)
    scenario = Scenario(depth=Depth(noise=0.0, invalid=0.0), camera=Camera(k1=0.3, k2=0.1))
    bent = Arena(dataclasses.replace(scenario, people=people, furniture=pillar), 0)
    assert np.array_equal(bent.frame().depth, Arena(scenario, 0).frame().depth, equal_nan=True)
    plain = Arena(Scenario(people=people, furniture=pillar), 0)
    for arena, within in ((plain, True), (bent, False)):
        person = there(arena.frame().truth.people[0])
        for visible, box in ((person.visible, person.box), *arena.furniture_in_frame()):
            assert bool(visible > 0.0) is within
            assert (box is not None) is within


def turned(camera: Camera, rate: float) -> TrueFrame:
    """Return a frame taken while the robot turns, by which time it looks straight ahead again."""
    scenario = dataclasses.replace(POST, camera=dataclasses.replace(camera, noise=0.0, rate_hz=50.0))
    arena = Arena(dataclasses.replace(scenario, robot=Robot(wheel_acceleration=10.0)), 0)
    return drive(arena, 0.6, Twist(0.0, rate)).frame()


def darkness(frame: TrueFrame, row: int) -> NDArray[np.float64]:
    line = frame.image[row - 3 : row + 4].astype(float).mean(axis=(0, 2))
    return np.asarray(np.maximum(np.median(line) - line, 0.0))


def spread(line: NDArray[np.float64]) -> tuple[float, float]:
    """Return the mean and the standard deviation of the columns of something dark [px]."""
    columns = np.arange(len(line))
    mean = (columns * line).sum() / line.sum()
    return float(mean), float(math.sqrt(((columns - mean) ** 2 * line).sum() / line.sum()))


def test_what_moves_while_the_shutter_is_open_is_blurred_by_that_much() -> None:
    exposure, rate = 0.04, 0.6
    sharp, blurred = turned(Camera(), rate), turned(Camera(exposure_s=exposure), rate)
    # The pole at the height of the horizon: a box filter as long as the turn, to the side it came from.
    (at, wide), (moved, wider) = (spread(darkness(frame, 215)) for frame in (sharp, blurred))
    length = rate * exposure * LIMO.focal_px(640) * (1 + ((at - CENTRE_X) / LIMO.focal_px(640)) ** 2)
    assert moved - at == pytest.approx(-length / 2, abs=1.0)
    assert wider == pytest.approx(math.sqrt(wide**2 + length**2 / 12), rel=0.1)
    at_rest = turned(Camera(), 0.0).image, turned(Camera(exposure_s=exposure), 0.0).image
    assert np.abs(at_rest[0].astype(int) - at_rest[1]).max() <= 1


def test_a_rolling_shutter_leans_what_moves() -> None:
    readout, rate = 0.04, 0.6
    rolling, instant = turned(Camera(readout_s=readout), rate), turned(Camera(), rate)
    rows = (100, 215)
    places = [spread(darkness(instant, row))[0] for row in rows]
    lean = [spread(darkness(rolling, row))[0] - place for row, place in zip(rows, places, strict=True)]
    for row, place, moved in zip(rows, places, lean, strict=True):
        age = readout * (1 - (row + 0.5) / HEIGHT)
        ahead = (place - CENTRE_X) / LIMO.focal_px(640)
        assert moved == pytest.approx(-rate * age * LIMO.focal_px(640) * (1 + ahead**2), abs=1.5)
    assert abs(lean[0]) > abs(lean[1]) + 1.0


def test_every_row_gets_all_of_its_light_and_depth_and_truth_are_of_the_stamp() -> None:
    grey = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    for camera in (Camera(exposure_s=0.03), Camera(readout_s=0.03), Camera(exposure_s=0.02, readout_s=0.1)):
        assert (Shutter(camera, LIMO.focal_px(640)).expose(lambda _: grey, 1.5) == 200).all()
    sharp, blurred = turned(Camera(), 0.6), turned(Camera(exposure_s=0.05, readout_s=0.05), 0.6)
    np.testing.assert_array_equal(sharp.depth, blurred.depth)
    assert sharp.truth == blurred.truth


def test_the_light_goes_down_and_comes_back() -> None:
    scenario = Scenario(light=Light(swing=0.6, swing_s=4.0), camera=Camera(noise=0.0))
    arena = Arena(scenario, 0)
    means = [drive(arena, seconds).frame().image.mean() for seconds in (0, 1, 1, 1, 1)]
    assert np.array(means) / means[0] == pytest.approx([1.0, 0.7, 0.4, 0.7, 1.0], abs=0.01)
