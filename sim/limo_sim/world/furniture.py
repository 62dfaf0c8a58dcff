"""Furniture: each kind as solids for the camera, a footprint for collisions, and shapes for the lidar.

Lengths are metres; a piece's own frame is x forward, y left, z up from the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from limo_sim.world.schema import WIDEST, one_of, required, within

Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Frustum:
    """An upright cone or cylinder without lids: centre (x, y), from z0 (radius r0) up to z1 (radius r1)."""

    x: float
    y: float
    z0: float
    z1: float
    r0: float
    r1: float
    colour: Colour


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: centre (x, y), half sizes, from z0 to z1, turned by yaw."""

    x: float
    y: float
    half_x: float
    half_y: float
    z0: float
    z1: float
    colour: Colour
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Disc:
    """A round obstacle as the floor plan shows it."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangular obstacle as the floor plan shows it."""

    x: float
    y: float
    half_x: float
    half_y: float
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Piece:
    """A kind of furniture: solids for the camera, the footprint for collisions, shapes for the lidar."""

    solids: tuple[Frustum | Box, ...]
    footprint: Disc | Rectangle
    scanned: tuple[Disc | Rectangle, ...]

    @property
    def extent(self) -> tuple[float, float]:
        """Radius and height of the upright cylinder about the piece's middle that holds its solids [m]."""
        reaches = (
            math.hypot(solid.x, solid.y)
            + (math.hypot(solid.half_x, solid.half_y) if isinstance(solid, Box) else max(solid.r0, solid.r1))
            for solid in self.solids
        )
        return max(reaches), max(solid.z1 for solid in self.solids)


_STONE: Colour = (176, 172, 164)
_WOOD: Colour = (150, 108, 72)
_STEEL: Colour = (92, 94, 98)
_ORANGE: Colour = (214, 92, 34)
_WHITE: Colour = (226, 226, 222)
_CARDBOARD: Colour = (172, 134, 92)
_POSTS = ((-0.235, -0.155), (-0.235, 0.155), (0.235, -0.155), (0.235, 0.155))
_LEGS = ((-0.14, -0.13), (-0.14, 0.13), (0.14, -0.13), (0.14, 0.13))

KINDS: dict[str, Piece] = {
    "pillar": Piece(
        solids=(Frustum(0, 0, 0.0, 1.1, 0.15, 0.15, _STONE),), footprint=Disc(0, 0, 0.15), scanned=(Disc(0, 0, 0.15),)
    ),
    "cone": Piece(
        solids=(
            Box(0, 0, 0.2, 0.2, 0.0, 0.03, (48, 48, 50)),
            Frustum(0, 0, 0.03, 0.75, 0.18, 0.03, _ORANGE),
            Frustum(0, 0, 0.30, 0.44, 0.126, 0.097, _WHITE),
        ),
        footprint=Rectangle(0, 0, 0.2, 0.2),
        scanned=(Disc(0, 0, 0.163),),
    ),
    # of all kinds the most like a person to HOG: head, neck and trunk
    "bollard": Piece(
        solids=(
            Frustum(0, 0, 0.0, 0.70, 0.13, 0.13, _STONE),
            Frustum(0, 0, 0.70, 0.82, 0.05, 0.05, _STONE),
            Frustum(0, 0, 0.78, 0.92, 0.07, 0.06, _STONE),
        ),
        footprint=Disc(0, 0, 0.13),
        scanned=(Disc(0, 0, 0.13),),
    ),
    "coat_rack": Piece(
        solids=(
            Box(0, 0, 0.13, 0.13, 0.0, 0.025, _STEEL),
            Frustum(0, 0, 0.025, 1.0, 0.018, 0.018, _STEEL),
            Box(0, 0, 0.012, 0.16, 0.90, 0.92, _STEEL),
            Frustum(0, -0.10, 0.42, 0.88, 0.09, 0.045, (74, 86, 62)),
            Frustum(0.02, 0.11, 0.55, 0.89, 0.075, 0.035, (128, 62, 54)),
        ),
        footprint=Disc(0, 0, 0.17),
        scanned=(Disc(0, 0, 0.018),),
    ),
    "chair": Piece(
        solids=(
            *(Frustum(x, y, 0.0, 0.28, 0.014, 0.017, _WOOD) for x, y in _LEGS),
            Box(0, 0, 0.17, 0.16, 0.28, 0.31, _WOOD),
            Box(-0.155, 0, 0.015, 0.16, 0.40, 0.60, _WOOD),
            *(Box(-0.155, y, 0.012, 0.012, 0.31, 0.40, _WOOD) for y in (-0.13, 0.13)),
        ),
        footprint=Rectangle(0, 0, 0.17, 0.16),
        scanned=tuple(Disc(x, y, 0.015) for x, y in _LEGS),
    ),
    "trolley": Piece(
        solids=(
            *(Box(x, y, 0.012, 0.012, 0.03, 0.75, _STEEL) for x, y in _POSTS),
            Box(0, 0, 0.25, 0.17, 0.08, 0.13, _STEEL),
            Box(0, 0, 0.25, 0.17, 0.48, 0.50, _STEEL),
            Box(0.04, 0.02, 0.16, 0.12, 0.13, 0.38, _CARDBOARD),
            Box(-0.08, 0, 0.12, 0.13, 0.50, 0.68, _CARDBOARD),
        ),
        footprint=Rectangle(0, 0, 0.25, 0.17),
        scanned=(Rectangle(0, 0, 0.25, 0.17),),
    ),
}


def reach(shape: Disc | Rectangle) -> float:
    """Radius of the circle about the piece's middle that holds its footprint [m]."""
    size = shape.radius if isinstance(shape, Disc) else math.hypot(shape.half_x, shape.half_y)
    return math.hypot(shape.x, shape.y) + size


def placed(shape: Disc | Rectangle, x: float, y: float, yaw: float) -> Disc | Rectangle:
    """Move a floor-plan shape from its piece's frame into the arena."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    at_x, at_y = x + cos * shape.x - sin * shape.y, y + sin * shape.x + cos * shape.y
    if isinstance(shape, Disc):
        return Disc(at_x, at_y, shape.radius)
    return Rectangle(at_x, at_y, shape.half_x, shape.half_y, shape.yaw + yaw)


def distance_to(shape: Disc | Rectangle, x: float, y: float) -> float:
    """Distance [m] from a point to a shape's edge; negative inside."""
    dx, dy = x - shape.x, y - shape.y
    if isinstance(shape, Disc):
        return math.hypot(dx, dy) - shape.radius
    cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
    across_x = abs(cos * dx + sin * dy) - shape.half_x
    across_y = abs(cos * dy - sin * dx) - shape.half_y
    return math.hypot(max(across_x, 0.0), max(across_y, 0.0)) + min(max(across_x, across_y), 0.0)


@dataclass(frozen=True, slots=True)
class Furniture:
    """A piece of one of the known kinds, standing at (x, y)."""

    kind: str = one_of(tuple(KINDS))
    x: float = required(-WIDEST, WIDEST)
    y: float = required(-WIDEST, WIDEST)
    yaw: float = within(0.0, -2 * math.pi, 2 * math.pi)

    @property
    def footprint(self) -> Disc | Rectangle:
        """What the robot bumps into, in the arena's frame."""
        return placed(KINDS[self.kind].footprint, self.x, self.y, self.yaw)
