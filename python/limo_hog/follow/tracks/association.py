"""Which box, and which legs in the scan, belong to which person.

Boxes by a gate, a cost, minus twice the log-likelihood of a match but for a constant, and a greedy assignment. Legs
keep a track alive where the camera does not show the person: nearer than about 1.6 m, beside the image, between two
frames. The lidar cannot tell a person from a chair: legs may continue a track and never begin one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np

from limo_hog.follow.parameters import param
from limo_hog.follow.sense.clearance import Points
from limo_hog.follow.sense.measurement import STATURE, TALLEST, Measurement
from limo_hog.follow.sense.observation import Appearance, Array, Clothes, Odometry
from limo_hog.follow.tracks.kalman import Noise, Track, bearing_range, innovation, update
from limo_hog.follow.tracks.person import Person, distance_to


@dataclass(frozen=True, slots=True)
class Association:
    """Pairs people with boxes."""

    gate: float = param(18.0, "chi² of 2", "Squared Mahalanobis distance beyond which a box belongs to another track.")
    max_cost: float = param(24.0, "chi²", "Highest cost of a match.")
    same_place: float = param(0.5, "m", "Boxes and people nearer than this to each other are the same person.")
    size_tolerance: float = param(0.35, "1", "Share by which height times range may differ from the known window.")
    low: float = param(0.12, "window heights", "Lower boxes show trousers in the shirt's place.")
    unknown: float = param(3.0, "m", "Distance assumed of a first box without depth.")
    unknown_sigma: float = param(1.5, "m", "Its standard deviation.")
    appearance: Appearance = field(default_factory=Appearance)  #: Compares clothes.

    def pair(
        self,
        people: Sequence[Person],
        measurements: Sequence[Measurement],
        pose: Odometry,
        noise: Noise,
        others: AbstractSet[tuple[int, int]] = frozenset(),
        variance: float = 1.0,
    ) -> dict[int, int]:
        """Pair people with boxes, confirmed people first, then by cost: index of the person -> index of the box.

        Of the pairs `others` it is known that the box is not that person's. `variance` is that of the clothes in one
        person's boxes. Every track must be at the frame's stamp.
        """
        matches = []
        for who, person in enumerate(people):
            for which, seen in enumerate(measurements):
                if (who, which) in others:
                    continue
                ranged, clothes_cost = seen, 0.0
                if self.fits_size(person, seen):
                    slips = seen.is_low(self.low)
                    clothes_cost = self.appearance.cost(person.clothes, seen.clothes, variance, slips=slips)
                elif seen.range is not None:
                    if seen.range > bearing_range(person.track, pose)[1] + self.same_place:
                        # On something behind the person: further away, and of another size.
                        continue
                    # On a part of the body: its patches are not on shirt and trousers; or something stands before it.
                    ranged = replace(seen, range=None)
                fit = innovation(person.track, ranged.bearing, ranged.range, pose, noise)
                off = fit.distance2
                cost = off + fit.log_volume_ratio + clothes_cost
                matched = off <= self.gate and cost <= self.max_cost
                if not matched and person.confirmed and clothes_cost <= self.appearance.other:
                    # A confirmed person may turn sharply, out of the gate; a pillar does not.
                    matched = distance_to(person, ranged, pose) < self.same_place
                if matched:
                    matches.append((not person.confirmed, cost, who, which))
        pairs: dict[int, int] = {}
        for _, _, who, which in sorted(matches):
            doubles = (self._is_double(measurements[which], measurements[other]) for other in pairs.values())
            if who not in pairs and not any(doubles):
                pairs[who] = which
        return pairs

    def is_new(self, seen: Measurement, people: Sequence[Person], pose: Odometry) -> bool:
        """Whether a box without a match is a new person, not a second box on a person found in this frame."""
        found = (person for person in people if person.misses == 0)
        return all(distance_to(person, seen, pose) >= self.same_place for person in found)

    def fits_size(self, person: Person, seen: Measurement) -> bool:
        """Whether a box is as high as the person's window at its range; true where the range is unknown."""
        return seen.range is None or abs(seen.range * seen.height - person.window) < self.size_tolerance * person.window

    def worn(self, seen: Measurement) -> Clothes | None:
        """Return the clothes in a box; None where the head is cut off or the box sits low, and shows other parts."""
        return seen.clothes if seen.range is None or (seen.whole and not seen.is_low(self.low)) else None

    def _is_double(self, seen: Measurement, other: Measurement) -> bool:
        """Whether two boxes are on one person: at the same place, in the same clothes."""
        if self.appearance.cost(other.clothes, seen.clothes) > self.appearance.other:
            return False
        turn = math.remainder(seen.bearing - other.bearing, math.tau)
        one, two = seen.range or other.range, other.range or seen.range
        if one is None or two is None:
            return abs(turn) < self.same_place / self.unknown
        return math.hypot(one - two * math.cos(turn), two * math.sin(turn)) < self.same_place


