"""A tracked person: position, size, clothes and how surely it is one, and how these follow from frame to frame.

A frame moves the log-odds of existence by the logarithm of how much more likely its outcome is for a person than for
clutter (Bar-Shalom, Li and Kirubarajan 2001, 7.3: the score of a track). How often people are found is learnt by the
size of their window, so that a detector that misses half of the time still starts tracks, and its misses cost little.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field, replace

from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Clothes, Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range


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
        Of being a person, by all frames in which one should have been found (`Existence`).
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
    measured
        Stamp of the last frame or scan that showed the person [s].
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
    measured: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "measured", max(self.seen, self.felt))

    @property
    def existence(self) -> float:
        """Probability of being a person [0 … 1]."""
        return 1.0 / (1.0 + math.exp(-self.log_odds))


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
    turn = math.remainder(seen.bearing - bearing, math.tau)
    if seen.range is None:
        return abs(distance * math.tan(turn)) if abs(turn) < 1 else math.inf
    return math.hypot(distance - seen.range * math.cos(turn), seen.range * math.sin(turn))


@dataclass(frozen=True, slots=True)
class Recall:
    """How often people were found, by the height of their window.

    Attributes
    ----------
    found, expected
        Frames in which a person was found, and in which one should have been, for each class of size; old frames count
        less.
    """

    found: tuple[float, ...] = ()
    expected: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Existence:
    """Moves the log-odds of tracks, and learns the recall.

    Attributes
    ----------
    prior
        Log-odds of a new track before its first box. Chosen: of ten boxes that begin a track one is on a person.
    person_score
        Scale of the scores [SVM margin] of boxes on people, which are taken to be gamma distributed with shape 2.
        Measured in the arena, 1,027 boxes: median 2.9, lower quartile 1.9; near by a median of .8.
    clutter_score
        Mean score of boxes on other things, exponentially distributed. Measured: on the arena's furniture .39 (31
        boxes), in photographs without people .64 (30 boxes).
    clutter_again
        Chance that a false box is there again in the next frame [1]. Measured: a pillar is found in 55 % of the frames,
        a cone in 50 %, other furniture never; chosen, the mean over kinds.
    weight
        Share of its own evidence that a frame counts for [1]. Chosen: neighbouring frames show nearly the same, so that
        two in a row tell as much as one.
    most
        The most that a frame can add [log-odds], and `least` the most that it can take. Chosen: four clear frames
        confirm, and fifteen misses drop a track that was certain.
    confirm, drop
        Log-odds from which a track is confirmed, and below which it is not any more. Chosen: 95 % and 27 %.
    lowest, highest
        Limits of the log-odds: what is certain can still change within two seconds.
    stands_out
        A box whose surroundings are in one plane with it, to within this, is on a picture and no evidence [m].
        Measured: of 1,027 boxes on people 97 % stand out further; a trunk of .9 m stature is .11 m deep.
    sizes
        Heights of windows that part the classes of size [px].
    recall, recall_frames
        Recall before anything is learnt, and how many frames that is worth [1]. Chosen: a start with a detector that
        finds few, three people in ten or four; one that finds more has shown it after a second.
    recall_memory
        Share of what was learnt that is kept from frame to frame [1]. Chosen: 100 frames, ten seconds.
    least_recall, most_recall
        Limits of what is believed to be learnt [1].
    run_of_misses
        Misses in a row that are less likely than this are no chance: the person is not there [1].
    """

    prior: float = -2.2
    person_score: float = 1.3
    clutter_score: float = 0.5
    clutter_again: float = 0.2
    weight: float = 0.5
    most: float = 1.5
    least: float = 0.4
    confirm: float = 3.0
    drop: float = -1.0
    lowest: float = -5.0
    highest: float = 5.0
    stands_out: float = 0.2
    sizes: tuple[float, ...] = (170.0, 240.0, 330.0)
    recall: float = 0.4
    recall_frames: float = 10.0
    recall_memory: float = 0.99
    least_recall: float = 0.2
    most_recall: float = 0.98
    run_of_misses: float = 1e-3

    def of_box(self, seen: Measurement, recall: float) -> float:
        """Return how much a box adds to the log-odds; negative for one that is more likely on something else.

        Parameters
        ----------
        seen
            The box.
        recall
            Share of frames in which a person of this size is found [1].
        """
        if not self.is_solid(seen):
            return -self.least
        score = max(seen.score, 1e-3)
        person = math.log(score / self.person_score**2) - score / self.person_score
        clutter = -math.log(self.clutter_score) - score / self.clutter_score
        evidence = math.log(recall / self.clutter_again) + person - clutter
        return min(max(self.weight * evidence, -self.least), self.most)

    def of_miss(self, recall: float) -> float:
        """Return how much a miss adds to the log-odds: never more than 0."""
        evidence = math.log((1.0 - recall) / (1.0 - self.clutter_again))
        return min(max(self.weight * evidence, -self.least), 0.0)

    def is_solid(self, seen: Measurement) -> bool:
        """Whether a box stands out from what is beside it; true where the depth does not tell."""
        return seen.stands_out is None or abs(seen.stands_out) >= self.stands_out

    def update(self, person: Person, evidence: float, *, found: bool) -> Person:
        """Count one more frame in which the person should have been found."""
        log_odds = min(max(person.log_odds + evidence, self.lowest), self.highest)
        confirmed = log_odds >= (self.drop if person.confirmed else self.confirm)
        misses = 0 if found else person.misses + 1
        return replace(person, log_odds=log_odds, confirmed=confirmed, age=person.age + 1, misses=misses)

    def recall_of(self, learnt: Recall, window_px: float) -> float:
        """Return the share of frames in which a person with a window of this height [px] is found."""
        if not learnt.expected:
            return self.recall
        size = bisect.bisect(self.sizes, window_px)
        found = self.recall_frames * self.recall + learnt.found[size]
        share = found / (self.recall_frames + learnt.expected[size])
        return min(max(share, self.least_recall), self.most_recall)

    def learn(self, learnt: Recall, window_px: float, *, found: bool) -> Recall:
        """Count one more frame in which a confirmed person should have been found."""
        classes = len(self.sizes) + 1
        size = bisect.bisect(self.sizes, window_px)
        hits, tries = list(learnt.found or (0.0,) * classes), list(learnt.expected or (0.0,) * classes)
        hits[size] = self.recall_memory * hits[size] + found
        tries[size] = self.recall_memory * tries[size] + 1.0
        return Recall(tuple(hits), tuple(tries))

    def is_chance(self, misses: int, recall: float) -> bool:
        """Whether so many misses in a row can happen to a person who is there."""
        return (1.0 - recall) ** misses >= self.run_of_misses
