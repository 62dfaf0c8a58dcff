"""The camera's images: colour and depth from the same rays, then the sensor's noise.

The room is cast column by column, people and furniture pixel by pixel, far objects first; an object's pixel
is drawn where it is nearer than all that is there already.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, FOCAL_PX, HEIGHT, MOUNT_HEIGHT, WIDTH, CameraPose
from limo_sim.sensing.paint import Paint, sides_of
from limo_sim.sensing.solids import (
    BAND,
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
    covers,
    outline,
    slab,
    upright_bounds,
)
from limo_sim.world.furniture import KINDS, Box, Frustum, Rectangle
from limo_sim.world.person import Pose, body
from limo_sim.world.scenario import WALL_HEIGHT, Furniture, Scenario

with needed(by="the arena's camera", what="OpenCV", install="'limo-hog[cv]'"):
    import cv2

U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]
Seen = tuple[float, tuple[int, int, int, int] | None]
"""Visible share of a silhouette, and its box [px]."""

_SHADOW = 0.35  # share of the floor's brightness that is lost right under a person or a piece of furniture; by eye
_BANK_MARGIN = 64  # by how much the noise patterns are larger than a frame, which takes a window of them [px]
_NO_PERSON = -1
_LEVELS = 128  # of brightness, from black to the full colour
_COARSE = 64  # rows of the grid on which the part of a silhouette outside the image is measured

_COLUMNS = ((np.arange(WIDTH) - CENTRE_X) / FOCAL_PX).astype(np.float32)
_ROWS = ((np.arange(HEIGHT) - CENTRE_Y) / FOCAL_PX).astype(np.float32)[:, None]
with np.errstate(divide="ignore"):
    _FLOOR_DEPTH = np.where(_ROWS > 0, MOUNT_HEIGHT / _ROWS, np.inf).astype(np.float32)
_FAR = np.full((HEIGHT, WIDTH), np.inf, np.float32)
_NEAR = -_FAR


class Renderer:
    """The camera of one scenario; `noise` seeds the sensors' fixed noise patterns."""

    def __init__(self, scenario: Scenario, noise: np.random.Generator) -> None:
        self._scenario = scenario
        self._sun = Sun.above(scenario.light)
        self._backdrop = self._make_backdrop()
        self._walls = [wall.footprint for wall in scenario.walls]
        self._wall_greys = self._make_wall_greys()
        self._paint = Paint(scenario, sides_of(scenario.room.half, self._walls, self._wall_greys))
        self._wall_greys = [grey * self._paint.mean_shade for grey in self._wall_greys]
        self._palettes = [_palette(body(person, Pose(0, 0, 0)).colours.tolist()) for person in scenario.people]
        self._models = {piece: _model(piece) for piece in scenario.furniture}
        shape = (HEIGHT + _BANK_MARGIN, WIDTH + _BANK_MARGIN)
        unit = noise.standard_normal(shape, dtype=np.float32)
        grey = np.rint(unit * np.float32(scenario.camera.noise))
        self._grain = np.clip([grey, -grey], 0, 255).astype(np.uint8)
        self._stretch = 1 + np.float32(scenario.depth.noise) * noise.standard_normal(shape, dtype=np.float32)
        self._colours = np.empty((HEIGHT, WIDTH), np.uint32)
        self._sheet = np.empty((3, HEIGHT * WIDTH), np.float32)
        self._owner = np.empty((HEIGHT, WIDTH), np.int16)
        self._dead = round(scenario.depth.invalid * WIDTH * HEIGHT)

    def render(
        self,
        camera: CameraPose,
        people: Sequence[Pose | None],
        noise: np.random.Generator,
        movers: Sequence[Furniture] = (),
    ) -> tuple[U8, F32, list[Seen]]:
        """Expose one frame; `movers` are pieces of furniture beside the scenario's.

        Returns
        -------
        uint8 (480, 640, 3) BGR; float32 (480, 640) depth [m]; per person the visible share and the box.
        """
        depth, seen = self._draw(self._colours, camera, people, movers)
        image = cv2.cvtColor(_bytes(self._colours), cv2.COLOR_BGRA2BGR).astype(np.uint8, copy=False)
        row, column = noise.integers(_BANK_MARGIN, size=2)
        brighter, darker = self._grain[:, row : row + HEIGHT, column : column + WIDTH]
        cv2.add(image, cv2.cvtColor(brighter, cv2.COLOR_GRAY2BGR), dst=image)
        cv2.subtract(image, cv2.cvtColor(darker, cv2.COLOR_GRAY2BGR), dst=image)
        row, column = noise.integers(_BANK_MARGIN, size=2)
        depth *= self._stretch[row : row + HEIGHT, column : column + WIDTH]
        settings = self._scenario.depth
        # OpenCV's masked copy is ten times as fast as numpy's masked assignment
        cv2.copyTo(_FAR, (depth > settings.far_m).view(np.uint8), depth)
        cv2.copyTo(_NEAR, (depth < settings.near_m).view(np.uint8), depth)
        depth.reshape(-1)[noise.integers(WIDTH * HEIGHT, size=self._dead)] = np.nan
        return image, depth, seen

    def look(self, camera: CameraPose, people: Sequence[Pose | None], movers: Sequence[Furniture] = ()) -> list[Seen]:
        """Return each person's visible share and box, without drawing colours."""
        return self._draw(None, camera, people, movers)[1]

    def _draw(
        self, image: U32 | None, camera: CameraPose, people: Sequence[Pose | None], movers: Sequence[Furniture]
    ) -> tuple[F32, list[Seen]]:
        """Return depth and what is visible of people; colours go into `image`, if there is one."""
        scenario, sun = self._scenario, self._sun.seen_from(camera)
        room = self._backdrop.copy() if image is not None else None
        depth, wall, faces = self._draw_room(room, camera)
        outlines: dict[int, Outline] = {}
        order: list[tuple[float, int | Furniture]] = []
        for index, (person, pose) in enumerate(zip(scenario.people, people, strict=True)):
            if pose is None:
                continue
            if room is not None:
                _shade_floor(room, depth, camera, (pose.x, pose.y), 0.25 * person.height)
            if shape := outline(body(person, pose), camera):
                outlines[index] = shape
                order.append((math.hypot(pose.x - camera.x, pose.y - camera.y), index))
        for piece in (*scenario.furniture, *movers):
            order.append((math.hypot(piece.x - camera.x, piece.y - camera.y), piece))
            if room is not None:
                _shade_floor(room, depth, camera, (piece.x, piece.y), 0.25)
        if image is not None and room is not None:
            cv2.cvtColor(room, cv2.COLOR_GRAY2BGRA, dst=_bytes(image))
            if not self._paint.is_bare:
                self._paint.draw(_bytes(image), faces, wall, camera)
        self._owner.fill(_NO_PERSON)
        seen: list[Seen] = [(0.0, None)] * len(people)
        drawn: list[tuple[int, Window, float]] = []
        for _, thing in sorted(order, key=lambda entry: -entry[0]):
            if isinstance(thing, Furniture):
                self._draw_furniture(image, depth, camera, thing)
            elif window := _window(outlines[thing].bounds):
                area = _area_outside(outlines[thing])
                canvas = Canvas(window, self._sheet)
                cast_body(canvas, outlines[thing], sun)
                self._blend(image, depth, canvas, self._palettes[thing], thing)
                area += np.count_nonzero(canvas.inside)
                drawn.append((thing, window, area))
        for index, (left, top, right, bottom), area in drawn:
            visible = np.count_nonzero(self._owner[top:bottom, left:right] == index)
            share = min(visible / area, 1.0) if area else 0.0
            seen[index] = share, (left, top, right - left, bottom - top)
        return depth, seen

    def _draw_room(self, room: U8 | None, camera: CameraPose) -> tuple[F32, F32, NDArray[np.int64]]:
        """Sky, floor and walls; `room` is grey and has its sky and floor already.

        Returns the depth, and for every column the depth and the number of the wall's side that it shows.
        """
        look = math.cos(camera.yaw), math.sin(camera.yaw)
        ahead_x, ahead_y = look[0] + look[1] * _COLUMNS, look[1] - look[0] * _COLUMNS
        half = np.float32(self._scenario.room.half)
        with np.errstate(divide="ignore"):
            to_x = (np.copysign(half, ahead_x) - camera.x) / ahead_x
            to_y = (np.copysign(half, ahead_y) - camera.y) / ahead_y
        wall = np.minimum(to_x, to_y).astype(np.float32)
        faces = np.where(to_x < to_y, 2 * (ahead_x < 0), 1 + 2 * (ahead_y < 0))
        # All walls are equally high and higher than the camera: of a column's walls, the nearest hides the others.
        for number, shape in enumerate(self._walls, start=1):
            enters, face = _nearest_face(shape, camera, ahead_x, ahead_y)
            nearer = enters < wall
            wall, faces = np.where(nearer, enters, wall), np.where(nearer, 4 * number + face, faces)
        if room is not None:
            self._paint_walls(room, wall, faces)
        depth: F32 = np.minimum(_FLOOR_DEPTH, wall)
        top = CENTRE_Y - FOCAL_PX * (WALL_HEIGHT - MOUNT_HEIGHT) / wall
        sky, end = (max(0, math.ceil(float(edge))) for edge in (top.min(), top.max()))
        depth[:sky] = np.inf
        depth[sky:end][np.arange(sky, end, dtype=np.float32)[:, None] < top] = np.inf
        return depth, wall, faces

    def _paint_walls(self, room: U8, wall: F32, faces: NDArray[np.int64]) -> None:
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
            cv2.fillConvexPoly(room, quad, grey, cv2.LINE_AA, shift=4)

    def _draw_furniture(self, image: U32 | None, depth: F32, camera: CameraPose, piece: Furniture) -> None:
        solids, palette, (radius, height) = self._models.get(piece) or _model(piece)
        [[x, _, z]] = camera.to_camera(np.array([[piece.x, piece.y, 0.0]])).tolist()
        window = _window(upright_bounds(x, z, radius, 0.0, height))
        if window is None:
            return
        seen_sun = self._sun.seen_from(camera)
        canvas = Canvas(window, self._sheet)
        for part, solid in enumerate(solids):
            if isinstance(solid, Box):
                cast_box(canvas, solid, camera, self._sun, part)
            else:
                cast_frustum(canvas, solid, camera, seen_sun, part)
        self._blend(image, depth, canvas, palette, _NO_PERSON)

    def _blend(self, image: U32 | None, depth: F32, canvas: Canvas, palette: U32, owner: int) -> None:
        """Draw an object wherever it is nearer than what has been drawn; `owner` is its number in the map of people."""
        left, top, right, bottom = canvas.window
        step = max(1, BAND // (right - left))
        for row in range(top, bottom, step):
            at = np.s_[row : min(row + step, bottom), left:right]
            of = np.s_[row - top : at[0].stop - top]
            there, new, cover = depth[at], canvas.depth[of], canvas.cover[of]
            nearer = new < there
            if image is not None:
                colour = palette.take((canvas.tone[of] * _LEVELS).astype(np.int32), mode="clip")
                full = cover >= 1.0
                full &= nearer
                edge = cover > 0.0
                edge &= nearer
                edge ^= full
                patch = image[at]
                cv2.copyTo(colour.view(np.int32), full.view(np.uint8), patch.view(np.int32))
                where = np.divmod(np.flatnonzero(edge), right - left)
                if len(where[0]):
                    share = cover[where][:, None]
                    over, under = (_bytes(pixels[where][:, None]) for pixels in (colour, patch))
                    patch[where] = cv2.blendLinear(over, under, share, 1.0 - share).view(np.uint32)[:, 0, 0]
            nearer &= cover >= 0.5
            cv2.copyTo(new, nearer.view(np.uint8), there)
            self._owner[at][nearer] = owner

    def _make_backdrop(self) -> U8:
        """Sky above, floor below, each a little brighter towards the horizon."""
        light = self._scenario.light
        toward = np.linspace(0.0, 1.0, HEIGHT // 2, dtype=np.float32)
        sky = 255 * light.sky * (0.985 + 0.03 * toward)
        floor = 255 * light.floor * (0.97 + 0.05 * toward[::-1])
        rows = np.rint(np.minimum(np.concatenate([sky, floor]), 255)).astype(np.uint8)
        return np.repeat(rows[:, None], WIDTH, axis=1)

    def _make_wall_greys(self) -> list[float]:
        """Brightness of the outer walls at +x, +y, -x, -y, then of each inner wall's sides, as they face the sun."""
        x, y, _ = self._sun.towards
        facings = [-x, -y, x, y]
        for shape in self._walls:
            cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
            facings += [cos * x + sin * y, cos * y - sin * x, -cos * x - sin * y, sin * x - cos * y]
        wall = 255 * self._scenario.light.wall
        return [min(wall * (0.895 + 0.095 * facing), 255.0) for facing in facings]


def _nearest_face(shape: Rectangle, camera: CameraPose, ahead_x: F32, ahead_y: F32) -> tuple[F32, NDArray[np.int64]]:
    """Where each column's ray meets an upright block: depth float32 (W,) [m], inf where it does not, and on which side.

    The sides are numbered 0 … 3: +x, +y, -x, -y of the block's own frame.
    """
    cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
    from_x, from_y = camera.x - shape.x, camera.y - shape.y
    along_x, along_y = cos * ahead_x + sin * ahead_y, cos * ahead_y - sin * ahead_x
    in_x, out_x = slab(cos * from_x + sin * from_y, along_x, shape.half_x)
    in_y, out_y = slab(cos * from_y - sin * from_x, along_y, shape.half_y)
    enters = np.maximum(in_x, in_y)
    hit = (enters < np.minimum(out_x, out_y)) & (enters > 0)
    face = np.where(in_x > in_y, 2 * (along_x > 0), 1 + 2 * (along_y > 0))
    return np.where(hit, enters, np.inf).astype(np.float32), face


def _shade_floor(room: U8, depth: F32, camera: CameraPose, at: tuple[float, float], radius: float) -> None:
    """Darken the floor softly around something that stands on it."""
    [[across, _, ahead]] = camera.to_camera(np.array([[*at, 0.0]])).tolist()
    # the nearest floor that the camera sees lies at the image's lower edge
    bounds = upright_bounds(across, ahead, radius, 0.0, 0.0, near=MOUNT_HEIGHT * FOCAL_PX / (HEIGHT - CENTRE_Y))
    window = _window(bounds)
    if window is None:
        return
    left, top, right, bottom = window
    top = max(top, HEIGHT // 2)
    if top >= bottom:
        return
    floor = _FLOOR_DEPTH[top:bottom]
    gap = (floor * _COLUMNS[left:right] - across) ** 2
    gap += (floor - ahead) ** 2
    dark = np.maximum(1.0 - gap / radius**2, 0.0)
    dark *= depth[top:bottom, left:right] >= floor * 0.999
    patch = room[top:bottom, left:right]
    patch[:] = np.rint(patch * (1.0 - _SHADOW * dark))


def _model(piece: Furniture) -> tuple[list[Frustum | Box], U32, tuple[float, float]]:
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


def _bytes(pixels: U32) -> U8:
    """See pixels (...) as blue, green, red, 0 (..., 4)."""
    return pixels.view(np.uint8).reshape(*pixels.shape, 4)


def _palette(colours: Sequence[Sequence[float]]) -> U32:
    """Table from a canvas's tone, in steps of 1 / `_LEVELS`, to the four bytes blue, green, red, 0."""
    shades = np.arange(TONES * _LEVELS) / _LEVELS
    table = np.zeros((len(colours), len(shades), 4), np.uint8)
    table[..., :3] = np.rint(np.minimum(np.array(colours)[:, None, ::-1] * shades[None, :, None], 255))
    return table.reshape(-1, 4).view(np.uint32)[:, 0]


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


def _area_outside(shape: Outline) -> float:
    """Area of what the image's edge cuts off a silhouette [px]."""
    left, top, right, bottom = _pixels(shape.bounds)
    if (left, top, right, bottom) == _window(shape.bounds):
        return 0.0
    step = max(1, (bottom - top) // _COARSE, (right - left) // _COARSE)
    x = np.arange(left, right, step, dtype=np.float32)
    y = np.arange(top, bottom, step, dtype=np.float32)[:, None]
    rows, columns = np.nonzero((x < 0) | (x > WIDTH - 1) | (y < 0) | (y > HEIGHT - 1))
    return float(step**2 * np.count_nonzero(covers(shape, x[columns], y[rows, 0])))
