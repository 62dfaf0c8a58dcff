"""Draw the pictures of the arena in docs/simulator.md: `uv run python benches/pictures.py`.

Each is of one of the scenarios in examples/arena, seen by the robot's camera at chosen instants, side by side.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Robot, Scenario

ROOT = Path(__file__).parents[1]
SCENARIOS, IMAGES = ROOT / "examples" / "arena", ROOT / "docs" / "images"
#: For each picture the views: seconds after the start, and where the robot stands (x, y, yaw); None: at its start.
VIEWS: dict[str, list[tuple[float, tuple[float, float, float] | None]]] = {
    "flat": [(2.0, None), (8.0, (1.9, -0.8, 1.3))],
    "corridor": [(3.0, None), (9.5, (-4.0, 0.3, -0.05))],
    "crowd": [(2.0, None), (4.5, None)],
    "adult": [(0.5, None), (2.5, None)],
    "posters": [(1.0, None), (7.0, (1.6, -0.6, 0.35))],
}
SEEN = 400  # rows of a frame; below them there is only floor [px]
WIDTH = 480  # of each view in a picture [px]
QUALITY = 82  # of the JPEG files


def view(scenario: Scenario, seconds: float, place: tuple[float, float, float] | None) -> NDArray[np.uint8]:
    """Return what the camera of a standing robot sees."""
    if place is not None:
        scenario = dataclasses.replace(scenario, robot=Robot(*place))
    arena = Arena(scenario, 0)
    while arena.time < seconds:
        arena.step()
    image = arena.frame().image[:SEEN]
    size = WIDTH, round(image.shape[0] * WIDTH / image.shape[1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def main() -> None:
    """Write a JPEG file for each scenario."""
    for name, views in VIEWS.items():
        scenario = Scenario.load(SCENARIOS / f"{name}.toml")
        picture = np.hstack([view(scenario, *one) for one in views])
        path = IMAGES / f"{name}.jpg"
        cv2.imwrite(str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
