"""Who is who from frame to frame: detections become tracks, and tracks earn trust by being seen again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import RobotGeometry
from limo_hog.follow.sense.appearance import OTHER_CLOTHES, Clothes, learnt, unlikeness
from limo_hog.follow.sense.observation import Observation, Odometry
from limo_hog.follow.sense.ranging import box_centre, person_depth
from limo_hog.follow.sense.region import Region
from limo_hog.follow.tracks.kalman import (
    Noise,
    Track,
    bearing_range,
    found,
    innovation,
    predicted,
    updated,
    wrapped,
)

#: How much one frame counts in a person's trust.
_TRUST_STEP = 0.1
#: A range that does not fit the size of the box by more than this share of it is not the person's.
_MISFIT = 0.35
#: After so long unseen a person's track begins anew [s].
_STALE = 1.0
#: A box with this score [SVM margin] is beyond doubt; pillars and cones rarely reach it.
_SURE = 1.0
#: Nearer than this HOG misses people too often to be held against them [m].
_NEAR = 1.7
#: What any box counts at least for somebody already taken for a person.
_KNOWN = 0.6
#: Trust from which somebody is taken for a person, and below which not any more.
_TRUSTED, _DOUBTED = 0.7, 0.3
#: A box is somebody else's where fit, vagueness and clothes together count more than this against somebody.
_UNLIKELY = 24.0
#: Boxes nearer than this to a person are never somebody else [m].
_SAME_PERSON = 0.5
#: How much one box counts in a person's size, and in what they wear.
_SIZE_STEP, _CLOTHES_STEP = 0.2, 0.05
#: Smaller windows than this HOG cannot find [px].
SMALLEST_WINDOW = 128
#: Distance assumed for somebody whose distance no sensor tells [m], and its standard deviation [m].
_UNKNOWN_RANGE, _UNKNOWN_SPREAD = 3.0, 1.5


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody, or something that looks like it.

    Attributes
    ----------
    number
        Tells people apart; never used twice.
    track
        Where they are and how they walk.
    seen, felt
        Stamp of the last frame they were found in, and of the last scan with their legs [s].
    trust
        0..1: evidence in the latest frames in which they should have been found. A pillar may look like a
        person now and then, and not much; a person looks like one all the time.
    confirmed
        Whether they have earned trust, and not lost it since.
    age, misses
        Frames in which they should have been found, and those since they were.
    window, centre
        Height of their detection window, and its middle below the image's, times their distance [px m].
    clothes
        What they wear, as far as seen; None while no camera tells.
    """

    number: int
    track: Track
    seen: float
    trust: float
    window: float
    centre: float
    confirmed: bool = False
    age: int = 1
    misses: int = 0
    felt: float = -math.inf
    clothes: Clothes | None = None


@dataclass(frozen=True, slots=True)
class Measurement:
    """One box as the robot sees it.

    Bearing [rad] and range [m] from the robot's centre, range None where unknown; height of the box and its middle
    below the image's [px]; its score; and what is worn there, None where no camera tells.
    """

    bearing: float
    range: float | None
    height: int
    centre: float
    score: float
    clothes: Clothes | None = None


def measure(observation: Observation, body: RobotGeometry) -> list[Measurement]:
    """Turn every box into a bearing and a range, the range from the depth image."""
    measurements = []
    for index, (box, score) in enumerate(observation.detections):
        worn = None if observation.clothes is None else observation.clothes[index]
        if worn is not None and not np.isfinite(worn).all():
            worn = None
        column, row = box_centre(box)
        slope = (observation.width / 2 - column) / observation.focal_px
        height, centre = int(box[3]), row - observation.height / 2
        depth = None if observation.depth is None else person_depth(observation.depth, box)
        if depth is None:
            measurements.append(Measurement(math.atan(slope), None, height, centre, score, worn))
            continue
        x, y = body.camera_x + depth, slope * depth
        measurements.append(Measurement(math.atan2(y, x), math.hypot(x, y), height, centre, score, worn))
    return measurements


