"""A tracked person: position, evidence, size and clothes, and how each follows from frame to frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from limo_hog.follow.sense.appearance import Clothes
from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, wrap


@dataclass(frozen=True, slots=True)
class Person:
    """A person, or something that looks like one.

    Attributes
    ----------
    number
        Identifies the person; never used twice.
    track
        Position and velocity.
    seen, felt
        Stamp of the last frame in which HOG found them, and of the last scan with their legs [s].
    log_odds
        Of being a person, by all frames in which one should have been found (`existence`).
    window, centre
        Height of the detection window, and its middle below the image's, times the distance [px m].
    confirmed
        Whether the log-odds have been high enough, and not too low since.
    age, misses
        Frames in which the person should have been found, and those since they were.
    clothes
        What they wear; None while no colour image tells.
    worn, tall
        Clothes and window as the last box showed them; None where it did not.
    strained
        Whether the last box was not where the person was expected, or not of their size.
    """

    number: int
    track: Track
    seen: float
    log_odds: float
    window: float
    centre: float
    confirmed: bool = False
    age: int = 1
    misses: int = 0
    felt: float = -math.inf
    clothes: Clothes | None = None
    worn: Clothes | None = None
    tall: float | None = None
    strained: bool = False

    @property
    def existence(self) -> float:
        """Probability of being a person [0 … 1]."""
        return 1.0 / (1.0 + math.exp(-self.log_odds))

    @property
    def measured(self) -> float:
        """Stamp of the last frame or scan that showed the person [s]."""
        return max(self.seen, self.felt)


@dataclass(frozen=True, slots=True)
class UnknownRange:
    """Where a new track begins whose first box has no depth.

    Attributes
    ----------
    distance, sigma
        Assumed distance and its standard deviation [m]. Chosen: the middle of where HOG finds a 0.9 m person, 1.5 to
        4.8 m, and its half.
    """

    distance: float = 3.0
    sigma: float = 1.5


def initiate(
    number: int,
    seen: Measurement,
    stamp: float,
    pose: Odometry,
    noise: Noise,
    unknown: UnknownRange,
    log_odds: float = 0.0,
) -> Person:
    """Begin to track a box that belongs to no known person."""
    distance = unknown.distance if seen.range is None else seen.range
    if seen.range is None:
        noise = replace(noise, range=unknown.sigma)
    track = kalman.initiate(stamp, seen.bearing, distance, pose, noise)
    window = seen.window or seen.height * distance
    centre = seen.middle if seen.window else seen.centre * distance
    worn, tall = seen.clothes, window if seen.whole and seen.window else None
    return Person(number, track, stamp, log_odds, window, centre, clothes=worn, worn=worn, tall=tall)


def predict(person: Person, stamp: float, noise: Noise) -> Person:
    """Predict the person's track for `stamp` [s]."""
    return replace(person, track=kalman.predict(person.track, stamp, noise))


def separation(one: Person, other: Person) -> float:
    """Return the distance between two people [m]."""
    return math.dist(one.track.place, other.track.place)


def distance_to(person: Person, seen: Measurement, pose: Odometry) -> float:
    """Return the distance between a track and a box [m]; to a box without a range, across the line of sight."""
    bearing, distance = bearing_range(person.track, pose)
    turn = wrap(seen.bearing - bearing)
    if seen.range is None:
        return abs(distance * math.tan(turn)) if abs(turn) < 1 else math.inf
    return math.hypot(distance - seen.range * math.cos(turn), seen.range * math.sin(turn))
