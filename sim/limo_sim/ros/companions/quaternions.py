"""Rotations as quaternions (x, y, z, w), and transforms made of one and a translation [m]."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


class Rigid(NamedTuple):
    """A rotation, then a translation: what carries coordinates of a child frame to its parent's."""

    translation: Vector
    rotation: Vector

    def apply(self, point: Vector) -> Vector:
        """Carry a point, (3,) [m]."""
        return rotate(self.rotation, point) + self.translation

    def after(self, first: Rigid) -> Rigid:
        """Return the transform that does `first`, then this one."""
        return Rigid(self.apply(first.translation), multiply(self.rotation, first.rotation))

    def inverse(self) -> Rigid:
        """Return the transform back."""
        back = self.rotation * _BACK
        return Rigid(-rotate(back, self.translation), back)


def rigid_of(stamped: Any) -> Rigid:
    """Return what a TransformStamped says."""
    place, turn = stamped.transform.translation, stamped.transform.rotation
    return Rigid(np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w]))


IDENTITY = Rigid(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
#: Times this a quaternion of length 1 is the rotation back.
_BACK = np.array([-1.0, -1.0, -1.0, 1.0])


def multiply(a: Vector, b: Vector) -> Vector:
    """Return Hamilton's product: rotates by `b`, then by `a`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def rotate(q: Vector, point: Vector) -> Vector:
    """Rotate a point, (3,)."""
    return multiply(multiply(q, np.append(point, 0.0)), q * _BACK)[:3]


def slerp(a: Vector, b: Vector, share: float) -> Vector:
    """Interpolate on the sphere (Shoemake 1985), the shorter way round; `share` from 0 to 1."""
    cosine = float(np.dot(a, b))
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-6:
        return a
    mixed: Vector = (math.sin((1 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle)
    return mixed


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = "sxyz") -> tuple[float, ...]:
    """Return the quaternion of roll, pitch and yaw [rad] about fixed axes, as tf_transformations does."""
    _only_fixed(axes)
    parts = [
        np.array([*(math.sin(angle / 2) * np.eye(3)[i]), math.cos(angle / 2)]) for i, angle in enumerate((ai, aj, ak))
    ]
    return tuple(float(value) for value in multiply(parts[2], multiply(parts[1], parts[0])))


def euler_from_quaternion(quaternion: tuple[float, ...], axes: str = "sxyz") -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] about fixed axes, as tf_transformations does."""
    _only_fixed(axes)
    x, y, z, w = quaternion
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def _only_fixed(axes: str) -> None:
    if axes != "sxyz":
        raise ValueError(f"axes {axes!r} are not offered: want 'sxyz', roll, pitch and yaw about fixed axes")
