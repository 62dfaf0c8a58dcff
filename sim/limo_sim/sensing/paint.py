"""What is on the walls: bricks or boards, posters and doors, drawn by code; no photograph.

Every side of a wall has a picture, made when the side is first seen, in full size and halved again and again; the
camera sees it through the homography of the side's plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, WIDTH, CameraPose
from limo_sim.world.furniture import Rectangle
from limo_sim.world.people import door_of
from limo_sim.world.scenario import WALL_HEIGHT, Scenario

with needed(by="the arena's camera"):
    import cv2

U8 = NDArray[np.uint8]
F64 = NDArray[np.float64]

_FINE = 160.0  # resolution of a wall's picture [px/m]: the camera's at 2.8 m
_BRICK, _BOARD = (0.21, 0.065), (0.14, 1.0)  # width, height [m]: a German brick with its joint; a floor board
_JOINT = 0.012  # [m]
# A poster's width, height and lower edge [m]; a door's margin beside and above a person, in statures. Chosen.
_POSTER_WIDTH, _POSTER_HEIGHT, _POSTER_LOW = (0.34, 0.46), (0.74, 0.90), (0.04, 0.08)
_DOOR_HALF, _DOOR_HIGH = 0.34, 1.12
_DOOR_COLOUR = (38, 36, 34)
_INKS = ((42, 40, 38), (120, 52, 30), (40, 66, 150), (44, 96, 52), (30, 36, 92))
_PAPERS = ((222, 226, 228), (186, 206, 216), (150, 190, 214), (206, 190, 160))


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a wall."""

    start: tuple[float, float]  #: left end of the side for who stands before it [m]
    along: tuple[float, float]  #: unit vector from there to the right
    length: float  #: of the side [m]
    grey: float  #: its brightness, 0 … 255


def sides_of(half: float, walls: Sequence[Rectangle], greys: Sequence[float]) -> list[Side]:
    """Return the sides of the outer walls at +x, +y, -x, -y, then +x, +y, -x, -y of each inner wall's own frame."""
    sides = [
        Side((half, half), (0.0, -1.0), 2 * half, greys[0]),
        Side((-half, half), (1.0, 0.0), 2 * half, greys[1]),
        Side((-half, -half), (0.0, 1.0), 2 * half, greys[2]),
        Side((half, -half), (-1.0, 0.0), 2 * half, greys[3]),
    ]
    for number, wall in enumerate(walls, start=1):
        cos, sin = math.cos(wall.yaw), math.sin(wall.yaw)
        for face, (sign_x, sign_y, way_x, way_y, length) in enumerate(
            (
                (1, -1, 0, 1, 2 * wall.half_y),
                (1, 1, -1, 0, 2 * wall.half_x),
                (-1, 1, 0, -1, 2 * wall.half_y),
                (-1, -1, 1, 0, 2 * wall.half_x),
            )
        ):
            x, y = sign_x * wall.half_x, sign_y * wall.half_y
            start = wall.x + cos * x - sin * y, wall.y + sin * x + cos * y
            along = cos * way_x - sin * way_y, sin * way_x + cos * way_y
            sides.append(Side(start, along, length, greys[4 * number + face]))
    return sides


