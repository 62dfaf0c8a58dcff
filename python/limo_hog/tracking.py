"""Identities: the same number for the same person in all pictures of a film, by the trackers of Roboflow's `trackers`.

>>> tracker = Tracker(fps=25)
>>> detector = PeopleDetector(threshold=tracker.lowest)
>>> people = [tracker.update(detector.detect(image)) for image in film]
"""

from __future__ import annotations

import dataclasses
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from limo_hog.detections import Detections
from limo_hog.exceptions import ParameterError
from limo_hog.extras import needed
from limo_hog.models import load_model

#: Class of each tracker in `trackers`.
TRACKERS = MappingProxyType({"bytetrack": "ByteTrackTracker", "ocsort": "OCSORTTracker", "sort": "SORTTracker"})

#: Boxes of so much less than the threshold continue a person who was seen before [score].
FED = 0.3
#: A person is numbered in the second picture, and waited for for 1 s (in 1/30 s); IoU of a box with where the person is
#: expected. Chosen, with `FED`, on the odd ones of TUD's frames 1 to 41.
_SETTINGS = {"minimum_consecutive_frames": 2, "lost_track_buffer": 30, "minimum_iou_threshold": 0.3}


class Tracker:
    """Numbers the people of one film; its pictures are given in their order.

    Parameters
    ----------
    name
        "bytetrack", "ocsort" or "sort". docs/detect.md compares them.
    threshold
        Least score of a box that may be a new person; other boxes only continue one. None: `PeopleDetector()`'s.
    fps
        Pictures a second [Hz].

    Raises `ParameterError` for another name, `MissingExtraError` where `trackers` is not installed.
    """

    def __init__(self, name: str = "bytetrack", threshold: float | None = None, fps: float = 25.0) -> None:
        if name not in TRACKERS:
            raise ParameterError(f"tracker is {name!r}; one of {', '.join(TRACKERS)} is wanted")
        with needed(by="tracking people"):
            import trackers
        from supervision import ColorLookup, Position, TraceAnnotator

        feet, by_number = Position.BOTTOM_CENTER, ColorLookup.TRACK
        self._trails = TraceAnnotator(position=feet, trace_length=round(2 * fps), color_lookup=by_number)
        self._tracker = getattr(trackers, TRACKERS[name])(frame_rate=fps, **_SETTINGS)
        limo = load_model("limo")
        self.set_threshold((limo.second_look or limo).threshold if threshold is None else threshold)

    @property
    def lowest(self) -> float:
        """Least score of a box that is of use: the detector's threshold."""
        return self._threshold - FED

    def set_threshold(self, threshold: float) -> None:
        """Take new people from another score on, from the next picture on."""
        self._threshold = threshold
        # SORT has the first, OC-SORT the second, ByteTrack both.
        for name in {"track_activation_threshold", "high_conf_det_threshold"} & {*vars(self._tracker)}:
            setattr(self._tracker, name, threshold)

    def update(self, found: Detections, time: float | None = None) -> Detections:
        """Return the people among `found` who were seen before, with their `ids`, best first.

        `found` is all that the detector finds from `lowest` on in the next picture. `time` [s] is when that was taken,
        for a film without a steady rate.
        """
        given = found.to_supervision()
        given.confidence = found.scores
        told = self._tracker.update(given, timestamp=time)
        told.tracker_id = told.tracker_id + 1
        return dataclasses.replace(Detections.from_supervision(told[told.tracker_id > 0]), _searched=found._searched)

    def draw(self, people: Detections, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Draw people that `update` returned into a copy of their picture: boxes, numbers, and trails of 2 s.

        `image` is uint8 (H, W, 3) BGR; pictures are drawn in the film's order.
        """
        drawn: NDArray[np.uint8] = self._trails.annotate(people.draw(image), people.to_supervision())
        return drawn
