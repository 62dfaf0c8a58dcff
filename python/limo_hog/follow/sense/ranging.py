"""How far away a person is, by the depth image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def box_centre(box: NDArray[np.int32]) -> tuple[int, int]:
    """Return the centre [px] of an int32 (4,) box x, y, w, h."""
    x, y, w, h = (int(value) for value in box)
    return x + w // 2, y + h // 2


def person_depth(depth: NDArray[np.float32], box: NDArray[np.int32], side: int = 20) -> float | None:
    """Return how far away the person in a box is [m]; None where the camera does not know.

    The median of the valid depths in a square at the centre of the box: pixels that see past the person, or nothing,
    do not change it as long as they are less than half.

    Parameters
    ----------
    depth
        float32 (H, W) [m], not finite or <= 0 where unknown.
    box
        int32 (4,): x, y, w, h [px].
    side
        Side of the square [px]; the workshop's is 20.
    """
    x, y = box_centre(box)
    half = side // 2
    patch = depth[max(y - half, 0) : max(y + half, 0), max(x - half, 0) : max(x + half, 0)]
    valid = patch[(patch > 0) & (patch < np.inf)]
    return median(valid) if valid.size else None


def median(values: NDArray[np.float32]) -> float:
    """Return the median of (N,) finite numbers, N > 0: as `numpy.median`, without the checks that take most of it."""
    half, values = len(values) // 2, values.copy()
    values.partition(half)
    if len(values) % 2:
        return float(values[half])
    return float((values[:half].max() + values[half]) / 2)


@dataclass(frozen=True, slots=True)
class Strips:
    """Where a detection window shows a person's chest, and what is beside it.

    Attributes
    ----------
    top, bottom
        Of the rows looked at [window heights]. Chosen: the chest, .27 to .5 of HOG's window.
    chest
        Half the width of the strip in the middle [window widths]. Chosen: narrower than a person seen from the side.
    inner, outer
        Edges of the two strips beside it, from the middle [window widths]. Chosen: outside of the arms, which reach to
        .25, and inside of the window, in which HOG was trained to find background.
    beyond
        Depth taken where the camera sees none [m]: further than it reaches.
    known
        Share of pixels that must be valid for a depth to be known [1].
    """

    top: float = 0.27
    bottom: float = 0.5
    chest: float = 0.06
    inner: float = 0.36
    outer: float = 0.46
    beyond: float = 20.0
    known: float = 0.2


STRIPS = Strips()


def stands_out(depth: NDArray[np.float32], box: NDArray[np.int32], strips: Strips = STRIPS) -> float | None:
    """Return how far the surroundings of a box are behind its middle [m]; None where the depth does not tell.

    The inverse depth of a plane is linear in the image, so the plane through the strips left and right of the person
    has, in the middle between them, the mean of their inverse depths. A picture on a wall is in that plane, seen from
    whatever side: 0.

    Parameters
    ----------
    depth
        float32 (H, W) [m], not finite or <= 0 where unknown.
    box
        int32 (4,): x, y, w, h [px].
    strips
        Where to look.
    """
    x, y, w, h = (int(value) for value in box)
    band = depth[max(round(y + strips.top * h), 0) : max(round(y + strips.bottom * h), 0)]
    centre = x + w / 2

    def depth_of(left: float, right: float) -> float | None:
        strip = band[:, max(round(centre + left * w), 0) : max(round(centre + right * w), 0)]
        if strip.size == 0:
            return None
        valid = strip[(strip > 0) & (strip < np.inf)]
        return median(valid) if valid.size > strips.known * strip.size else strips.beyond

    middle = depth_of(-strips.chest, strips.chest)
    sides = [depth_of(-strips.outer, -strips.inner), depth_of(strips.inner, strips.outer)]
    seen = [side for side in sides if side is not None]
    if middle is None or not seen:
        return None
    return len(seen) / sum(1.0 / side for side in seen) - middle


@dataclass(frozen=True, slots=True)
class Outline:
    """How a person's outline is followed upwards in the depth image.

    Attributes
    ----------
    half_width
        Half the width of the strip looked at [window widths]. Chosen: a head is a quarter of HOG's window wide.
    least_half_px
        And at least this [px]: the middle of a box strays by 3 px.
    tolerance
        Depth within which a pixel is the person's [m]. Chosen: a trunk and an arm; people keep more from walls.
    share
        Part of the valid pixels of a row that must be the person's [1].
    gap_px
        So many rows without the person end the outline [px]. Chosen: more than the depth image's holes.
    """

    half_width: float = 0.08
    least_half_px: int = 4
    tolerance: float = 0.35
    share: float = 0.25
    gap_px: int = 5


OUTLINE = Outline()


def top_row(depth: NDArray[np.float32], box: NDArray[np.int32], person: float, outline: Outline = OUTLINE) -> int:
    """Return the highest image row [px] of the person in a box; 0 where they reach the image's edge or beyond.

    Parameters
    ----------
    depth
        float32 (H, W) [m], not finite or <= 0 where unknown.
    box
        int32 (4,): x, y, w, h [px].
    person
        Depth of the person [m].
    outline
        How to follow the outline.
    """
    column, row = box_centre(box)
    half = max(round(outline.half_width * int(box[2])), outline.least_half_px)
    # A copy by columns: the sums over a row's few pixels are sums of long vectors.
    strip = np.ascontiguousarray(depth[: max(row, 1), max(column - half, 0) : max(column + half, 1)].T)
    with np.errstate(invalid="ignore"):
        near = (np.abs(strip - person) < outline.tolerance).sum(axis=0, dtype=np.int16)
    known = ((strip > 0) & (strip < np.inf)).sum(axis=0, dtype=np.int16)
    gap = 0
    for at, empty in enumerate((near < np.maximum(outline.share * known, 1))[::-1].tolist(), 1):
        gap = gap + 1 if empty else 0
        if gap == outline.gap_px:
            return len(near) - at + gap
    return 0
