"""A generated picture of a street with people; detecting in it takes as long as in a photograph."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

#: Parts of a person standing before us: ends (x, y) and radius as shares of the height, x from the middle,
#: y from the floor; and which of the person's three colours it has (skin, shirt, trousers).
_PARTS = (
    ((-0.055, 0.03), (-0.05, 0.27), 0.030, 2),
    ((0.055, 0.03), (0.05, 0.27), 0.030, 2),
    ((-0.05, 0.27), (-0.04, 0.50), 0.043, 2),
    ((0.05, 0.27), (0.04, 0.50), 0.043, 2),
    ((-0.035, 0.52), (0.035, 0.52), 0.058, 2),
    ((-0.135, 0.78), (-0.16, 0.48), 0.026, 1),
    ((0.135, 0.78), (0.16, 0.48), 0.026, 1),
    ((-0.05, 0.60), (-0.07, 0.76), 0.062, 1),
    ((0.05, 0.60), (0.07, 0.76), 0.062, 1),
    ((-0.10, 0.79), (0.10, 0.79), 0.038, 1),
    ((0.0, 0.80), (0.0, 0.86), 0.028, 0),
    ((0.0, 0.89), (0.0, 0.93), 0.052, 0),
)


def street(width: int, height: int, channels: int, *, people: bool = True) -> NDArray[np.uint8]:
    """Draw the street of these arguments, with people of many sizes or without: uint8 (height, width[, 3]), BGR."""
    rng = np.random.default_rng([width, height])
    ground = np.linspace(200, 120, height, dtype=np.float32)[:, None, None]
    canvas = np.broadcast_to(ground, (height, width, 3)) + rng.normal(0, 6, 3).astype(np.float32)
    for _ in range(40):
        _house(canvas, rng)
    count = max(2, width // 160) if people else 0
    places = rng.permutation((np.arange(count) + 0.5) / count) * width
    # From near to far, each in a strip of the street, the far ones higher up.
    for size, place in zip(np.geomspace(0.8 * height, min(105, 0.7 * height), count), places, strict=True):
        _person(canvas, rng, float(size), float(place))
    canvas += rng.normal(0, 2, canvas.shape).astype(np.float32)
    picture = np.clip(np.rint(canvas), 0, 255).astype(np.uint8)
    return picture if channels == 3 else np.ascontiguousarray(picture[..., 1])


def _house(canvas: NDArray[np.float32], rng: np.random.Generator) -> None:
    height, width = canvas.shape[:2]
    w, h = int(width * rng.uniform(0.02, 0.2)), int(height * rng.uniform(0.03, 0.4))
    x, y = int(rng.integers(-w // 2, width)), int(rng.integers(-h // 2, max(1, height * 2 // 3)))
    canvas[max(0, y) : y + h, max(0, x) : x + w] += rng.normal(0, 14) + rng.normal(0, 5, 3)


def _person(canvas: NDArray[np.float32], rng: np.random.Generator, size: float, middle: float) -> None:
    height = canvas.shape[0]
    floor = 0.5 * height + 0.55 * size
    colours = [(120, 150, 190), rng.uniform(20, 100, 3), rng.uniform(15, 60, 3)]
    for (x0, y0), (x1, y1), radius, colour in _PARTS:
        ends = [(middle + size * x, floor - size * y) for x, y in ((x0, y0), (x1, y1))]
        _capsule(canvas, ends, size * radius, np.asarray(colours[colour], np.float32))


def _capsule(
    canvas: NDArray[np.float32], ends: list[tuple[float, float]], radius: float, colour: NDArray[np.float32]
) -> None:
    """Fill what lies within `radius` of the line between two points, with a soft edge."""
    (x0, y0), (x1, y1) = ends
    left, top = max(0, math.floor(min(x0, x1) - radius)), max(0, math.floor(min(y0, y1) - radius))
    patch = canvas[top : math.ceil(max(y0, y1) + radius) + 1, left : math.ceil(max(x0, x1) + radius) + 1]
    y, x = np.mgrid[top : top + patch.shape[0], left : left + patch.shape[1]].astype(np.float32)
    along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2)
    along = np.clip(along, 0, 1)
    distance = np.hypot(x - x0 - along * (x1 - x0), y - y0 - along * (y1 - y0))
    cover = np.clip(radius - distance + 0.5, 0, 1)[..., None]
    # Rounder to the eye than a flat cut-out: darker to the side.
    shade = 1 - 0.25 * np.clip(distance / radius, 0, 1)[..., None]
    patch += cover * (colour * shade - patch)
