"""Casting the camera's rays at solids: per pixel a depth, a brightness, and how much of it is covered.

Capsules and ellipsoids are small against their distance, so each is cast in its own parallel projection;
frusta and boxes are cast in exact perspective. Camera frame and pixels as in `camera`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limo_hog.extras import needed
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, FOCAL_PX, MOUNT_HEIGHT, CameraPose
from limo_sim.world.furniture import Box, Frustum
from limo_sim.world.person import BodyMesh
from limo_sim.world.scenario import Light

with needed(by="the arena's camera", what="OpenCV", install="'limo-hog[cv]'"):
    import cv2

F32 = NDArray[np.float32]
Bounds = tuple[float, float, float, float]
"""left, top, right, bottom [px]."""
Window = tuple[int, int, int, int]
"""First column, first row, last column + 1, last row + 1."""

NEAR = 0.08
"""Nothing nearer than this is drawn [m]."""
_UPRIGHT = 0.2  # a capsule whose axis leans less than this [sine] is cast as if it lay in the image plane
TONES = 4.0
"""Brightness stays below this, so that a solid's number and its brightness fit in one value."""
BAND = 1 << 16
"""Pixels that are worked on at a time, so that scratch arrays stay small enough to be had without page faults."""


@dataclass(frozen=True, slots=True)
class Sun:
    """Light in some frame: unit vector towards the sun, and how it shades a surface turned towards it."""

    towards: tuple[float, float, float]
    base: float
    gain: float

    @classmethod
    def above(cls, light: Light) -> Sun:
        """Return the sun of a scenario, in the arena's frame."""
        length = math.hypot(*light.sun)
        x, y, z = (-part / length for part in light.sun)
        return cls((x, y, z), light.ambient + 0.5 * light.diffuse, 0.5 * light.diffuse)

    def seen_from(self, camera: CameraPose) -> Sun:
        """Return the same sun in the camera's frame."""
        x, y, z = (camera.rotation @ np.array(self.towards)).tolist()
        return Sun((x, y, z), self.base, self.gain)


