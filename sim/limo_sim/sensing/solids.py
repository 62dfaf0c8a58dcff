"""Where solids are in the image; `_core.Canvas` casts the rays at them, in compiled code.

Capsules and ellipsoids are small against their distance, so each is cast in its own parallel projection;
frusta and boxes are cast in exact perspective. Camera frame and pixels as in `camera`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog._core import Canvas
from limo_sim.sensing.camera import CENTRE_X, CENTRE_Y, CameraPose
from limo_sim.world.furniture import Box, Frustum
from limo_sim.world.person import BodyMesh
from limo_sim.world.scenario import Light

F32 = NDArray[np.float32]
Bounds = tuple[float, float, float, float]
"""left, top, right, bottom [px]."""
Window = tuple[int, int, int, int]
"""First column, first row, last column + 1, last row + 1."""

NEAR = 0.08
"""Nothing nearer than this is drawn [m]."""
TONES = 4.0
"""Brightness stays below this, so that a solid's number and its brightness fit in one value; as in `_core.Canvas`."""


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

    @property
    def light(self) -> tuple[float, float, float, float, float]:
        """The numbers that a canvas takes."""
        return *self.towards, self.base, self.gain


@dataclass(frozen=True, slots=True)
class Outline:
    """A body as the camera sees it: parts as rounded strips or ellipses in the image, ready to be cast."""

    #: float64 (N, 12), per capsule: part, u, v, axis u, axis v, length, radius [px], taper, depth [m], depth per px, m
    #: per px, sine of the angle between axis and image.
    strips: NDArray[np.float64]
    #: float64 (M, 12), per ellipsoid: part, u, v, the three entries of the lower-triangular whitening matrix, half
    #: height and half width [px], depth [m], depth per canonical x and y, bulge [m].
    ellipses: NDArray[np.float64]
    bounds: Bounds  #: of all of it


def outline(body: BodyMesh, camera: CameraPose) -> Outline | None:
    """Project a body's parts; those that reach behind the near plane are left out, None if all do."""
    start, end = camera.to_camera(body.start), camera.to_camera(body.end)
    centre = camera.to_camera(body.centre)
    z0, z1, zc = start[:, 2], end[:, 2], centre[:, 2]
    strip_ok, ellipse_ok = np.minimum(z0, z1) > NEAR + 0.05, zc > NEAR + 0.1
    z0, z1, zc = np.maximum(z0, NEAR), np.maximum(z1, NEAR), np.maximum(zc, NEAR)
    focal = camera.focal_px
    u0, v0 = CENTRE_X + focal * start[:, 0] / z0, CENTRE_Y + focal * start[:, 1] / z0
    u1, v1 = CENTRE_X + focal * end[:, 0] / z1, CENTRE_Y + focal * end[:, 1] / z1
    r0, r1 = focal * body.start_radius / z0 + 0.5, focal * body.end_radius / z1 + 0.5
    length = np.maximum(np.hypot(u1 - u0, v1 - v0), 1e-3)
    axis_u, axis_v = (u1 - u0) / length, (v1 - v0) / length
    metre = (z0 + z1) / (2 * focal)
    lean = (z1 - z0) / np.hypot(z1 - z0, length * metre)
    metre *= 1.0 - 1.0 / (r0 + r1)  # the half pixel by which it is too wide adds no depth
    parts, taper, slope = np.arange(len(z0)), (r1 - r0) / length, (z1 - z0) / length
    strips = np.stack([parts, u0, v0, axis_u, axis_v, length, r0, taper, z0, slope, metre, lean], axis=1)

    axes = camera.rotation @ body.axes
    spread = axes @ axes.transpose(0, 2, 1)
    pixels = focal / zc
    a, b, c = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    l00 = np.sqrt(a)
    l10 = b / l00
    l11 = np.sqrt(c - l10 * l10)
    slope_x = spread[:, 0, 2] / l00
    slope_y = (spread[:, 1, 2] - l10 * slope_x) / l11
    bulge = np.sqrt(np.maximum(spread[:, 2, 2] - slope_x**2 - slope_y**2, 1e-9))
    l00, l10, l11 = pixels * l00 + 0.5, pixels * l10, pixels * l11 + 0.5
    uc, vc = CENTRE_X + focal * centre[:, 0] / zc, CENTRE_Y + focal * centre[:, 1] / zc
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
    return Outline(strips[strip_ok], ellipses[ellipse_ok], bounds)


