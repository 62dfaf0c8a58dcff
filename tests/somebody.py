"""Somebody 3 m ahead of the arena's camera, and a detector that finds one box in any image."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Scenario


def somebody_ahead() -> NDArray[np.uint8]:
    """Return what the camera shows, uint8 (480, 640, 3), BGR."""
    return Arena(Scenario.load("standing"), 0).frame().image


@dataclass
class OneBox:
    """A detector that remembers the images it was given."""

    images: list[NDArray[np.uint8]] = field(default_factory=list)

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        self.images.append(image)
        return Detections(np.array([[10, 20, 64, 128]], np.int32), np.array([1.0]))
