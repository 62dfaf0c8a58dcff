"""The modern face of the detector: immutable, keyword-only, typed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
