"""An occupancy grid of the ground around the robot, from the lidar and the depth image, in the odometry frame.

Cells hold the log-odds of being occupied (Moravec and Elfes 1985) and when they were last looked at. The grid is a
square that moves along with the robot in whole cells.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.parameters import param
from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.clearance import Points, beam_directions, lidar_at, to_odometry
from limo_hog.follow.sense.measurement import PERSON_RADIUS
from limo_hog.follow.sense.observation import Array, Mask, Odometry, Scan

Cells = NDArray[np.int64]
"""(N, 2): row (x) and column (y) of cells."""


@dataclass(frozen=True, slots=True)
class Ground:
    """What is known about the ground."""

    corner: tuple[int, int]  #: Lower corner of cell (0, 0), x and y in the odometry frame [cells].
    #: float32 (N, N): log-odds of each cell's being occupied; rows along x, columns along y.
    occupied: NDArray[np.float32]
    #: float64 (N, N): when each cell was last seen to be free or occupied [s]; -inf for never. On a robot times count
    #: from 1970: in float32 they would be two minutes apart.
    seen: Array
    freed: Array  #: float64 (N, N): when each cell was last seen to be free [s]; -inf for never.
    stamp: float = -math.inf  #: Of the last scan [s].


@dataclass(frozen=True, slots=True)
class Grid:
    """How the ground is mapped."""

    cell: float = param(0.1, "m", "Side of a cell.")
    cells: int = param(100, "1", "Along each side of the square.")
    shift_after: float = param(1.0, "m", "The square moves along when the robot is this far from its middle.")
    reach: float = param(5.0, "m", "Of a beam's free part and of its end, no more is used.")
    every: int = param(2, "1", "Of this number of neighbouring beams one clears cells; all of them fill cells.")
    free: float = param(0.4, "log-odds", "What a beam takes from a cell that it passes.")
    hit: float = param(0.9, "log-odds", "What it adds to the cell where it ends.")
    lowest: float = param(-1.2, "log-odds", "Lower limit.")
    highest: float = param(2.5, "log-odds", "Upper limit: what has moved away is forgotten after seven scans.")
    person_radius: float = param(PERSON_RADIUS, "m", "Returns nearer than this to a tracked person fill no cell.")
    period_s: float = param(0.2, "s", "A scan sooner after the last one entered is left out.")
    lasts_s: float = param(6.0, "s", "What stands for this time is taken to last.")
    samples: int = param(24, "1", "Points on a line of sight at which something may stand.")
    own_radius: float = param(0.2, "m", "The ground under the robot is free: the circle around its outline.")

    def start(self, pose: Odometry) -> Ground:
        """Return ground of which nothing is known, around the robot."""
        never = np.full((self.cells, self.cells), -np.inf)
        return Ground(self._corner(pose), np.zeros(never.shape, np.float32), never, never.copy())

    def update(
        self, ground: Ground | None, scan: Scan, pose: Odometry, people: Points, depths: Points, robot: RobotGeometry
    ) -> Ground:
        """Enter a scan, taken at `pose`, into what was known: None before the first.

        `people` and `depths` are float64 (N, 2) [m], odometry frame: people who are tracked are no part of the
        ground; what the depth image shows above the floor fills cells and clears none.
        """
        ground = self._moved(ground or self.start(pose), pose)
        ranges = scan.ranges.astype(np.float64)
        at = np.array(lidar_at(pose, robot))
        returned = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
        # A beam that hits nothing is free as far as it reaches; one that is no number says nothing.
        clear = np.where(np.isnan(ranges) | (ranges < scan.range_min), 0.0, np.minimum(ranges, scan.range_max))
        directions = to_odometry(beam_directions(scan.angle_min, scan.angle_max, len(ranges)), Odometry(yaw=pose.yaw))
        near = returned & (ranges < self.reach)
        ends = np.concatenate([at + ranges[near, None] * directions[near], depths])
        if len(people) and len(ends):
            gaps = np.hypot(ends[:, None, 0] - people[None, :, 0], ends[:, None, 1] - people[None, :, 1])
            ends = ends[gaps.min(axis=1) > self.person_radius]
        under = np.array([pose.x, pose.y]) + _square(self.own_radius, self.cell)
        passed = self._passed(ground, at, directions[:: self.every], clear[:: self.every])
        (own, own_inside), (at_end, end_inside) = self.flat(ground, under), self.flat(ground, ends)
        cleared = self._mask(np.concatenate([passed, own[own_inside]]))
        filled = self._mask(at_end[end_inside])
        before = ground.occupied
        lower = np.maximum(before - np.float32(self.free), np.float32(self.lowest))
        higher = np.minimum(before + np.float32(self.hit), np.float32(self.highest))
        occupied = np.where(filled, higher, np.where(cleared, lower, before))
        seen = np.where(cleared | filled, scan.stamp, ground.seen)
        freed = np.where(cleared & (occupied <= 0), scan.stamp, ground.freed)
        return Ground(ground.corner, occupied, seen, freed, scan.stamp)

    def flat(self, ground: Ground, points: Points, side: int = 1) -> tuple[NDArray[np.int64], Mask]:
        """Return the flat index of each point's cell, the first of `side` by `side`, and if all are inside; else 0."""
        cells = np.floor(points / self.cell).astype(np.int64) - ground.corner
        # As unsigned numbers, what is below 0 is large.
        within = cells.view(np.uint64) <= self.cells - side
        inside = within[:, 0] & within[:, 1]
        return np.where(inside, cells[:, 0] * self.cells + cells[:, 1], 0), inside

    def middle_of(self, ground: Ground, cells: Cells) -> Points:
        """Return the middle of each cell [m], float64 (N, 2)."""
        return np.asarray((cells + ground.corner + 0.5) * self.cell, np.float64)

    def is_blocked(self, ground: Ground, points: Points, *, lasting: bool = False) -> Mask:
        """Return whether each point is in an occupied cell; `lasting`: one not free within `lasts_s`. bool (N,)."""
        flat, inside = self.flat(ground, points)
        return inside & self._is_occupied(ground, flat, lasting)

    def is_free_since(self, ground: Ground, points: Points, stamps: float | Array) -> Mask:
        """Return whether each point was seen to be free after its stamp [s], bool (N,); outside of the square none."""
        flat, inside = self.flat(ground, points)
        return inside & (ground.freed.take(flat) > stamps)

    def is_near_blocked(self, ground: Ground, points: Points, *, lasting: bool = False) -> Mask:
        """Return whether an occupied cell is within half a cell of each point, bool (N,); at the edge none is."""
        flat, inside = self.flat(ground, points - self.cell / 2, side=2)
        steps = np.array((0, 1, self.cells, self.cells + 1), np.int64)
        return np.asarray(inside & self._is_occupied(ground, flat[:, None] + steps, lasting).any(axis=1))

    def lasting_near(self, ground: Ground, pose: Odometry, reach: float) -> Points:
        """Return the middles of cells within `reach` [m] in which something lasts, float64 (N, 2), odometry frame."""
        x, y = math.floor(pose.x / self.cell) - ground.corner[0], math.floor(pose.y / self.cell) - ground.corner[1]
        side = int(reach / self.cell)
        rows, columns = slice(max(x - side, 0), x + side + 1), slice(max(y - side, 0), y + side + 1)
        lasts = (ground.occupied[rows, columns] > 0) & (ground.freed[rows, columns] < ground.stamp - self.lasts_s)
        return self.middle_of(ground, np.argwhere(lasts) + np.array([rows.start, columns.start]))

    def _is_occupied(self, ground: Ground, flat: NDArray[np.int64], lasting: bool) -> Mask:
        """Return whether the cells of flat indices are occupied, bool of their shape; `lasting` as `is_blocked`."""
        occupied = ground.occupied.take(flat) > 0
        if lasting:
            occupied &= ground.freed.take(flat) < ground.stamp - self.lasts_s
        return np.asarray(occupied)

    def sees(self, ground: Ground, origins: Points, places: Points, *, lasting: bool = False) -> Mask:
        """Return whether nothing occupied is between (K, 2) origins and (N, 2) places, at `samples` points, (K, N)."""
        shares = (np.arange(self.samples) + 0.5) / self.samples
        way = origins[:, None, None, :] + shares[None, None, :, None] * (places[None, :] - origins[:, None])[:, :, None]
        blocked = self.is_blocked(ground, way.reshape(-1, 2), lasting=lasting)
        return np.asarray(~blocked.reshape(way.shape[:3]).any(axis=2))

    def _passed(self, ground: Ground, at: Array, directions: Points, clear: Array) -> NDArray[np.int64]:
        """Return the flat indices of the cells that beams from a place (2,) pass, each as far as it is clear [m]."""
        steps = np.arange(0.5, self.reach / self.cell) * self.cell
        # So far before the end that it is in another cell.
        free = steps < clear[:, None] - 1.5 * self.cell
        row = np.floor((at[0] + steps * directions[:, :1]) / self.cell).astype(np.int64) - ground.corner[0]
        column = np.floor((at[1] + steps * directions[:, 1:]) / self.cell).astype(np.int64) - ground.corner[1]
        inside = (row.view(np.uint64) < self.cells) & (column.view(np.uint64) < self.cells)
        return np.asarray((row * self.cells + column)[free & inside])

    def _mask(self, flat: NDArray[np.int64]) -> Mask:
        """Return which cells are among those of flat indices, bool (N, N)."""
        mask = np.zeros(self.cells**2, bool)
        mask[flat] = True
        return mask.reshape(self.cells, self.cells)

    def _corner(self, pose: Odometry) -> tuple[int, int]:
        half = self.cells // 2
        return math.floor(pose.x / self.cell) - half, math.floor(pose.y / self.cell) - half

    def _moved(self, ground: Ground, pose: Odometry) -> Ground:
        """Return the ground with the robot near the square's middle; what comes in at the edges is unknown."""
        corner = self._corner(pose)
        moved = corner[0] - ground.corner[0], corner[1] - ground.corner[1]
        if max(map(abs, moved)) * self.cell <= self.shift_after:
            return ground
        fresh = self.start(pose)
        # Where old cells go, and where they come from, along each axis.
        steps = [min(max(step, -self.cells), self.cells) for step in moved]
        to, of = (tuple(slice(max(way * by, 0), self.cells + min(way * by, 0)) for by in steps) for way in (-1, 1))
        fresh.occupied[to], fresh.seen[to], fresh.freed[to] = ground.occupied[of], ground.seen[of], ground.freed[of]
        return replace(fresh, stamp=ground.stamp)


@functools.lru_cache(maxsize=4)
def _square(radius: float, step: float) -> Points:
    """Return points all over a square around 0, so far apart [m], float64 (N, 2), read only."""
    along = np.arange(-radius, radius + 1e-9, step)
    points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    points.flags.writeable = False
    return points
