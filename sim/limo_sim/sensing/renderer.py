"""The camera's images: colour and depth from the same rays, then the sensor's noise.

The room is cast column by column, people and furniture pixel by pixel, far objects first; an object's pixel
is drawn where it is nearer than all that is there already.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from limo_hog._core import Canvas
from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_Y, HEIGHT, WIDTH, CameraPose
from limo_sim.sensing.optics import Lens, Shutter
from limo_sim.sensing.room import Room
from limo_sim.sensing.solids import (
    F32,
    TONES,
    Bounds,
    Outline,
    Sun,
    Window,
    cast_box,
    cast_frustum,
    covers,
    outline,
    upright_bounds,
)
from limo_sim.world.furniture import KINDS, Box, Frustum
from limo_sim.world.person import Pose, body, colours
from limo_sim.world.scenario import Furniture, Scenario

with needed(by="the arena's camera"):
    import cv2

U8 = NDArray[np.uint8]
U32 = NDArray[np.uint32]
Seen = tuple[float, tuple[int, int, int, int] | None]
"""Visible share of a silhouette, and its box [px]."""

_SHADOW = 0.35  # share of the floor's brightness that is lost right under a person or a piece of furniture; by eye
_BANK_MARGIN = 64  # by how much the noise patterns are larger than a frame, which takes a window of them [px]
_NO_PERSON = -1
_LEVELS = 128  # of brightness, from black to the full colour; as in `_core.Canvas`
_COARSE = 64  # rows of the grid on which the part of a silhouette outside the image is measured

_FAR = np.full((HEIGHT, WIDTH), np.inf, np.float32)
_NEAR = -_FAR


@dataclass(frozen=True, slots=True)
class Earlier:
    """What the camera saw before."""

    #: Camera, people and movers so many seconds before the stamp.
    before: Callable[[float], tuple[CameraPose, Sequence[Pose | None], Sequence[Furniture]]]
    turn_rate: float  #: of the camera [rad/s]


class Renderer:
    """The camera of one scenario; `noise` seeds the sensors' fixed noise patterns."""

    def __init__(self, scenario: Scenario, noise: np.random.Generator) -> None:
        self._scenario = scenario
        self._sun = Sun.above(scenario.light)
        self._room = Room(scenario)
        self._palettes = [_palette(colours(person)) for person in scenario.people]
        self._models = {piece: _model(piece) for piece in scenario.furniture}
        settings, focal = scenario.camera, scenario.robot.geometry.focal_px(WIDTH)
        self._lens, self._shutter = Lens(settings.k1, settings.k2, focal), Shutter(settings, focal)
        shape = (HEIGHT + _BANK_MARGIN, WIDTH + _BANK_MARGIN)
        unit = noise.standard_normal(shape, dtype=np.float32)
        grey = np.rint(unit * np.float32(settings.noise))
        self._brighter, self._darker = (
            cv2.cvtColor(np.clip(part, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR) for part in (grey, -grey)
        )
        self._stretch = 1 + np.float32(scenario.depth.noise) * noise.standard_normal(shape, dtype=np.float32)
        self._colours = np.empty((HEIGHT, WIDTH), np.uint32)
        self._bytes: U8 = self._colours.view(np.uint8).reshape(HEIGHT, WIDTH, 4)  # blue, green, red, 0
        self._canvas = Canvas(HEIGHT, WIDTH, focal)
        self._owner = np.empty((HEIGHT, WIDTH), np.int16)
        self._dead = round(scenario.depth.invalid * WIDTH * HEIGHT)

    def render(
        self,
        camera: CameraPose,
        people: Sequence[Pose | None],
        noise: np.random.Generator,
        movers: Sequence[Furniture] = (),
        *,
        time: float = 0.0,
        past: Earlier | None = None,
    ) -> tuple[U8, F32, list[Seen]]:
        """Expose one frame of what there is at the stamp, `time` [s]: people, and furniture beside the scenario's.

        Return uint8 (480, 640, 3) BGR; float32 (480, 640) depth [m]; per person the visible share and the box. `past`
        is what there was before, for a shutter that takes time; without it the shutter takes none.
        """
        depth, seen = self._draw(camera, people, movers)
        if past is not None and not self._shutter.is_instant:
            image = self._shutter.expose(partial(self._picture, past), past.turn_rate)
        else:
            image = cv2.cvtColor(self._bytes, cv2.COLOR_BGRA2BGR).astype(np.uint8, copy=False)
        if self._scenario.light.swing:
            image = cv2.convertScaleAbs(image, alpha=self._scenario.light.strength(time)).astype(np.uint8, copy=False)
        if not self._lens.is_plain:
            image, depth = self._lens.image(image), self._lens.depth(depth)
        row, column = noise.integers(_BANK_MARGIN, size=2)
        window = np.s_[row : row + HEIGHT, column : column + WIDTH]
        cv2.add(image, self._brighter[window], dst=image)
        cv2.subtract(image, self._darker[window], dst=image)
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
        return self._draw(camera, people, movers, paints=False)[1]

    def look_at_furniture(
        self, camera: CameraPose, people: Sequence[Pose | None], movers: Sequence[Furniture]
    ) -> list[Seen]:
        """Return each piece's visible share and box; what the image's edge cuts off is estimated by its upright box."""
        depth = self._draw(camera, people, movers, paints=False)[0]
        return [self._seen_of(piece, depth, camera) for piece in (*self._scenario.furniture, *movers)]

    def _seen_of(self, piece: Furniture, depth: F32, camera: CameraPose) -> Seen:
        within_image = self._cast(self._model_of(piece), piece, camera, self._sun.seen_from(camera))
        if not within_image:
            return 0.0, None
        inside, visible, within = self._canvas.seen(depth)
        if within is None:
            return 0.0, None
        box = within[0], within[1], within[2] - within[0], within[3] - within[1]
        return self._through_lens(visible / inside * within_image, box)

    def _through_lens(self, share: float, box: tuple[int, int, int, int]) -> Seen:
        """Return a visible share and the image of a box; what the lens moves out of the image is not visible."""
        if self._lens.is_plain:
            return share, box
        bent = self._lens.box(box)
        return (0.0, None) if bent is None else (share, bent)

    def _picture(self, past: Earlier, age: float) -> U8:
        """Draw the scene as it was some seconds before the stamp, without noise."""
        self._draw(*past.before(age))
        return cv2.cvtColor(self._bytes, cv2.COLOR_BGRA2BGR).astype(np.uint8, copy=False)

    def _draw(
        self, camera: CameraPose, people: Sequence[Pose | None], movers: Sequence[Furniture], *, paints: bool = True
    ) -> tuple[F32, list[Seen]]:
        """Return depth and what is visible of people; with `paints` the colours go into `self._colours`."""
        scenario, sun = self._scenario, self._sun.seen_from(camera)
        depth, columns = self._room.cast(camera)
        image, room = (self._colours, self._room.paint(columns)) if paints else (None, None)
        outlines: dict[int, Outline] = {}
        order: list[tuple[float, int | Furniture]] = []
        for index, (person, pose) in enumerate(zip(scenario.people, people, strict=True)):
            if pose is None:
                continue
            if room is not None:
                self._shade_floor(room, depth, camera, (pose.x, pose.y), 0.25 * person.height)
            if shape := outline(body(person, pose), camera):
                outlines[index] = shape
                order.append((math.hypot(pose.x - camera.x, pose.y - camera.y), index))
        for piece in (*scenario.furniture, *movers):
            order.append((math.hypot(piece.x - camera.x, piece.y - camera.y), piece))
            if room is not None:
                self._shade_floor(room, depth, camera, (piece.x, piece.y), 0.25)
        if room is not None:
            cv2.cvtColor(room, cv2.COLOR_GRAY2BGRA, dst=self._bytes)
            self._room.painted.draw(self._bytes, columns, camera)
        self._owner.fill(_NO_PERSON)
        seen: list[Seen] = [(0.0, None)] * len(people)
        drawn: list[tuple[int, Window, float]] = []
        order.sort(key=itemgetter(0), reverse=True)
        for _, thing in order:
            if isinstance(thing, Furniture):
                self._draw_furniture(image, depth, camera, thing, sun, hides=bool(drawn))
            elif window := _window(outlines[thing].bounds):
                self._canvas.begin(window)
                self._canvas.strips(outlines[thing].strips, sun.light)
                self._canvas.ellipses(outlines[thing].ellipses, sun.light)
                inside = self._canvas.draw(image, depth, self._palettes[thing], self._owner, thing)
                area = _area_outside(outlines[thing], window) + inside
                drawn.append((thing, window, area))
        for index, (left, top, right, bottom), area in drawn:
            visible = np.count_nonzero(self._owner[top:bottom, left:right] == index)
            share = min(visible / area, 1.0) if area else 0.0
            box = left, top, right - left, bottom - top
            seen[index] = self._through_lens(share, box)
        return depth, seen

    def _shade_floor(self, room: U8, depth: F32, camera: CameraPose, place: tuple[float, float], radius: float) -> None:
        """Darken the floor softly around something that stands on it, at a place in the arena [m]."""
        at = camera.ahead_of(*place)
        # the nearest floor that the camera sees lies at the image's lower edge
        near = camera.height * camera.focal_px / (HEIGHT - CENTRE_Y)
        bounds = upright_bounds(camera, at, radius, (0.0, 0.0), near)
        if window := _window(bounds):
            left, top, right, bottom = window
            top = max(top, HEIGHT // 2)
            if top < bottom:
                within = left, top, right, bottom
                floor, columns = self._room.floor_depth[:, 0], self._room.columns
                self._canvas.shade_floor(room, depth, floor, columns, within, at, radius, _SHADOW)

    def _draw_furniture(
        self, image: U32 | None, depth: F32, camera: CameraPose, piece: Furniture, sun: Sun, *, hides: bool
    ) -> None:
        """Draw a piece; `hides`: whether there may be people behind it."""
        model = self._model_of(piece)
        if self._cast(model, piece, camera, sun):
            self._canvas.draw(image, depth, model.palette, self._owner if hides else None, _NO_PERSON)

    def _cast(self, model: _Model, piece: Furniture, camera: CameraPose, sun: Sun) -> float:
        """Put a piece on the canvas, by itself; return how much of its upright box is within the image: 0 … 1."""
        radius, height = model.extent
        bounds = upright_bounds(camera, camera.ahead_of(piece.x, piece.y), radius, (0.0, height))
        window = _window(bounds)
        if bounds is None or window is None:
            return 0.0
        self._canvas.begin(window)
        for part, solid in enumerate(model.solids):
            if isinstance(solid, Box):
                cast_box(self._canvas, solid, camera, self._sun, part)
            else:
                cast_frustum(self._canvas, solid, camera, sun, part)
        (left, top, right, bottom), whole = window, _pixels(bounds)
        return (right - left) * (bottom - top) / ((whole[2] - whole[0]) * (whole[3] - whole[1]))

    def _model_of(self, piece: Furniture) -> _Model:
        # What moves is somewhere else in every frame.
        return self._models.get(piece) or _model(piece)


class _Model(NamedTuple):
    """A piece where it stands: its solids, their colours, and the radius and height of all of it [m]."""

    solids: list[Frustum | Box]
    palette: U32
    extent: tuple[float, float]


def _model(piece: Furniture) -> _Model:
    cos, sin = math.cos(piece.yaw), math.sin(piece.yaw)
    solids: list[Frustum | Box] = []
    for solid in KINDS[piece.kind].solids:
        x, y = piece.x + cos * solid.x - sin * solid.y, piece.y + sin * solid.x + cos * solid.y
        if isinstance(solid, Box):
            solids.append(dataclasses.replace(solid, x=x, y=y, yaw=solid.yaw + piece.yaw))
        else:
            solids.append(dataclasses.replace(solid, x=x, y=y))
    return _Model(solids, _palette([solid.colour for solid in solids]), KINDS[piece.kind].extent)


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


def _area_outside(shape: Outline, window: Window) -> float:
    """Area of what the image's edge cuts off a silhouette, of which a window is inside [px]."""
    left, top, right, bottom = _pixels(shape.bounds)
    if (left, top, right, bottom) == window:
        return 0.0
    step = max(1, (bottom - top) // _COARSE, (right - left) // _COARSE)
    x = np.arange(left, right, step, dtype=np.float32)
    y = np.arange(top, bottom, step, dtype=np.float32)[:, None]
    rows, columns = np.nonzero((x < 0) | (x > WIDTH - 1) | (y < 0) | (y > HEIGHT - 1))
    return float(step**2 * np.count_nonzero(covers(shape, x[columns], y[rows, 0])))
