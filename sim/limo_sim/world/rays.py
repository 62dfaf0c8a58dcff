"""Where rays meet a rectangle of the floor plan: for the camera, the lidar, and ways round obstacles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.furniture import Rectangle

Rays = NDArray[Any]
"""float32 or float64, of any shape; what is returned is of the same kind."""


def slab(origin: Any, direction: Rays, half: Any) -> tuple[Rays, Rays]:
    """Where rays enter and leave the layer -half … half, in lengths of their direction."""
    tiny = direction.dtype.type(1e-12)
    inverse = 1.0 / np.where(np.abs(direction) < tiny, tiny, direction)
    one, other = (-half - origin) * inverse, (half - origin) * inverse
    return np.minimum(one, other), np.maximum(one, other)


def meet(shape: Rectangle, x: float, y: float, ahead_x: Rays, ahead_y: Rays) -> tuple[Rays, NDArray[np.int64]]:
    """Return where rays from a place outside meet a rectangle, and the side they meet.

    The distance is in lengths of the rays' direction, inf where they miss; the sides 0 … 3 are +x, +y, -x, -y of the
    rectangle's own frame.
    """
    cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
    from_x, from_y = x - shape.x, y - shape.y
    along_x, along_y = cos * ahead_x + sin * ahead_y, cos * ahead_y - sin * ahead_x
    in_x, out_x = slab(cos * from_x + sin * from_y, along_x, shape.half_x)
    in_y, out_y = slab(cos * from_y - sin * from_x, along_y, shape.half_y)
    enters = np.maximum(in_x, in_y)
    hit = (enters < np.minimum(out_x, out_y)) & (enters > 0)
    side = np.where(in_x > in_y, 2 * (along_x > 0), 1 + 2 * (along_y > 0))
    return np.where(hit, enters, np.inf).astype(ahead_x.dtype), side