class Paint:
    """The pictures on the walls of one scenario."""

    def __init__(self, scenario: Scenario, sides: list[Side]) -> None:
        self._texture, self._sides = scenario.walls_texture, sides
        around = scenario.surroundings
        passing = (
            person
            for person in scenario.people
            if person.walks_in or (person.yields and math.isfinite(person.leaves_s))
        )
        self._doors = [(door_of(person, around), person.height) for person in passing]
        plain = self._texture.kind == "plain" and not self._texture.posters
        doorless = (n for n, side in enumerate(sides) if not any(_on(side, place) for place, _ in self._doors))
        self._bare = set(doorless) if plain else set()
        self._pictures: dict[int, list[U8]] = {}

    def draw(self, image: U8, columns: tuple[NDArray[Any], NDArray[np.int64]], camera: CameraPose) -> None:
        """Draw what is on the walls over them in an image, uint8 (480, 640, 4): blue, green, red, 0.

        `columns`, (640,) each, are how far away the side is that the camera sees in each column [m], and which it is.
        """
        depth, faces = columns
        edges = [0, *(np.flatnonzero(np.diff(faces)) + 1).tolist(), WIDTH]
        for first, end in pairwise(edges):
            number = int(faces[first])
            if number in self._bare:
                continue
            # Of the picture's sizes the one that has at least as many pixels as the camera where the wall is nearest.
            pictures = self._picture(number)
            near = float(depth[first:end].min())
            level = min(int(math.log2(max(_FINE * near / camera.focal_px, 1.0))), len(pictures) - 1)
            scale = _FINE / 2**level
            to_wall = _to_wall(self._sides[number], camera, first)
            to_picture = np.array([[scale, 0.0, -0.5], [0.0, scale, -0.5], [0.0, 0.0, 1.0]]) @ to_wall
            top = max(0, math.floor(CENTRE_Y - camera.focal_px * (WALL_HEIGHT - camera.height) / near))
            foot = min(image.shape[0], math.ceil(CENTRE_Y + camera.focal_px * camera.height / near) + 1)
            to_picture = to_picture @ np.array([[1.0, 0.0, 0.0], [0.0, 1.0, top], [0.0, 0.0, 1.0]])
            there = np.ascontiguousarray(image[top:foot, first:end])
            cv2.warpPerspective(
                pictures[level],
                to_picture,
                (end - first, foot - top),
                dst=there,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_TRANSPARENT,
            )
            image[top:foot, first:end] = there

    def _picture(self, number: int) -> list[U8]:
        """Return a side's picture in all its sizes: uint8 (height, width, 4)."""
        if number not in self._pictures:
            sizes = [self._painted(number)]
            while min(sizes[-1].shape[:2]) > 8:
                height, width = sizes[-1].shape[:2]
                half = cv2.resize(sizes[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)
                sizes.append(half.astype(np.uint8, copy=False))
            self._pictures[number] = sizes
        return self._pictures[number]

    def _painted(self, number: int) -> U8:
        side, texture = self._sides[number], self._texture
        random = np.random.default_rng([texture.seed, number])
        # Multiples of 2⁵, so that every halved picture has half the resolution; the right end may lie beyond the wall.
        width, height = 32 * math.ceil(side.length * _FINE / 32), round(WALL_HEIGHT * _FINE)
        shade = _pattern(texture.kind, texture.contrast, width, height, random)
        picture = np.zeros((height, width, 4), np.uint8)
        picture[..., :3] = np.clip(np.rint(side.grey * shade), 0, 255)[..., None]
        light = side.grey / 255.0
        spacing = 1.0 / texture.posters if texture.posters else math.inf
        middle = spacing / 2
        while middle < side.length - _POSTER_WIDTH[1] / 2:
            _poster(picture, middle + float(random.uniform(-0.1, 0.1)) * spacing, light, random)
            middle += spacing
        for place, stature in self._doors:
            if (along := _on(side, place)) is not None:
                left, right = (round((along + sign * _DOOR_HALF * stature) * _FINE) for sign in (-1, 1))
                top = max(0, round((WALL_HEIGHT - _DOOR_HIGH * stature) * _FINE))
                cv2.rectangle(picture, (left, top), (right, height), [light * c for c in _DOOR_COLOUR], cv2.FILLED)
        return picture


def _on(side: Side, place: tuple[float, float]) -> float | None:
    """Return how far along a side a place is [m]; None where it is not on the side."""
    dx, dy = place[0] - side.start[0], place[1] - side.start[1]
    along = dx * side.along[0] + dy * side.along[1]
    across = dx * side.along[1] - dy * side.along[0]
    return along if abs(across) < 0.02 and 0.0 <= along <= side.length else None


def _to_wall(side: Side, camera: CameraPose, first: int) -> F64:
    """Return float64 (3, 3): from pixels, columns counted from `first`, to metres to the right and down on a side."""
    look_x, look_y = math.cos(camera.yaw), math.sin(camera.yaw)
    right_x, right_y = look_y, -look_x
    from_x, from_y = camera.x - side.start[0], camera.y - side.start[1]
    normal_x, normal_y = -side.along[1], side.along[0]

    def linear(x: float, y: float) -> F64:
        """Return the product of a vector with a column's ray, as a linear function of column, row and 1."""
        slope = (x * right_x + y * right_y) / camera.focal_px
        return np.array([slope, 0.0, x * look_x + y * look_y + slope * (first - CENTRE_X)])

    away = -(normal_x * from_x + normal_y * from_y)
    towards = linear(normal_x, normal_y)
    start = side.along[0] * from_x + side.along[1] * from_y
    down = np.array([0.0, 1.0 / camera.focal_px, -CENTRE_Y / camera.focal_px])
    return np.stack(
        [start * towards + away * linear(*side.along), (WALL_HEIGHT - camera.height) * towards + away * down, towards]
    )


def _pattern(kind: str, contrast: float, width: int, height: int, random: np.random.Generator) -> F64:
    """Return the brightness of a bare wall relative to its plain one: float64 (height, width)."""
    shade = np.ones((height, width))
    if kind == "plain":
        return shade
    tile_width, tile_height = (max(4, round(size * _FINE)) for size in (_BRICK if kind == "bricks" else _BOARD))
    joint = max(1, round(_JOINT * _FINE))
    for row, top in enumerate(range(0, height, tile_height)):
        shift = (row % 2) * tile_width // 2 if kind == "bricks" else 0
        for left in range(-shift, width, tile_width):
            tile = shade[top : top + tile_height, max(left, 0) : left + tile_width]
            tile *= 1.0 - contrast * float(random.uniform(0.0, 1.0))
            tile[:, : joint if left >= 0 else 0] *= 1.0 - contrast
            if kind == "bricks":
                tile[:joint] *= 1.0 - contrast
    return shade


def _poster(picture: U8, middle: float, light: float, random: np.random.Generator) -> None:
    """Draw a poster around a place on the wall [m]: paper, a frame, and one of four upright things."""
    width, height, low = (float(random.uniform(*span)) for span in (_POSTER_WIDTH, _POSTER_HEIGHT, _POSTER_LOW))
    paper, ink = (
        tuple(light * part for part in colours[random.integers(len(colours))]) for colours in (_PAPERS, _INKS)
    )
    left, top = middle - width / 2, WALL_HEIGHT - low - height

    def at(x: float, y: float) -> tuple[int, int]:
        """Return a place on the poster, both 0 … 1, in 16ths of a pixel of the picture."""
        return round(16 * _FINE * (left + x * width)), round(16 * _FINE * (top + y * height))

    def polygon(points: list[tuple[float, float]], colour: tuple[float, ...]) -> None:
        cv2.fillPoly(picture, [np.array([at(*point) for point in points], np.int32)], colour, cv2.LINE_AA, 4)

    def ball(x: float, y: float, radius: float) -> None:
        cv2.circle(picture, at(x, y), round(16 * _FINE * radius * height), ink, cv2.FILLED, cv2.LINE_AA, 4)

    polygon([(0, 0), (1, 0), (1, 1), (0, 1)], tuple(0.5 * part for part in paper))
    polygon([(0.03, 0.02), (0.97, 0.02), (0.97, 0.98), (0.03, 0.98)], paper)
    # Half of them the one that HOG may take for a person: from the front in 1 to 6 of 12 frames between 1.2 and 3 m.
    motif = int(random.integers(6))
    if motif > 2:  # the sign of a person, as on doors of lavatories
        ball(0.5, 0.16, 0.075)
        arms, legs = [(0.3, 0.28), (0.7, 0.28), (0.72, 0.56), (0.62, 0.58)], [(0.62, 0.92), (0.38, 0.92)]
        polygon([*arms, *legs, (0.38, 0.58), (0.28, 0.56)], ink)
    elif motif == 0:  # a carafe with a stopper
        ball(0.5, 0.16, 0.07)
        neck, shoulder, foot = [(0.44, 0.2), (0.56, 0.2)], [(0.58, 0.3), (0.7, 0.38)], [(0.66, 0.92), (0.34, 0.92)]
        polygon([*neck, *shoulder, *foot, (0.3, 0.38), (0.42, 0.3)], ink)
    elif motif == 1:  # a tree
        ball(0.5, 0.32, 0.19)
        polygon([(0.44, 0.4), (0.56, 0.4), (0.58, 0.92), (0.42, 0.92)], ink)
    else:  # bars
        for x in np.linspace(0.2, 0.8, int(random.integers(2, 5))).tolist():
            polygon([(x - 0.06, 0.1), (x + 0.06, 0.1), (x + 0.06, 0.92), (x - 0.06, 0.92)], ink)
