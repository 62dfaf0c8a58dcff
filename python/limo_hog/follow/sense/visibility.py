"""Whether the detector should find a person at a given place: only then is a miss evidence against the track."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.sense.observation import Observation
from limo_hog.follow.sense.ranging import person_depth
from limo_hog.follow.sense.region import Region


@dataclass(frozen=True, slots=True)
class Visibility:
    """Where HOG finds people.

    Attributes
    ----------
    smallest_window
        Height of the model's window, and so of the smallest person's [px].
    near
        Nearer than this a person is often missed, and boxes are on parts of the body [m]. Measured in the arena, by
        robot-centre distance: found at 1.5 m .67, 1.6 m .92, 1.65 m 1.0 of the frames.
    widest
        Larger bearings are out of any image [rad]: twice the Limo's half field of view of 0.62.
    shown
        The part of half a window, above and below its middle, that must be in the image [window heights]. Chosen: .5
        is the whole window; .02 less allows for the middle's own error.
    cut
        Share of the window that may be above the image where a distance is chosen [window heights]. Measured in the
        arena, by camera distance: a .9 m person is found in .92 of the frames at 1.52 m, where .05 is cut, a 1.75 m
        person in .69 at 3.0 m (.10) and in all at 3.5 m (0).
    occluder
        Something nearer than the person by more than this hides them [m]. Measured: the depth at a box's centre was
        never more than 0.5 m off the person in 3,500 frames.
    """

    smallest_window: float = 128
    near: float = 1.7
    widest: float = 1.2
    shown: float = 0.48
    cut: float = 0.06
    occluder: float = 0.5

    def least_distance(self, window: float, centre: float, image_height: int) -> float:
        """Return how near a person may be with their window in the image, but for `cut` of it [m].

        Parameters
        ----------
        window, centre
            Height of the detection window, and its middle below the image's, times the distance [px m].
        image_height
            Of the camera [px].
        """
        return ((0.5 - self.cut) * window - centre) / (image_height / 2)

    def expected(
        self, bearing: float, distance: float, window: float, centre: float, observation: Observation, confirmed: bool
    ) -> bool:
        """Whether a person's whole window should be in the part of the image that was searched.

        Parameters
        ----------
        bearing, distance
            Of the person, from the robot's centre [rad, m].
        window, centre
            Height of the detection window, and its middle below the image's, times the distance [px m].
        observation
            The image that was searched, with its depth.
        confirmed
            Whether the track is known to be a person. Near by, the head and the space HOG wants above it are out of
            the image: that excuses a miss of a person, and not of a track that has yet to prove itself.
        """
        if abs(bearing) > self.widest:
            return False
        column = observation.width / 2 - observation.focal_px * math.tan(bearing)
        height = window / max(distance, 0.3)
        middle = observation.height / 2 + centre / max(distance, 0.3)
        if height < self.smallest_window:
            return False
        cut_off = not self.shown * height <= middle <= observation.height - self.shown * height
        if confirmed and (cut_off or distance < self.near):
            return False
        if not (observation.region or Region(0, 0, observation.width, observation.height, height)).holds(column):
            return False
        return not self._hidden(observation.depth, column, middle, distance)

    def _hidden(self, depth: NDArray[np.float32] | None, column: float, row: float, distance: float) -> bool:
        if depth is None:
            return False
        there = person_depth(depth, np.array([column, row, 0, 0], np.int32))
        return there is not None and there < distance - self.occluder
