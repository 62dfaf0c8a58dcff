"""Casting the camera's rays at solids: per pixel a depth, a brightness, and how much of it is covered.

Capsules and ellipsoids are small against their distance, so each is cast in its own parallel projection;
frusta and boxes are cast in exact perspective. Camera frame and pixels as in `camera`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_sim.camera import CENTRE_X, CENTRE_Y, FOCAL_PX, MOUNT_HEIGHT, CameraPose
from limo_sim.furniture import Box, Frustum
from limo_sim.person import Body
from limo_sim.scenario import Light

F32 = NDArray[np.float32]
Bounds = tuple[float, float, float, float]
"""left, top, right, bottom [px]."""
Window = tuple[int, int, int, int]
"""First column, first row, last column + 1, last row + 1."""

NEAR = 0.08
"""Nothing nearer than this is drawn [m]."""
_FRINGE = np.float32(1.0)  # a pixel less than half covered yields to any solid within a metre behind it


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

    `stride` casts every so many pixels only, which is enough to measure an area.
    """

    def __init__(self, window: Window, stride: int = 1) -> None:
        left, top, right, bottom = window
        self.window = window
        self.stride = stride
        self.xs: F32 = np.arange(left, right, stride, dtype=np.float32)
        self.ys: F32 = np.arange(top, bottom, stride, dtype=np.float32)[:, None]
        shape = (len(self.ys), len(self.xs))
        self.depth: F32 = np.full(shape, np.inf, np.float32)
        self.cover: F32 = np.zeros(shape, np.float32)
        self.shade: F32 = np.zeros(shape, np.float32)
        self.part: NDArray[np.uint8] = np.zeros(shape, np.uint8)

    def crop(self, left: float, top: float, right: float, bottom: float) -> tuple[slice, slice] | None:
        """Rows and columns of the canvas that a box in image pixels touches."""
        x0, y0 = self.window[0], self.window[1]
        rows, columns = self.depth.shape
        c0 = max(0, math.floor((left - x0) / self.stride))
        r0 = max(0, math.floor((top - y0) / self.stride))
        c1 = min(columns, math.ceil((right - x0) / self.stride) + 1)
        r1 = min(rows, math.ceil((bottom - y0) / self.stride) + 1)
        return (slice(r0, r1), slice(c0, c1)) if c0 < c1 and r0 < r1 else None

    def put(self, at: tuple[slice, slice], depth: F32, cover: F32, shade: F32, part: int) -> None:
        """Draw one solid where it is nearest; `cover` may leave 0 … 1."""
        order = depth + _FRINGE * (cover < 0.5)
        target = self.depth[at]
        wins = order < target
        wins &= cover > 0
        np.copyto(target, order, where=wins)
        np.copyto(self.shade[at], shade, where=wins)
        np.copyto(self.part[at], part, where=wins)
        covered = self.cover[at]
        np.maximum(covered, cover, out=covered)

    @property
    def surface(self) -> F32:
        """Depth of the object per pixel [m], where it covers the pixel at all."""
        surface: F32 = self.depth - _FRINGE * (self.cover < 0.5)
        return surface

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
        Per capsule: part, u, v, axis u, axis v, length, radius [px], taper, depth [m], its slope, m per px.
    ellipses
        Per ellipsoid: part, u, v, the three entries of the lower-triangular whitening matrix, half height and
        half width [px], depth [m], depth per canonical x and y, bulge [m].
    bounds
        Of all of it.
    """

    strips: list[list[float]]
    ellipses: list[list[float]]
    bounds: Bounds


def outline(body: Body, camera: CameraPose) -> Outline | None:
    """Project a body's parts; those that reach behind the near plane are left out, None if all do."""
    start, end = camera.to_camera(body.start), camera.to_camera(body.end)
    centre = camera.to_camera(body.centre)
    z0, z1, zc = start[:, 2], end[:, 2], centre[:, 2]
    strip_ok, ellipse_ok = np.minimum(z0, z1) > NEAR + 0.05, zc > NEAR + 0.1
    z0, z1, zc = np.maximum(z0, NEAR), np.maximum(z1, NEAR), np.maximum(zc, NEAR)
    u0, v0 = CENTRE_X + FOCAL_PX * start[:, 0] / z0, CENTRE_Y + FOCAL_PX * start[:, 1] / z0
    u1, v1 = CENTRE_X + FOCAL_PX * end[:, 0] / z1, CENTRE_Y + FOCAL_PX * end[:, 1] / z1
    r0, r1 = FOCAL_PX * body.start_radius / z0, FOCAL_PX * body.end_radius / z1
    length = np.maximum(np.hypot(u1 - u0, v1 - v0), 1e-3)
    axis_u, axis_v = (u1 - u0) / length, (v1 - v0) / length
    parts = np.arange(len(z0))
    strips = np.stack(
        [
            parts,
            u0,
            v0,
            axis_u,
            axis_v,
            length,
            r0,
            (r1 - r0) / length,
            z0,
            (z1 - z0) / length,
            (z0 + z1) / (2 * FOCAL_PX),
        ],
        axis=1,
    )[strip_ok]

    axes = camera.rotation @ body.axes
    spread = axes @ axes.transpose(0, 2, 1)
    metre = FOCAL_PX / zc
    a, b, c = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    l00 = np.sqrt(a)
    l10 = b / l00
    l11 = np.sqrt(c - l10 * l10)
    g0 = spread[:, 0, 2] / l00
    g1 = (spread[:, 1, 2] - l10 * g0) / l11
    bulge = np.sqrt(np.maximum(spread[:, 2, 2] - g0 * g0 - g1 * g1, 1e-9))
    uc, vc = CENTRE_X + FOCAL_PX * centre[:, 0] / zc, CENTRE_Y + FOCAL_PX * centre[:, 1] / zc
    half_w, half_h = metre * np.sqrt(a), metre * np.sqrt(c)
    ellipses = np.stack(
        [
            np.arange(len(zc)) + len(z0),
            uc,
            vc,
            1 / (metre * l00),
            -l10 / (metre * l00 * l11),
            1 / (metre * l11),
            half_h,
            half_w,
            zc,
            g0,
            g1,
            bulge,
        ],
        axis=1,
    )[ellipse_ok]
    if not strip_ok.any() and not ellipse_ok.any():
        return None
    left = np.concatenate([np.minimum(u0 - r0, u1 - r1)[strip_ok], (uc - half_w)[ellipse_ok]])
    right = np.concatenate([np.maximum(u0 + r0, u1 + r1)[strip_ok], (uc + half_w)[ellipse_ok]])
    top = np.concatenate([np.minimum(v0 - r0, v1 - r1)[strip_ok], (vc - half_h)[ellipse_ok]])
    bottom = np.concatenate([np.maximum(v0 + r0, v1 + r1)[strip_ok], (vc + half_h)[ellipse_ok]])
    bounds = (float(left.min()), float(top.min()), float(right.max()), float(bottom.max()))
    return Outline(strips.tolist(), ellipses.tolist(), bounds)


