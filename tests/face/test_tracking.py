"""People keep their numbers through a film."""

from __future__ import annotations

import numpy as np
import pytest

from limo_hog.detections import Detections
from limo_hog.exceptions import ParameterError
from limo_hog.models import WHOLE_WINDOW
from limo_hog.tracking import FED, TRACKERS, Tracker

pytest.importorskip("trackers", reason="needs limo-hog[track]")


def walk(score: float = 1.0, frames: int = 20) -> list[Detections]:
    """Two people who walk towards and past each other, one in front; the left one scores `score`."""
    people = []
    for i in range(frames):
        windows = np.array([[20 + 10 * i, 40, 40, 100], [220 - 10 * i, 60, 50, 130]], np.int32)
        scores = np.array([score if i > 2 else 1.0, 2.0])
        order = np.argsort(-scores)
        people.append(Detections(windows[order], scores[order], WHOLE_WINDOW))
    return people


@pytest.mark.parametrize("name", TRACKERS)
def test_two_people_who_pass_each_other_keep_their_numbers(name: str) -> None:
    tracker = Tracker(name, fps=10)
    seen = [tracker.update(found) for found in walk()][2:]
    assert all(people.ids is not None and sorted(people.ids.tolist()) == [1, 2] for people in seen)
    by_height = [dict(zip(people.boxes[:, 3].tolist(), people.ids.tolist(), strict=True)) for people in seen]  # type: ignore[union-attr]
    assert all(numbers == by_height[0] for numbers in by_height)


@pytest.mark.parametrize("score", [0.01, -FED + 0.01])
def test_a_box_below_the_threshold_continues_a_person(score: float) -> None:
    tracker = Tracker("bytetrack", fps=10)
    assert [len(tracker.update(found)) for found in walk(score, frames=8)][2:] == [2] * 6


def test_a_box_below_the_threshold_is_no_new_person_until_the_threshold_is_lower() -> None:
    tracker, faint = Tracker("bytetrack", threshold=3.0), walk(2.0)
    assert [len(tracker.update(found)) for found in faint[3:6]] == [0, 0, 0]
    tracker.set_threshold(1.5)
    assert [len(tracker.update(found)) for found in faint[6:9]] == [0, 2, 2]
    assert tracker.lowest == 1.5 - FED


def test_a_picture_without_people_has_no_numbers() -> None:
    people = Tracker().update(Detections.none())
    assert len(people) == 0
    assert people.ids is not None


def test_an_unknown_tracker_is_named() -> None:
    with pytest.raises(ParameterError, match=r"'deepsort'; one of bytetrack, ocsort, sort is wanted"):
        Tracker("deepsort")
