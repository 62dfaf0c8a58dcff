"""People who are known well and boxes on them, made up."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise
from limo_hog.follow.tracks.person import Person

NOISE, POSE = Noise(), Odometry()
#: The height of the window around a person at a metre [px], and the colours of two kinds of clothes.
WINDOW = 536.0
IN_RED: NDArray[np.float64] = np.array([[10.0, 4.0, 10.0], [6.0, 6.0, 9.0]])
IN_GREEN: NDArray[np.float64] = np.array([[5.0, 10.0, 10.0], [6.0, 6.0, 9.0]])


def a_person(number: int, distance: float, bearing: float = 0.0, clothes: NDArray[np.float64] | None = None) -> Person:
    """A person who is known well, last seen at time 0."""
    sharp = replace(NOISE, range=0.05, bearing=0.01, velocity=0.1)
    track = kalman.initiate(0.0, bearing, distance, POSE, sharp)
    return Person(number, track, 0.0, 5.0, WINDOW, -120.0, confirmed=True, age=50, clothes=clothes)


def box(distance: float, bearing: float = 0.0, clothes: NDArray[np.float64] | None = None) -> Measurement:
    """A box on the whole of a person."""
    height, centre = round(WINDOW / distance), -120.0 / distance
    return Measurement(bearing, distance, height, centre, 2.0, clothes, window=WINDOW, middle=-120.0)
