"""What the camera sees of the bare room: sky, floor and walls, column by column."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, HEIGHT, WIDTH, CameraPose
from limo_sim.sensing.paint import Paint, sides_of
from limo_sim.sensing.solids import F32, Sun
from limo_sim.world.rays import meet
from limo_sim.world.scenario import WALL_HEIGHT, Scenario

with needed(by="the arena's camera"):
    import cv2

U8 = NDArray[np.uint8]
Columns = tuple[F32, NDArray[np.int64]]
"""For every column of the image the depth of the wall [m] and the number of the wall's side."""


class Room:
    """The room of one scenario, as its robot's camera sees it."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario, geometry = scenario, scenario.robot.geometry
        focal, self._height = geometry.focal_px(WIDTH), geometry.camera_z
        self._focal = focal
        #: float32 (640,): how far to the right of straight ahead each column looks [m at 1 m]
        self.columns = ((np.arange(WIDTH) - CENTRE_X) / focal).astype(np.float32)
        rows = ((np.arange(HEIGHT) - CENTRE_Y) / focal).astype(np.float32)[:, None]
        with np.errstate(divide="ignore"):
            #: float32 (480, 1): depth of the bare floor in each row [m]; inf above the horizon
            self.floor_depth: F32 = np.where(rows > 0, self._height / rows, np.inf).astype(np.float32)
        self._backdrop = self._make_backdrop()
        self._walls = [wall.footprint for wall in scenario.walls]
        greys = self._make_wall_greys()
        #: What is on the walls, to be drawn over the room's greys.
        self.painted = Paint(scenario, sides_of(scenario.room.half, self._walls, greys))
        texture = scenario.walls_texture
        # The mean of a wall's tiles: that of its antialiased rim.
        shade = 1.0 if texture.kind == "plain" else 1.0 - texture.contrast / 2
        self._wall_greys = [grey * shade for grey in greys]

    def cast(self, camera: CameraPose) -> tuple[F32, Columns]:
        """Return the depth of sky, floor and walls, float32 (480, 640) [m], and what each column shows of the walls."""
        look = math.cos(camera.yaw), math.sin(camera.yaw)
        ahead_x, ahead_y = look[0] + look[1] * self.columns, look[1] - look[0] * self.columns
        half = np.float32(self._scenario.room.half)
        with np.errstate(divide="ignore"):
            to_x = (np.copysign(half, ahead_x) - camera.x) / ahead_x
            to_y = (np.copysign(half, ahead_y) - camera.y) / ahead_y
        wall = np.minimum(to_x, to_y).astype(np.float32)
        faces = np.where(to_x < to_y, 2 * (ahead_x < 0), 1 + 2 * (ahead_y < 0))
        # All walls are equally high and higher than the camera: of a column's walls, the nearest hides the others.
        for number, shape in enumerate(self._walls, start=1):
            enters, face = meet(shape, camera.x, camera.y, ahead_x, ahead_y)
            nearer = enters < wall
            wall, faces = np.where(nearer, enters, wall), np.where(nearer, 4 * number + face, faces)
        depth: F32 = np.minimum(self.floor_depth, wall)
        top = CENTRE_Y - self._focal * (WALL_HEIGHT - self._height) / wall
        sky, end = max(0, math.ceil(top.min())), max(0, math.ceil(top.max()))
        depth[:sky] = np.inf
        depth[sky:end][np.arange(sky, end, dtype=np.float32)[:, None] < top] = np.inf
        return depth, (wall, faces)

    def paint(self, columns: Columns) -> U8:
        """Return the room in its plain greys: uint8 (480, 640)."""
        room: U8 = self._backdrop.copy()
        above, below = self._focal * (WALL_HEIGHT - self._height), self._focal * self._height
        wall, faces = columns
        edges = [0, *(np.flatnonzero(np.diff(faces)) + 1).tolist(), WIDTH]
        for start, stop in pairwise(edges):
            z = wall[[start, stop - 1]]
            # a flat wall is a straight line in 1/z: carry it on to the pixels' outer edges
            inverse = 1.0 / z
            step = (inverse[1] - inverse[0]) / max(stop - 1 - start, 1)
            left, right = inverse[0] - step / 2, inverse[1] + step / 2
            corners = [
                (start - 0.5, CENTRE_Y - above * left),
                (stop - 0.5, CENTRE_Y - above * right),
                (stop - 0.5, CENTRE_Y + below * right),
                (start - 0.5, CENTRE_Y + below * left),
            ]
            quad = np.clip(np.rint(np.array(corners) * 16), -(2**20), 2**20).astype(np.int32)
            grey = self._wall_greys[int(faces[start])]
            cv2.fillConvexPoly(room, quad, grey, cv2.LINE_AA, shift=4)
        return room

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
        x, y, _ = Sun.above(self._scenario.light).towards
        facings = [-x, -y, x, y]
        for shape in self._walls:
            cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
            facings += [cos * x + sin * y, cos * y - sin * x, -cos * x - sin * y, sin * x - cos * y]
        wall = 255 * self._scenario.light.wall
        return [min(wall * (0.895 + 0.095 * facing), 255.0) for facing in facings]
