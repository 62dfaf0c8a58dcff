"""Which box belongs to which person: a gate, a cost, and a greedy assignment.

The cost is minus twice the log-likelihood of a match but for a constant: the squared Mahalanobis distance, the log
volume of the prediction's uncertainty, and the difference of the clothes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

from limo_hog.follow.sense.appearance import Appearance, Clothes
from limo_hog.follow.sense.measurement import Measurement
from limo_hog.follow.sense.observation import Odometry
from limo_hog.follow.tracks.kalman import Noise, bearing_range, innovation, wrap
from limo_hog.follow.tracks.person import Person, UnknownRange, distance_to


@dataclass(frozen=True, slots=True)
class Association:
    """Pairs people with boxes.

    Attributes
    ----------
    gate
        Squared Mahalanobis distance beyond which a box does not belong to a track [chi-squared of 2 numbers]: of a
        person's own boxes, exp(-18/2), 1 in 8,100, is beyond.
    max_cost
        Highest cost of a match [chi-squared]. Chosen: a third more than the gate, for uncertainty and clothes. From 12
        to 48 `crossing`, `two_people` and
        `dropouts` give the same figures (seed 3).
    same_place
        Boxes and people nearer than this to each other are the same person [m]. Chosen: shoulders and an arm of an
        adult; the depth at a box's centre was never further off in 3,500 frames of the arena.
    size_tolerance
        A range is not the person's where height times range differs from the known window by more than this share
        [1]. Chosen; from .2 to .6 the pixel error in `crossing` changes by less than .5 px (seed 3).
    low
        A box lower than the person by more than this shows trousers in the shirt's place [window heights]. Measured in
        the arena: of 424 boxes 98 % are within .12 of the middle.
    appearance
        Compares clothes.
    unknown
        Distance assumed of a box without depth.
    """

    gate: float = 18.0
    max_cost: float = 24.0
    same_place: float = 0.5
    size_tolerance: float = 0.35
    low: float = 0.12
    appearance: Appearance = field(default_factory=Appearance)
    unknown: UnknownRange = field(default_factory=UnknownRange)

    def pair(
        self,
        people: Sequence[Person],
        measurements: Sequence[Measurement],
        pose: Odometry,
        noise: Noise,
        flat: AbstractSet[int] = frozenset(),
        others: AbstractSet[tuple[int, int]] = frozenset(),
    ) -> dict[int, int]:
        """Pair people with boxes: confirmed people first, then by cost.

        `flat` are the indices of boxes that do not stand out from what is behind them: no confirmed person's; `others`
        are pairs, person and box, of which the scan shows that the box is another's. Returns index of the person ->
        index of the measurement. Every track must be at the frame's stamp.
        """
        matches = []
        for who, person in enumerate(people):
            for which, seen in enumerate(measurements):
                if (
                    (who, which) in others
                    or self._is_behind(person, seen, pose)
                    or (person.confirmed and which in flat)
                ):
                    continue
                clothes_cost = self.appearance_cost(person, seen)
                ranged = self.without_bad_range(person, seen)
                fit = innovation(person.track, ranged.bearing, ranged.range, pose, noise)
                cost = fit.distance2 + fit.log_volume_ratio + clothes_cost
                # A confirmed person may turn sharply, out of the gate; a pillar does not.
                near = person.confirmed and distance_to(person, ranged, pose) < self.same_place
                turned = near and clothes_cost <= self.appearance.other
                if turned or (fit.distance2 <= self.gate and cost <= self.max_cost):
                    matches.append((not person.confirmed, cost, who, which))
        pairs: dict[int, int] = {}
        for _, _, who, which in sorted(matches):
            taken = [measurements[other] for other in pairs.values()]
            if who not in pairs and not any(self._is_double(measurements[which], other) for other in taken):
                pairs[who] = which
        return pairs

    def is_new(self, seen: Measurement, people: Sequence[Person], pose: Odometry) -> bool:
        """Whether a box without a match is a new person, not a second box on a person found in this frame."""
        found = (person for person in people if person.misses == 0)
        return all(distance_to(person, seen, pose) >= self.same_place for person in found)

    def appearance_cost(self, person: Person, seen: Measurement) -> float:
        """Return how much the clothes in a box differ from the person's (chi-squared); 0 where they cannot be told.

        A box of another size than the person's is on a part of a body, and its patches are not on shirt and trousers.
        """
        if not self.fits_size(person, seen):
            return 0.0
        return self.appearance.cost(person.clothes, seen.clothes, slips=seen.is_low(self.low))

    def fits_size(self, person: Person, seen: Measurement) -> bool:
        """Whether a box is as high as the person's window at its range; true where the range is unknown."""
        if seen.range is None:
            return True
        return abs(seen.range * seen.height - person.window) < self.size_tolerance * person.window

    def worn(self, seen: Measurement) -> Clothes | None:
        """Return the clothes in a box; None where its patches are not on shirt and trousers.

        Where the head is cut off, or the box sits lower, they are not.
        """
        return seen.clothes if seen.range is None or (seen.whole and not seen.is_low(self.low)) else None

    def without_bad_range(self, person: Person, seen: Measurement) -> Measurement:
        """Return a box without its range where its size contradicts it: something stands in front of the person."""
        return seen if self.fits_size(person, seen) else replace(seen, range=None)

    def _is_behind(self, person: Person, seen: Measurement, pose: Odometry) -> bool:
        """Whether a box is on something behind the person: further away, and of another size."""
        if seen.range is None or self.fits_size(person, seen):
            return False
        return seen.range > bearing_range(person.track, pose)[1] + self.same_place

    def _is_double(self, seen: Measurement, other: Measurement) -> bool:
        """Whether two boxes are on one person: at the same place, in the same clothes."""
        if self.appearance.cost(other.clothes, seen.clothes) > self.appearance.other:
            return False
        turn = wrap(seen.bearing - other.bearing)
        one, two = seen.range or other.range, other.range or seen.range
        if one is None or two is None:
            return abs(turn) < self.same_place / self.unknown.distance
        return math.hypot(one - two * math.cos(turn), two * math.sin(turn)) < self.same_place