class Canvas:
    """A z-buffer over a window of the image, on which the solids of one object are cast.

    Solids are cast half a pixel too wide, and `cover` falls from 1 to 0 over the last pixel: the edges come out
    smooth.

    Attributes
    ----------
    depth
        float32 [m], of the nearest solid; inf where there is none.
    cover
        float32, how much of a pixel is covered: its depth [px] inside the silhouette.
    tone
        float32, number of the solid x `TONES` + brightness; a single row where all rows are equal.
    """

    def __init__(self, window: Window, sheet: F32, *, solids: int) -> None:
        """Begin on scratch memory, float32 (3, at least as many as there are pixels), for a number of solids."""
        left, top, right, bottom = window
        self.window = window
        self.xs: F32 = np.arange(left, right, dtype=np.float32)
        self.ys: F32 = np.arange(top, bottom, dtype=np.float32)[:, None]
        shape = bottom - top, right - left
        self._shape, self._single = shape, solids == 1
        self.depth, self.cover, self.tone = sheet[:, : shape[0] * shape[1]].reshape(3, *shape)
        self._is_blank = self._single
        if not self._single:
            self._clear()

    def _clear(self) -> None:
        self.depth.fill(np.inf)
        self.cover.fill(0.0)
        self.tone.fill(0.0)
        self._is_blank = False

    def finish(self) -> None:
        """Leave a canvas on which nothing was put empty."""
        if self._is_blank:
            self._clear()

    def bands(self, left: float, top: float, right: float, bottom: float) -> list[tuple[slice, slice]]:
        """Rows and columns of the canvas that a box in image pixels touches, in bands that fit the cache."""
        x0, y0 = self.window[0], self.window[1]
        rows, columns = self._shape
        c0, c1 = max(0, math.floor(left - x0)), min(columns, math.ceil(right - x0) + 1)
        r0, r1 = max(0, math.floor(top - y0)), min(rows, math.ceil(bottom - y0) + 1)
        if c0 >= c1 or r0 >= r1:
            return []
        if (r1 - r0) * (c1 - c0) <= BAND:
            return [(slice(r0, r1), slice(c0, c1))]
        step = max(1, BAND // (c1 - c0))
        return [(slice(row, min(row + step, r1)), slice(c0, c1)) for row in range(r0, r1, step)]

    def put(self, at: tuple[slice, slice], depth: F32, cover: F32, tone: F32) -> None:
        """Draw one solid where it is nearest; its depth is NaN where it is not."""
        if self._is_blank and depth.shape == self._shape:
            # The only solid, and it touches all of the canvas: nothing to compare with. Its depth is NaN for inf.
            self.depth, self.cover, self.tone, self._is_blank = depth, cover, tone, False
            return
        if self._is_blank:
            self._clear()
        nearest, covered = self.depth[at], self.cover[at]
        # OpenCV's masked copy is ten times as fast as numpy's.
        wins = (depth < nearest).view(np.uint8)
        cv2.copyTo(depth, wins, nearest)
        cv2.copyTo(tone if tone.shape == wins.shape else np.repeat(tone, len(wins), axis=0), wins, self.tone[at])
        np.fmax(covered, cover, out=covered)

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Pixels that belong to the object: at least half covered."""
        return self.cover >= 0.5


@dataclass(frozen=True, slots=True)
class Outline:
    """A body as the camera sees it: parts as rounded strips or ellipses in the image, ready to be cast.

    Attributes
    ----------
    strips
        Per capsule: part, u, v, axis u, axis v, length, radius [px], taper, depth [m], depth per px, m per px,
        sine of the angle between axis and image.
    ellipses
        Per ellipsoid: part, u, v, the three entries of the lower-triangular whitening matrix, half height and
        half width [px], depth [m], depth per canonical x and y, bulge [m].
    bounds
        Of all of it.
    """

    strips: list[list[float]]
    ellipses: list[list[float]]
    bounds: Bounds


def outline(body: BodyMesh, camera: CameraPose) -> Outline | None:
    """Project a body's parts; those that reach behind the near plane are left out, None if all do."""
    start, end = camera.to_camera(body.start), camera.to_camera(body.end)
    centre = camera.to_camera(body.centre)
    z0, z1, zc = start[:, 2], end[:, 2], centre[:, 2]
    strip_ok, ellipse_ok = np.minimum(z0, z1) > NEAR + 0.05, zc > NEAR + 0.1
    z0, z1, zc = np.maximum(z0, NEAR), np.maximum(z1, NEAR), np.maximum(zc, NEAR)
    u0, v0 = CENTRE_X + FOCAL_PX * start[:, 0] / z0, CENTRE_Y + FOCAL_PX * start[:, 1] / z0
    u1, v1 = CENTRE_X + FOCAL_PX * end[:, 0] / z1, CENTRE_Y + FOCAL_PX * end[:, 1] / z1
    r0, r1 = FOCAL_PX * body.start_radius / z0 + 0.5, FOCAL_PX * body.end_radius / z1 + 0.5
    length = np.maximum(np.hypot(u1 - u0, v1 - v0), 1e-3)
    axis_u, axis_v = (u1 - u0) / length, (v1 - v0) / length
    metre = (z0 + z1) / (2 * FOCAL_PX)
    lean = (z1 - z0) / np.hypot(z1 - z0, length * metre)
    metre *= 1.0 - 1.0 / (r0 + r1)  # the half pixel by which it is too wide adds no depth
    parts, taper, slope = np.arange(len(z0)), (r1 - r0) / length, (z1 - z0) / length
    strips = np.stack([parts, u0, v0, axis_u, axis_v, length, r0, taper, z0, slope, metre, lean], axis=1)

    axes = camera.rotation @ body.axes
    spread = axes @ axes.transpose(0, 2, 1)
    pixels = FOCAL_PX / zc
    a, b, c = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    l00 = np.sqrt(a)
    l10 = b / l00
    l11 = np.sqrt(c - l10 * l10)
    slope_x = spread[:, 0, 2] / l00
    slope_y = (spread[:, 1, 2] - l10 * slope_x) / l11
    bulge = np.sqrt(np.maximum(spread[:, 2, 2] - slope_x**2 - slope_y**2, 1e-9))
    l00, l10, l11 = pixels * l00 + 0.5, pixels * l10, pixels * l11 + 0.5
    uc, vc = CENTRE_X + FOCAL_PX * centre[:, 0] / zc, CENTRE_Y + FOCAL_PX * centre[:, 1] / zc
    half_w, half_h = l00, np.hypot(l10, l11)
    parts, w10 = len(z0) + np.arange(len(zc)), -l10 / (l00 * l11)
    ellipses = np.stack([parts, uc, vc, 1 / l00, w10, 1 / l11, half_h, half_w, zc, slope_x, slope_y, bulge], axis=1)
    if not strip_ok.any() and not ellipse_ok.any():
        return None
    left = np.concatenate([np.minimum(u0 - r0, u1 - r1)[strip_ok], (uc - half_w)[ellipse_ok]])
    right = np.concatenate([np.maximum(u0 + r0, u1 + r1)[strip_ok], (uc + half_w)[ellipse_ok]])
    top = np.concatenate([np.minimum(v0 - r0, v1 - r1)[strip_ok], (vc - half_h)[ellipse_ok]])
    bottom = np.concatenate([np.maximum(v0 + r0, v1 + r1)[strip_ok], (vc + half_h)[ellipse_ok]])
    bounds = (float(left.min()), float(top.min()), float(right.max()), float(bottom.max()))
    return Outline(strips[strip_ok].tolist(), ellipses[ellipse_ok].tolist(), bounds)


def cast_body(canvas: Canvas, shape: Outline, sun: Sun) -> None:
    """Cast a body; `sun` in the camera's frame."""
    with np.errstate(invalid="ignore"):  # the root of a negative number is NaN: a miss
        for strip in shape.strips:
            _cast_strip(canvas, strip, sun)
        for ellipse in shape.ellipses:
            _cast_ellipse(canvas, ellipse, sun)


def _cast_strip(canvas: Canvas, strip: list[float], sun: Sun) -> None:
    part, u, v, axis_u, axis_v, length, radius, taper, near, slope, metre, lean = strip
    end_u, end_v, end_radius = u + axis_u * length, v + axis_v * length, radius + taper * length
    left, right = min(u - radius, end_u - end_radius), max(u + radius, end_u + end_radius)
    top, bottom = min(v - radius, end_v - end_radius), max(v + radius, end_v + end_radius)
    x, y, z = sun.towards
    for at in canvas.bands(left, top, right, bottom):
        dx, dy = canvas.xs[at[1]] - np.float32(u), canvas.ys[at[0]] - np.float32(v)
        along = axis_u * dx + axis_v * dy
        across = axis_u * dy - axis_v * dx
        on_axis = np.minimum(np.maximum(along, 0.0), length)
        radii = taper * on_axis
        radii += radius
        beyond = along - on_axis
        room = radii * radii
        room -= across * across
        inner = room - beyond * beyond
        root = np.sqrt(inner)
        if abs(lean) > _UPRIGHT:
            # the ray meets a leaning capsule first in a ball that is not the one beneath the pixel
            on_axis = np.minimum(np.maximum(along - lean * root, 0.0), length)
            beyond = along - on_axis
            room -= beyond * beyond
            root = np.sqrt(np.maximum(room, 0.0 * root))
        depth = slope * on_axis
        depth += near
        depth -= metre * root
        beyond *= sun.gain * (x * axis_u + y * axis_v)
        across *= sun.gain * (y * axis_u - x * axis_v)
        beyond += across
        beyond -= (sun.gain * z) * root
        beyond /= radii
        beyond += TONES * part + sun.base
        inner *= 1.0 / (radius + end_radius)
        canvas.put(at, depth, inner, beyond)


def _cast_ellipse(canvas: Canvas, ellipse: list[float], sun: Sun) -> None:
    part, u, v, w00, w10, w11, half_h, half_w, centre, slope_x, slope_y, bulge = ellipse
    sun_x, sun_y, sun_z = sun.towards
    for at in canvas.bands(u - half_w, v - half_h, u + half_w, v + half_h):
        dx, dy = canvas.xs[at[1]] - np.float32(u), canvas.ys[at[0]] - np.float32(v)
        x = w00 * dx
        y = w10 * dx + w11 * dy
        inner = 1.0 - x * x - y * y
        root = np.sqrt(inner)
        depth = (slope_x * x + centre) + slope_y * y
        depth -= bulge * root
        tone = (sun.gain * sun_x) * x + (sun.gain * sun_y) * y
        tone -= (sun.gain * sun_z) * root
        tone += TONES * part + sun.base
        inner *= 0.25 * (half_w + half_h)
        canvas.put(at, depth, inner, tone)


def covers(shape: Outline, x: F32, y: F32) -> NDArray[np.bool_]:
    """Whether pixels at float32 (N,) columns `x` and rows `y`, in the image or not, belong to a body."""
    inside = np.zeros(len(x), np.bool_)
    if shape.strips:
        _, u, v, axis_u, axis_v, length, radius, taper, *_ = np.array(shape.strips, np.float32).T[..., None]
        along = axis_u * (x - u) + axis_v * (y - v)
        across = axis_u * (y - v) - axis_v * (x - u)
        on_axis = np.minimum(np.maximum(along, 0.0), length)
        inner = (radius + taper * on_axis) ** 2 - across**2 - (along - on_axis) ** 2
        inside |= (inner >= 0.5 * (2.0 * radius + taper * length)).any(axis=0)
    if shape.ellipses:
        _, u, v, w00, w10, w11, half_h, half_w, *_ = np.array(shape.ellipses, np.float32).T[..., None]
        inner = 1.0 - (w00 * (x - u)) ** 2 - (w10 * (x - u) + w11 * (y - v)) ** 2
        inside |= (inner >= 2.0 / (half_w + half_h)).any(axis=0)
    return inside


def cast_frustum(canvas: Canvas, solid: Frustum, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright cone or cylinder that stands in the arena's frame; `sun` in the camera's frame."""
    x0, z0 = camera.ahead_of(solid.x, solid.y)
    widest = max(solid.r0, solid.r1)
    bounds = upright_bounds(x0, z0, widest, solid.z0, solid.z1)
    if bounds is None:
        return
    taper = (solid.r1 - solid.r0) / (solid.z1 - solid.z0)
    half_pixel = 0.5 * max(z0, NEAR) / FOCAL_PX
    level = solid.r0 + taper * (MOUNT_HEIGHT - solid.z0) + half_pixel  # radius at the camera's height
    c = x0 * x0 + z0 * z0 - level * level
    x, _, z = sun.towards
    for at in canvas.bands(*bounds):
        right, down = (canvas.xs[at[1]] - CENTRE_X) / FOCAL_PX, (canvas.ys[at[0]] - CENTRE_Y) / FOCAL_PX
        # a cylinder's rays differ by column only: `lift` is then a number, and most of this one row
        lift: Any = taper * down if taper else 0.0
        a = right * right + (1.0 - lift * lift)
        b = right * x0 + (z0 - level * lift)
        with np.errstate(invalid="ignore"):
            discriminant = b * b - a * c
            depth = (b - np.sqrt(discriminant)) / a
            radii = level - lift * depth
            depth += half_pixel
            pixels = FOCAL_PX / depth
            cover = 0.5 * pixels * discriminant / (a * radii)
            below_top, above_foot = FOCAL_PX * down + 0.5, 0.5 - FOCAL_PX * down
            cover = np.minimum(cover, (solid.z1 - MOUNT_HEIGHT) * pixels + below_top)
            np.minimum(cover, (MOUNT_HEIGHT - solid.z0) * pixels + above_foot, out=cover)
            tone = (sun.gain / radii) * (x * (right * depth - x0) + z * (depth - z0)) + (TONES * part + sun.base)
            depth = np.where((cover > 0) & (depth > NEAR), depth, np.float32(np.nan))
        canvas.put(at, depth, cover, tone if tone.ndim > 1 else tone[None])


def cast_box(canvas: Canvas, solid: Box, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright box that stands in the arena's frame; `sun` in the arena's frame."""
    x0, z0 = camera.ahead_of(solid.x, solid.y)
    bounds = upright_bounds(x0, z0, math.hypot(solid.half_x, solid.half_y), solid.z0, solid.z1)
    if bounds is None:
        return
    cos, sin = math.cos(solid.yaw), math.sin(solid.yaw)
    look_cos, look_sin = math.cos(camera.yaw - solid.yaw), math.sin(camera.yaw - solid.yaw)
    from_x, from_y = camera.x - solid.x, camera.y - solid.y
    middle, half = (solid.z0 + solid.z1) / 2, (solid.z1 - solid.z0) / 2
    x, y, z = sun.towards
    facing_x = math.copysign(1.0, cos * from_x + sin * from_y) * (cos * x + sin * y)
    facing_y = math.copysign(1.0, cos * from_y - sin * from_x) * (cos * y - sin * x)
    facing_z = math.copysign(1.0, MOUNT_HEIGHT - middle) * z
    for at in canvas.bands(*bounds):
        right, down = (canvas.xs[at[1]] - CENTRE_X) / FOCAL_PX, (canvas.ys[at[0]] - CENTRE_Y) / FOCAL_PX
        in_x, out_x = slab(cos * from_x + sin * from_y, look_cos + look_sin * right, solid.half_x)
        in_y, out_y = slab(cos * from_y - sin * from_x, look_sin - look_cos * right, solid.half_y)
        in_z, out_z = slab(MOUNT_HEIGHT - middle, -down, half)
        in_side = np.maximum(in_x, in_y)
        depth = np.maximum(in_side, in_z)
        hit = (depth < np.minimum(np.minimum(out_x, out_y), out_z)) & (depth > NEAR)
        depth[~hit] = np.nan
        side = np.where(in_x > in_y, facing_x, facing_y)
        tone = sun.gain * np.where(in_z > in_side, facing_z, side) + (TONES * part + sun.base)
        canvas.put(at, depth, hit.astype(np.float32), tone.astype(np.float32))


def slab(origin: float, direction: F32, half: float) -> tuple[F32, F32]:
    """Where rays enter and leave the layer -half … half."""
    inverse = 1.0 / np.where(np.abs(direction) < 1e-9, np.float32(1e-9), direction)
    one, other = (-half - origin) * inverse, (half - origin) * inverse
    return np.minimum(one, other), np.maximum(one, other)


def upright_bounds(x: float, z: float, radius: float, low: float, high: float, near: float = NEAR) -> Bounds | None:
    """Image box that holds what of an upright cylinder is beyond `near` [m]; None if nothing is."""
    near, far = max(z - radius, near), z + radius
    if far < near:
        return None
    sides = [CENTRE_X + FOCAL_PX * (x + side) / depth for side in (-radius, radius) for depth in (near, far)]
    ends = [CENTRE_Y + FOCAL_PX * (MOUNT_HEIGHT - end) / depth for end in (low, high) for depth in (near, far)]
    return min(sides) - 1, min(ends) - 1, max(sides) + 1, max(ends) + 1
