"""Ways around obstacles on the floor plan: the shortest polyline between two places.

The visibility graph of T. Lozano-Pérez and M. A. Wesley, "An algorithm for planning collision-free paths among
polyhedral obstacles", Communications of the ACM 22 (1979) 560-570: its nodes are the corners of the widened obstacles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.furniture import Disc, Rectangle
from limo_sim.world.rays import slab

F64 = NDArray[np.float64]
Point = tuple[float, float]

_SIDES = 8  # of the polygon whose corners stand for a disc
# Ways pass a widened obstacle's corner this much outside of it [m], so that rounding does not close them.
_SLACK = 1e-3


class FloorPlan:
    """Obstacles on a floor, in the arena's frame: what is near, what hides what, and how to get round.

    The room's outer walls stand at ± `half`; ways keep a `margin` from them and from obstacles [m].
    """

    def __init__(self, shapes: Sequence[Disc | Rectangle], half: float, margin: float) -> None:
        blocks = [shape for shape in shapes if isinstance(shape, Rectangle)]
        discs = [shape for shape in shapes if isinstance(shape, Disc)]
        self._margin = margin
        self._middle = _pairs([(s.x, s.y) for s in blocks] + [(s.x, s.y) for s in discs])
        turns = _pairs([(math.cos(s.yaw), math.sin(s.yaw)) for s in blocks])
        self._cos, self._sin = turns[:, 0, None], turns[:, 1, None]
        self._halves = _pairs([(s.half_x, s.half_y) for s in blocks])
        self._radii = np.array([s.radius for s in discs], dtype=np.float64)
        self._corners = [corner for shape in shapes for corner in _corners(shape, margin + _SLACK)]
        self._half = half

    @cached_property
    def _nodes(self) -> F64:
        """Where ways may turn: float64 (k, 2) [m]."""
        kept = _pairs([node for node in self._corners if max(map(abs, node)) <= self._half - self._margin])
        # A node within another widened obstacle is none: the way from it to itself crosses that obstacle.
        return np.asarray(kept[~self._crossed(kept, kept + 1e-9, self._margin)])

    def away(self, position: F64) -> F64:
        """Return the way from each obstacle's nearest point to each place, float64 (n, 2) [m].

        It is float64 (n, number of obstacles, 2) [m], rectangles first; nearly 0 for a place within one.
        """
        count = len(self._halves)
        apart = position[:, None] - self._middle[None, :]
        result = np.empty_like(apart)
        result[:, :count] = apart[:, :count] - self._nearest(apart[:, :count])
        rest = apart[:, count:]
        gap = np.maximum(np.hypot(rest[..., 0], rest[..., 1]), 1e-9)
        result[:, count:] = rest * np.maximum(1.0 - self._radii / gap, 1e-9)[..., None]
        return result

    def hidden(self, start: F64, end: F64) -> NDArray[np.bool_]:
        """Whether an obstacle stands between places: float64 (n, 2) each [m], bool (n,)."""
        return self._crossed(start, end, 0.0)

    def way(self, start: Point, goal: Point) -> tuple[Point, float]:
        """Return the place to go to first on the shortest way, and the length of the way [m].

        A stretch that begins or ends nearer to an obstacle than the margin does without it. Where no way leads to the
        goal: the goal itself, and inf.
        """
        if not len(self._middle):
            return goal, math.dist(start, goal)
        ends = np.array([start, goal])
        away = self.away(ends)
        clear = (np.hypot(away[..., 0], away[..., 1]) >= self._margin).all(axis=1)
        from_start, from_goal = np.where(clear, self._margin, 0.0).tolist()
        if not self._crossed(ends[:1], ends[1:], min(from_start, from_goal))[0]:
            return goal, math.dist(start, goal)
        first, last = self._reach(ends[:1], from_start), self._reach(ends[1:], from_goal)
        through = first[:, None] + self._lengths + last[None, :]
        if not through.size or not np.isfinite(through.min()):
            return goal, math.inf
        node = self._nodes[int(through.argmin()) // len(self._nodes)]
        return (float(node[0]), float(node[1])), float(through.min())

    def _reach(self, place: F64, margin: float) -> F64:
        """Lengths of the straight ways from a place to every node [m]; inf where there is none."""
        straight = np.hypot(*(self._nodes - place).T)
        crossed = self._crossed(np.broadcast_to(place, self._nodes.shape), self._nodes, margin)
        return np.asarray(np.where(crossed, np.inf, straight))

    @cached_property
    def _lengths(self) -> F64:
        """Lengths of the shortest ways between all nodes: float64 (k, k) [m] (Floyd and Warshall)."""
        count = len(self._nodes)
        lengths = np.full((count, count), np.inf)
        for index, node in enumerate(self._nodes):
            lengths[index] = self._reach(node[None], self._margin)
            lengths[index, index] = 0.0
        for index in range(count):
            np.minimum(lengths, lengths[:, index, None] + lengths[None, index], out=lengths)
        return lengths

    def _nearest(self, apart: F64) -> F64:
        """Nearest points of the rectangles, from their middles, to places (n, rectangles, 2) from their middles."""
        cos, sin = self._cos[:, 0], self._sin[:, 0]
        along = np.clip(cos * apart[..., 0] + sin * apart[..., 1], -self._halves[:, 0], self._halves[:, 0])
        across = np.clip(cos * apart[..., 1] - sin * apart[..., 0], -self._halves[:, 1], self._halves[:, 1])
        return np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)

    def _crossed(self, start: F64, end: F64, margin: float) -> NDArray[np.bool_]:
        """Whether straight ways (n, 2) to (n, 2) lead through an obstacle widened by a margin."""
        crossed = np.zeros(len(start), bool)
        count = len(self._halves)
        if count:
            dx, dy = (start[:, axis] - self._middle[:count, axis, None] for axis in (0, 1))
            way_x, way_y = (end - start).T
            enters, leaves = np.zeros((count, len(start))), np.ones((count, len(start)))
            for origin, way, half in (
                (self._cos * dx + self._sin * dy, self._cos * way_x + self._sin * way_y, self._halves[:, 0]),
                (self._cos * dy - self._sin * dx, self._cos * way_y - self._sin * way_x, self._halves[:, 1]),
            ):
                first, last = slab(origin, way, half[:, None] + margin)
                enters, leaves = np.maximum(enters, first), np.minimum(leaves, last)
            crossed |= (enters < leaves).any(axis=0)
        if len(self._radii):
            apart = start[None] - self._middle[count:, None]
            way = (end - start)[None]
            share = -(apart * way).sum(axis=2) / np.maximum((way**2).sum(axis=2), 1e-18)
            nearest = apart + np.clip(share, 0.0, 1.0)[..., None] * way
            crossed |= (np.hypot(nearest[..., 0], nearest[..., 1]) < self._radii[:, None] + margin).any(axis=0)
        return crossed


def _pairs(values: list[Point]) -> F64:
    """Return float64 (n, 2), also of no values."""
    return np.array(values, dtype=np.float64).reshape(-1, 2)


def _corners(shape: Disc | Rectangle, margin: float) -> list[Point]:
    """Corners of a shape widened by a margin [m]."""
    if isinstance(shape, Disc):
        reach = (shape.radius + margin) / math.cos(math.pi / _SIDES)
        angles = [math.tau * side / _SIDES for side in range(_SIDES)]
        return [(shape.x + reach * math.cos(angle), shape.y + reach * math.sin(angle)) for angle in angles]
    cos, sin = math.cos(shape.yaw), math.sin(shape.yaw)
    corners = []
    for sign_x, sign_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        x, y = sign_x * (shape.half_x + margin), sign_y * (shape.half_y + margin)
        corners.append((shape.x + cos * x - sin * y, shape.y + sin * x + cos * y))
    return corners
