"""Who is who from frame to frame: detections become tracks, and tracks earn trust by being seen again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.body import Body
from limo_hog.follow.kalman import (
    Noise,
    Track,
    bearing_range,
    found,
    innovation,
    predicted,
    updated,
    wrapped,
)
from limo_hog.follow.observation import Observation, Odometry
from limo_hog.follow.proxemics import box_centre, person_depth
from limo_hog.follow.region import Region

#: How much one frame counts in a person's trust.
_TRUST_STEP = 0.1
#: Boxes nearer than this to a person are never somebody else [m].
_SAME_PERSON = 0.5
#: How much one box counts in a person's size.
_SIZE_STEP = 0.2
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
        0..1: share of the latest frames in which they were found where they should be. A pillar may look like a
        person now and then; a person looks like one all the time.
    window, centre
        Height of their detection window, and its middle below the image's, times their distance [px m].
    """

    number: int
    track: Track
    seen: float
    trust: float
    window: float
    centre: float
    felt: float = -math.inf


@dataclass(frozen=True, slots=True)
class Measurement:
    """One box as the robot sees it.

    Bearing [rad] and range [m] from the robot's centre, range None where unknown; height of the box and its middle
    below the image's [px].
    """

    bearing: float
    range: float | None
    height: int
    centre: float


def measure(observation: Observation, body: Body) -> list[Measurement]:
    """Turn every box into a bearing and a range, the range from the depth image."""
    measurements = []
    for box in observation.detections.boxes:
        column, row = box_centre(box)
        slope = (observation.width / 2 - column) / observation.focal_px
        height, centre = int(box[3]), row - observation.height / 2
        depth = None if observation.depth is None else person_depth(observation.depth, box)
        if depth is None:
            measurements.append(Measurement(math.atan(slope), None, height, centre))
            continue
        x, y = body.camera_x + depth, slope * depth
        measurements.append(Measurement(math.atan2(y, x), math.hypot(x, y), height, centre))
    return measurements


def associate(
    people: tuple[Person, ...], measurements: list[Measurement], pose: Odometry, noise: Noise, gate: float
) -> dict[int, int]:
    """Pair people with boxes, the best fit first; a fit further off than `gate` (chi-squared) is none.

    Returns index of the person -> index of the measurement. Every track must be at the frame's stamp.
    """
    fits = []
    for who, person in enumerate(people):
        for which, seen in enumerate(measurements):
            fit = innovation(person.track, seen.bearing, seen.range, pose, noise).distance2
            # Somebody who changed direction sharply is still who they were, if nobody else could be meant.
            if fit <= gate or apart(person, seen, pose) < _SAME_PERSON:
                fits.append((fit, who, which))
    pairs: dict[int, int] = {}
    for _, who, which in sorted(fits):
        if who not in pairs and which not in pairs.values():
            pairs[who] = which
    return pairs


def apart(person: Person, seen: Measurement, pose: Odometry) -> float:
    """Return the distance [m] between a person's track and a box; across the line of sight where that is all."""
    bearing, distance = bearing_range(person.track, pose)
    turn = wrapped(seen.bearing - bearing)
    if seen.range is None:
        return abs(distance * math.tan(turn)) if abs(turn) < 1 else math.inf
    return math.sqrt(distance**2 + seen.range**2 - 2 * distance * seen.range * math.cos(turn))


def should_be_seen(person: Person, pose: Odometry, observation: Observation) -> bool:
    """Whether the whole of a person's window should be in the part of the image that was searched."""
    bearing, distance = bearing_range(person.track, pose)
    if abs(bearing) > 1.2:
        return False
    column = observation.width / 2 - observation.focal_px * math.tan(bearing)
    window = person.window / max(distance, 0.3)
    middle = observation.height / 2 + person.centre / max(distance, 0.3)
    # Near by, the head and the room HOG wants above it are out of the image.
    if middle < 0.48 * window or observation.height - middle < 0.48 * window:
        return False
    return (observation.region or Region(0, 0, observation.width, observation.height, window)).holds(column)


def begin(number: int, seen: Measurement, stamp: float, pose: Odometry, noise: Noise) -> Person:
    """Begin to track a box nobody known accounts for."""
    distance = _UNKNOWN_RANGE if seen.range is None else seen.range
    if seen.range is None:
        noise = replace(noise, range=_UNKNOWN_SPREAD)
    track = found(stamp, seen.bearing, distance, pose, noise)
    return Person(number, track, stamp, _TRUST_STEP, seen.height * distance, seen.centre * distance)


def is_new(seen: Measurement, people: Sequence[Person], pose: Odometry) -> bool:
    """Whether a box is somebody unknown, not a second box on somebody known."""
    return all(apart(person, seen, pose) >= _SAME_PERSON for person in people)


def seen_again(person: Person, seen: Measurement, pose: Odometry, noise: Noise, gate: float) -> Person:
    """Correct a person by the box that is theirs; a box beyond `gate` says that they changed their ways."""
    fit = innovation(person.track, seen.bearing, seen.range, pose, noise)
    if fit.distance2 > gate:
        loose = person.track.covariance + np.diag([_SAME_PERSON**2, _SAME_PERSON**2, 1.0, 1.0])
        person = replace(person, track=replace(person.track, covariance=loose))
        fit = innovation(person.track, seen.bearing, seen.range, pose, noise)
    window, centre = person.window, person.centre
    if seen.range is not None:
        window += _SIZE_STEP * (seen.height * seen.range - window)
        centre += _SIZE_STEP * (seen.centre * seen.range - centre)
    return replace(
        person,
        track=updated(person.track, fit),
        seen=person.track.stamp,
        trust=person.trust + _TRUST_STEP * (1 - person.trust),
        window=window,
        centre=centre,
    )


def not_seen(person: Person) -> Person:
    """Trust a person less who should have been found and was not."""
    return replace(person, trust=person.trust * (1 - _TRUST_STEP))


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
