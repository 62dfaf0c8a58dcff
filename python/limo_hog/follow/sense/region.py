"""Looking only where the followed person should be: most of the detector's time goes into the rest."""

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


#: The region is so many expected windows wide and high: room for steps, for the gait, and for HOG's margin.
_WIDTHS, _HEIGHTS = 2.0, 1.25
#: Sides are multiples of this [px], so that few different sizes occur.
_GRID = 16


def region_around(
    bearing: float, distance: float, window: float, centre_y: float, focal_px: float, width: int, height: int
) -> Region | None:
    """Return where to look for somebody expected at a bearing [rad] and a distance [m].

    Parameters
    ----------
    bearing, distance
        As seen from the camera.
    window
        Height of the detection window times the distance [px m].
    centre_y
        Middle of the window above or below the image's middle, times the distance [px m]; down is positive.
    focal_px, width, height
        The camera.

    Returns
    -------
    None where the expected place is not in the image, or the region would be most of it.
    """
    if abs(bearing) > 1.2 or distance < 0.3:
        return None
    expected = window / distance
    x = width / 2 - focal_px * math.tan(bearing)
    y = height / 2 + centre_y / distance
    if not 0 <= x < width:
        return None
    left, right = _span(x, _WIDTHS * expected / 2, width)
    top, bottom = _span(y, _HEIGHTS * expected, height)
    if (right - left) * (bottom - top) > 0.7 * width * height:
        return None
    return Region(left, top, right - left, bottom - top, expected)


def _span(middle: float, length: float, limit: int) -> tuple[int, int]:
    low = max(0, math.floor((middle - length / 2) / _GRID) * _GRID)
    high = min(limit, math.ceil((middle + length / 2) / _GRID) * _GRID)
    return low, max(high, low)
