"""A tracked person: position, size, clothes and how surely it is one, and how these follow from frame to frame.

A frame moves the log-odds of existence by the logarithm of how much more likely its outcome is for a person than for
clutter (Bar-Shalom, Li and Kirubarajan 2001, 7.3: the score of a track). How often people are found is learnt by the
size of their window, so that a detector that misses half of the time still starts tracks, and its misses cost little.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, field, replace

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.measurement import STATURE, Measurement
from limo_hog.follow.sense.observation import Clothes, Odometry
from limo_hog.follow.tracks import kalman
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range


@dataclass(frozen=True, slots=True)
class Person:
    """A person, or something that looks like one."""

    number: int  #: Identifies the person; never used twice.
    track: Track  #: Position and velocity.
    seen: float  #: Stamp of the last frame in which HOG found them [s].
    log_odds: float  #: Of being a person, by all frames in which one should have been found (`Existence`).
    window: float  #: Height of the detection window, and its middle below the image's, times the distance [px m].
    centre: float
    stature: float = STATURE  #: As far as the depth image shows it [m].
    confirmed: bool = False  #: Whether the log-odds have been high enough, and not too low since.
    age: int = 1  #: Frames in which the person should have been found, and those since they were.
    misses: int = 0
    felt: float = -math.inf  #: Stamp of the last scan with their legs [s].
    clothes: Clothes | None = None  #: What they wear; None while no colour image tells.
    worn: Clothes | None = None  #: Clothes and window as the last box or glimpse showed them; None where it did not.
    tall: float | None = None
    glimpsed: float = -math.inf  #: Stamp of the last frame that showed the clothes where HOG found nobody [s].
    strained: bool = False  #: Whether the last box was not where the person was expected, or not of their size.
    measured: float = field(init=False)  #: Stamp of the last frame or scan that showed the person [s].

    def __post_init__(self) -> None:
        object.__setattr__(self, "measured", max(self.seen, self.felt))

    @property
    def existence(self) -> float:
        """Probability of being a person [0 … 1]."""
        return 1.0 / (1.0 + math.exp(-self.log_odds))


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
    """How often people were found, by the height of their window."""

    #: Frames in which a person was found, and in which one should have been, for each class of size; old frames count
    #: less.
    found: tuple[float, ...] = ()
    expected: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Existence:
    """Moves the log-odds of tracks, and learns the recall."""

    prior: float = param(-2.2, "log-odds", "Of a new track before its first box.")
    person_score: float = param(1.3, "SVM margin", "Scale of the scores on people, gamma distributed with shape 2.")
    clutter_score: float = param(0.5, "SVM margin", "Mean of the scores on other things, exponentially distributed.")
    clutter_again: float = param(0.2, "1", "Chance that a false box is there again in the next frame.")
    weight: float = param(0.5, "1", "Share of its own evidence that a frame counts for: neighbouring frames are alike.")
    most: float = param(1.5, "log-odds", "The most that a frame can add.")
    least: float = param(0.4, "log-odds", "The most that a frame can take.")
    confirm: float = param(3.0, "log-odds", "From here a track is confirmed.")
    drop: float = param(-1.0, "log-odds", "Below this it is not any more.")
    lowest: float = param(-5.0, "log-odds", "Lower limit of the log-odds.")
    highest: float = param(5.0, "log-odds", "Upper limit of the log-odds.")
    stands_out: float = param(0.2, "m", "A box in one plane with its surroundings, to within this, is on a picture.")
    sizes: tuple[float, ...] = param((170.0, 240.0, 330.0), "px", "Heights of windows that part the classes of size.")
    recall: float = param(0.4, "1", "Recall before anything is learnt.")
    recall_frames: float = param(10.0, "1", "Frames that this first guess is worth.")
    recall_memory: float = param(0.99, "1", "Share of what was learnt that is kept from frame to frame.")
    least_recall: float = param(0.2, "1", "Lower limit of the recall that is believed.")
    most_recall: float = param(0.98, "1", "Upper limit of the recall that is believed.")
    run_of_misses: float = param(1e-3, "1", "Misses in a row less likely than this are no chance.")

    def of_box(self, seen: Measurement, recall: float) -> float:
        """Return how much a box adds to the log-odds where people are found with `recall`; negative for clutter."""
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