def associate(
    people: tuple[Person, ...], measurements: list[Measurement], pose: Odometry, noise: Noise, gate: float
) -> dict[int, int]:
    """Pair people with boxes, the confirmed and then the likeliest first; beyond `gate` (chi-squared) is no fit.

    Returns index of the person -> index of the measurement. Every track must be at the frame's stamp.
    """
    fits = []
    for who, person in enumerate(people):
        for which, seen in enumerate(measurements):
            if is_beyond(person, seen, pose):
                continue
            unlike = strangeness(person, seen)
            seen = believed(person, seen)
            fit = innovation(person.track, seen.bearing, seen.range, pose, noise)
            # Who may be anywhere fits anything: that counts against them, as other clothes do.
            cost = fit.distance2 + fit.vagueness + unlike
            # A person who changed direction sharply is still who they were; a pillar does not.
            turned = person.confirmed and apart(person, seen, pose) < _SAME_PERSON and unlike <= OTHER_CLOTHES
            if turned or (fit.distance2 <= gate and cost <= _UNLIKELY):
                fits.append((not person.confirmed, cost, who, which))
    pairs: dict[int, int] = {}
    for _, _, who, which in sorted(fits):
        taken = [measurements[other] for other in pairs.values()]
        if who not in pairs and not any(is_double(measurements[which], other) for other in taken):
            pairs[who] = which
    return pairs


def strangeness(person: Person, seen: Measurement) -> float:
    """Return how unlike theirs the clothes in a box are (chi-squared); 0 where clothes cannot be told.

    A box of another size than theirs is on a part of somebody, and tells nothing.
    """
    return unlikeness(person.clothes, seen.clothes) if of_size(person, seen) else 0.0


def is_double(seen: Measurement, other: Measurement) -> bool:
    """Whether two boxes are on the same person: at the same place, in the same clothes."""
    if unlikeness(other.clothes, seen.clothes) > OTHER_CLOTHES:
        return False
    turn = wrapped(seen.bearing - other.bearing)
    one, two = seen.range or other.range, other.range or seen.range
    if one is None or two is None:
        return abs(turn) < _SAME_PERSON / _UNKNOWN_RANGE
    return math.hypot(one - two * math.cos(turn), two * math.sin(turn)) < _SAME_PERSON


def of_size(person: Person, seen: Measurement) -> bool:
    """Whether a box is as large as a person's whole body at its range; any is where the range is unknown."""
    return seen.range is None or abs(seen.range * seen.height - person.window) < _MISFIT * person.window


def is_beyond(person: Person, seen: Measurement, pose: Odometry) -> bool:
    """Whether a box is on something behind a person: too far away, and of another size than theirs."""
    if seen.range is None or of_size(person, seen):
        return False
    return seen.range > bearing_range(person.track, pose)[1] + _SAME_PERSON


def believed(person: Person, seen: Measurement) -> Measurement:
    """Return a box without its range where its size belies that: something stands before the person."""
    return seen if of_size(person, seen) else replace(seen, range=None)


def apart(person: Person, seen: Measurement, pose: Odometry) -> float:
    """Return the distance [m] between a person's track and a box; across the line of sight where that is all."""
    bearing, distance = bearing_range(person.track, pose)
    turn = wrapped(seen.bearing - bearing)
    if seen.range is None:
        return abs(distance * math.tan(turn)) if abs(turn) < 1 else math.inf
    return math.hypot(distance - seen.range * math.cos(turn), seen.range * math.sin(turn))


def should_be_seen(person: Person, pose: Odometry, observation: Observation) -> bool:
    """Whether the whole of a person's window should be in the part of the image that was searched."""
    bearing, distance = bearing_range(person.track, pose)
    if abs(bearing) > 1.2:
        return False
    column = observation.width / 2 - observation.focal_px * math.tan(bearing)
    window = person.window / max(distance, 0.3)
    middle = observation.height / 2 + person.centre / max(distance, 0.3)
    if window < SMALLEST_WINDOW:
        return False
    # Near by, the head and the room HOG wants above it are out of the image, and boxes shrink to parts of the body;
    # who is not known yet gets no such credit.
    cut_off = not 0.48 * window <= middle <= observation.height - 0.48 * window
    if person.confirmed and (cut_off or distance < _NEAR):
        return False
    if not (observation.region or Region(0, 0, observation.width, observation.height, window)).holds(column):
        return False
    return not is_hidden(observation.depth, column, middle, distance)


def is_hidden(depth: NDArray[np.float32] | None, column: float, row: float, distance: float) -> bool:
    """Whether something nearer stands where somebody at a distance [m] should be in the image [px]."""
    if depth is None:
        return False
    there = person_depth(depth, np.array([column, row, 0, 0], np.int32))
    return there is not None and there < distance - _SAME_PERSON


