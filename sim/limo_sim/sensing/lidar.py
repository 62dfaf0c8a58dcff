"""The planar lidar: all rays at once against the walls, the furniture and people's legs."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.furniture import Disc, Rectangle
from limo_sim.world.rays import meet
from limo_sim.world.scenario import ROOM_HALF

BEAMS = 292
ANGLE_MAX = 2.0
"""First and last beam [rad], right and left of straight ahead."""
RANGE_MIN, RANGE_MAX = 0.12, 8.0

_ANGLES = np.linspace(-ANGLE_MAX, ANGLE_MAX, BEAMS)


def cast(
    x: float, y: float, yaw: float, shapes: Iterable[Disc | Rectangle], half: float = ROOM_HALF
) -> NDArray[np.float64]:
    """Return the distance [m] along every beam to the nearest outer wall, at ± `half` [m], or shape in its plane.

    It is float64 (292,), counter-clockwise from -2 rad, without noise or limits; x, y, yaw are the lidar's pose in the
    arena's frame, inside the walls.
    """
    angles = _ANGLES + yaw
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        walls_x = (np.copysign(half, cos) - x) / cos
        walls_y = (np.copysign(half, sin) - y) / sin
    ranges = np.minimum(walls_x, walls_y)
    discs = [(shape.x - x, shape.y - y, shape.radius) for shape in shapes if isinstance(shape, Disc)]
    if discs:
        dx, dy, radius = np.array(discs).T[..., None]
        along = dx * cos + dy * sin
        inner = radius * radius - (dx * sin - dy * cos) ** 2
        hits = np.where((inner > 0) & (along > 0), along - np.sqrt(np.maximum(inner, 0.0)), np.inf)
        ranges = np.minimum(ranges, hits.min(axis=0))
    for shape in shapes:
        if isinstance(shape, Rectangle):
            ranges = np.minimum(ranges, meet(shape, x, y, cos, sin)[0])
    return ranges


def measure(ranges: NDArray[np.float64], noise_m: float, noise: np.random.Generator) -> NDArray[np.float32]:
    """Turn true distances into what the sensor reports: noisy, and inf outside its limits."""
    measured = ranges + noise_m * noise.standard_normal(len(ranges))
    measured[(measured < RANGE_MIN) | (measured > RANGE_MAX)] = np.inf
    return measured.astype(np.float32)
