"""People whom the lidar shows, made up: returns of their legs, and what moves there."""

import math
from dataclasses import replace

import numpy as np
from tests.follow.estimates import upper

from limo_hog.follow.robot import LIMO
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.space.grid import Grid, Ground
from limo_hog.follow.tracks.association import Returns
from limo_hog.follow.tracks.kalman import Noise, Track
from limo_hog.follow.tracks.movers import Mover, Movers
from limo_hog.follow.tracks.person import Person

MOVERS, NOISE, HALF_VIEW, SCAN_S, GRID = Movers(), Noise(), 2.0, 0.125, Grid()
#: Ground that is free from now on, wherever nothing is.
FREE = replace(GRID.start(Odometry()), freed=np.full((GRID.cells, GRID.cells), np.inf, np.float32))


def legs(x: float, y: float, phase: float) -> list[tuple[float, float]]:
    """Three returns of each of two shins, of which one stands while the other swings."""
    swing = 0.15 * math.sin(phase)
    return [(x + side * swing, y + side * 0.06 + d) for side in (-1, 1) for d in (-0.02, 0.0, 0.02)]


def person(number: int, x: float, y: float, stamp: float) -> Person:
    """Someone found by the camera at a stamp."""
    track = Track(stamp, (x, y, 0.0, 0.0), upper(np.diag([0.04, 0.04, 0.5, 0.5])))
    return Person(number, track, stamp, 5.0, 400.0, 0.0, confirmed=True)


def walker(number: int | None, x: float, y: float) -> Mover:
    """Legs that walk, of the person of a number."""
    track = Track(1.0, (x, y, 0.0, 0.0), upper(np.diag([0.01, 0.01, 0.1, 0.1])))
    return Mover(track, (x - 1.0, y), 0.0, 1.0, left=True, way=1.0, scans=9, number=number, named=0.0)


def update(
    movers: tuple[Mover, ...], stamp: float, *points: tuple[float, float], ground: Ground | None = FREE
) -> tuple[Mover, ...]:
    """What moves after a scan of a robot that stands and sees ±115°."""
    returns = Returns(stamp, np.array(points).reshape(-1, 2), Odometry())
    return MOVERS.update(movers, returns, (HALF_VIEW, 0.0), NOISE, GRID, ground)


def walk(start: tuple[float, float], velocity: tuple[float, float], scans: int) -> tuple[Mover, ...]:
    """What moves after so many scans of a robot that stands, with a wall 3 m to its left; it sees ±115°."""
    movers: tuple[Mover, ...] = ()
    wall = [(0.05 * step - 3.0, 3.0) for step in range(120)]
    for index in range(scans):
        time = index * SCAN_S
        x, y = start[0] + velocity[0] * time, start[1] + velocity[1] * time
        shown = abs(math.atan2(y, x - LIMO.lidar_x)) < HALF_VIEW
        # In the order of the beams.
        points = sorted(legs(x, y, 9.0 * time) * shown + wall, key=lambda one: math.atan2(one[1], one[0]))
        movers = update(movers, time, *points)
    return movers