def covers(shape: Outline, x: F32, y: F32) -> NDArray[np.bool_]:
    """Whether pixels at float32 (N,) columns `x` and rows `y`, in the image or not, belong to a body."""
    inside = np.zeros(len(x), np.bool_)
    if len(shape.strips):
        _, u, v, axis_u, axis_v, length, radius, taper, *_ = shape.strips.astype(np.float32).T[..., None]
        along = axis_u * (x - u) + axis_v * (y - v)
        across = axis_u * (y - v) - axis_v * (x - u)
        on_axis = np.minimum(np.maximum(along, 0.0), length)
        inner = (radius + taper * on_axis) ** 2 - across**2 - (along - on_axis) ** 2
        inside |= (inner >= 0.5 * (2.0 * radius + taper * length)).any(axis=0)
    if len(shape.ellipses):
        _, u, v, w00, w10, w11, half_h, half_w, *_ = shape.ellipses.astype(np.float32).T[..., None]
        inner = 1.0 - (w00 * (x - u)) ** 2 - (w10 * (x - u) + w11 * (y - v)) ** 2
        inside |= (inner >= 2.0 / (half_w + half_h)).any(axis=0)
    return inside


def cast_frustum(canvas: Canvas, solid: Frustum, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright cone or cylinder that stands in the arena's frame; `sun` in the camera's frame."""
    x, z = camera.ahead_of(solid.x, solid.y)
    bounds = upright_bounds(camera, (x, z), max(solid.r0, solid.r1), (solid.z0, solid.z1))
    if bounds is None:
        return
    taper = (solid.r1 - solid.r0) / (solid.z1 - solid.z0)
    half_pixel = 0.5 * max(z, NEAR) / camera.focal_px
    level = solid.r0 + taper * (camera.height - solid.z0) + half_pixel  # radius at the camera's height
    offset = x * x + z * z - level * level
    ends = solid.z1 - camera.height, camera.height - solid.z0
    canvas.frustum((part, *bounds, x, z, taper, level, half_pixel, offset, *ends), sun.light)


def cast_box(canvas: Canvas, solid: Box, camera: CameraPose, sun: Sun, part: int) -> None:
    """Cast an upright box that stands in the arena's frame; `sun` in the arena's frame."""
    radius = math.hypot(solid.half_x, solid.half_y)
    bounds = upright_bounds(camera, camera.ahead_of(solid.x, solid.y), radius, (solid.z0, solid.z1))
    if bounds is None:
        return
    cos, sin = math.cos(solid.yaw), math.sin(solid.yaw)
    look_cos, look_sin = math.cos(camera.yaw - solid.yaw), math.sin(camera.yaw - solid.yaw)
    dx, dy = camera.x - solid.x, camera.y - solid.y
    middle = (solid.z0 + solid.z1) / 2
    # the camera and the sun in the box's frame, whose origin is in its middle
    at = cos * dx + sin * dy, cos * dy - sin * dx, camera.height - middle
    x, y, z = sun.towards
    shines = cos * x + sin * y, cos * y - sin * x, z
    half = solid.half_x, solid.half_y, (solid.z1 - solid.z0) / 2
    sides = [side for h, a in zip(half, at, strict=True) for side in (-h - a, h - a)]
    base = TONES * part + sun.base
    tones = [sun.gain * (math.copysign(1.0, a) * shine) + base for a, shine in zip(at, shines, strict=True)]
    canvas.slab((*bounds, *sides, look_cos, look_sin, look_sin, -look_cos, *tones))


def upright_bounds(
    camera: CameraPose, at: tuple[float, float], radius: float, ends: tuple[float, float], near: float = NEAR
) -> Bounds | None:
    """Return the image box that holds what of an upright cylinder is beyond `near` [m]; None if nothing is.

    It stands `at` so far to the right of the camera and ahead of it, and has its `ends` so high above the floor [m].
    """
    (x, z), focal = at, camera.focal_px
    near, far = max(z - radius, near), z + radius
    if far < near:
        return None
    sides = [CENTRE_X + focal * (x + side) / depth for side in (-radius, radius) for depth in (near, far)]
    rows = [CENTRE_Y + focal * (camera.height - end) / depth for end in ends for depth in (near, far)]
    return min(sides) - 1, min(rows) - 1, max(sides) + 1, max(rows) + 1
