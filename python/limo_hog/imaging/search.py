"""People of the sizes one wants, in pictures of any size."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from limo_hog.detector import Detections, PeopleDetector
from limo_hog.extras import needed

with needed(by="enlarging pictures", what="OpenCV", install="'limo-hog[cv]'"):
    import cv2

#: Height of the person in the model's window of 64 × 128 [px], and its share of the window.
MODEL_HEIGHT = 96
_SHARE = MODEL_HEIGHT / 128


@dataclass(frozen=True)
class Search:
    """A detector with the sizes of people to look for.

    Attributes
    ----------
    detector
        Looks at each picture.
    min_height
        Height of the smallest person to find [px]: pictures are enlarged (or reduced) so that it fills the model's
        window. None leaves pictures as they are: 96.
    max_height
        Height of the tallest person to report [px]; None reports all.
    """

    detector: PeopleDetector = field(default_factory=PeopleDetector)
    min_height: float | None = None
    max_height: float | None = None

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Find people, best first, in pixels of the image as it came.

        Parameters
        ----------
        image
            uint8 (height, width) or (height, width, 3).
        """
        zoom = 1.0 if self.min_height is None else MODEL_HEIGHT / self.min_height
        found = self.detector.detect(image if zoom == 1 else _resized(image, zoom))
        boxes, scores = found.boxes, found.scores
        if zoom != 1:
            boxes = np.rint(boxes / zoom).astype(np.int32)
        keep = np.arange(len(scores))
        if self.max_height is not None:
            keep = keep[_SHARE * boxes[:, 3] <= self.max_height]
        return Detections(boxes[keep], scores[keep])


def _resized(image: NDArray[np.uint8], zoom: float) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    size = max(1, round(width * zoom)), max(1, round(height * zoom))
    how = cv2.INTER_CUBIC if zoom > 1 else cv2.INTER_AREA
    return cv2.resize(image, size, interpolation=how).astype(np.uint8, copy=False)
