"""People of whom clothes, stature and legs are known, made up: for who is the person followed."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from tests.follow.tracks.people import IN_RED, WINDOW

from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise
from limo_hog.follow.tracks.movers import Mover
from limo_hog.follow.tracks.person import Person
from limo_hog.follow.tracks.tracker import Tracks


def person(
    number: int,
    stamp: float,
    y: float = 0.0,
    clothes: NDArray[np.float64] | None = IN_RED,
    *,
    tall: float = WINDOW,
    measured: float | None = None,
    age: int = 50,
) -> Person:
    """Return a confirmed person 2 m ahead, found in the frame of `stamp` unless `measured` says when."""
    track = kalman.initiate(stamp, 0.0, 2.0, Odometry(), Noise())
    track = replace(track, mean=(2.0, y, 0.0, 0.0))
    seen = stamp if measured is None else measured
    return Person(
        number, track, seen, 5.0, tall, -120.0, confirmed=True, age=age, clothes=clothes, worn=clothes, tall=tall
    )


def at(stamp: float, *people: Person) -> Tracks:
    """Return the tracks of a frame."""
    return Tracks(people, stamp=stamp)


def legs(one: Person, stamp: float, *, since: float = 0.0) -> Mover:
    """Return what walks where a person is and has been shown to be their legs since then [s]."""
    return Mover(one.track, (0.0, 0.0), 0.0, stamp, left=True, number=one.number, named=since)
