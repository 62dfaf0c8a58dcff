"""Ways over known free ground: distances from the robot, and the shortest way to a place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.observation import Array, Mask, Odometry
from limo_hog.follow.space.grid import Grid, Ground

_NEIGHBOURS = [(dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


Field = NDArray[np.float32]
"""(N, N): how far it is to drive to each cell [m]; inf where no way leads."""


@dataclass(frozen=True, slots=True)
class Router:
    """Plans ways."""

    keep_off: float = param(0.36, "m", "Distance that a way keeps from the middles of occupied cells.")
    keep_off_far: float = param(0.5, "m", "Nearer than this to something, a way counts as longer.")
    detour: float = param(1.0, "1", "By this share.")
    ahead: float = param(0.5, "m", "The point of a way that is faced is this far off.")
    farthest: float = param(6.0, "m", "Longer ways are not looked for.")

    def field(self, grid: Grid, ground: Ground, pose: Odometry) -> Field:
        """Return the driving distance to every cell that is known to be free."""
        blocked = ground.occupied > 0
        wide, wider = _dilated(blocked, self.keep_off / grid.cell), _dilated(blocked, self.keep_off_far / grid.cell)
        reach = int(self.keep_off / grid.cell)
        free = np.isfinite(ground.seen) & ~wide
        here, inside = grid.flat(ground, np.array([[pose.x, pose.y]]))
        distance = np.full(free.shape, np.inf, np.float32)
        if not inside[0]:
            return distance
        x, y = divmod(int(here[0]), grid.cells)
        # The robot may stand nearer to something than a way should lead.
        near = tuple(slice(max(at - reach, 0), at + reach + 1) for at in (x, y))
        free[near] |= ~blocked[near]
        distance[x, y] = 0.0
        closed = np.where(free, np.float32(self.detour * grid.cell) * wider, np.float32(np.inf)).astype(np.float32)
        straight, diagonal = np.float32(grid.cell), np.float32(math.sqrt(2) * grid.cell)
        # With an edge of cells that no way leads to, every cell has eight neighbours.
        edged = np.pad(distance, 1, constant_values=np.inf)
        for step in range(1, int(self.farthest / grid.cell) + 1):
            # After so many steps nothing further off has been reached.
            (x0, x1), (y0, y1) = ((max(at - step, 0), min(at + step + 1, grid.cells)) for at in (x, y))
            around = edged[x0 : x1 + 2, y0 : y1 + 2]
            across = np.minimum(around[:, :-2], around[:, 2:])
            beside = np.minimum(np.minimum(around[:-2, 1:-1], around[2:, 1:-1]), across[1:-1])
            corners = np.minimum(across[:-2], across[2:])
            nearer = np.minimum(beside + straight, corners + diagonal)
            nearer += closed[x0:x1, y0:y1]
            before = around[1:-1, 1:-1]
            np.minimum(nearer, before, out=nearer)
            if np.array_equal(nearer, before):
                break
            before[...] = nearer
        return np.asarray(edged[1:-1, 1:-1])

    def way_towards(self, grid: Grid, ground: Ground, pose: Odometry, place: Points) -> Points:
        """Return the shortest way to the cell nearest to a place (2,) [m] of those that a way leads to."""
        field = self.field(grid, ground, pose)
        cells = np.argwhere(np.isfinite(field))
        if len(cells) == 0:
            return np.empty((0, 2))
        x, y = cells[np.argmin(np.hypot(*(grid.middle_of(ground, cells) - place).T))].tolist()
        return self.way(grid, ground, field, (x, y))

    def way(self, grid: Grid, ground: Ground, field: Field, goal: tuple[int, int]) -> Points:
        """Return the shortest way from the robot to a cell, float64 (N, 2) [m]; empty where none leads there."""
        if not math.isfinite(field[goal]):
            return np.empty((0, 2))
        cells, here = [goal], goal
        while field[here] > 0:
            x, y = here
            around = [
                (float(field[x + dx, y + dy]) + cost * grid.cell, (x + dx, y + dy))
                for dx, dy, cost in _NEIGHBOURS
                if 0 <= x + dx < len(field) and 0 <= y + dy < len(field)
            ]
            here = min(around)[1]
            cells.append(here)
        return grid.middle_of(ground, np.array(cells[::-1]))


def along(way: Points, pose: Odometry, far: Array) -> Points:
    """Return the points of a way (N, 2) that are so far (M,) along it from where it is nearest to the robot [m]."""
    rest = way[int(np.argmin(np.hypot(way[:, 0] - pose.x, way[:, 1] - pose.y))) :]
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rest, axis=0).T))])
    return np.stack([np.interp(far, arc, rest[:, 0]), np.interp(far, arc, rest[:, 1])], axis=1)


def _dilated(cells: Mask, radius: float) -> Mask:
    """Return the cells within a radius [cells] of those that are true."""
    wide, reach, (rows, columns) = cells.copy(), int(radius), cells.shape
    edged = np.pad(cells, reach)
    for dx in range(2 * reach + 1):
        for dy in range(2 * reach + 1):
            if math.hypot(dx - reach, dy - reach) <= radius:
                wide |= edged[dx : dx + rows, dy : dy + columns]
    return np.asarray(wide)
