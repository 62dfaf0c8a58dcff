"""OpenCV's own HOG sees the person as it sees people, and sees nobody where nobody is."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tests.sim.logs import there

from limo_sim.sensing.camera import CameraPose
from limo_sim.sensing.renderer import Renderer
from limo_sim.world.person import Pose
from limo_sim.world.scenario import Camera, Light, Person, Scenario, Vary
from limo_sim.world.variants import of_run

DISTANCES = (1.75, 2.0, 2.5, 3.0, 3.5, 4.0)
SOMEBODY = Scenario(people=(Person(route=((2, 0, 0),)),))

if not hasattr(cv2, "HOGDescriptor"):
    pytest.skip("this OpenCV has no HOGDescriptor", allow_module_level=True)


def found(image: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Boxes of OpenCV's detector with the workshop's parameters, int32 (N, 4)."""
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(np.array(cv2.HOGDescriptor.getDefaultPeopleDetector(), np.float32))
    boxes, _ = hog.detectMultiScale(image, winStride=(8, 8), padding=(4, 4), scale=1.05)
    return np.asarray(boxes, np.int32).reshape(-1, 4)


def holds(box: NDArray[np.int32], person: tuple[int, int, int, int]) -> bool:
    """Whether a detection is this person: intersection over union with the box and its margin at least a half."""
    x, y, w, h = person
    middle, tall = x + w / 2, h / 0.75
    ideal = middle - tall / 4, y + h / 2 - tall / 2, tall / 2, tall
    across = min(box[0] + box[2], ideal[0] + ideal[2]) - max(box[0], ideal[0])
    down = min(box[1] + box[3], ideal[1] + ideal[3]) - max(box[1], ideal[1])
    shared = max(across, 0) * max(down, 0)
    return bool(shared / (box[2] * box[3] + ideal[2] * ideal[3] - shared) >= 0.5)


def rate(scenario: Scenario, distance: float, phases: int, seed: int, swing: float = 1.0) -> float:
    """Share of 8 directions × some phases in which the person, so far from the camera, is found."""
    renderer, camera, hits = Renderer(scenario, np.random.default_rng(seed)), CameraPose(0, 0, 0), []
    for direction in range(8):
        for phase in range(phases):
            pose = Pose(distance, 0.0, direction * math.tau / 8, phase * math.tau / phases, swing)
            image, _, [(_, box)] = renderer.render(camera, [pose], np.random.default_rng([seed, direction, phase]))
            hits.append(any(holds(candidate, there(box)) for candidate in found(image)))
    return float(np.mean(hits))


SLOW = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize(
    ("phases", "seed", "least"), [(2, 3, 0.95), *(pytest.param(12, seed, 0.99, marks=SLOW) for seed in range(3))]
)
def test_a_person_who_walks_is_found(phases: int, seed: int, least: float, distance: float) -> None:
    assert rate(SOMEBODY, distance, phases, seed) >= least


def test_a_person_who_stands_is_found_from_every_side() -> None:
    assert rate(SOMEBODY, 2.5, 1, 0, swing=0.0) == 1.0


@pytest.mark.parametrize(
    ("frames", "seed", "most"), [(20, 1, 0.0), *(pytest.param(500, seed, 0.01, marks=SLOW) for seed in range(2))]
)
def test_nobody_is_found_in_the_empty_arena(frames: int, seed: int, most: float) -> None:
    renderer, random, hits = Renderer(Scenario(), np.random.default_rng(seed)), np.random.default_rng(seed), 0
    for _ in range(frames):
        place = random.uniform((-4, -4, -math.pi), (4, 4, math.pi)).tolist()
        hits += len(found(renderer.render(CameraPose(*place), [], random)[0])) > 0
    assert hits <= most * frames


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", range(6))
def test_other_clothes_and_other_light_change_little(seed: int) -> None:
    light = Light(sun=(0.6, -0.5, -0.9), diffuse=0.6 + 0.05 * seed, ambient=0.5 - 0.04 * seed)
    asked = dataclasses.replace(SOMEBODY, vary=Vary(clothes=True, height=0.1), light=light, camera=Camera(noise=2.0))
    rates = [rate(of_run(asked, seed), distance, phases=3, seed=seed) for distance in (2.0, 3.0)]
    assert np.mean(rates) >= 0.9
