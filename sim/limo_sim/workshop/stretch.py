"""What the stretch tasks' checkpoints want; each holds on evidence of the node's own doing, as the workshop's do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from limo_hog.follow.robot import LIMO
from limo_hog.ros2 import names
from limo_sim.workshop.checkpoints import RIGHT, looks_of, surest
from limo_sim.workshop.mistakes import Finding
from limo_sim.workshop.sights import RED
from limo_sim.workshop.takes import Look, Take
from limo_sim.world.furniture import distance_to

#: What else carries a topic's messages: the public page's name of the depth image.
_ALSO = {names.DEPTH: names.DEPTH_LCAS}


def speeds(takes: Sequence[Take], scene: str) -> list[float]:
    """Return the forward speeds that answer the pictures of a scene with a person found in them [m/s]."""
    looks = [look for take in takes if take.scene.name == scene for look in take.looks]
    return [look.commands[-1].twist.linear for look in looks if look.commands and len(look.found)]


def reads(takes: Sequence[Take], topic: str) -> Finding:
    """Whether a topic is subscribed to, under one of its names."""
    readers = takes[0].calls.readers
    there = next((name for name in (topic, _ALSO.get(topic)) if name in readers), None)
    if there is None:
        return Finding(False, f"the node does not subscribe to {topic!r}")
    return Finding(True, f"subscribes to {there!r}", readers[there])


def red_on_person(takes: Sequence[Take]) -> Finding:
    """Whether every window of a scene with people has its red box on one of them."""
    tried = [(take, look) for take in takes for look in take.looks[1:] if len(look.people) and look.pictures]
    if not tried:
        return Finding(False, "no picture with a person was seen")
    wrong = [(take, look) for take, look in tried if not any(look.on_person(box) for box in _reds(look))]
    right = len(tried) - len(wrong)
    if right < RIGHT * len(tried):
        take, look = wrong[0]
        return Finding(False, f"{take.at(look)}: no red box, (0, 0, 255), is on a person", None, look)
    return Finding(True, f"the red box is on a person in {right} of {len(tried)} frames")


def _reds(look: Look) -> Iterator[NDArray[np.int32]]:
    """Yield the red box in each picture of an image."""
    for picture in look.pictures:
        rows, columns = np.nonzero((picture == RED).all(axis=2))
        if len(rows) > 40:
            left, top = columns.min(), rows.min()
            yield np.array([left, top, columns.max() - left, rows.max() - top], np.int32)


def slows(takes: Sequence[Take], order: Sequence[str] = ("far", "half way", "near")) -> Finding:
    """Whether the nearer person is approached the more slowly: in each of these scenes one stands nearer."""
    means = [float(np.median(speeds(takes, name) or [np.nan])) for name in order]
    said = ", ".join(f"{speed:.2f} m/s {name}" for name, speed in zip(order, means, strict=True))
    if np.isnan(means).any():
        return Finding(None, "not tried: a person was not found, or no command answers the picture")
    if means[0] <= 0:
        return Finding(False, f"{said}: the robot does not drive towards a person far away")
    if means[0] - means[-1] < 0.05:
        return Finding(False, f"{said}: the speed does not depend on the distance")
    if means != sorted(means, reverse=True):
        return Finding(False, f"{said}: the robot must not be faster when nearer")
    return Finding(True, said)


def every_hit(takes: Sequence[Take]) -> Finding:
    """Whether the detector returns more boxes than people: the merging is then the node's own."""
    more = [look for _, look in looks_of(takes) if look.raw is not None and len(look.found) > len(look.people) > 0]
    if not more:
        return Finding(False, "the detector returns no more boxes than people: give detectMultiScale groupThreshold=0")
    most = max(len(look.found) for look in more)
    return Finding(True, f"the detector returns up to {most} boxes of {len(more[0].people)} person")


def no_hog(takes: Sequence[Take]) -> Finding:
    """Whether people are found without OpenCV's HOG detector: a red box is on the person."""
    if any(take.outcome.stage.detector_inputs for take in takes):
        return Finding(False, "cv2's HOGDescriptor is still asked: detectMultiScale runs")
    return red_on_person(takes)


def stays(takes: Sequence[Take]) -> Finding:
    """Whether the red box stays on the person who was followed first, though HOG is surer of the second."""
    looks = [look for _, look in looks_of(takes) if len(look.truth.people) == 2]
    first = [look for look in looks if len(look.people) == 1 and look.pictures]
    both = [look for look in looks if len(look.people) == 2 and look.pictures]
    if not any(look.on_person(box, 0) for look in first for box in _reds(look)):
        return Finding(None, "not tried: the first person had no red box before the second came")
    # (A tracker may never look at the second person.)
    telling = any(len(look.found) and look.on_person(look.found.windows[surest(look)], 1) for look in both)
    if not telling and not any(look.on_person(box, 0) for look in both for box in _reds(look)):
        return Finding(None, "not tried: the second person was not found, or not surer than the first")
    wrong = [look for look in both if not any(look.on_person(box, 0) for box in _reds(look))]
    if len(wrong) > (1 - RIGHT) * len(both):
        said = f"frame at {wrong[0].time:.1f} s: the red box leaves the first person for one HOG is surer of"
        return Finding(False, said, None, wrong[0])
    return Finding(True, f"the red box stays on the first person in {len(both) - len(wrong)} of {len(both)} frames")


def stops(takes: Sequence[Take], clearance: float = 0.2) -> Finding:
    """Whether a robot that drives to people stops so far [m] before the furniture."""
    take = next((take for take in takes if take.scene.scenario.furniture), None)
    free = [speed for other in takes if other is not take for speed in speeds(takes, other.scene.name)]
    if take is None or not any(speed > 0 for speed in free):
        return Finding(None, "not tried: the robot does not drive to a person in a free room")
    way = max(x for _, x, _, _ in take.path)
    if way < 0.1:
        return Finding(None, "not tried: the robot does not drive towards the chair")
    if take.outcome.episode.contacts.wall:
        return Finding(False, f"the robot drives {way:.2f} m and into the chair")
    room = min(_room(take, *pose) for _, *pose in take.path)
    said = f"the robot drives {way:.2f} m and stops {room:.2f} m before the chair"
    if room < clearance:
        return Finding(False, f"{said}; wanted are at least {clearance} m")
    return Finding(True, said)


def _room(take: Take, x: float, y: float, yaw: float) -> float:
    """Return the distance from the furniture to the nearest of the robot's corners, its pose being x, y, yaw [m]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return min(
        distance_to(piece.footprint, x + cos * ahead - sin * left, y + sin * ahead + cos * left)
        for piece in take.scene.scenario.furniture
        for ahead in (-LIMO.half_length, LIMO.half_length)
        for left in (-LIMO.half_width, LIMO.half_width)
    )


#: By the names that an exercise's file uses.
CHECKS = {check.__name__: check for check in (reads, red_on_person, slows, every_hit, no_hog, stays, stops)}
