"""What somebody wears: the colours of shirt and trousers, which tell people apart where their ways cross."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Clothes = NDArray[np.float64]
"""(2, 3): shirt and trousers; red and green share and logarithm of the brightness, each over how far it strays."""

#: Where a person's chest and hips are in a detection window: middle and half height, by its height.
_CHEST, _HIPS = (0.35, 0.07), (0.54, 0.03)
#: Half the width of what is looked at, by the window's height: narrower than somebody from the side.
_HALF_WIDTH = 0.04
#: Added to each channel [of 255], so that the hue of black cloth is not that of the sensor's noise.
_DARK = 8.0
#: How far the same cloth strays in other light.
_STRAY = np.array([0.05, 0.05, 0.5])
#: The most that a shirt and trousers can count: hands and the gap between two legs are seen for trousers.
_MOST = np.array([16.0, 9.0])
#: Clothes that differ by more than this are somebody else's: so much only a shirt can.
OTHER_CLOTHES = 12.0


def clothes_in(image: NDArray[np.uint8], boxes: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return what the person in each box wears.

    Parameters
    ----------
    image
        uint8 (H, W, 3), BGR, or (H, W), in which all clothes are grey.
    boxes
        int32 (N, 4): x, y, w, h of detection windows [px].

    Returns
    -------
    float64 (N, 2, 3): `Clothes` of each; NaN where they are out of the image.
    """
    worn: NDArray[np.float64] = np.full((len(boxes), 2, 3), np.nan)
    # What is no list of boxes is a fault, and told where the robot is stopped for it.
    for index, (x, y, w, h) in enumerate(boxes.tolist() if boxes.shape[1:] == (4,) else ()):
        middle, half = x + w / 2, max(_HALF_WIDTH * h, 1)
        columns = slice(max(round(middle - half), 0), max(round(middle + half), 0))
        for part, (centre, reach) in enumerate((_CHEST, _HIPS)):
            rows = slice(max(round(y + (centre - reach) * h), 0), max(round(y + (centre + reach) * h), 0))
            patch = image[rows, columns]
            if patch.size:
                blue, green, red = np.broadcast_to(np.median(patch, axis=(0, 1)), 3) + _DARK
                total = blue + green + red
                worn[index, part] = red / total, green / total, np.log(total)
    worn /= _STRAY
    return worn


def unlikeness(known: Clothes | None, seen: Clothes | None) -> float:
    """Return how much the colours seen on somebody are not those of known clothes: chi-squared, with an upper end.

    A box that slipped down shows trousers for a shirt: that is no other shirt. What is unknown is not unlike.
    """
    if known is None or seen is None:
        return 0.0
    slipped = known[[1, 1]]
    return min(float(np.minimum(_gaps(lower, seen), _MOST).sum()) for lower in (known, slipped))


def learnt(known: Clothes, seen: Clothes, step: float) -> Clothes:
    """Move known clothes towards what is seen of them, by a share `step`; what is clearly another cloth is left out."""
    same = _gaps(known, seen) < _MOST
    moved: Clothes = known + step * same[:, None] * (seen - known)
    return moved


def _gaps(known: Clothes, seen: Clothes) -> NDArray[np.float64]:
    """Chi-squared of shirt and of trousers."""
    gaps: NDArray[np.float64] = ((seen - known) ** 2).sum(axis=1)
    return gaps
