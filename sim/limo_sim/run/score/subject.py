"""What a run shows of one person, added up step by step."""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Sequence

from limo_hog.follow.sense.measurement import Zone, zone_of
from limo_sim.run.log import Step
from limo_sim.run.matching import Criteria
from limo_sim.sensing.camera import WIDTH
from limo_sim.world.truth import PersonTruth, Truth


class Subject:
    """The sums for one person, who may turn out to be the one followed."""

    def __init__(self, index: int, criteria: Criteria) -> None:
        self._index, self._criteria = index, criteria
        self.targeted = 0  #: frames in which the person was the target
        self.first_detection: float | None = None  #: when the person was first detected [s]
        self.longest_gap: float | None = None  #: longest time between two detections [s]
        self._stamp: float | None = None
        #: Frames since the person was first in view; of these, those with the person in view; of these, those in which
        #: the robot was near enough to have kept up, and those in which the person was detected.
        self.frames = self.in_view = self.kept_up = self.detected = 0
        self.last_in_view = False  #: in the newest frame
        self.longest_unseen = 0.0  #: longest time between two frames with the person in view [s]
        self._seen_at: float | None = None
        #: How far the person was from the middle of the image in each frame with the person in view [px]. (Halves of
        #: pixels: single precision holds them exactly.)
        self.pixel_errors = array("f")
        self.distances = Mean()  #: from the robot's centre, since the person was first in view [m]
        self.zones: Counter[Zone] = Counter()  #: how often the person was in each of Hall's zones
        # Distances held before the controller first says which one it keeps, and after that what it keeps, and by how
        # much the person was off.
        self._kept_unknown, self._kept_known, self._squares = Mean(), Mean(), 0.0
        self._keeps: float | None = None
        self._gaps: list[float] = []
        self._length = self._searched = 0.0
        self._last: float | None = None

    def add(self, step: Step, hits: Sequence[int], target: int | None) -> None:
        """Add a step: the persons its boxes are on, and the one its target is; None without a target."""
        if step.seen is not None:
            self._add_frame(step, step.seen, self._index in hits, target == self._index)
        person = of(step.truth, self._index)
        if not self.frames or person is None:
            return
        self.distances.add(person.distance)
        self.zones[zone_of(person.distance)] += 1
        self._keeps = step.log.decision.belief.keeps or self._keeps
        if self._keeps is None:
            self._kept_unknown.add(person.surface_distance)
        else:
            self._kept_known.add(self._keeps)
            self._squares += (person.surface_distance - self._keeps) ** 2

    def _add_frame(self, step: Step, seen: Truth, found: bool, targeted: bool) -> None:
        person = of(seen, self._index)
        # A person of whom anything is visible has a box.
        box = person.box if person is not None and person.visible >= self._criteria.in_view else None
        visible = box is not None
        if found:
            if self._stamp is None:
                self.first_detection = seen.stamp
            else:
                self.longest_gap = max(self.longest_gap or 0.0, seen.stamp - self._stamp)
            self._stamp = seen.stamp
        if self.frames or visible:
            self.frames += 1
            self.last_in_view = visible
        if box is not None and person is not None:
            self.in_view += 1
            self.kept_up += person.distance <= self._criteria.kept_up_m
            self.detected += found
            self.pixel_errors.append(abs(box[0] + box[2] / 2 - WIDTH / 2))
            if self._seen_at is not None:
                self.longest_unseen = max(self.longest_unseen, step.log.time - self._seen_at)
            self._seen_at = step.log.time
        hidden = person is not None and person.box is not None and not visible
        self._search(step.log.time, targeted, hidden)

    def _search(self, time: float, targeted: bool, hidden: bool) -> None:
        if self._last is not None:
            self._length += time - self._last
            self._searched += 0.0 if hidden else time - self._last
        if targeted:
            self.targeted += 1
            if self._length > self._criteria.lost_after_s:
                self._gaps.append(self._searched)
            self._length = self._searched = 0.0
        if targeted or self._last is not None:
            self._last = time

    @property
    def gaps(self) -> list[float]:
        """How long the search after each loss took [s], without the time the person was hidden."""
        cut_off = [self._searched] if self._searched > self._criteria.found_within_s else []
        return [*self._gaps, *cut_off]

    def kept(self, target: float) -> float | None:
        """Return the mean of the distance that a controller held whose target is `target` [m]."""
        count = self._kept_unknown.count + self._kept_known.count
        return (self._kept_unknown.count * target + self._kept_known.total) / count if count else None

    def distance_error(self, target: float) -> float | None:
        """Return the root mean square of the distance's error, the controller's target being `target` [m]."""
        count = self._kept_unknown.count + self._kept_known.count
        return math.sqrt((self._kept_unknown.squares(target) + self._squares) / count) if count else None


class Mean:
    """A mean, a minimum and a spread of numbers that are not kept; without any, `least` is infinite."""

    def __init__(self) -> None:
        self.count, self.total, self.least = 0, 0.0, math.inf
        # Welford's: the running mean, and the sum of squares about it.
        self._mean = self._about = 0.0

    def add(self, value: float) -> None:
        """Add a number."""
        self.count += 1
        self.total += value
        self.least = min(self.least, value)
        off = value - self._mean
        self._mean += off / self.count
        self._about += off * (value - self._mean)

    @property
    def value(self) -> float | None:
        """The mean; None without numbers."""
        return self.total / self.count if self.count else None

    def squares(self, middle: float) -> float:
        """Return the sum of the squares of the numbers' differences from `middle`."""
        return self._about + self.count * (self._mean - middle) ** 2


def of(truth: Truth, index: int) -> PersonTruth | None:
    """Return a person; None where there is none, or not yet."""
    return truth.people[index] if index < len(truth.people) else None