def begin(number: int, seen: Measurement, stamp: float, pose: Odometry, noise: Noise) -> Person:
    """Begin to track a box nobody known accounts for."""
    distance = _UNKNOWN_RANGE if seen.range is None else seen.range
    if seen.range is None:
        noise = replace(noise, range=_UNKNOWN_SPREAD)
    track = found(stamp, seen.bearing, distance, pose, noise)
    return Person(number, track, stamp, 0.0, seen.height * distance, seen.centre * distance, clothes=seen.clothes)


def between(one: Person, other: Person) -> float:
    """Return the distance of two people [m]."""
    return float(np.hypot(*(one.track.mean[:2] - other.track.mean[:2])))


def is_new(seen: Measurement, people: Sequence[Person], pose: Odometry) -> bool:
    """Whether a box is somebody unknown, not a second box on somebody just found."""
    just_found = (person for person in people if person.misses == 0)
    return all(apart(person, seen, pose) >= _SAME_PERSON for person in just_found)


def seen_again(person: Person, seen: Measurement, pose: Odometry, noise: Noise, gate: float) -> Person:
    """Correct a person by the box that is theirs; a box beyond `gate` says that they changed their ways."""
    window, centre = person.window, person.centre
    if seen.range is not None and (seen.range > _NEAR or not person.confirmed):
        # Learnt from what is not believed too: it may have been wrong from the beginning.
        window += _SIZE_STEP * (seen.height * seen.range - window)
        centre += _SIZE_STEP * (seen.centre * seen.range - centre)
    clothes = worn_by(person, seen)
    seen = believed(person, seen)
    if seen.range is not None and person.track.stamp - max(person.seen, person.felt) > _STALE:
        # What they did before is no guide to how they walk now.
        person = replace(person, track=found(person.track.stamp, seen.bearing, seen.range, pose, noise))
    fit = innovation(person.track, seen.bearing, seen.range, pose, noise)
    if fit.distance2 > gate:
        loose = person.track.covariance + np.diag([_SAME_PERSON**2, _SAME_PERSON**2, 1.0, 1.0])
        person = replace(person, track=replace(person.track, covariance=loose))
        fit = innovation(person.track, seen.bearing, seen.range, pose, noise)
    # Near by HOG is never sure, of a person known to be one either.
    evidence = max(min(seen.score / _SURE, 1.0), _KNOWN if person.confirmed else 0.0)
    return replace(
        judged(person, evidence),
        track=updated(person.track, fit),
        seen=person.track.stamp,
        window=window,
        centre=centre,
        clothes=clothes,
    )


def worn_by(person: Person, seen: Measurement) -> Clothes | None:
    """Return what somebody wears, with one more box: a mean until they are known, then slowly and with distrust."""
    if seen.clothes is None or not of_size(person, seen):
        return person.clothes
    if person.clothes is None:
        return seen.clothes
    if person.confirmed:
        return learnt(person.clothes, seen.clothes, _CLOTHES_STEP)
    return person.clothes + (seen.clothes - person.clothes) / (person.age + 1)


def judged(person: Person, evidence: float) -> Person:
    """Count one more frame of evidence, 0 not found … 1 surely found, for or against a person."""
    trust = person.trust + _TRUST_STEP * (evidence - person.trust)
    confirmed = trust >= _DOUBTED if person.confirmed else trust >= _TRUSTED
    misses = 0 if evidence > 0 else person.misses + 1
    return replace(person, trust=trust, confirmed=confirmed, age=person.age + 1, misses=misses)


def moved_on(person: Person, stamp: float, noise: Noise) -> Person:
    """Let a person walk on until `stamp` [s]."""
    return replace(person, track=predicted(person.track, stamp, noise))


def pose_at(poses: tuple[Odometry, ...], stamp: float) -> Odometry:
    """Return where the robot was at `stamp`: between the two nearest of `poses`, oldest first.

    Before the first it stood; after the last it drives on as it did.
    """
    if not poses:
        return Odometry(stamp)
    last = poses[-1]
    if stamp >= last.stamp:
        ahead = stamp - last.stamp
        yaw = last.yaw + last.angular * ahead
        x = last.x + last.linear * ahead * math.cos(last.yaw)
        y = last.y + last.linear * ahead * math.sin(last.yaw)
        return replace(last, stamp=stamp, x=x, y=y, yaw=yaw)
    stamps = np.array([pose.stamp for pose in poses])
    columns: NDArray[np.float64] = np.array([(pose.x, pose.y, pose.yaw) for pose in poses])
    columns[:, 2] = np.unwrap(columns[:, 2])
    x, y, yaw = (float(np.interp(stamp, stamps, column)) for column in columns.T)
    return replace(last, stamp=stamp, x=x, y=y, yaw=yaw)