@dataclass(frozen=True, slots=True)
class Returns:
    """A scan's returns in the odometry frame."""

    stamp: float  #: Of the scan [s].
    points: Points  #: float64 (N, 2) [m].
    pose: Odometry  #: Where the robot was.


@dataclass(frozen=True, slots=True)
class Legs:
    """Finds a tracked person's legs in a scan; the lengths are those of a person `STATURE` high."""

    radius: float = param(0.35, "m", "Returns nearer than this to the predicted position are taken for legs.")
    widest: float = param(0.55, "m", "A wider group is a wall or a piece of furniture.")
    reach: float = param(6.5, "m", "Further away legs are not looked for: there the beams may pass beside both shins.")
    sparse: float = param(3.5, "m", "Nearer than this legs have two returns: one may be the end of something else.")
    sigma: float = param(0.1, "m", "Standard deviation of the middle of two walking legs from the person's axis.")
    trail_s: float = param(0.05, "s", "The middle of the legs is where the person was so long ago.")

    def of(self, stature: float) -> Legs:
        """Return the same for a person of a stature [m], up to `TALLEST`: the taller, the longer a stride."""
        times = min(max(stature, STATURE), TALLEST) / STATURE
        return replace(self, radius=times * self.radius, widest=times * self.widest, sigma=times * self.sigma)

    def corrected(self, track: Track, legs: Points, pose: Odometry, noise: Noise) -> Track | None:
        """Return the track, at the scan's stamp, corrected by returns (N, 2) near it; None where these are no legs."""
        x, y, vx, vy = track.mean
        distance = math.hypot(x - pose.x, y - pose.y)
        if len(legs) < (2 if distance < self.sparse else 1) or distance > self.reach:
            return None
        xs, ys = legs.T.tolist()  # Of a few points, lists are faster than arrays.
        if math.hypot(max(xs) - min(xs), max(ys) - min(ys)) > self.widest:
            return None
        dx = sum(xs) / len(xs) + self.trail_s * vx - pose.x
        dy = sum(ys) / len(ys) + self.trail_s * vy - pose.y
        bearing = math.atan2(dy, dx) - pose.yaw
        return update(track, innovation(track, bearing, math.hypot(dx, dy), pose, self.noise_at(distance, noise, pose)))

    def noise_at(self, distance: float, noise: Noise, pose: Odometry) -> Noise:
        """Return the noise with that of legs measured at a distance [m] from a robot at `pose`."""
        return replace(noise, bearing=self.sigma / max(distance, 0.3), range=self.sigma).turning(pose.angular)


def distances(points: Points, tracks: Sequence[Track]) -> Array:
    """Return the distance from each of M tracks to each of (N, 2) points, odometry frame, float64 (M, N) [m]."""
    means = np.array([*map(attrgetter("mean"), tracks)]).reshape(-1, 4, 1)
    return np.asarray(np.hypot(points[:, 0] - means[:, 0], points[:, 1] - means[:, 1]))