def cast_body(canvas: Canvas, shape: Outline, sun: Sun) -> None:
    """Cast a body; `sun` in the camera's frame."""
    for strip in shape.strips:
        _cast_strip(canvas, strip, sun)
    for ellipse in shape.ellipses:
        _cast_ellipse(canvas, ellipse, sun)


def _cast_strip(canvas: Canvas, strip: list[float], sun: Sun) -> None:
    part, u, v, axis_u, axis_v, length, radius, taper, near, slope, metre = strip
    end_u, end_v, end_radius = u + axis_u * length, v + axis_v * length, radius + taper * length
    at = canvas.crop(
        min(u - radius, end_u - end_radius),
        min(v - radius, end_v - end_radius),
        max(u + radius, end_u + end_radius),
        max(v + radius, end_v + end_radius),
    )
    if at is None:
        return
    dx, dy = canvas.xs[at[1]] - np.float32(u), canvas.ys[at[0]] - np.float32(v)
    along = axis_u * dx + axis_v * dy
    across = axis_u * dy - axis_v * dx
    on_axis = np.minimum(np.maximum(along, 0.0), length)
    radii = radius + taper * on_axis
    along -= on_axis
    along /= radii
    across /= radii
    inner = 1.0 - along * along - across * across
    root = np.sqrt(np.maximum(inner, 0.0))
    depth = near + slope * on_axis - metre * radii * root
    cover = inner * (0.25 * (radius + end_radius) / canvas.stride) + 0.5
    x, y, z = sun.towards
    lit_along, lit_across = sun.gain * (x * axis_u + y * axis_v), sun.gain * (y * axis_u - x * axis_v)
    shade = sun.base + lit_along * along + lit_across * across - (sun.gain * z) * root
    canvas.put(at, depth, cover, shade, int(part))


def _cast_ellipse(canvas: Canvas, ellipse: list[float], sun: Sun) -> None:
    part, u, v, w00, w10, w11, half_h, half_w, centre, slope_x, slope_y, bulge = ellipse
    at = canvas.crop(u - half_w, v - half_h, u + half_w, v + half_h)
    if at is None:
        return
    dx, dy = canvas.xs[at[1]] - np.float32(u), canvas.ys[at[0]] - np.float32(v)
    x = w00 * dx
    y = w10 * dx + w11 * dy
    inner = 1.0 - x * x - y * y
    root = np.sqrt(np.maximum(inner, 0.0))
    depth = centre + slope_x * x + slope_y * y - bulge * root
    cover = inner * (0.25 * (half_w + half_h) / canvas.stride) + 0.5
    sun_x, sun_y, sun_z = sun.towards
    shade = sun.base + (sun.gain * sun_x) * x + (sun.gain * sun_y) * y - (sun.gain * sun_z) * root
    canvas.put(at, depth, cover, shade, int(part))


