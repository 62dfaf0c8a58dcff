"""How far a person is, and what that distance means to them."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray


class Zone(str, Enum):
    """Hall's zones of personal space (The Hidden Dimension, 1966), nearest first."""

    INTIMATE = "intimate"
    PERSONAL = "personal"
    SOCIAL = "social"
    PUBLIC = "public"


#: Where each zone but the last ends [m].
ZONE_ENDS = {Zone.INTIMATE: 0.45, Zone.PERSONAL: 1.2, Zone.SOCIAL: 3.6}

#: Side of the square at the centre of a box that the distance is read from [px].
PATCH_PX = 20


def zone_of(distance: float) -> Zone:
    """Return the zone of a person `distance` [m] away."""
    for zone, end in ZONE_ENDS.items():
        if distance <= end:
            return zone
    return Zone.PUBLIC


def box_centre(box: NDArray[np.int32]) -> tuple[int, int]:
    """Return the centre [px] of an int32 (4,) box x, y, w, h."""
    x, y, w, h = (int(value) for value in box)
    return x + w // 2, y + h // 2


def person_depth(depth: NDArray[np.float32], box: NDArray[np.int32], side: int = PATCH_PX) -> float | None:
    """Return how far away the person in a box is [m], None where the camera does not know.

    The median of the valid depths in a square at the centre of the box: it shrugs off the few pixels that see
    past the person or nothing.

    Parameters
    ----------
    depth
        float32 (H, W) [m], not finite or <= 0 where unknown.
    box
        int32 (4,): x, y, w, h [px].
    side
        Side of the square [px].
    """
    x, y = box_centre(box)
    half = side // 2
    patch = depth[max(y - half, 0) : max(y + half, 0), max(x - half, 0) : max(x + half, 0)]
    valid = patch[np.isfinite(patch) & (patch > 0)]
    return float(np.median(valid)) if valid.size else None
