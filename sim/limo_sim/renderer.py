"""Draws what the camera sees: colour and depth from the same rays, then the sensor's noise.

The room is cast column by column, people and furniture pixel by pixel, far objects first; an object's pixel
is drawn where it is nearer than all that is there already.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from limo_sim.camera import CENTRE_X, CENTRE_Y, FOCAL_PX, HEIGHT, MOUNT_HEIGHT, WIDTH, CameraPose
from limo_sim.furniture import KINDS, Box, Frustum
from limo_sim.person import Pose, body
from limo_sim.scenario import ROOM_HALF, WALL_HEIGHT, Furniture, Scenario
from limo_sim.solids import (
    F32,
    TONES,
    Bounds,
    Canvas,
    Outline,
    Sun,
    Window,
    cast_body,
    cast_box,
    cast_frustum,
    outline,
    upright_bounds,
)

U8 = NDArray[np.uint8]
Seen = tuple[float, tuple[int, int, int, int] | None]
"""Visible share of a silhouette, and its box [px]."""

_SHADOW = 0.35  # how much darker the floor is right under somebody
_BANK_MARGIN = 64  # the noise patterns are so much larger than a frame, which takes a window of them
_LEVELS = 128  # of brightness, from black to the full colour
_COARSE = 64  # a silhouette that the image's edge cuts is measured on about so many rows

_COLUMNS = ((np.arange(WIDTH) - CENTRE_X) / FOCAL_PX).astype(np.float32)
_ROWS = ((np.arange(HEIGHT) - CENTRE_Y) / FOCAL_PX).astype(np.float32)[:, None]
with np.errstate(divide="ignore"):
    _FLOOR_DEPTH = np.where(_ROWS > 0, MOUNT_HEIGHT / _ROWS, np.inf).astype(np.float32)


class Renderer:
    """The camera of one scenario; `noise` seeds the sensors' fixed noise patterns."""

    def __init__(self, scenario: Scenario, noise: np.random.Generator) -> None:
        self._scenario = scenario
        self._sun = Sun.above(scenario.light)
        self._backdrop = self._make_backdrop()
        self._wall_greys = self._make_wall_greys()
        self._palettes = [_palette(body(person, Pose(0, 0, 0)).colours.tolist()) for person in scenario.people]
        self._models = {piece: _model(piece) for piece in scenario.furniture}
        shape = (HEIGHT + _BANK_MARGIN, WIDTH + _BANK_MARGIN)
        unit = noise.standard_normal(shape, dtype=np.float32)
        grey = np.rint(unit * np.float32(scenario.camera.noise))
        self._brighter = _three(np.clip(grey, 0, 255))
        self._darker = _three(np.clip(-grey, 0, 255))
        self._stretch = 1 + np.float32(scenario.depth.noise) * noise.standard_normal(shape, dtype=np.float32)
        self._dead = round(scenario.depth.invalid * WIDTH * HEIGHT)

    def render(
        self, camera: CameraPose, people: Sequence[Pose | None], noise: np.random.Generator
    ) -> tuple[U8, F32, list[Seen]]:
        """Expose one frame.

        Returns
        -------
        uint8 (480, 640, 3) BGR; float32 (480, 640) depth [m]; per person how much of them is seen, and where.
        """
        image = self._backdrop.copy()
        depth, seen = self._draw(image, camera, people)
        row, column = noise.integers(_BANK_MARGIN, size=2)
        window = np.s_[row : row + HEIGHT, column : column + WIDTH]
        cv2.add(image, self._brighter[window], dst=image)
        cv2.subtract(image, self._darker[window], dst=image)
        row, column = noise.integers(_BANK_MARGIN, size=2)
        depth *= self._stretch[row : row + HEIGHT, column : column + WIDTH]
        settings = self._scenario.depth
        depth[depth > settings.far_m] = np.inf
        depth[depth < settings.near_m] = -np.inf
        depth.reshape(-1)[noise.integers(WIDTH * HEIGHT, size=self._dead)] = np.nan
        return image, depth, seen

    def look(self, camera: CameraPose, people: Sequence[Pose | None]) -> list[Seen]:
        """How much of each person a frame would show, and where; no frame is exposed."""
        return self._draw(None, camera, people)[1]

    def _draw(self, image: U8 | None, camera: CameraPose, people: Sequence[Pose | None]) -> tuple[F32, list[Seen]]:
        """Depth and what is seen of people; the colours go into `image`, if there is one."""
        scenario, sun = self._scenario, self._sun.seen_from(camera)
        depth = self._draw_room(image, camera)
        outlines: dict[int, Outline] = {}
        order: list[tuple[float, int | Furniture]] = []
        for index, (person, pose) in enumerate(zip(scenario.people, people, strict=True)):
            if pose is None:
                continue
            if image is not None:
                self._shade_floor(image, depth, camera, (pose.x, pose.y), 0.25 * person.height)
            if shape := outline(body(person, pose), camera):
                outlines[index] = shape
                order.append((math.hypot(pose.x - camera.x, pose.y - camera.y), index))
        for piece in scenario.furniture:
            order.append((math.hypot(piece.x - camera.x, piece.y - camera.y), piece))
            if image is not None:
                self._shade_floor(image, depth, camera, (piece.x, piece.y), 0.25)
        canvases: list[tuple[int, Canvas]] = []
        for _, thing in sorted(order, key=lambda entry: -entry[0]):
            if isinstance(thing, Furniture):
                self._draw_furniture(image, depth, camera, thing)
            elif window := _window(outlines[thing].bounds):
                canvas = Canvas(window)
                cast_body(canvas, outlines[thing], sun)
                _blend(image, depth, canvas, self._palettes[thing])
                canvases.append((thing, canvas))
        seen: list[Seen] = [(0.0, None)] * len(people)
        for index, canvas in canvases:
            seen[index] = _measure(canvas, depth, outlines[index], sun)
        return depth, seen

    def _draw_room(self, image: U8 | None, camera: CameraPose) -> F32:
        """Sky, floor and walls; the image has its sky and floor already."""
        look = math.cos(camera.yaw), math.sin(camera.yaw)
        ahead_x, ahead_y = look[0] + look[1] * _COLUMNS, look[1] - look[0] * _COLUMNS
        with np.errstate(divide="ignore"):
            to_x = (np.copysign(np.float32(ROOM_HALF), ahead_x) - camera.x) / ahead_x
            to_y = (np.copysign(np.float32(ROOM_HALF), ahead_y) - camera.y) / ahead_y
        wall = np.minimum(to_x, to_y).astype(np.float32)
        if image is not None:
            self._paint_walls(image, wall, np.where(to_x < to_y, 2 * (ahead_x < 0), 1 + 2 * (ahead_y < 0)))
        depth: F32 = np.minimum(_FLOOR_DEPTH, wall)
        top = CENTRE_Y - FOCAL_PX * (WALL_HEIGHT - MOUNT_HEIGHT) / wall
        above = math.ceil(float(top.max()))
        if above > 0:
            depth[:above][np.arange(above, dtype=np.float32)[:, None] < top] = np.inf
        return depth

    def _paint_walls(self, image: U8, wall: F32, faces: NDArray[np.int64]) -> None:
        """Paint walls whose depth and number are known for every column."""
        edges = [0, *(np.flatnonzero(np.diff(faces)) + 1).tolist(), WIDTH]
        for start, stop in pairwise(edges):
            z = wall[[start, stop - 1]]
            # a flat wall is a straight line in 1/z: carry it on to the pixels' outer edges
            inverse = 1.0 / z
            step = (inverse[1] - inverse[0]) / max(stop - 1 - start, 1)
            left, right = inverse[0] - step / 2, inverse[1] + step / 2
            corners = [
                (start - 0.5, CENTRE_Y - FOCAL_PX * (WALL_HEIGHT - MOUNT_HEIGHT) * left),
                (stop - 0.5, CENTRE_Y - FOCAL_PX * (WALL_HEIGHT - MOUNT_HEIGHT) * right),
                (stop - 0.5, CENTRE_Y + FOCAL_PX * MOUNT_HEIGHT * right),
                (start - 0.5, CENTRE_Y + FOCAL_PX * MOUNT_HEIGHT * left),
            ]
            quad = np.clip(np.rint(np.array(corners) * 16), -(2**20), 2**20).astype(np.int32)
            grey = self._wall_greys[int(faces[start])]
            cv2.fillConvexPoly(image, quad, (grey, grey, grey), cv2.LINE_AA, shift=4)

    def _draw_furniture(self, image: U8 | None, depth: F32, camera: CameraPose, piece: Furniture) -> None:
        solids, palette, (radius, height) = self._models[piece]
        [[x, _, z]] = camera.to_camera(np.array([[piece.x, piece.y, 0.0]])).tolist()
        window = _window(upright_bounds(x, z, radius, 0.0, height))
        if window is None:
            return
        canvas = Canvas(window)
        seen_sun = self._sun.seen_from(camera)
        for part, solid in enumerate(solids):
            if isinstance(solid, Box):
                cast_box(canvas, solid, camera, self._sun, part)
            else:
                cast_frustum(canvas, solid, camera, seen_sun, part)
        _blend(image, depth, canvas, palette)

    def _shade_floor(self, image: U8, depth: F32, camera: CameraPose, at: tuple[float, float], radius: float) -> None:
        """Darken the floor softly around something that stands on it."""
        [[across, _, ahead]] = camera.to_camera(np.array([[*at, 0.0]])).tolist()
        window = _window(upright_bounds(across, ahead, radius, 0.0, 0.0))
        if window is None:
            return
        left, top, right, bottom = window
        top = max(top, HEIGHT // 2)
        if top >= bottom:
            return
        floor = _FLOOR_DEPTH[top:bottom]
        gap = (floor * _COLUMNS[left:right] - across) ** 2 + (floor - ahead) ** 2
        dark = np.maximum(1.0 - gap / radius**2, 0.0)
        dark *= depth[top:bottom, left:right] >= floor * 0.999
        patch = image[top:bottom, left:right]
        patch[:] = np.rint(patch * (1.0 - _SHADOW * dark)[..., None])

    def _make_backdrop(self) -> U8:
        """Sky above, floor below, each a little brighter towards the horizon."""
        light = self._scenario.light
        toward = np.linspace(0.0, 1.0, HEIGHT // 2, dtype=np.float32)
        sky = 255 * light.sky * (0.985 + 0.03 * toward)
        floor = 255 * light.floor * (0.97 + 0.05 * toward[::-1])
        rows = np.rint(np.minimum(np.concatenate([sky, floor]), 255)).astype(np.uint8)
        return np.ascontiguousarray(np.broadcast_to(rows[:, None, None], (HEIGHT, WIDTH, 3)))

    def _make_wall_greys(self) -> list[float]:
        """Brightness of the walls at +x, +y, -x, -y by how they face the sun."""
        x, y, _ = self._sun.towards
        wall = 255 * self._scenario.light.wall
        return [min(wall * (0.895 + 0.095 * facing), 255.0) for facing in (-x, -y, x, y)]


def _model(piece: Furniture) -> tuple[list[Frustum | Box], U8, tuple[float, float]]:
    """Solids of a piece where it stands, their colours, and the radius and height of all of it [m]."""
    cos, sin = math.cos(piece.yaw), math.sin(piece.yaw)
    solids: list[Frustum | Box] = []
    radius = 0.0
    for solid in KINDS[piece.kind].solids:
        x, y = piece.x + cos * solid.x - sin * solid.y, piece.y + sin * solid.x + cos * solid.y
        reach = math.hypot(solid.half_x, solid.half_y) if isinstance(solid, Box) else max(solid.r0, solid.r1)
        radius = max(radius, math.hypot(solid.x, solid.y) + reach)
        if isinstance(solid, Box):
            solids.append(dataclasses.replace(solid, x=x, y=y, yaw=solid.yaw + piece.yaw))
        else:
            solids.append(dataclasses.replace(solid, x=x, y=y))
    return solids, _palette([solid.colour for solid in solids]), (radius, max(solid.z1 for solid in solids))


def _three(grey: F32) -> U8:
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def _palette(colours: Sequence[Sequence[float]]) -> U8:
    """Table from a canvas's tone, in steps of 1 / `_LEVELS`, to BGR."""
    shades = np.arange(TONES * _LEVELS) / _LEVELS
    table = np.array(colours)[:, None, ::-1] * shades[None, :, None]
    return np.rint(np.minimum(table, 255)).astype(np.uint8).reshape(-1, 3)


def _pixels(bounds: Bounds) -> Window:
    """Whole pixels within bounds, whether in the image or not."""
    return math.floor(bounds[0]), math.floor(bounds[1]), math.ceil(bounds[2]) + 1, math.ceil(bounds[3]) + 1


def _window(bounds: Bounds | None) -> Window | None:
    """Whole pixels of the image within bounds."""
    if bounds is None:
        return None
    left, top, right, bottom = _pixels(bounds)
    left, top, right, bottom = max(0, left), max(0, top), min(WIDTH, right), min(HEIGHT, bottom)
    return (left, top, right, bottom) if left < right and top < bottom else None


def _blend(image: U8 | None, depth: F32, canvas: Canvas, palette: U8) -> None:
    """Lay an object over the picture wherever it is nearer than what is there."""
    left, top, right, bottom = canvas.window
    there = depth[top:bottom, left:right]
    nearer = canvas.depth < there
    if image is not None:
        alpha = np.minimum(canvas.cover, 1.0)
        alpha *= nearer
        colour = palette.take((canvas.tone * _LEVELS).astype(np.int32), axis=0, mode="clip")
        patch = image[top:bottom, left:right]
        cv2.blendLinear(colour, patch.copy(), alpha, 1.0 - alpha, dst=patch)
    nearer &= canvas.inside
    np.copyto(there, canvas.depth, where=nearer)


def _measure(canvas: Canvas, depth: F32, shape: Outline, sun: Sun) -> Seen:
    """Visible share and box of a silhouette, once everything is drawn."""
    left, top, right, bottom = canvas.window
    visible = int(np.count_nonzero((depth[top:bottom, left:right] == canvas.depth) & canvas.inside))
    whole = _pixels(shape.bounds)
    if (left, top, right, bottom) == whole:
        area = float(np.count_nonzero(canvas.inside))
    else:
        stride = max(1, (whole[3] - whole[1]) // _COARSE, (whole[2] - whole[0]) // _COARSE)
        coarse = Canvas(whole, stride)
        cast_body(coarse, shape, sun)
        area = float(np.count_nonzero(coarse.inside) * stride**2)
    share = min(visible / area, 1.0) if area else 0.0
    return share, (left, top, right - left, bottom - top)