def cast_frustum(canvas: Canvas, solid: Frustum, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright cone or cylinder that stands in the arena's frame; `sun` in the camera's frame."""
    [[x0, _, z0]] = camera.to_camera(np.array([[solid.x, solid.y, 0.0]])).tolist()
    widest = max(solid.r0, solid.r1)
    bounds = upright_bounds(x0, z0, widest, solid.z0, solid.z1)
    at = canvas.crop(*bounds) if bounds else None
    if at is None:
        return
    right, down = (canvas.xs[at[1]] - CENTRE_X) / FOCAL_PX, (canvas.ys[at[0]] - CENTRE_Y) / FOCAL_PX
    taper = (solid.r1 - solid.r0) / (solid.z1 - solid.z0)
    level = solid.r0 + taper * (MOUNT_HEIGHT - solid.z0)  # radius at the camera's height
    a = right * right + (1.0 - (taper * down) ** 2)
    b = right * x0 + (z0 - (level * taper) * down)
    c = x0 * x0 + z0 * z0 - level * level
    discriminant = b * b - a * c
    depth = (b - np.sqrt(np.maximum(discriminant, 0.0))) / a
    np.maximum(depth, NEAR, out=depth)
    height = MOUNT_HEIGHT - down * depth
    radii = np.maximum(level - taper * down * depth, 1e-3)
    pixels = FOCAL_PX / canvas.stride / depth
    cover = discriminant / (a * radii) * (0.5 * pixels) + 0.5
    np.minimum(cover, (solid.z1 - height) * pixels + 0.5, out=cover)
    np.minimum(cover, (height - solid.z0) * pixels + 0.5, out=cover)
    cover[depth <= NEAR] = 0.0
    x, _, z = sun.towards
    shade = sun.base + sun.gain * (x * (right * depth - x0) + z * (depth - z0)) / radii
    canvas.put(at, depth, cover, shade, part)


def cast_box(canvas: Canvas, solid: Box, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright box that stands in the arena's frame; `sun` in the arena's frame."""
    [[x0, _, z0]] = camera.to_camera(np.array([[solid.x, solid.y, 0.0]])).tolist()
    bounds = upright_bounds(x0, z0, math.hypot(solid.half_x, solid.half_y), solid.z0, solid.z1)
    at = canvas.crop(*bounds) if bounds else None
    if at is None:
        return
    right, down = (canvas.xs[at[1]] - CENTRE_X) / FOCAL_PX, (canvas.ys[at[0]] - CENTRE_Y) / FOCAL_PX
    cos, sin = math.cos(solid.yaw), math.sin(solid.yaw)
    look_cos, look_sin = math.cos(camera.yaw - solid.yaw), math.sin(camera.yaw - solid.yaw)
    from_x, from_y = camera.x - solid.x, camera.y - solid.y
    in_x, out_x = _slab(cos * from_x + sin * from_y, look_cos + look_sin * right, solid.half_x)
    in_y, out_y = _slab(cos * from_y - sin * from_x, look_sin - look_cos * right, solid.half_y)
    middle, half = (solid.z0 + solid.z1) / 2, (solid.z1 - solid.z0) / 2
    in_z, out_z = _slab(MOUNT_HEIGHT - middle, -down, half)
    in_side = np.maximum(in_x, in_y)
    depth = np.maximum(in_side, in_z)
    hit = (depth < np.minimum(np.minimum(out_x, out_y), out_z)) & (depth > NEAR)
    x, y, z = sun.towards
    facing_x = math.copysign(1.0, cos * from_x + sin * from_y) * (cos * x + sin * y)
    facing_y = math.copysign(1.0, cos * from_y - sin * from_x) * (cos * y - sin * x)
    facing_z = math.copysign(1.0, MOUNT_HEIGHT - middle) * z
    side = np.where(in_x > in_y, facing_x, facing_y)
    shade = sun.base + sun.gain * np.where(in_z > in_side, facing_z, side)
    canvas.put(at, depth, hit.astype(np.float32), shade.astype(np.float32), part)


def _slab(origin: float, direction: F32, half: float) -> tuple[F32, F32]:
    """Where rays enter and leave the layer -half … half."""
    inverse = 1.0 / np.where(np.abs(direction) < 1e-9, np.float32(1e-9), direction)
    one, other = (-half - origin) * inverse, (half - origin) * inverse
    return np.minimum(one, other), np.maximum(one, other)


def upright_bounds(x: float, z: float, radius: float, low: float, high: float) -> Bounds | None:
    """Image box that holds an upright cylinder; None behind the camera, everything beside it."""
    near = z - radius
    if z + radius < NEAR:
        return None
    if near < NEAR:
        return -1e6, -1e6, 1e6, 1e6
    far = z + radius
    sides = [CENTRE_X + FOCAL_PX * (x + side) / depth for side in (-radius, radius) for depth in (near, far)]
    ends = [CENTRE_Y + FOCAL_PX * (MOUNT_HEIGHT - end) / depth for end in (low, high) for depth in (near, far)]
    return min(sides) - 1, min(ends) - 1, max(sides) + 1, max(ends) + 1
