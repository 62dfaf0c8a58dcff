"""The modern face of the detector: immutable, keyword-only, typed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from limo_hog import _core
from limo_hog.cv2_api.arguments import pixels
from limo_hog.suppression import soften, suppress

#: The person inside a window: x + .1 w, y + .07 h, .8 w, .8 h. The rest is the margin it was trained with.
_PERSON_IN_WINDOW = (0.1, 0.07, 0.8, 0.8)


@dataclass(frozen=True, slots=True)
class Detections:
    """People found in one image, best first.

    Attributes
    ----------
    boxes
        int32 (N, 4): x, y, w, h [px] of the detection windows, top left corner first.
    scores
        float64 (N,): SVM margin of each box, descending; larger is surer, 0 is the model's own threshold.
    """

    boxes: NDArray[np.int32]
    scores: NDArray[np.float64]

    @classmethod
    def none(cls) -> Detections:
        """No people at all."""
        return cls(np.empty((0, 4), np.int32), np.empty(0))

    def __len__(self) -> int:
        return len(self.scores)

    def __iter__(self) -> Iterator[tuple[NDArray[np.int32], float]]:
        for box, score in zip(self.boxes, self.scores, strict=True):
            yield box, float(score)

    @property
    def person_boxes(self) -> NDArray[np.int32]:
        """int32 (N, 4): the boxes without the window's margin, tight around the person [px]."""
        dx, dy, sw, sh = _PERSON_IN_WINDOW
        x, y, w, h = self.boxes.T.astype(np.float64)
        person = np.stack([x + dx * w, y + dy * h, sw * w, sh * h], axis=1)
        return np.asarray(np.rint(person), np.int32)


#: Window and coefficients of each model.
_MODELS = {
    "default": ((64, 128), _core.default_people_detector),
    "daimler": ((48, 96), _core.daimler_people_detector),
}


@dataclass(frozen=True, kw_only=True)
class PeopleDetector:
    """Finds standing and walking people in images; immutable, may be shared between threads.

    Attributes
    ----------
    model
        "default" (INRIA, window 64 × 128) or "daimler" (window 48 × 96).
    threshold
        Least SVM margin of a hit; raise it for fewer false alarms.
    win_stride
        Distance of neighbouring windows (x, y) [px of each pyramid level].
    padding
        Mirrored border around each level (x, y) [px].
    scale
        How much each level is smaller than the one before.
    group_threshold
        Similar hits must be more than this to make a detection; 0 returns every hit.
    nms
        How one box is made of many hits: "group", OpenCV's grouping; "iou", the best of those that overlap; "soft",
        as that, but others are doubted, not dropped, so that somebody half hidden by somebody else may stay.
    overlap
        For "iou", the intersection over union beyond which two hits are one person; for "soft", the one at which
        doubt is strong.
    """

    model: Literal["default", "daimler"] = "default"
    threshold: float = 0.0
    win_stride: tuple[int, int] = (8, 8)
    padding: tuple[int, int] = (4, 4)
    scale: float = 1.05
    group_threshold: int = 2
    nms: Literal["group", "iou", "soft"] = "group"
    overlap: float = 0.3

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """People in `image`, best first.

        Parameters
        ----------
        image
            uint8 (H, W), (H, W, 1) or (H, W, 3), colours in any order.

        Raises
        ------
        ImageError
            The array is not such an image.
        """
        boxes, scores = self._hog.detect_multi_scale(
            pixels(image),
            self.threshold,
            self.win_stride,
            self.padding,
            self.scale,
            self.group_threshold if self.nms == "group" else 0,
            False,
        )
        if self.nms == "iou":
            kept = suppress(boxes, scores, self.overlap)
            return Detections(boxes[kept], scores[kept])
        if self.nms == "soft":
            kept, scores = soften(boxes, scores, self.overlap**2, self.threshold)
            return Detections(boxes[kept], scores)
        best_first = np.argsort(-scores, kind="stable")
        return Detections(boxes[best_first], scores[best_first])

    @cached_property
    def _hog(self) -> _core.Hog:
        win_size, coefficients = _MODELS[self.model]
        return _core.Hog(win_size, (16, 16), (8, 8), (8, 8), 9, -1.0, 0.2, True, 64, False, coefficients())
