"""People keep their numbers through a film."""

import sys

import numpy as np
import pytest

from limo_hog.detections import Detections
from limo_hog.exceptions import ParameterError
from limo_hog.extras import MissingExtraError
from limo_hog.models import WHOLE_WINDOW
from limo_hog.tracking import FED, TRACKERS, Tracker

pytest.importorskip("trackers", reason="needs limo-hog[track]")


def walk(score: float) -> list[Detections]:
    """Two people who walk towards and past each other; the second scores `score` from the fourth picture on."""
    steps = [np.array([[220 - 10 * i, 60, 50, 130], [20 + 10 * i, 40, 40, 100]], np.int32) for i in range(20)]
    scores = [np.array([2.0, score if i > 2 else 1.0]) for i in range(20)]
    return [Detections(*found, WHOLE_WINDOW) for found in zip(steps, scores, strict=True)]


@pytest.mark.parametrize(("name", "score"), [*((name, 1.0) for name in TRACKERS), ("bytetrack", 0.01 - FED)])
def test_two_people_who_pass_each_other_keep_their_numbers_and_leave_trails(name: str, score: float) -> None:
    tracker, image = Tracker(name, fps=10), np.zeros((200, 300, 3), np.uint8)
    seen = [tracker.update(found) for found in walk(score)][2:]
    drawn = [tracker.draw(people, image) for people in seen]
    numbers = [dict(zip(people.boxes[:, 3].tolist(), people.to_dict()["ids"], strict=True)) for people in seen]
    assert numbers == [numbers[0]] * 18 and {*numbers[0].values()} == {1, 2}
    assert (drawn[-1] != seen[-1].draw(image))[140, 90:180].any()  # where the shorter one's feet were
    assert tracker.update(Detections.none()).to_dict()["ids"] == []


def test_a_box_below_the_threshold_is_no_new_person_until_the_threshold_is_lower() -> None:
    tracker, faint = Tracker("bytetrack", threshold=3.0), walk(2.0)
    assert [len(tracker.update(found)) for found in faint[3:6]] == [0, 0, 0]
    tracker.set_threshold(1.5)
    assert [len(tracker.update(found)) for found in faint[6:9]] == [0, 2, 2]
    assert tracker.lowest == 1.5 - FED


def test_unknown_and_missing_trackers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match=r"'deepsort'; one of bytetrack, ocsort, sort is wanted"):
        Tracker("deepsort")
    monkeypatch.setitem(sys.modules, "trackers", None)
    with pytest.raises(MissingExtraError, match=r"tracking people needs trackers: pip install 'limo-hog\[track\]'"):
        Tracker()
