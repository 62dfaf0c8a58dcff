"""How far away a person is, by the depth image."""

from __future__ import annotations

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
    valid = patch[np.isfinite(patch) & (patch > 0)]
    return float(np.median(valid)) if valid.size else None
