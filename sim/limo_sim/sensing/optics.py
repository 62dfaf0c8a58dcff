"""What a real camera adds to the pinhole: a lens that bends lines, and a shutter that takes time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, HEIGHT, WIDTH
from limo_sim.world.scenario import Camera

with needed(by="the arena's camera"):
    import cv2

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Box = tuple[int, int, int, int]

# The scene moves by no more than this from one picture of an exposure to the next [px], and is drawn no more often than
# that. Chosen: the edge of a person is two pixels wide as it is.
_MOST_SHIFT, _MOST_PICTURES = 1.5, 12
# How fast a person turns about the camera, beside the robot's own turn [rad/s]: 0.75 m/s at 2 m.
_PERSON_TURN = 0.75 / 2.0
_ALONG_BOX = 9  # places on each side of a box whose images tell the box of its image


class Lens:
    """Radial distortion after Brown and Conrady, as OpenCV's `distortPoints` has it: r' = r (1 + k1 r² + k2 r⁴).

    r is the distance from the optical axis at 1 m. Where the lens sees beyond the pinhole's image, the image is
    mirrored at its edge. The focal length is in pixels.
    """

    def __init__(self, k1: float, k2: float, focal_px: float) -> None:
        self._k1, self._k2, self._focal = k1, k2, focal_px
        self.is_plain = k1 == 0.0 and k2 == 0.0  #: whether it bends nothing

    @cached_property
    def _maps(self) -> tuple[F32, F32]:
        """For every pixel the column and the row of the pinhole's image: float32 (480, 640) each."""
        x = (np.arange(WIDTH) - CENTRE_X)[None, :] / self._focal
        y = (np.arange(HEIGHT) - CENTRE_Y)[:, None] / self._focal
        bent = np.hypot(x, y)
        radii = np.linspace(0.0, 2.0, 20_001)
        images = self._bent(radii)
        rising = int(np.argmax(np.diff(images) <= 0)) or len(radii)
        shrink = np.interp(bent, images[:rising], radii[:rising]) / np.maximum(bent, 1e-12)
        columns, rows = CENTRE_X + self._focal * x * shrink, CENTRE_Y + self._focal * y * shrink
        return columns.astype(np.float32), rows.astype(np.float32)

    def image(self, picture: U8) -> U8:
        """Return what the lens makes of a colour image."""
        bent = cv2.remap(picture, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
        return bent.astype(np.uint8, copy=False)

    def depth(self, depth: F32) -> F32:
        """Return what the lens makes of a depth image: nearest pixels, since depths of two things have no mean."""
        bent = cv2.remap(depth, *self._maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT_101)
        return bent.astype(np.float32, copy=False)

    def box(self, box: Box) -> Box | None:
        """Return the box of a box's image: x, y, w, h [px]; None when all of it is outside."""
        left, top, width, height = box
        share = np.linspace(0.0, 1.0, _ALONG_BOX)
        across, along = left - 0.5 + width * share, top - 0.5 + height * share
        columns = np.concatenate([across, across, np.full(_ALONG_BOX, across[0]), np.full(_ALONG_BOX, across[-1])])
        rows = np.concatenate([np.full(_ALONG_BOX, along[0]), np.full(_ALONG_BOX, along[-1]), along, along])
        x, y = (columns - CENTRE_X) / self._focal, (rows - CENTRE_Y) / self._focal
        radius = np.hypot(x, y)
        stretch = self._bent(radius) / np.maximum(radius, 1e-12)
        u, v = CENTRE_X + self._focal * x * stretch, CENTRE_Y + self._focal * y * stretch
        left, top = max(0, math.floor(float(u.min()) + 0.5)), max(0, math.floor(float(v.min()) + 0.5))
        right, foot = min(WIDTH, math.ceil(float(u.max()) + 0.5)), min(HEIGHT, math.ceil(float(v.max()) + 0.5))
        return (left, top, right - left, foot - top) if left < right and top < foot else None

    def _bent(self, radius: F64) -> F64:
        return radius * (1.0 + self._k1 * radius**2 + self._k2 * radius**4)


class Shutter:
    """Rows read one after the other, each exposed for a time; the last row's exposure ends at the stamp.

    A frame is the mean of pictures taken at several instants, each row of those within its own exposure. The focal
    length is in pixels.
    """

    def __init__(self, settings: Camera, focal_px: float) -> None:
        self._exposure, self._readout, self._focal = settings.exposure_s, settings.readout_s, focal_px
        #: Whether all of the image is taken at one instant.
        self.is_instant = self._exposure == 0.0 and self._readout == 0.0

    def expose(self, picture: Callable[[float], U8], turn_rate: float) -> U8:
        """Return the frame of a camera that turns [rad/s].

        `picture` draws the scene as it was so many seconds before the stamp: uint8 (480, 640, 3).
        """
        time = self._exposure + self._readout
        shift = time * (abs(turn_rate) * self._focal + _PERSON_TURN * self._focal)
        count = min(max(2, math.ceil(shift / _MOST_SHIFT)), _MOST_PICTURES)
        shares = self._shares(count)
        frame = np.zeros((HEIGHT, WIDTH, 3), np.float32)
        for number in range(count):
            drawn, rows = picture((number + 0.5) / count * time), np.flatnonzero(shares[number])
            part = slice(int(rows[0]), int(rows[-1]) + 1) if len(rows) else slice(0)
            frame[part] += shares[number, part, None, None] * drawn[part]
        return np.rint(frame).astype(np.uint8)

    def _shares(self, count: int) -> F32:
        """Return how much of each row's light comes from each picture: float32 (count, 480); each row sums to 1."""
        time = self._exposure + self._readout
        # Each row's exposure as ages before the stamp; never shorter than nothing, so that it falls in some picture.
        ends = self._readout * (1.0 - (np.arange(HEIGHT) + 0.5) / HEIGHT)
        begins = ends + max(self._exposure, 1e-9)
        edges = np.linspace(0.0, time + 2e-9, count + 1)[:, None]
        overlap = np.minimum(begins, edges[1:]) - np.maximum(ends, edges[:-1])
        shares = np.maximum(overlap, 0.0)
        return np.asarray(shares / shares.sum(axis=0), dtype=np.float32)
