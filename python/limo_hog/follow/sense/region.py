"""The part of an image that is searched for the person followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from limo_hog.detections import Detections, Detector
from limo_hog.named_detectors import DoubleSize, HalfSize, Image

#: A region whose expected window is at least this high is searched at half size [px]: its finest levels cost most and
#: hold only smaller people. Chosen above twice HOG's 128, so that a person may be 9 % lower than expected.
_HALVED_FROM = 280.0
#: And at twice its size if it is lower than this [px]. Chosen: of windows this high HOG finds nine of ten; of those of
#: 128 px three of four as they are, and at twice the size nine of ten down to 64 px.
_DOUBLED_BELOW = 150.0
#: The lowest window that is found so [px].
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
    def is_halved(self) -> bool:
        """Whether it is searched at half its size."""
        return self.window_height >= _HALVED_FROM

    @property
    def is_doubled(self) -> bool:
        """Whether it is searched at twice its size."""
        return self.window_height < _DOUBLED_BELOW


def detect_in(detector: Detector, image: Image, region: Region | None) -> Detections:
    """Search a region of an image, or all of it where `region` is None; windows are in the whole image."""
    if region is None:
        return detector.detect(image)
    rows, columns = slice(region.y, region.y + region.height), slice(region.x, region.x + region.width)
    if region.is_halved or region.is_doubled:
        detector = HalfSize(detector) if region.is_halved else DoubleSize(detector)
    found = detector.detect(np.ascontiguousarray(image[rows, columns]))
    return replace(found, windows=found.windows + np.array([region.x, region.y, 0, 0], np.int32))
