"""The part of an image that is searched for the person followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from limo_hog.detections import Detections, Detector
from limo_hog.named_detectors import AtScale, Image

#: A region whose expected window is at least this high is searched at half its size [px]. Chosen above twice HOG's 128,
#: so that a person may be 9 % lower than expected.
_HALVED_FROM = 280.0
#: A region whose expected window is lower than this is searched at twice its size [px]. Chosen: HOG finds nine of ten
#: people with windows of this height, three of four with 128, and nine of ten down to 64 in the image enlarged.
_DOUBLED_BELOW = 150.0
#: Height of the lowest window that is found at twice the size [px].
FAR_WINDOW = 64.0


@dataclass(frozen=True, slots=True)
class Region:
    """Part of an image worth searching."""

    x: int  #: Within the image [px], top left corner first.
    y: int
    width: int
    height: int
    #: Expected height of the detection window [px]: the person's, with the margin HOG was trained with.
    window_height: float

    def holds(self, column: float) -> bool:
        """Whether an image column [px] is within the region, by half an expected window's width."""
        margin = self.window_height / 4
        return self.x + margin <= column <= self.x + self.width - margin

    @property
    def scale(self) -> float:
        """Times its size at which it is searched: the finest levels cost most, and hold only small people."""
        if self.window_height >= _HALVED_FROM:
            return 0.5
        return 2.0 if self.window_height < _DOUBLED_BELOW else 1.0


def detect_in(detector: Detector, image: Image, region: Region | None) -> Detections:
    """Search a region of an image, or all of it where `region` is None; windows are in the whole image."""
    if region is None:
        return detector.detect(image)
    rows, columns = slice(region.y, region.y + region.height), slice(region.x, region.x + region.width)
    if region.scale != 1.0:
        detector = AtScale(detector, region.scale)
    found = detector.detect(np.ascontiguousarray(image[rows, columns]))
    return replace(found, windows=found.windows + np.array([region.x, region.y, 0, 0], np.int32))
