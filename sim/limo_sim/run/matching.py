"""Which person a box is on, and the thresholds that say what counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limo_sim.world.truth import PersonTruth

NO_PERSON = -1


@dataclass(frozen=True, slots=True)
class Criteria:
    """Thresholds of the score card; only cards of equal criteria can be compared."""

    in_view: float = 0.5  #: share of the silhouette from which a person is in view. Chosen: half.
    #: A robot further from the subject than this has not kept up [m]. Chosen: twice the distance held.
    kept_up_m: float = 3.0
    #: A subject who was not the target for longer than this was lost [s]. Chosen: five camera frames, more than a
    #: detector's single misses.
    lost_after_s: float = 0.5
    #: A lost subject counts as found again within this time [s]. Chosen: a person who walks at 0.75 m/s crosses the
    #: camera's field, 71° at 1.5 m, in 3 s.
    found_within_s: float = 3.0
    #: A run in which the subject is out of view for longer than this fails [s]. Follow-Bench (arXiv 2509.10796): 100
    #: frames of a camera of 10 Hz.
    unseen_s: float = 10.0
    #: How far beside a silhouette the middle of a box on it may lie [widths of the silhouette]. Chosen: the middle of a
    #: box strays by up to 16 px (arena measurements, 1.75 … 4 m), a silhouette 4 m away is 35 … 50 px wide.
    box_margin: float = 0.25
    #: box_height_min, box_height_max: how high a box on a person may be [heights of the silhouette]. HOG's window is
    #: 1.33 times as high; chosen: half of that, for silhouettes cut off by the image's edge, to twice.
    box_height_min: float = 0.6
    box_height_max: float = 2.5


CRITERIA = Criteria()


def on_person(box: NDArray[np.int32], truth: PersonTruth, criteria: Criteria = CRITERIA) -> bool:
    """Whether a detection window (x, y, w, h) [px] is on a person: its middle on the silhouette, of about its size."""
    if truth.box is None:
        return False
    x, y, w, h = truth.box
    column, row = box[0] + box[2] / 2, box[1] + box[3] / 2
    margin = criteria.box_margin * w
    inside = x - margin <= column <= x + w + margin and y <= row <= y + h
    return bool(inside and criteria.box_height_min <= box[3] / h <= criteria.box_height_max)


def person_of(box: NDArray[np.int32], people: Sequence[PersonTruth | None], criteria: Criteria = CRITERIA) -> int:
    """Return the index of the person a box is on: of several, one in view first, then the one in the middle."""
    middle = box[0] + box[2] / 2
    ranks = [
        (person.visible < criteria.in_view, abs(person.box[0] + person.box[2] / 2 - middle), index)
        for index, person in enumerate(people)
        if person and person.box and on_person(box, person, criteria)
    ]
    return min(ranks)[2] if ranks else NO_PERSON
