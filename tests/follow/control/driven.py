"""The tracking controller driving a robot of a made-up world, and states of it that are made up."""

import math
from dataclasses import replace

import numpy as np
from tests.follow.estimates import upper
from tests.follow.tracks.walkers import person
from tests.follow.views import World, look

from limo_hog.follow import Decision, Observation, Odometry, TrackingController
from limo_hog.follow.control.selection import TrackingState
from limo_hog.follow.space.grid import Ground
from limo_hog.follow.tracks.identity import Likeness, Traits
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracks

CONTROLLER = TrackingController()
GRID = CONTROLLER.grid
NOW = 5.0


def run(world: World, seconds: float, state: TrackingState | None = None, **seen: bool) -> Decision[TrackingState]:
    state = state or CONTROLLER.start()
    for _ in range(round(seconds / world.period)):
        decision = CONTROLLER.step(world.observe(**seen), state)
        state = decision.state
        world.drive(decision.twist)
    return decision


def someone(
    number: int, x: float, y: float = 0.0, vx: float = 0.0, vy: float = 0.0, *, seen: float = NOW, window: float = 100.0
) -> Person:
    """A confirmed person who is at a place now, with a velocity; the window is small enough to be whole anywhere."""
    one = person(number, x, y, seen)
    track = replace(one.track, stamp=NOW, mean=(x, y, vx, vy), covariance=upper(0.01 * np.eye(4)))
    return replace(one, track=track, window=window, centre=0.0)


def view(late: float = 0.0) -> Observation:
    """A frame in which nobody is found, taken `late` before the newest odometry, of a robot that stands."""
    return replace(look(stamp=NOW - late), odometry=Odometry(NOW))


def state(*people: Person, pose: Odometry | None = None, **other: object) -> TrackingState:
    tracks = Tracks(people, stamp=NOW, poses=(pose or Odometry(NOW),))
    return replace(CONTROLLER.start(), tracks=tracks, **other)  # type: ignore[arg-type]


def likely(**chances: float) -> Likeness:
    odds = tuple((int(name[1:]), chance) for name, chance in chances.items())
    return Likeness(Traits(1, None, 100.0), (2.0, 0.0), NOW, odds)


def blocked(*places: tuple[float, float], since: float = -math.inf) -> Ground:
    """Ground on which something stands at places, and was not there until a stamp [s]."""
    ground = GRID.start(Odometry())
    occupied, freed = ground.occupied.copy(), np.full_like(ground.freed, NOW)
    at, _ = GRID.flat(ground, np.array(places))
    occupied.flat[at], freed.flat[at] = 2.0, since
    return replace(ground, occupied=occupied, freed=freed, stamp=NOW)
