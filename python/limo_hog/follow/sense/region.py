"""The part of the next image to search: where the followed person is expected. The rest takes most of the time."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Region:
    """Part of an image worth searching.

    Attributes
    ----------
    x, y, width, height
        Within the image [px], top left corner first.
    window_height
        Expected height of the detection window [px]: the person's, with the margin HOG was trained with.
    """

    x: int
    y: int
    width: int
    height: int
    window_height: float

    def holds(self, column: float) -> bool:
        """Whether an image column [px] is within the region, by half an expected window's width."""
        margin = self.window_height / 4
        return self.x + margin <= column <= self.x + self.width - margin


@dataclass(frozen=True, slots=True)
class RegionSize:
    """How large a region is around the expected window.

    Attributes
    ----------
    widths, heights
        Sides, in expected window widths and heights [1]. Chosen: half a window to either side for a step and the
        prediction's error, an eighth above and below for the gait.
    grid
        Sides are multiples of this [px], so that few different image sizes occur and buffers are used again.
    most
        A region larger than this share of the image is not worth it: all of the image is searched [1]. Chosen.
    widest, nearest
        Larger bearings are out of any image [rad]; a nearer person fills it [m].
    """

    widths: float = 2.0
    heights: float = 1.25
    grid: int = 16
    most: float = 0.7
    widest: float = 1.2
    nearest: float = 0.3

    def around(
        self, bearing: float, distance: float, window: float, centre: float, focal_px: float, width: int, height: int
    ) -> Region | None:
        """Return where to look for a person expected at a bearing [rad] and a distance [m] from the camera.

        Parameters
        ----------
        window
            Height of the detection window times the distance [px m].
        centre
            Middle of the window below the image's middle, times the distance [px m]; above is negative.
        focal_px, width, height
            The camera's focal length and image size [px].

        Returns
        -------
        None where the expected place is not in the image, or the region would be most of it.
        """
        if abs(bearing) > self.widest or distance < self.nearest:
            return None
        expected = window / distance
        x = width / 2 - focal_px * math.tan(bearing)
        y = height / 2 + centre / distance
        if not 0 <= x < width:
            return None
        left, right = self._span(x, self.widths * expected / 2, width)
        top, bottom = self._span(y, self.heights * expected, height)
        if (right - left) * (bottom - top) > self.most * width * height:
            return None
        return Region(left, top, right - left, bottom - top, expected)

    def _span(self, middle: float, length: float, limit: int) -> tuple[int, int]:
        low = max(0, math.floor((middle - length / 2) / self.grid) * self.grid)
        high = min(limit, math.ceil((middle + length / 2) / self.grid) * self.grid)
        return low, max(high, low)
