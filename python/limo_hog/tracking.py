"""Identities: the same number for the same person in all pictures of a film, by the trackers of Roboflow's `trackers`.

>>> tracker = Tracker(fps=25)
>>> detector = PeopleDetector(threshold=tracker.lowest)
>>> people = [tracker.update(detector.detect(image)) for image in film]
"""

from __future__ import annotations

import dataclasses
from types import MappingProxyType
from typing import Any

import numpy as np

from limo_hog.detections import Detections
from limo_hog.exceptions import ParameterError
from limo_hog.extras import needed

#: Class of each tracker in `trackers`.
TRACKERS = MappingProxyType({"bytetrack": "ByteTrackTracker", "ocsort": "OCSORTTracker", "sort": "SORTTracker"})


class Tracker:
    """Numbers the people of one film; its pictures are given in their order.

    Parameters
    ----------
    name
        "bytetrack", "ocsort" or "sort". docs/detect.md compares them.
    threshold
        Least SVM margin of a box from which a person may be new. Boxes from `lowest` on only continue a person.
    fps
        Pictures a second [Hz].

    Attributes
    ----------
    lowest
        Least SVM margin that is of use: the detector's threshold.

    Raises
    ------
    ParameterError
        There is no tracker of this name.
    MissingExtraError
        `trackers` is not installed.
    """

    def __init__(self, name: str = "bytetrack", threshold: float = 0.0, fps: float = 25.0) -> None:
        if name not in TRACKERS:
            raise ParameterError(f"tracker is {name!r}; one of {', '.join(TRACKERS)} is wanted")
        with needed(by="tracking people"):
            import trackers
        self.lowest = threshold - 0.5
        settings: dict[str, Any] = {"lost_track_buffer": 30, "minimum_consecutive_frames": 2, "frame_rate": fps}
        if name == "sort":
            settings["track_activation_threshold"] = threshold
        else:
            settings["high_conf_det_threshold"] = threshold
        if name == "bytetrack":
            settings["track_activation_threshold"] = threshold
        self._tracker = getattr(trackers, TRACKERS[name])(**settings)

    def update(self, found: Detections, time: float | None = None) -> Detections:
        """Return the people among `found` who were seen before, with their `ids`, best first.

        Parameters
        ----------
        found
            All that the detector finds from `lowest` on in the next picture.
        time
            When the picture was taken [s], for a film without a steady rate.
        """
        from supervision import Detections as Supervisions

        places: Any = {"place": np.arange(len(found))}
        given = Supervisions(found.xyxy.astype(np.float64), confidence=found.scores, data=places)
        told = self._tracker.update(given, timestamp=time)
        ids = np.full(len(found), -1, np.int64)
        if len(told):
            ids[told.data["place"]] = told.tracker_id
        known = ids >= 0
        return dataclasses.replace(found[known], ids=ids[known] + 1)
